"""Presets of published work against the figures of the work.

`SOURCES` has every parameter that a preset gives, written anew from the source: (easy, hard) where
it depends on the difficulty.
"""

import re
from math import atan, radians, tan

import numpy as np
import pytest

import terrainkit as tk
from terrainkit.errors import ConfigError
from terrainkit.map.validate import validate
from terrainkit.terrain.paper import get_paper, paper_names

LEGGED_GYM_SLOPE = {"grade": (0, 0.4), "platform": 3}  # slope = difficulty * 0.4
# step_height = 0.05 + 0.18 * difficulty, step_width=0.31, platform_size=3.
LEGGED_GYM_STAIRS = {"step_height": (0.05, 0.05 + 0.18), "step_width": 0.31, "platform": 3}
OBSTACLES = {"number": 20, "min_width": 1, "max_width": 2, "platform": 3}
LEGGED_GYM = {
    "pyramid_slope": LEGGED_GYM_SLOPE,
    "pyramid_slope_inverted": LEGGED_GYM_SLOPE | {"inverted": True},
    # min_height=-0.05, max_height=0.05, step=0.005, downsampled_scale=0.2
    "rough_slope": LEGGED_GYM_SLOPE | {"amplitude": 0.05, "step": 0.005, "spacing": 0.2},
    "pyramid_stairs": LEGGED_GYM_STAIRS,
    "pyramid_stairs_inverted": LEGGED_GYM_STAIRS | {"inverted": True},
    "obstacles": OBSTACLES | {"height": (0.05, 0.05 + 0.2)},
}
# MeshPyramidStairsTerrainCfg, HfPyramidSlopedTerrainCfg and HfRandomUniformTerrainCfg
ISAAC_STAIRS = {"step_height": (0.05, 0.23), "step_width": 0.3, "platform": 3}
ISAAC_SLOPE = {"grade": (0, 0.4), "platform": 2}
ISAAC_ROUGH = {"amplitude": (0.10 - 0.02) / 2, "step": 0.02, "spacing": 0.1}
MJLAB_STAIRS = {"step_height": (0, 0.1), "step_width": 0.3, "platform": 3}
MJLAB_SLOPE = {"grade": (0, 0.7), "platform": 2}
HUMANOID_SLOPE = {"grade": (0, 0.15), "platform": 2}  # h_slope = difficulty * 0.15
HIKING_STAIRS = {"step_height": (0.05, 0.23), "step_width": 0.3, "platform": 2.5}
HIKING_HIGH_STAIRS = {"step_height": (0.05, 0.45), "step_width": 1.5, "platform": 4}
# w_gap, w_stone, s_max and h_max of RISKY_TERRAINS_CFG
RISKY_STONES = {
    "gap": (0.08, 0.26),
    "stone": (0.92, 0.2),
    "shift": (0.036, 0.118),
    "variation": (0.01, 0.1),
}

SOURCES = {
    "legged_gym": LEGGED_GYM
    | {
        # 1.5 * (1.05 - difficulty), stone_distance 0.1, depth -10, platform_size=4.
        "stepping_stones": {
            "stone": (1.5 * 1.05, 1.5 * 0.05),
            "distance": 0.1,
            "depth": 10,
            "platform": 4,
        },
        "gap": {
            "width": (0, 1),
            "depth": 1000 * 0.005,
            "platform": 3,
        },  # gap_size = 1. * difficulty
        "pit": {"depth": (0, 1), "side": 4},
    },
    "legged_gym_rough": LEGGED_GYM,
    "isaaclab": {
        "pyramid_stairs": ISAAC_STAIRS,
        "pyramid_stairs_inverted": ISAAC_STAIRS | {"inverted": True},
        "random_grid": {"block": 0.45, "height": (0.05, 0.2), "platform": 2},
        "rough": ISAAC_ROUGH,
        "pyramid_slope": ISAAC_SLOPE,
        "pyramid_slope_inverted": ISAAC_SLOPE | {"inverted": True},
    },
    "mjlab": {
        "flat": {},
        "pyramid_stairs": MJLAB_STAIRS,
        "pyramid_stairs_inverted": MJLAB_STAIRS | {"inverted": True},
        "pyramid_slope": MJLAB_SLOPE,
        "pyramid_slope_inverted": MJLAB_SLOPE | {"inverted": True},
        "rough": ISAAC_ROUGH,
        "wave": {"amplitude": (0, 0.2), "number": 4},
    },
    "humanoid_gym": {
        "flat": {},
        "obstacles": OBSTACLES | {"height": (0, 0.04)},  # difficulty * 0.04
        "rough": {"amplitude": (0, 0.07), "step": 0.005, "spacing": 0.2},  # difficulty * 0.07
        "pyramid_slope": HUMANOID_SLOPE,
        "pyramid_slope_inverted": HUMANOID_SLOPE | {"inverted": True},
    },
    "extreme_parkour": {
        # parkour_terrain: incline_height 0.25 d at both sides of a stone 1.0 wide and 0.9 - 0.3 d
        # long; x_range up to 0.1 + 0.3 d; y_range up to 0.3 + 0.1 d; pit_depth up to 1
        "side_ramps": {
            "start": 2.5,
            "roll": (0, atan(0.25 / 0.5)),
            "gap": (0.1, 0.1 + 0.3),
            "width": 1,
            "offset": (0.3, 0.3 + 0.1),
            "spacing": (0.9 + 0.1, 0.6 + 0.4),
            "depth": 1,
        },
        # parkour_hurdle_terrain: stone_len 0.1 + 0.3 d, hurdle_height up to 0.15 + 0.25 d
        "hurdles": {
            "start": 2.5,
            "height": (0.15, 0.15 + 0.25),
            "min_thickness": (0.1, 0.1 + 0.3),
            "max_thickness": (0.1, 0.1 + 0.3),
            "min_spacing": 1.2,
            "max_spacing": 2.2,
        },
        "rough": {"amplitude": 0.06, "spacing": 0.1},  # cfg.height = [0.02, 0.06]
        # parkour_step_terrain: step_height 0.1 + 0.35 d, 3 of 6 up; 0.3 + 0.45 at difficulty 1
        "steps": {
            "order": "random",
            "slot_length": 3.95,
            "platform": 1,
            "elements[0].step_height": (0.1, 0.1 + 0.35),
            "elements[0].step_width": 0.3 + 0.45,
            "elements[0].landing": 0.1,
            "elements[0].element_length": 0.1 + 5 * 0.75 + 0.1,
        },
        # parkour_gap_terrain: gap_size 0.1 + 0.7 d, x_range [0.8, 1.5] + gap_size, gap_depth to 1
        "gap_track": {
            "start": 2.5,
            "length": (0.1, 0.1 + 0.7),
            "depth": 1,
            "min_spacing": (0.8 + 0.1, 0.8 + 0.8),
            "max_spacing": (1.5 + 0.1, 1.5 + 0.8),
        },
    },
    "robot_parkour_learning": {
        "climb": {"step_height": (0.2, 0.6), "step_width": 1.6},  # jump.height, track_block_length
        # leap.length and leap.depth; track_block_length 2
        "leap": {"length": (0.2, 0.8), "depth": 0.8, "min_spacing": 2, "max_spacing": 2},
        # crawl.height, depth and wall_height; track_block_length 1.6
        "crawl": {
            "clearance": (0.5, 0.25),
            "min_depth": 0.1,
            "max_depth": 0.6,
            "thickness": 0.6,
            "spacing": 1.6 - 0.6,
        },
        # tilt.width (0.24, 0.4), depth up to 1, wall_height 0.5; track_block_length 2
        "tilt": {
            "opening": (0.4 / 0.4, 0.24 / 0.4),
            "body_width": 0.4,
            "offset": 0,
            "depth": 1,
            "height": 0.5,
            "spacing": 2,
        },
    },
    "anymal_parkour": {
        "boxes": {"height": (0.05, 1)},
        "drop": {"step_height": (0.05, 1), "step_width": 2},
        "gap_track": {},
        "crawl": {"clearance": (0.5, 0.2), "min_depth": 0.1, "max_depth": 0.6},
        "stairs": {},
    },
    "barkour": {
        # size="0.5 0.5 0.05", half of each
        "table": {"height": 0.1, "number": 2, "layers": 1, "min_side": 1, "max_side": 1},
        # cones 0.05 wide at x 1.7, 2.5, 3.2, 3.8 and 4.3
        "weave_poles": {
            "gap": 4.3 - 3.8 - 0.05,
            "number": 5,
            "min_width": 0.05,
            "max_width": 0.05,
        },
        "a_frame": {"grade": 0.92376 / 1.6, "landing": (8 - 3.2) / 2},  # 30degree_aframe, 3.2 long
        "broad_jump": {"length": 0.5, "depth": 0.5},
    },
    "risky_terrains": {
        "stones_everywhere": RISKY_STONES | {"depth": 10, "platform": 1.5},
        "beams": {"width": 0.25, "gap": 0, "yaw": 0},  # w_stone
        # w_stone, gap, yaw and l_stone
        "stepping_beams": {
            "width": (0.5, 0.2),
            "gap": (0.15, 0.5),
            "yaw": (0, radians(15)),
            "min_length": 0.8,
            "max_length": 1.6,
        },
    },
    "beamdojo": {
        # levels 0 and 8: max(0.25, 1.5 (1 - 0.1 l)), 0.05 ceil(l / 2)
        "stones_everywhere": {
            "stone": (1.5, 1.5 * 0.2),
            "gap": (0.01, 0.05 * 4),
            "shift": 0,
            "variation": 0.05,
            "depth": 1,
        },
        # 0.8 ... 0.2, 0.1 + 0.05 l
        "stone_rows": {
            "stone": (0.8, 0.2),
            "gap": (0.1, 0.1 + 0.05 * 8),
            "variation": 0.05,
            "depth": 1,
        },
        "beams": {
            "width": (0.3, 0.3 - 0.05 * 2),
            "gap": 0,
            "yaw": 0,
            "depth": 1,
        },  # 0.05 floor(l / 3)
        "stepping_beams": {"width": 0.2, "gap": 0.3, "yaw": 0, "min_length": 1, "max_length": 1},
        "gap_track": {"length": 0.5, "depth": 1},
    },
    "walking_with_terrain_reconstruction": {
        "stones_everywhere": RISKY_STONES,
        "beams": {},
        "gap_track": {},
    },
    "hiking_in_the_wild": {
        "rough": {"amplitude": (0, 0.1), "spacing": 0.1},  # noise_scale
        # gap_distance_range, gap_depth up to 0.6
        "gap": {"width": (0.1, 0.7), "depth": 0.6, "platform": 2.5},
        "pyramid_stairs": HIKING_STAIRS,
        "pyramid_stairs_high": HIKING_HIGH_STAIRS,
        "pyramid_stairs_inverted": HIKING_STAIRS | {"inverted": True},
        "pyramid_stairs_inverted_high": HIKING_HIGH_STAIRS | {"inverted": True},
        # obstacle_height_range, obstacle_width_range, num_obstacles
        "obstacles": {
            "height": (0.05, 0.45),
            "number": 20,
            "min_width": 0.8,
            "max_width": 1.5,
            "platform": 1.5,
        },
        # box_height_mean 0.1 to 0.4, + 0.05; box_length 0.4 +- 0.1; 0.3 * 8 * 8 / 0.4 / 0.4 boxes
        "small_obstacles": {
            "height": (0.1 + 0.05, 0.4 + 0.05),
            "number": 120,
            "min_width": 0.3,
            "max_width": 0.5,
            "platform": 1.5,
        },
        "pyramid_slope_inverted": {"grade": (0, 0.7), "platform": 1.5, "inverted": True},
    },
    # Appendix A, in its order
    "ame_2": {
        "rough": {"amplitude": (0, 0.2), "spacing": 0.1},
        "open_stairs": {
            "riser": (0.3 * tan(radians(5)), 0.3 * tan(radians(45))),
            "tread": 0.3,
        },
        "obstacles": {"height": (0.05, 0.4)},
        "climbing_up": {"depth": (0.1, 1)},
        "climbing_down": {"step_height": (0.2, 1), "step_width": 2},
        "climbing_consecutive": {"step_height": (0.05, 0.5), "step_width": 1},
        "gap_track": {"length": (0.1, 1.1), "depth": 1.5},
        "pallets": {"width": (0.4, 0.16), "gap": (0.08, 0.35), "yaw": 0, "depth": 1.5},
        "stones_everywhere": RISKY_STONES | {"depth": 1.5},
        "beams": {
            "width": (0.9, 0.18),
            "gap": 0,
            "yaw": 0.1,
            "min_spacing": 4,
            "max_spacing": 4,
            "depth": 1.5,
        },
    },
}


def config_of(name, **values):
    """Return the config of the map of a work, with other values."""
    return tk.MapConfig.from_table({"preset": name, "border": 0.0, **get_paper(name).map, **values})


@pytest.mark.parametrize("name", paper_names())
def test_paper_realizes_the_figures_of_its_source(name):
    grid = config_of(name).patch_grid(0, 0)
    given = {}
    for sub_terrain in get_paper(name).terrains:
        known = {**sub_terrain.parameters}
        for element in known.pop("elements", ()):
            own = {**element.parameters, "element_length": element.element_length}
            known |= {f"elements[0].{key}": value for key, value in own.items()}
        source = given[sub_terrain.name] = SOURCES[name][sub_terrain.name]
        assert known.keys() == source.keys(), sub_terrain.name
        for end, difficulty in enumerate((0.0, 1.0)):
            realized = sub_terrain.at(difficulty).realized(grid)
            for key, value in source.items():
                expected = value[end] if isinstance(value, tuple) else value
                snap = sub_terrain.declarations[key].snap
                step = {"none": 1e-4, "cells": grid.cell / 2, "centered": grid.cell}[snap] + 1e-6
                near = expected if isinstance(value, str) else pytest.approx(expected, abs=step)
                assert realized[key] == near, (sub_terrain.name, key)
    assert given == SOURCES[name]


def one_patch(name, terrain, difficulty):
    """Return a map of one patch of a work."""
    (sub_terrain,) = (each for each in get_paper(name).terrains if each.name == terrain)
    size = {key: value for key, value in get_paper(name).map.items() if key not in ("rows", "cols")}
    one = {"rows": 1, "cols": 1, "mode": "selected", "selected_difficulty": difficulty}
    return tk.generate(tk.MapConfig(**size, **one, border=1.0, terrains=(sub_terrain,)))


def rays(terrain_map, axis=0, at=None, start=20.0, direction="down"):
    """Return where rays every 5 mm along a line through the patch end."""
    size = terrain_map.config.patch_size
    line = np.arange(0.0025, size[axis], 0.005)
    across = np.full_like(line, size[1 - axis] / 2 if at is None else at)
    points = np.column_stack([*((line, across) if axis == 0 else (across, line)), 0 * line + start])
    return terrain_map.scan(points, direction)


def lengths(is_inside):
    """Return the lengths of the runs of True, 5 mm each, without the runs at both ends."""
    edges = np.flatnonzero(np.diff(is_inside.astype(int)))
    runs = np.diff(edges) * 0.005
    return runs[is_inside[edges[:-1] + 1]]


@pytest.mark.parametrize(
    ("name", "terrain", "easy", "hard"),
    [
        ("extreme_parkour", "gap_track", 0.1, 0.8),
        ("robot_parkour_learning", "leap", 0.2, 0.8),
        ("beamdojo", "gap_track", 0.5, 0.5),
        ("barkour", "broad_jump", 0.5, 0.5),
        ("hiking_in_the_wild", "gap", 0.1, 0.7),
        ("ame_2", "gap_track", 0.1, 1.1),
        ("ame_2", "pallets", 0.08, 0.35),
        ("risky_terrains", "stepping_beams", 0.15, None),  # turned at difficulty 1
    ],
)
def test_paper_gaps_have_their_length_by_rays(name, terrain, easy, hard):
    for difficulty, length in ((0.0, easy), (1.0, hard)):
        if length is not None:
            gaps = lengths(rays(one_patch(name, terrain, difficulty)) < -0.2)
            assert gaps[:-1] == pytest.approx(length, abs=0.006)  # the last one ends at a cell
            assert len(gaps) > 1


@pytest.mark.parametrize(
    ("name", "terrain", "difficulty", "levels"),
    [
        ("extreme_parkour", "hurdles", 1.0, [0, 0.4]),
        ("extreme_parkour", "steps", 0.0, [0, 0.1, 0.2, 0.3]),
        ("extreme_parkour", "steps", 1.0, [0, 0.45, 0.9, 1.35]),
        ("robot_parkour_learning", "climb", 1.0, [0, 0.6]),
        ("barkour", "a_frame", 1.0, [0, 0.9238]),
        ("hiking_in_the_wild", "pyramid_stairs_high", 1.0, [0, 0.45]),
        ("ame_2", "climbing_up", 1.0, [-1, 0]),
        ("ame_2", "climbing_down", 0.0, [0, 0.2]),
        ("ame_2", "climbing_down", 1.0, [0, 1]),
        ("ame_2", "climbing_consecutive", 1.0, [0, 0.5, 1]),
    ],
)
def test_paper_obstacles_have_their_height_by_rays(name, terrain, difficulty, levels):
    z = rays(one_patch(name, terrain, difficulty))
    assert [z.min(), z.max()] == pytest.approx([levels[0], levels[-1]], abs=2e-3)
    if terrain != "a_frame":
        assert np.unique(z.round(4)).tolist() == pytest.approx(levels)


def test_paper_openings_and_ramps_by_rays():
    for difficulty, clearance, width in ((0.0, 0.5, 0.4), (1.0, 0.25, 0.24)):
        bars = rays(one_patch("robot_parkour_learning", "crawl", difficulty), 0, None, 0.01, "up")
        assert np.nanmin(bars) == pytest.approx(clearance)
        slit = rays(one_patch("robot_parkour_learning", "tilt", difficulty), 1, at=3.0)
        assert lengths(slit < 0.1) == pytest.approx(width, abs=0.006)
        assert slit.max() == pytest.approx(0.5)
    ramp = rays(one_patch("extreme_parkour", "side_ramps", 1.0), 1, at=3.2)
    on_ramp = ramp[20:-20][ramp[20:-20] > -0.5]  # without the rim of the pit
    assert [on_ramp.min(), on_ramp.max()] == pytest.approx([-0.25, 0.25], abs=2e-3)
    assert len(on_ramp) * 0.005 == pytest.approx(1.0)
    stones = lengths(rays(one_patch("beamdojo", "stone_rows", 1.0), at=4.15) > -0.5)
    assert stones[1:-1] == pytest.approx(0.2, abs=0.006)
    wedge = lengths(rays(one_patch("barkour", "a_frame", 1.0)) > 1e-3)
    assert wedge == pytest.approx(3.2, abs=0.106)  # a slope starts at the center of a cell


@pytest.mark.parametrize("name", paper_names())
def test_paper_generates_as_in_the_work_with_valid_origins(name):
    terrain_map = tk.generate(config_of(name, rows=2, cols=20, border=1.0))
    assert validate(terrain_map) == []


def test_paper_citations_are_complete():
    for paper in map(get_paper, paper_names()):
        assert min(len(paper.title), len(paper.authors), len(paper.figures)) > 4
        assert 2020 < paper.year < 2027
        assert re.match(r"arXiv:\d{4}\.\d{5}$|doi:10\.|https://", paper.source)
        assert {*paper.second_hand} <= {each.name for each in paper.terrains}


def test_get_paper_unknown_name_lists_papers():
    with pytest.raises(ConfigError, match="'ame'; did you mean 'ame_2'"):
        get_paper("ame")
