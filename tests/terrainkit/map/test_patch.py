import dataclasses

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, make_patch
from terrainkit.errors import ConfigError
from terrainkit.map.patch import PatchParameters, with_heading
from terrainkit.terrains.obstacles import Obstacles
from terrainkit.terrains.rough import Rough
from tests.tables import read_table


def test_make_patch_describes_itself():
    choice = SubTerrain(terrain="pit", name="crater", parameters={"depth": (0.2, 0.6)})
    patch = make_patch(MapConfig(rows=3, cols=4, patch_size=(8.0, 4.0), terrains=(choice,)), 1, 3)
    assert (patch.terrain, patch.difficulty) == ("crater", 0.5)
    assert patch.grid.lower == pytest.approx((8.0, 12.0))
    assert patch.grid.upper == pytest.approx((16.0, 16.0))
    assert patch.origin == pytest.approx((12.0, 14.0, -0.4))
    assert patch.heights.min() == pytest.approx(-0.4)
    assert patch.heights.shape == patch.grid.shape == (80, 40)
    assert patch.heights.dtype == np.float32
    with pytest.raises(dataclasses.FrozenInstanceError):
        patch.difficulty = 1.0


def test_spawns_head_to_the_first_goal():
    goals = np.array([[4.0, 3.0, 0.0, 1.0], [9.0, 9.0, 0.0, 0.0]], np.float32)
    positions = np.array([[1.0, 3.0, 0.5], [4.0, 1.0, 0.0], [5.0, 2.0, 0.0]])
    spawns = with_heading(positions, goals, 0.7)
    assert spawns[:, :3].tolist() == positions.tolist()
    assert spawns[:, 3] == pytest.approx([0.0, np.pi / 2, np.pi * 3 / 4])
    assert with_heading(positions, goals[:0], 0.7)[:, 3] == pytest.approx([0.7] * 3)
    patch = make_patch(MapConfig(terrains=(SubTerrain(terrain="crawl"),), spawns_per_patch=3), 0, 0)
    expected = with_heading(patch.spawns[:, :3].astype(float), patch.goals)
    assert patch.spawns == pytest.approx(expected, abs=1e-5)


def test_make_patch_records_requested_and_realized():
    choice = SubTerrain(terrain="gap", parameters={"width": 0.33, "platform": 3.1, "depth": 2.0})
    parameters = make_patch(MapConfig(terrains=(choice,)), 0, 0).parameters
    assert parameters.requested == {"width": 0.33, "platform": 3.1, "depth": 2.0}
    assert parameters.realized == {"width": 0.3, "platform": 3.2, "depth": 2.0}


def test_parameters_differ_by_request_or_realization():
    first = PatchParameters(requested={"a": 1, "b": 2}, realized={"a": 1, "b": 2})
    other = PatchParameters(requested={"a": 1, "b": 2, "c": 3}, realized={"a": 1.5, "b": 2})
    assert first.diff(first) == []
    assert first.diff(other) == other.diff(first) == ["a", "c"]


def test_far_edges_are_farthest_from_the_origin():
    """Sides count that are nearer than the farthest one by up to 0.15 m."""
    patch = make_patch(
        MapConfig(patch_size=(8.0, 4.0), terrains=(SubTerrain(terrain="flat"),)), 0, 0
    )
    sides = []
    for x, y in ((4.0, 2.0), (4.07, 2.0), (4.08, 2.0), (2.0, 0.5), (4.0, 7.9)):
        spawns = np.array([[x, y, 0, 0]], np.float32)
        sides.append(dataclasses.replace(patch, spawns=spawns).far_edges.tolist())
    assert sides == [
        [[True, False], [True, False]],
        [[True, False], [True, False]],
        [[True, False], [False, False]],
        [[False, False], [True, False]],
        [[False, True], [False, False]],
    ]


@pytest.mark.parametrize("seed", [7, 2**40 + 7])
@pytest.mark.parametrize(
    ("terrain", "entropy", "key"), [(Rough, (3, 5), ()), (Obstacles, (5,), (2,))]
)
def test_make_patch_is_seeded_by_row_and_column_or_by_column(seed, terrain, entropy, key):
    name = terrain.__name__.lower()
    patch = make_patch(MapConfig(seed=seed, terrains=(SubTerrain(terrain=name),)), 3, 5)
    rng = np.random.default_rng(np.random.SeedSequence([seed, *entropy], spawn_key=key))
    # Row 3 of 0 to 9 has difficulty 1/3.
    alone = terrain.at(3 / 9).build(patch.grid, rng)
    assert patch.heights.tobytes() == alone.tobytes()


@pytest.mark.parametrize(
    ("terrain", "parameters", "message"),
    read_table(__file__, "make_patch_rejects_terrain_that_does_not_fit"),
)
def test_make_patch_rejects_terrain_that_does_not_fit(terrain, parameters, message):
    choice = SubTerrain(terrain=terrain, name="a", parameters=parameters)
    with pytest.raises(ConfigError, match=rf"^patch \(9, 0\): .*{message}"):
        make_patch(MapConfig(terrains=(choice,)), 9, 0)


@pytest.mark.parametrize(("grade", "threshold", "height"), [(0.75, 0.75, 1.875), (0.8, None, 2.0)])
def test_make_patch_allows_slopes_up_to_the_threshold(grade, threshold, height):
    steep = SubTerrain(terrain="pyramid_slope", parameters={"grade": grade})
    config = MapConfig(terrains=(steep,), slope_threshold=threshold)
    assert make_patch(config, 0, 0).heights.max() == pytest.approx(height)
