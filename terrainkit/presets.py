"""Presets: named lists of sub-terrains."""

from terrainkit import registry
from terrainkit.errors import ConfigError
from terrainkit.parameter import parameters_of
from terrainkit.sub_terrain import SubTerrain
from terrainkit.text import expected_names

_PROPORTIONS = {
    # The columns of legged_gym in its order. Its "stairs up" are climbed from the platform outward,
    # so they are the inverted pyramid here, and its "stairs down" the upright one.
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
"""Proportion of each sub-terrain, by preset."""


def preset_names() -> tuple[str, ...]:
    """Return the names of the presets."""
    return (*_PROPORTIONS, "all")


def get_preset(name: str) -> tuple[SubTerrain, ...]:
    """Return the sub-terrains of a preset.

    The preset "all" has every terrain once, and once more inverted where that exists.

    Raises:
        ConfigError: if there is no such preset.
    """
    if name not in preset_names():
        raise ConfigError(f"no preset {name!r}; {expected_names(name, preset_names())}")
    proportions = dict.fromkeys(_all_names(), 1.0) if name == "all" else _PROPORTIONS[name]
    return tuple(
        SubTerrain(
            terrain=name.removesuffix(registry.INVERTED),
            name=name,
            proportion=proportion,
            parameters={"inverted": True} if name.endswith(registry.INVERTED) else {},
        )
        for name, proportion in proportions.items()
    )


def _all_names() -> list[str]:
    names = []
    for name in registry.terrain_names():
        names.append(name)
        if "inverted" in parameters_of(registry.get_terrain(name)):
            names.append(name + registry.INVERTED)
    return names
