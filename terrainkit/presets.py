"""Presets: ready mixes of terrains, by name."""

from terrainkit import registry
from terrainkit.errors import ConfigError
from terrainkit.parameter import parameters_of
from terrainkit.sub_terrain import SubTerrain
from terrainkit.text import known_names

_MIXES = {
    # legged_gym's columns in its order. What it calls "stairs up" is climbed from the platform
    # outwards, so it is the inverted pyramid here, and "stairs down" the upright one.
    "legged_gym": {
        "pyramid_slope_inverted": 1.0,
        "pyramid_slope": 1.0,
        "rough_slope": 1.0,
        "pyramid_stairs_inverted": 2.0,
        "pyramid_stairs": 1.0,
        "obstacles": 1.0,
        "stepping_stones": 1.0,
        "gap": 1.0,
        "pit": 1.0,
    },
    "rough": {"flat": 1.0, "rough": 1.0, "rough_slope": 1.0, "obstacles": 1.0, "wave": 1.0},
    "stairs": {"stairs": 1.0, "pyramid_stairs": 1.0, "pyramid_stairs_inverted": 1.0},
}
"""Proportion of each terrain, by preset."""


def names() -> tuple[str, ...]:
    """Return the name of each preset."""
    return (*_MIXES, "all")


def find(name: str) -> tuple[SubTerrain, ...]:
    """Return the mix called `name`; "all" holds each terrain, upright and inverted, once.

    Raises:
        ConfigError: if there is none, listing those that exist.
    """
    if name not in names():
        raise ConfigError(f"no preset {name!r}; {known_names(name, names())}")
    mix = dict.fromkeys(_all(), 1.0) if name == "all" else _MIXES[name]
    return tuple(_sub_terrain(terrain, proportion) for terrain, proportion in mix.items())


def _all() -> list[str]:
    mix = []
    for terrain in registry.names():
        mix.append(terrain)
        if "inverted" in parameters_of(registry.find(terrain)):
            mix.append(terrain + registry.INVERTED)
    return mix


def _sub_terrain(name: str, proportion: float) -> SubTerrain:
    return SubTerrain(
        terrain=name.removesuffix(registry.INVERTED),
        name=name,
        proportion=proportion,
        parameters={"inverted": True} if name.endswith(registry.INVERTED) else {},
    )
