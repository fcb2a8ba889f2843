import dataclasses

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, make_patch
from terrainkit.errors import ConfigError, TerrainkitWarning
from terrainkit.terrains.obstacles import Obstacles
from terrainkit.terrains.rough import Rough

PIT = SubTerrain(terrain="pit")
OBSTACLES = SubTerrain(terrain="obstacles")


def test_make_patch_describes_itself():
    choice = SubTerrain(terrain="pit", name="crater", parameters={"depth": (0.2, 0.6)})
    patch = make_patch(MapConfig(rows=3, cols=2, terrains=(choice,)), 1, 0)
    assert patch.terrain == "crater"
    assert patch.difficulty == 0.5
    assert patch.heights.min() == pytest.approx(-0.4)
    assert patch.heights.shape == patch.grid.shape == (80, 80)
    assert patch.heights.dtype == np.float32


def test_make_patch_is_in_the_map_frame():
    config = MapConfig(rows=3, cols=4, patch_size=(8.0, 4.0), terrains=(OBSTACLES,))
    patch = make_patch(config, 2, 3)
    assert patch.grid.lower == pytest.approx((16.0, 12.0))
    assert patch.grid.upper == pytest.approx((24.0, 16.0))
    assert patch.origin == pytest.approx((20.0, 14.0, 0.0))


def test_make_patch_origin_of_a_pit():
    patch = make_patch(MapConfig(mode="selected", terrains=(PIT,)), 0, 1)
    assert patch.origin == pytest.approx((4.0, 12.0, -1.0))


def test_make_patch_heads_to_the_first_goal():
    terrain = SubTerrain(terrain="crawl")
    patch = make_patch(MapConfig(terrains=(terrain,), spawns_per_patch=3), 0, 0)
    assert len(patch.spawns) == 3
    for x, y, _, heading in patch.spawns:
        gx, gy = patch.goals[0, :2]
        assert np.hypot(gx - x, gy - y) * np.cos(heading) == pytest.approx(gx - x, abs=1e-4)
        assert np.hypot(gx - x, gy - y) * np.sin(heading) == pytest.approx(gy - y, abs=1e-4)


def test_make_patch_records_requested_and_realized():
    choice = SubTerrain(terrain="gap", parameters={"width": 0.33, "platform": 3.1, "depth": 2.0})
    parameters = make_patch(MapConfig(terrains=(choice,)), 0, 0).parameters
    assert parameters.requested == {"width": 0.33, "platform": 3.1, "depth": 2.0}
    assert parameters.realized == {"width": 0.3, "platform": 3.2, "depth": 2.0}


@pytest.mark.parametrize("seed", [7, 2**40 + 7])
def test_make_patch_is_seeded_by_row_and_column(seed):
    patch = make_patch(MapConfig(seed=seed, terrains=(SubTerrain(terrain="rough"),)), 3, 5)
    rng = np.random.default_rng(np.random.SeedSequence([seed, 3, 5]))
    # Row 3 of 0 to 9 has difficulty 1/3.
    alone = Rough.at(3 / 9).build(patch.grid, rng)
    assert patch.heights.tobytes() == alone.tobytes()


@pytest.mark.parametrize("seed", [7, 2**40 + 7])
def test_make_patch_with_column_layout_is_seeded_by_column(seed):
    patch = make_patch(MapConfig(seed=seed, terrains=(OBSTACLES,)), 3, 5)
    rng = np.random.default_rng(np.random.SeedSequence([seed, 5], spawn_key=(2,)))
    alone = Obstacles.at(3 / 9).build(patch.grid, rng)
    assert patch.heights.tobytes() == alone.tobytes()


def test_make_patch_differs_between_patches():
    config = MapConfig(rows=4, cols=4, mode="selected", terrains=(OBSTACLES,))
    patches = [make_patch(config, row, col).heights.tobytes() for row, col in np.ndindex(4, 4)]
    assert len(set(patches)) == 16


@pytest.mark.parametrize(("row", "col"), [(3, 0), (0, 4), (-1, 0), (0, -1)])
def test_make_patch_rejects_unknown_index(row, col):
    with pytest.raises(
        IndexError, match=rf"no patch \({row}, {col}\) in a map of 3 rows and 4 columns"
    ):
        make_patch(MapConfig(rows=3, cols=4, terrains=(PIT,)), row, col)


def test_make_patch_without_spawn_is_rejected():
    choice = SubTerrain(terrain="rough", name="rubble", parameters={"platform": 0.4})
    with pytest.raises(
        ConfigError,
        match=r"rubble: no disk of radius 0\.5 m is flat within 0\.01 m and free of",
    ):
        make_patch(MapConfig(terrains=(choice,)), 9, 0)


def test_make_patch_rejects_terrain_that_does_not_fit():
    choice = SubTerrain(terrain="pit", parameters={"side": 9.0})
    with pytest.raises(ConfigError, match="pit: side 9 m does not fit in a patch of 8 m x 8 m"):
        make_patch(MapConfig(terrains=(choice,)), 0, 0)


def test_make_patch_warns_of_missing_columns():
    with pytest.warns(TerrainkitWarning, match="no column for wave"):
        make_patch(MapConfig(cols=4, preset="rough"), 0, 0)


def test_patch_is_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        make_patch(MapConfig(terrains=(PIT,)), 0, 0).difficulty = 1.0


def test_make_patch_rejects_slope_above_threshold():
    steep = SubTerrain(terrain="pyramid_slope", parameters={"grade": 0.8})
    config = MapConfig(rows=1, cols=1, terrains=(steep,))
    with pytest.raises(
        ConfigError, match=r"grade: got 0\.8; expected at most slope_threshold \(0\.75\)"
    ):
        make_patch(config, 0, 0)
    assert make_patch(
        dataclasses.replace(config, slope_threshold=None), 0, 0
    ).heights.max() == pytest.approx(2.0)
