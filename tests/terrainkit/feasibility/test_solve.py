"""Ranges that demand what is requested, against values worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain
from terrainkit.errors import ConfigError
from terrainkit.feasibility import assess_patch, solve_ranges
from terrainkit.feasibility.solve import _is_same, _max_difficulty
from terrainkit.map.patch import build_patch
from terrainkit.terrain.registry import make_overlay
from terrainkit.terrains.course import Element
from tests.limits import LIMITS
from tests.tables import read_table


def solve(terrain, demand=(0.2, 0.9), size=(6.0, 6.0), **parameters):
    terrains = (SubTerrain(terrain=terrain, parameters=parameters),)
    config = MapConfig(terrains=terrains, border=0, patch_size=size)
    (solved,) = solve_ranges(config, LIMITS, demand)
    return solved


@pytest.mark.parametrize(("terrain", "name", "easy", "hard"), read_table(__file__, "ranges_end"))
def test_ranges_end_at_the_requested_demands(terrain, name, easy, hard):
    base, inverted = terrain.removesuffix("_inverted"), terrain.endswith("_inverted")
    solved = solve(base, **({"inverted": True} if inverted else {}))
    assert solved.sub_terrain.parameters[name] == pytest.approx((easy, hard), abs=0.008)
    assert 0.16 < solved.demand[0] <= 0.2
    assert 0.86 < solved.demand[1] <= 0.9


def test_ranges_may_fall_and_are_extrapolated():
    """The lower the bars, the harder: (0.6 - c) / (0.6 - 0.3)."""
    solved = solve("crawl", size=(4.0, 1.2))
    assert solved.sub_terrain.parameters["clearance"] == pytest.approx((0.54, 0.33), abs=0.008)
    solved = solve("stairs", step_height=(0.05, 0.1))
    assert solved.sub_terrain.parameters["step_height"] == pytest.approx((0.04, 0.18), abs=0.001)


def test_lengths_are_whole_cells():
    """Gaps of 0, 0.1, 0.2, 0.3 m demand 0, 0.25, 0.5, 0.75 with a limit of 0.4 m."""
    solved = solve("gap")
    assert solved.sub_terrain.parameters["width"] == (0.0, 0.3)
    assert solved.demand == pytest.approx((0.0, 0.75))


def test_closest_value_is_used_where_extrapolation_does_not_reach_the_demand():
    """Steps of 0.04 m at difficulty -1 to 0.08 m at 3, and of 0.1 m to 0.3 m."""
    solved = solve("stairs", step_height=(0.05, 0.06), demand=(0.35, 0.9))
    assert solved.sub_terrain.parameters["step_height"] == pytest.approx((0.07, 0.08), abs=0.001)
    assert solved.demand == pytest.approx((0.35, 0.4), abs=0.01)
    solved = solve("stairs", step_height=(0.15, 0.2))
    assert solved.sub_terrain.parameters["step_height"] == pytest.approx((0.1, 0.18), abs=0.001)
    assert solved.demand == pytest.approx((0.5, 0.9), abs=0.01)


def test_elements_of_a_course_are_solved_one_by_one():
    """Hurdles are 0.2 and 0.9 of the step limit, 0.2 m, and gaps up to the gap limit, 0.4 m."""
    hurdles = Element(terrain="hurdles", parameters={"height": (0.05, 0.3)})
    gaps = Element(terrain="gap_track", element_length=4.0)
    solved = solve("course", size=(8.0, 4.0), elements=(hurdles, gaps))
    first, second = solved.elements
    assert first.ranges["height"] == pytest.approx((0.2 * 0.2, 0.9 * 0.2), abs=0.008)
    assert second.ranges["length"] == (0.1, 0.3)
    assert solved.demand == pytest.approx((first.demand[0], 0.9), abs=0.04)
    course = solved.sub_terrain.parameters["elements"]
    assert course == (first.sub_terrain, second.sub_terrain)
    assert course[1].element_length == 4.0


def test_equal_elements_are_solved_once():
    spacing = {"min_spacing": 0.7, "max_spacing": 0.9}
    hurdles = Element(terrain="hurdles", parameters={"height": (0.05, 0.4), **spacing})
    gaps = Element(terrain="gap_track", parameters={"length": (0.1, 0.5), **spacing})

    def course(name, *elements):
        parameters = {"elements": elements, "order": "random"}
        return SubTerrain(terrain="course", name=name, proportion=3.0, parameters=parameters)

    config = MapConfig(
        terrains=(course("short", hurdles), course("long", gaps, replace(hurdles, proportion=0.5))),
        border=0,
        patch_size=(8.0, 4.0),
    )
    totals = []

    def progress(steps, total):
        totals.append(total)
        return steps

    short, long = solve_ranges(config, LIMITS, (0.2, 0.9), progress=progress)
    assert totals == [2]
    assert short.elements[0].ranges == long.elements[1].ranges != {}
    assert (short.sub_terrain.name, long.sub_terrain.proportion) == ("short", 3.0)
    assert [each.sub_terrain.proportion for each in long.elements] == [1.0, 0.5]
    assert long.demand == tuple(max(each.demand[end] for each in long.elements) for end in (0, 1))


def test_overlays_count_at_the_ends_of_the_map():
    """The demands equal the demands of patches without noise at level 0, with noise at level 1."""
    noise = make_overlay("noise", {"amplitude": (0.0, 0.05)})
    slope = SubTerrain(terrain="slope", overlays=(noise,))
    config = MapConfig(terrains=(slope,), rows=2, cols=3, border=0, patch_size=(6.0, 4.0))
    (solved,) = solve_ranges(config, LIMITS, (0.2, 0.6))
    for end, demand in enumerate(solved.demand):
        patches = [build_patch(config, solved.sub_terrain, float(end), 0, col) for col in range(3)]
        demands = [assess_patch(p, LIMITS, config.wall_threshold).demand for p in patches]
        assert demand == sorted(demands)[1]
    assert demands[0] != demands[1]


def test_terrain_whose_demand_has_no_range_is_unchanged():
    solved = solve("obstacles", size=(6.0, 4.0))
    assert (solved.sub_terrain, solved.demand) == (SubTerrain(terrain="obstacles"), (0.0, 0.0))
    stairs = solve("stairs", step_height=0.1)
    assert (stairs.ranges, stairs.demand) == ({}, (0.5, 0.5))
    assert stairs.sub_terrain.parameters == {"step_height": 0.1}


@pytest.mark.parametrize("demand", [(0.5, 0.5), (0.9, 0.2), (-0.1, 1), (0, 2.5), (0, float("nan"))])
def test_invalid_demands_are_rejected(demand):
    with pytest.raises(ConfigError, match="expected LOW:HIGH with 0 <= LOW < HIGH <= 2"):
        solve("slope", demand=demand)


def test_patches_are_the_same_up_to_their_places():
    """Only one of several equal patches is assessed."""
    crawl = SubTerrain(terrain="crawl")
    config = MapConfig(terrains=(crawl,), rows=1, cols=2)
    first = build_patch(config, crawl, 0.5, 0, 0)
    solids = first.solids.transform(np.eye(3), [0, 8, 0])
    goals = first.goals + np.float32([0, 8, 0, 0])
    other = replace(first, grid=config.patch_grid(0, 1), solids=solids, goals=goals)
    assert _is_same(first, other)
    assert not _is_same(first, replace(other, solids=first.solids))
    assert not _is_same(first, replace(other, goals=other.goals + np.float32(1e-3)))
    assert not _is_same(first, replace(other, goals=other.goals[1:]))
    assert not _is_same(first, replace(other, heights=other.heights + np.float32(1e-3)))


@pytest.mark.parametrize(
    ("demand", "found"),
    [
        (lambda d: d, 0.5),
        (lambda d: 0.5 if d <= 0.25 else 1.0, 0.25),
        (lambda d: 0.0 * d, 1.0),  # the same at 1 as at the end of the search
        (lambda d: 0.1 * max(d, 1.0), 3.0),  # more at the end than at 1
        (lambda d: 2.0 + d, -1.0),  # too hard: the easiest
        (lambda d: -np.inf if d < 0 else 1.0 + d, 0.0),  # easier values are invalid
        (lambda d: np.inf if d > 0.3 else 0.0, 0.3),
        (lambda d: 1.0 + 0.0 * d, 0.0),  # the same everywhere
    ],
)
def test_largest_difficulty_of_at_most_a_demand(demand, found):
    assert _max_difficulty(demand, 0.5) == pytest.approx(found, abs=4 / 2**9)
