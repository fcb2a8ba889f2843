import dataclasses
import math

import numpy as np
import pytest

from terrainkit import MapConfig, TerrainChoice, presets
from terrainkit.errors import ConfigError

FLAT, GAP = TerrainChoice(terrain="flat"), TerrainChoice(terrain="gap")


def test_the_default_is_legged_gyms_map():
    config = MapConfig()
    assert config.mix == presets.get_preset("legged_gym")
    # 10 x 8 m of patches and 2 x 25 m of border are 130 m, at 0.1 m.
    assert config.grid.shape == (1300, 1300)


def test_world_zero_is_the_corner_of_patch_zero():
    config = MapConfig()
    assert config.grid.lower == (-25.0, -25.0)
    assert config.patch_start(0, 0) == (250, 250)
    assert config.patch_grid(0, 0).lower == (0.0, 0.0)


def test_rows_run_along_x_and_columns_along_y():
    config = MapConfig(patch_size=(8.0, 4.0), border=2.0)
    patch = config.patch_grid(2, 3)
    assert patch.shape == (80, 40)
    assert patch.lower == pytest.approx((16.0, 12.0))
    assert config.patch_start(2, 3) == (20 + 2 * 80, 20 + 3 * 40)


def test_patches_do_not_drift():
    config = MapConfig(rows=11, patch_size=(8.2, 8.2))
    assert config.patch_grid(10, 0).lower[0] == pytest.approx(82.0)


def test_centered_puts_zero_at_the_middle():
    config = MapConfig(rows=3, cols=5, patch_size=(8.0, 4.0), border=1.0, centered=True)
    # 3 x 8 + 2 = 26 m along x, 5 x 4 + 2 = 22 m along y.
    assert config.grid.lower == pytest.approx((-13.0, -11.0))
    assert config.grid.center == pytest.approx((0.0, 0.0))
    assert config.patch_grid(1, 2).center == pytest.approx((0.0, 0.0))


def test_a_mix_of_ones_own_replaces_the_preset():
    config = MapConfig(preset="rough", terrains=(GAP, FLAT))
    assert config.mix == (GAP, FLAT)
    assert config.preset == ""


def test_walls_begin_a_hair_above_the_threshold_times_the_cell():
    wall = MapConfig(slope_threshold=0.5, cell=0.2, border=0.0).wall_threshold
    assert wall == pytest.approx(0.10001, abs=1e-9)
    assert MapConfig(slope_threshold=None).wall_threshold == math.inf


def test_a_million_cells_along_a_side_are_the_most():
    # 12 500 patches of 80 cells.
    assert MapConfig(rows=12_500, border=0.0).grid.shape[0] == 1_000_000
    with pytest.raises(ConfigError, match="cells along x; wanted at most 1000000"):
        MapConfig(rows=12_501, border=0.0)


def test_numpys_numbers_are_taken():
    config = MapConfig(rows=np.int64(3), border=np.float32(0.5), centered=np.True_)
    assert config == MapConfig(rows=3, border=0.5, centered=True)
    assert (type(config.rows), type(config.border)) == (int, float)


def test_whole_numbers_and_lists_are_taken_for_floats_and_tuples():
    config = MapConfig(patch_size=[8, 4], border=1, terrains=[FLAT])
    assert config == MapConfig(patch_size=(8.0, 4.0), border=1.0, terrains=(FLAT,))
    assert isinstance(config.border, float)


def test_a_config_does_not_change():
    with pytest.raises(dataclasses.FrozenInstanceError):
        MapConfig().rows = 3


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"rows": 0}, "rows is 0; wanted 1 to"),
        ({"cols": -2}, "cols is -2; wanted 1 to"),
        ({"rows": 2.0}, r"rows is 2\.0; wanted a whole number"),
        ({"cell": 0.0}, r"cell is 0; wanted 0\.0001 to"),
        ({"cell": math.nan}, r"cell is nan; wanted 0\.0001 to"),
        ({"cell": 0.3}, r"patch_size 8 m is not a whole number of cells of 0\.3 m; .*: 7\.8 m"),
        ({"patch_size": (8.0, 0.0)}, r"patch_size is 0; wanted 0\.0001 to"),
        ({"patch_size": (8.0, math.inf)}, r"patch_size is inf; wanted 0\.0001 to"),
        ({"patch_size": (8.0, 4.03)}, r"patch_size 4\.03 m is not .*: 4 m, 4\.1 m"),
        ({"patch_size": 8.0}, r"patch_size is 8\.0; wanted a list"),
        ({"border": -1.0}, "border is -1; wanted 0 to"),
        ({"border": 0.25}, r"border 0\.25 m is not a whole number of cells .*: 0\.2 m, 0\.3 m"),
        ({"cols": 10**6}, r"the map has 8\.00005e\+07 cells along y; wanted at most 1000000"),
        pytest.param({"rows": 10**400}, "rows is a whole number beyond 64 bits", id="10**400"),
        ({"seed": -1}, "seed is -1; wanted 0 to"),
        ({"slope_threshold": 0.0}, r"slope_threshold is 0; wanted 0\.0001 to"),
        ({"spawn_radius": 0.0}, r"spawn_radius is 0; wanted 0\.0001 to"),
        ({"spawn_tolerance": -0.1}, r"spawn_tolerance is -0\.1; wanted 0 to"),
        ({"difficulty_range": (0.0, 1.1)}, r"difficulty_range is 1\.1; wanted 0 to 1"),
        (
            {"difficulty_range": (0.8, 0.2)},
            r"difficulty_range falls from 0\.8 to 0\.2; wanted it to rise",
        ),
        ({"difficulty_jitter": 1.5}, r"difficulty_jitter is 1\.5; wanted 0 to 1"),
        ({"random_difficulties": ()}, "random_difficulties is empty; wanted at least one"),
        ({"random_difficulties": (0.5, 2.0)}, "random_difficulties is 2; wanted 0 to 1"),
        ({"selected_difficulty": -0.5}, r"selected_difficulty is -0\.5; wanted 0 to 1"),
        ({"static_friction": -1.0}, "static_friction is -1; wanted 0 to"),
        ({"dynamic_friction": math.inf}, "dynamic_friction is inf; wanted 0 to"),
        ({"restitution": 1.2}, r"restitution is 1\.2; wanted 0 to 1"),
        ({"mode": "random"}, "mode is 'random'; wanted one of: curriculum, selected, randomized"),
        ({"preset": "moon"}, "no preset 'moon'; there are: legged_gym, rough, stairs, all"),
        ({"terrains": (FLAT, "gap")}, "terrains is 'gap'; wanted TerrainChoice"),
        ({"terrains": (GAP, GAP)}, "2 terrains of the mix are called 'gap'"),
        ({"mode": "selected", "terrains": (GAP, FLAT)}, "mix of one terrain.* has 2: gap, flat"),
        ({"mode": "selected"}, "mode selected wants a mix of one terrain.* this one has 9: "),
        (
            {"terrains": (TerrainChoice(terrain="gap", proportion=0.0),)},
            "the proportions of gap sum to 0; wanted more",
        ),
    ],
)
def test_what_no_map_can_be_made_from_is_refused(given, message):
    with pytest.raises(ConfigError, match=message):
        MapConfig(**given)


def test_the_same_terrain_may_stand_twice_under_two_names():
    wide = TerrainChoice(terrain="gap", name="wide_gap", parameters={"width": 1.0})
    assert MapConfig(terrains=(GAP, wide)).mix == (GAP, wide)
