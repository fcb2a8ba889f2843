"""Presets: named lists of sub-terrains."""

import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from terrainkit.errors import ConfigError
from terrainkit.settings.text import expected_names
from terrainkit.terrain import registry
from terrainkit.terrain.paper import get_paper, paper_names
from terrainkit.terrain.parameter import parameters_of
from terrainkit.terrain.sub_terrain import SubTerrain

BEYOND_CODE = "_beyond_code"
"""Suffix of the presets with stairs that are steeper than the building code allows, and uneven."""

_UNEVEN = {"riser_difference": (0.0095, 0.04)}
"""Parameters of those stairs; the codes allow a difference of 9.5 mm."""


def preset_names() -> tuple[str, ...]:
    """Return the names of the presets."""
    return (*paper_names(), *_presets(), "all")


def get_preset(name: str) -> tuple[SubTerrain, ...]:
    """Return the sub-terrains of a preset.

    The preset "all" has every terrain once, and once more inverted where that exists; but no
    course, which consists of the others.

    Raises:
        ConfigError: if there is no such preset.
    """
    if name in paper_names():
        return get_paper(name).terrains
    if name == "all":
        return tuple(_sub_terrain(key, {}) for key in _all_names())
    if name not in _presets():
        raise ConfigError(f"no preset {name!r}; {expected_names(name, preset_names())}")
    return tuple(_sub_terrain(key, values) for key, values in _presets()[name].items())


def slope_threshold(name: str, default: float) -> float:
    """Return the slope above which the ground of a preset becomes a wall, or the default."""
    threshold: float = _tables()["slope_thresholds"].get(name, default)
    return threshold


@cache
def _tables() -> dict[str, Any]:
    return tomllib.loads(Path(__file__).with_name("presets.toml").read_text(encoding="utf-8"))


@cache
def _presets() -> dict[str, dict[str, Mapping[str, Any]]]:
    """Return the keys of each sub-terrain of the presets in presets.toml."""
    table = _tables()
    presets: dict[str, dict[str, Mapping[str, Any]]] = table["presets"]
    for name, stairs in table["built_stairs"].items():
        code = {"terrain": "staircase", **stairs["code"]}
        steeper = {key: (code[key][1], value) for key, value in stairs["beyond"].items()}
        for suffix, values in ("", code), (BEYOND_CODE, code | steeper | _UNEVEN):
            presets[name + suffix] = {
                f"{name}_{shape}": {"shape": shape, **values} for shape in stairs["shapes"]
            }
    for name, names in table["equal_parts"].items():
        presets[name] = {key: {} for key in names}
    return presets


def _sub_terrain(name: str, values: Mapping[str, Any]) -> SubTerrain:
    terrain = name.removesuffix(registry.INVERTED)
    inverted = {"inverted": True} if terrain != name else {}
    return SubTerrain.from_table({"terrain": terrain, "name": name, **values, **inverted})


def _all_names() -> list[str]:
    names = []
    for name in registry.terrain_names():
        if name == "course":
            continue
        names.append(name)
        if "inverted" in parameters_of(registry.get_terrain(name)):
            names.append(name + registry.INVERTED)
    return names
