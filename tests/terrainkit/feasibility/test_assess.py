"""The demand of a patch, against values worked out by hand."""

import dataclasses
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate, make_patch
from terrainkit.errors import ConfigError
from terrainkit.feasibility import assess as assess_module
from terrainkit.feasibility import assess_map, assess_patch
from terrainkit.geometry.solids import make_boxes
from terrainkit.terrain.registry import terrain_names
from tests.limits import LIMITS
from tests.tables import read_table
from tests.terrainkit.maps import contents

CASES = read_table(__file__, "cases")
"""Parameters of a terrain, its demand and the limit that determines it."""

BOUNDS = read_table(__file__, "bounds")
"""Parameters of a terrain, and the lowest and the highest demand; 0 to 1 of all others."""


def config_of(terrain, size=(8.0, 4.0), **parameters):
    return MapConfig(
        terrains=(SubTerrain(terrain=terrain, parameters=parameters),),
        rows=1,
        cols=1,
        patch_size=size,
        mode="selected",
        selected_difficulty=0.5,
        border=0.0,
    )


def assess(terrain, limits=LIMITS, size=(8.0, 4.0), **parameters):
    config = config_of(terrain, size, **parameters)
    return assess_patch(make_patch(config, 0, 0), limits, config.wall_threshold)


@pytest.mark.parametrize("terrain", CASES)
def test_demand_by_hand(terrain):
    parameters, demand, limit = CASES[terrain]
    result = assess(terrain, **parameters)
    assert (result.demand, result.limit) == (pytest.approx(demand, abs=1e-3), limit)


@pytest.mark.parametrize("terrain", sorted({*terrain_names()} - {*CASES}))
def test_demand_between_bounds(terrain):
    parameters, low, high = BOUNDS.get(terrain, ({}, 0.0, 1.0))
    assert low - 1e-6 <= assess(terrain, **parameters).demand <= high + 1e-6


def test_goal_between_two_rows_of_stones_is_reached_on_a_stone():
    """A column in the row gap of 0.1 m is three columns from a stone."""
    result = assess("stone_rows", stone=0.8, gap=0.1, row_gap=0.1, variation=0.0)
    assert (result.demand, result.limit) == (pytest.approx(0.25, abs=1e-3), "gap")


def test_pyramid_stairs_inverted_are_climbed():
    result = assess("pyramid_stairs", step_height=0.15, inverted=True)
    assert (result.demand, result.limit) == (pytest.approx(0.75), "step_up")
    assert result.value == pytest.approx(0.15)


def test_limit_is_exactly_demand_one():
    assert assess("stairs", step_height=0.2).demand == 1.0
    assert assess("stairs", step_height=0.2).is_passable
    assert not assess("stairs", step_height=0.21).is_passable
    assert assess("pit", depth=1.0).demand == np.inf
    assert assess("pit", depth=1.0).value == pytest.approx(1.0)


def test_path_leads_from_spawn_over_the_blocking_place():
    result = assess("stairs", step_height=0.15)
    assert result.path[0] == pytest.approx([1.05, 2.05, 0.0], abs=0.11)
    assert result.path[-1][0] == pytest.approx(7.95)  # the far edge
    assert (np.abs(np.diff(result.path[:, 2])) <= 0.15 + 1e-6).all()
    assert np.linalg.norm(result.path[:, :2] - result.place[:2], axis=1).min() < 0.11


def test_path_passes_all_goals():
    config = config_of("slit", opening=2.0)
    patch = make_patch(config, 0, 0)
    path = assess_patch(patch, LIMITS, config.wall_threshold).path
    for goal in patch.goals:
        assert np.linalg.norm(path[:, :2] - goal[:2], axis=1).min() < 0.03


def test_robot_goes_under_or_over_a_bar():
    """A bar at 0.45 m demands a crouch; one on the ground is a hurdle."""
    flat = generate(config_of("flat"))
    center, size = np.array([[1.0, 2.0, 0.05], [7.0, 2.0, 0.05]]), [0.1, 4.0, 0.1]
    for bottom, demand, limit in ((0.45, 0.5, "crouched_height"), (0.0, 0.5, "step_up")):
        bars = make_boxes(center + np.array([0.0, 0.0, bottom]), size)
        (result,) = assess_map(flat.edited(solids=bars), LIMITS)
        assert (result.demand, result.limit) == (pytest.approx(demand, abs=1e-3), limit)


@pytest.mark.parametrize(("collides", "demand"), [(False, 0.0), (True, np.inf)])
def test_solids_that_do_not_collide_are_ignored(collides, demand):
    flat = generate(config_of("flat"))
    walls = make_boxes([[0.6, 2.0, 0.5], [7.4, 2.0, 0.5]], [0.2, 4.0, 1.0], collides=collides)
    (result,) = assess_map(flat.edited(solids=walls), LIMITS)
    assert result.demand == demand


def test_gap_edges_do_not_pass_walls():
    """A ditch before a wall on both sides: the robot cannot step through the wall."""
    config = config_of("flat")
    heights = np.zeros((80, 40), dtype=np.float32)
    away = np.abs(np.arange(80) - 39.5)
    heights[(away > 20) & (away < 22)] = -1.0
    heights[(away > 22) & (away < 23)] = 2.0
    (result,) = assess_map(generate(config).edited(heights=heights), LIMITS)
    assert result.demand == np.inf


def test_goal_in_a_wall_is_rejected():
    terrain_map = generate(config_of("slit", opening=2.0))
    goals = terrain_map.goals.copy()
    goals[0, 0, 0, :2] = terrain_map.solids.boxes[0, :2]
    wrong = dataclasses.replace(terrain_map, goals=goals)
    with pytest.raises(ConfigError, match=r"slit: got goal 0 at .* inside the ground or a solid"):
        assess_map(wrong, LIMITS)
    goals[0, 0, 0, 0] = -5.0
    with pytest.raises(ConfigError, match="outside of its patch"):
        assess_map(wrong, LIMITS)


def test_assess_map_tells_apart_patches_of_one_terrain():
    """Of four equal columns, the second is leveled and the third has half the friction."""
    slope = SubTerrain(terrain="pyramid_slope")
    terrain_map = generate(MapConfig(terrains=(slope,), rows=2, cols=4))
    heights, friction = terrain_map.heights.copy(), terrain_map.friction.copy()
    heights[terrain_map.config.patch_cells(1, 1)] = 0.0
    friction[terrain_map.config.patch_cells(1, 2)] *= 0.5
    edited = dataclasses.replace(terrain_map, heights=heights, friction=friction)
    results = assess_map(edited, LIMITS)
    for result in results:
        patch = edited.patch(result.row, result.col)
        alone = assess_patch(patch, LIMITS, edited.config.wall_threshold)
        assert (result.demand, result.difficulty) == (alone.demand, patch.difficulty)
        np.testing.assert_allclose(result.path[0], alone.path[0], atol=1e-9)
    steep, level, icy, again = results[4:]
    assert (level.demand, again.demand) == (0.0, steep.demand)
    assert (icy.demand, icy.limit) == (pytest.approx(steep.value / 0.5 * 1.5), "friction")


def test_executor_gives_the_same_results():
    terrain_map = generate(MapConfig(terrains=(SubTerrain(terrain="stairs"),), rows=3, cols=2))
    expected, seen = assess_map(terrain_map, LIMITS), []

    def watch(places, total):
        for place in places:
            seen.append((place, total))
            yield place

    with ThreadPoolExecutor(2) as executor:
        results = assess_map(terrain_map, LIMITS, progress=watch, executor=executor)
    assert seen == [((each.row, each.col), 6) for each in results]
    assert [contents(each) for each in results] == [contents(each) for each in expected]


def test_memory_counts_the_columns_of_a_patch(monkeypatch):
    """Solids need columns of at most 3.5 cm: 9 per cell of 0.1 m."""
    needed = []
    monkeypatch.setattr(assess_module, "check_memory", lambda size, _: needed.append(size))
    assess("flat")
    assess("slit")
    assert needed[1] == 9 * needed[0] == 9 * 80 * 40 * 2000
