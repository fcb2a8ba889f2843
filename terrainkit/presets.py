"""Presets: ready mixes of terrains, by name."""

from terrainkit import registry
from terrainkit.choice import TerrainChoice
from terrainkit.errors import ConfigError, listing
from terrainkit.parameter import parameters_of


def names() -> tuple[str, ...]:
    """Return the name of each preset."""
    return (*_MIXES, "all")


def find(name: str) -> tuple[TerrainChoice, ...]:
    """Return the mix called `name`.

    Raises:
        ConfigError: if there is none, listing those that exist.
    """
    if name == "all":
        return tuple(_all())
    if name not in _MIXES:
        raise ConfigError(f"no preset {name!r}; there are: {listing(names())}")
    return _MIXES[name]


def _inverted(terrain: str, proportion: float = 1.0) -> TerrainChoice:
    return TerrainChoice(
        terrain=terrain,
        name=f"{terrain}_inverted",
        proportion=proportion,
        parameters={"inverted": True},
    )


def _one(terrain: str) -> TerrainChoice:
    return TerrainChoice(terrain=terrain)


def _all() -> list[TerrainChoice]:
    mix = []
    for terrain in registry.names():
        mix.append(_one(terrain))
        if "inverted" in parameters_of(registry.find(terrain)):
            mix.append(_inverted(terrain))
    return mix


_MIXES = {
    # legged_gym's columns in its order. What it calls "stairs up" is climbed from the platform
    # outwards, so it is the inverted pyramid here, and "stairs down" the upright one.
    "legged_gym": (
        _inverted("pyramid_slope"),
        _one("pyramid_slope"),
        _one("rough_slope"),
        _inverted("pyramid_stairs", proportion=2.0),
        _one("pyramid_stairs"),
        _one("obstacles"),
        _one("stepping_stones"),
        _one("gap"),
        _one("pit"),
    ),
    "rough": (
        _one("flat"),
        _one("rough"),
        _one("rough_slope"),
        _one("obstacles"),
        _one("wave"),
    ),
    "stairs": (
        _one("stairs"),
        _one("pyramid_stairs"),
        _inverted("pyramid_stairs"),
    ),
}
