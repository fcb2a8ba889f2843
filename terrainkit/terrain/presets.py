"""Presets: named lists of sub-terrains."""

from collections.abc import Mapping
from typing import Any

from terrainkit.errors import ConfigError
from terrainkit.settings.text import expected_names
from terrainkit.terrain import registry
from terrainkit.terrain.paper import get_paper, paper_names
from terrainkit.terrain.parameter import parameters_of
from terrainkit.terrain.sub_terrain import SubTerrain

# The obstacles of Extreme Parkour and Robot Parkour Learning, one on a length of 2 m each. At the
# hard end, the former climbs 0.5 m and leaps 0.8 m, and the latter crawls under 0.2 m and passes
# openings of 0.28 m.
_TILT = {"terrain": "side_ramps", "gap": (0.0, 0.2), "spacing": 1.2, "end": 0.4, "proportion": 0.5}

_OBSTACLES: dict[str, list[dict[str, Any]]] = {
    "hurdle": [{"terrain": "hurdles", "height": (0.05, 0.4)}],
    "step": [
        {
            "terrain": "hurdles",
            "height": (0.05, 0.5),
            "min_thickness": 0.6,
            "max_thickness": 1.0,
        }
    ],
    "leap": [
        {"terrain": "gap_track", "length": (0.1, 0.8), "min_spacing": 1.5, "max_spacing": 2.0}
    ],
    "tilt": [_TILT, {**_TILT, "first_side": "right"}],
    "crawl": [{"terrain": "crawl", "spacing": 0.8}],
    "squeeze": [{"terrain": "slit", "opening": (1.3, 0.8), "offset": 0.4}],
}

_OPEN = {"risers": "open", "handrail": 0.95, "number": 7}

_BUILT_STAIRS: dict[str, tuple[str, dict[str, Any], dict[str, float]]] = {
    # Shapes, parameters from easy to the limit of the code, and the hard end beyond the code. The
    # limits are in `features/building_codes.toml`: IRC, IBC, OSHA with EN ISO 14122-3, and Ontario.
    "residential": (
        "straight quarter_turn winders curved",
        {"riser": (0.15, 0.196), "going": (0.3, 0.254), "width": 0.95, "landing": 1.0},
        {"riser": 0.26, "going": 0.2},
    ),
    "public": (
        "straight half_turn quarter_turn curved",
        {"riser": (0.12, 0.178), "going": (0.36, 0.28), "width": 1.2, "landing": 1.25},
        {"riser": 0.24, "going": 0.22},
    ),
    "industrial": (
        "straight half_turn quarter_turn",
        {"riser": (0.165, 0.209), "going": (0.28, 0.241), "width": 0.8, "landing": 0.85, **_OPEN},
        {"riser": 0.28, "going": 0.19},
    ),
    "fire_escape": (
        "straight half_turn",
        {"riser": (0.17, 0.21), "going": (0.28, 0.22), "width": 0.65, "landing": 0.8, **_OPEN},
        {"riser": 0.28, "going": 0.17},
    ),
}


BEYOND_CODE = "_beyond_code"
"""Suffix of the presets with stairs that are steeper than the building code allows, and uneven."""

_STONES = {"stone": (0.8, 0.2), "platform": 1.5}

_HARD_STAIRS = {
    "terrain": "pyramid_stairs",
    "step_height": (0.05, 0.2),
    "step_width": 0.31,
    "platform": 1.2,
}

_COURSE = {"terrain": "course", "order": "random", "start": 1.5}

_PRESETS: dict[str, dict[str, Mapping[str, Any]]] = {
    # One to three storeys, and parts of them.
    "indoor": {
        "one_storey": {"terrain": "building", "storeys": 1},
        "two_storeys": {"terrain": "building", "proportion": 2.0},
        "three_storeys": {"terrain": "building", "storeys": 3},
        "rooms": {},
        "stairwell": {"terrain": "staircase", "shape": "half_turn", "wall": 1.0},
    },
    # The map of the task `quadruped_hard`. With cells of 0.05 m and ten rows, gaps grow by
    # one cell in each row. A robot that steps between shallow stones does not fall.
    "hard": {
        "gap_track": {
            "proportion": 4.0,
            "length": (0.05, 0.5),
            "depth": 1.0,
            "min_spacing": 1.2,
            "max_spacing": 1.8,
            "start": 1.4,
        },
        "stepping_stones": {"proportion": 6.0, **_STONES, "depth": 1.0},
        "shallow_stones": {
            "terrain": "stepping_stones",
            "proportion": 5.0,
            **_STONES,
            "depth": (0.06, 0.12),
        },
        "pit": {"proportion": 2.0, "depth": (0.05, 0.3), "side": 3.0},
        "boxes": {"proportion": 2.0, "height": (0.05, 0.3)},
        "rails": {"proportion": 2.0, "width": (0.05, 0.2), "height": (0.05, 0.2)},
        "pyramid_stairs": _HARD_STAIRS,
        "pyramid_stairs_inverted": {"proportion": 2.0, **_HARD_STAIRS, "inverted": True},
    },
    # Stones of 0.1 m, ramps of 1:12 to 1:8, and steps with the riser of `staircase`.
    "street": {
        "street": {"proportion": 2.0},
        "sidewalk": {},
        "road": {},
        "cobblestones": {"terrain": "random_grid", "height": (0.005, 0.025), "block": 0.1},
        "street_ramp": {"terrain": "slope", "grade": (0.083, 0.125), "landing": 1.5},
        "steps": {"terrain": "staircase", "number": 3, "nosing": 0.0},
    },
    # Courses of one obstacle as in the training of both, and mixed ones as in their distillation.
    "parkour_course": {
        **{
            f"{name}_course": {**_COURSE, "elements": obstacles}
            for name, obstacles in _OBSTACLES.items()
        },
        "mixed_course": {
            **_COURSE,
            "proportion": 4.0,
            "elements": [element for obstacles in _OBSTACLES.values() for element in obstacles],
        },
    },
}
"""Terrain (its name by default), proportion (1 by default) and parameters of each sub-terrain, by
preset."""

for _name, (_shapes, _given, _beyond) in _BUILT_STAIRS.items():
    _steeper = {name: (_given[name][1], value) for name, value in _beyond.items()}
    _uneven = {"riser_difference": (0.0095, 0.04)}
    for _suffix, _values in ("", _given), (BEYOND_CODE, _given | _steeper | _uneven):
        _PRESETS[_name + _suffix] = {
            f"{_name}_{shape}": {"terrain": "staircase", "shape": shape, **_values}
            for shape in _shapes.split()
        }

_EQUAL_PARTS = {
    "rough": ("flat", "rough", "rough_slope", "obstacles", "wave"),
    "stairs": ("stairs", "pyramid_stairs", "pyramid_stairs_inverted"),
    "parkour": ("boxes", "hurdles", "gap_track", "side_ramps", "stepping_beams", "crawl", "slit"),
    "sparse": (
        "stepping_stones",
        "stone_rows",
        "stones_everywhere",
        "stakes",
        "beams",
        "stepping_beams",
        "star",
        "rings",
        "floating_islands",
    ),
    "confined": ("crawl", "tunnel", "ceiling", "slit", "poles", "rooms", "maze"),
    "natural": ("rough", "rough_slope", "perlin", "fractal", "eroded", "contour", "rocks"),
}
"""Sub-terrains of the presets whose proportions are 1 and whose parameters are the defaults."""


def preset_names() -> tuple[str, ...]:
    """Return the names of the presets."""
    return (*paper_names(), *_PRESETS, *_EQUAL_PARTS, "all")


def get_preset(name: str) -> tuple[SubTerrain, ...]:
    """Return the sub-terrains of a preset.

    The preset "all" has every terrain once, and once more inverted where that exists; but no
    course, which consists of the others.

    Raises:
        ConfigError: if there is no such preset.
    """
    if name not in preset_names():
        raise ConfigError(f"no preset {name!r}; {expected_names(name, preset_names())}")
    if name in paper_names():
        return get_paper(name).terrains
    if name in _PRESETS:
        return tuple(_sub_terrain(key, **values) for key, values in _PRESETS[name].items())
    names = _all_names() if name == "all" else _EQUAL_PARTS[name]
    return tuple(_sub_terrain(sub_name) for sub_name in names)


def _sub_terrain(
    name: str, terrain: str = "", proportion: float = 1.0, **parameters: Any
) -> SubTerrain:
    if name.endswith(registry.INVERTED):
        parameters["inverted"] = True
    terrain = terrain or name.removesuffix(registry.INVERTED)
    return SubTerrain(terrain=terrain, name=name, proportion=proportion, parameters=parameters)


def _all_names() -> list[str]:
    names = []
    for name in registry.terrain_names():
        if name == "course":
            continue
        names.append(name)
        if "inverted" in parameters_of(registry.get_terrain(name)):
            names.append(name + registry.INVERTED)
    return names
