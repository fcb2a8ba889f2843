import dataclasses
import math

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain
from terrainkit.errors import ConfigError
from terrainkit.terrain import presets

FLAT, GAP = SubTerrain(terrain="flat"), SubTerrain(terrain="gap")


def test_default_map_is_that_of_legged_gym():
    config = MapConfig()
    assert config.sub_terrains == presets.get_preset("legged_gym")
    # 10 x 8 m of patches and 2 x 25 m of border are 130 m, at 0.1 m.
    assert config.grid.shape == (1300, 1300)


def test_world_origin_is_corner_of_first_patch():
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


def test_patch_positions_do_not_drift():
    config = MapConfig(rows=11, patch_size=(8.2, 8.2))
    assert config.patch_grid(10, 0).lower[0] == pytest.approx(82.0)


def test_centered_map_has_origin_at_center():
    config = MapConfig(rows=3, cols=5, patch_size=(8.0, 4.0), border=1.0, centered=True)
    # 3 x 8 + 2 = 26 m along x, 5 x 4 + 2 = 22 m along y.
    assert config.grid.lower == pytest.approx((-13.0, -11.0))
    assert config.grid.center == pytest.approx((0.0, 0.0))
    assert config.patch_grid(1, 2).center == pytest.approx((0.0, 0.0))


def test_custom_terrains_replace_the_preset():
    config = MapConfig(preset="rough", terrains=(GAP, FLAT))
    assert config.sub_terrains == (GAP, FLAT)
    assert config.preset == ""


def test_wall_threshold_includes_rounding_tolerance():
    wall = MapConfig(slope_threshold=0.5, cell=0.2, border=0.0).wall_threshold
    assert wall == pytest.approx(0.10001, abs=1e-9)
    assert MapConfig(slope_threshold=None).wall_threshold == math.inf


def test_map_side_is_limited_to_a_million_cells():
    # 12 500 patches of 80 cells.
    assert MapConfig(rows=12_500, border=0.0).grid.shape[0] == 1_000_000
    with pytest.raises(ConfigError, match=r"along x: got .*; expected at most 1000000"):
        MapConfig(rows=12_501, border=0.0)


def test_numpy_scalars_are_accepted():
    config = MapConfig(rows=np.int64(3), border=np.float32(0.5), centered=np.True_)
    assert config == MapConfig(rows=3, border=0.5, centered=True)
    assert (type(config.rows), type(config.border)) == (int, float)


def test_integers_and_lists_are_converted():
    config = MapConfig(patch_size=[8, 4], border=1, terrains=[FLAT])
    assert config == MapConfig(patch_size=(8.0, 4.0), border=1.0, terrains=(FLAT,))
    assert isinstance(config.border, float)


def test_map_config_is_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        MapConfig().rows = 3


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"rows": 0}, "rows: got 0; expected an integer from 1 to 1000000"),
        ({"cols": -2}, "cols: got -2; expected an integer from 1 to 1000000"),
        ({"rows": 2.0}, r"rows: got 2\.0; expected an integer"),
        ({"cell": 0.0}, r"cell: got 0\.0; expected a number from 0\.0001 to"),
        ({"cell": math.nan}, r"cell: got nan; expected a number from 0\.0001 to"),
        (
            {"cell": 0.3},
            r"patch_size: got 8 m; expected a whole number of cells of 0\.3 m, such as 7\.8 m",
        ),
        ({"patch_size": (8.0, 0.0)}, r"patch_size: got \[8\.0, 0\.0\]; expected 2 values, each"),
        ({"patch_size": (8.0, math.inf)}, r"patch_size: got \[8\.0, inf\]; expected 2 values"),
        ({"patch_size": (8.0, 4.03)}, r"patch_size: got 4\.03 m; expected .* 4 m or 4\.1 m"),
        ({"patch_size": 8.0}, r"patch_size: got 8\.0; expected 2 values"),
        ({"border": -1.0}, r"border: got -1\.0; expected a number from 0 to"),
        (
            {"border": 0.25},
            r"border: got 0\.25 m; expected a whole number of cells .* 0\.2 m or 0\.3 m",
        ),
        ({"cols": 10**6}, r"map along y: got 8\.00005e\+07; expected at most 1000000"),
        pytest.param({"rows": 10**400}, "rows: got an integer beyond 64 bits", id="10**400"),
        pytest.param({"rows": 10**5000}, "rows: got an integer beyond 64 bits", id="10**5000"),
        ({"seed": -1}, "seed: got -1; expected an integer from 0 to"),
        ({"slope_threshold": 0.0}, r"slope_threshold: got 0\.0; .* from 0\.0001 to .*, or none"),
        ({"spawn_radius": 0.0}, r"spawn_radius: got 0\.0; expected a number from 0\.0001 to"),
        ({"spawn_tolerance": -0.1}, r"spawn_tolerance: got -0\.1; expected a number from 0 to"),
        ({"difficulty_range": (0.0, 1.1)}, r"difficulty_range: got .*each a number from 0 to 1"),
        (
            {"difficulty_range": (0.8, 0.2)},
            r"difficulty_range: got \[0\.8, 0\.2\]; expected .*, the lower one first",
        ),
        ({"difficulty_jitter": 1.5}, r"difficulty_jitter: got 1\.5; expected .* from 0 to 1"),
        ({"random_difficulties": ()}, r"random_difficulties: got \[\]; expected a non-empty list"),
        ({"random_difficulties": (0.5, 2.0)}, "random_difficulties: got .* from 0 to 1"),
        ({"selected_difficulty": -0.5}, r"selected_difficulty: got -0\.5; expected"),
        ({"static_friction": -1.0}, r"static_friction: got -1\.0; expected a number from 0"),
        ({"dynamic_friction": math.inf}, "dynamic_friction: got inf; expected a number from 0"),
        ({"restitution": 1.2}, r"restitution: got 1\.2; expected a number from 0 to 1"),
        (
            {"mode": "random"},
            "mode: got 'random'; expected one of: curriculum, selected, randomized, custom; "
            "did you mean 'randomized'",
        ),
        (
            {"preset": "moon"},
            "no preset 'moon'; there are: legged_gym, legged_gym_rough, isaaclab, mjlab, "
            "parkour_course, rough, stairs, hard, parkour, sparse, confined, natural, all",
        ),
        ({"preset": "stair"}, "no preset 'stair'; did you mean 'stairs'"),
        ({"terrains": (FLAT, "gap")}, r"terrains\[1\]: got 'gap'; expected a table \(SubTerrain\)"),
        ({"terrains": (GAP, GAP)}, "terrains: got 2 of name 'gap'; expected unique names"),
        ({"mode": "selected", "terrains": (GAP, FLAT)}, r"mode selected: got 2 .*\(gap, flat\)"),
        ({"mode": "selected"}, "mode selected: got 9 terrains .* expected one"),
        (
            {"terrains": (SubTerrain(terrain="gap", proportion=0.0),)},
            "proportions of gap: got a sum of 0; expected a sum above 0",
        ),
    ],
)
def test_map_config_rejects_invalid_values(given, message):
    with pytest.raises(ConfigError, match=message):
        MapConfig(**given)


def test_one_terrain_may_have_two_names():
    wide = SubTerrain(terrain="gap", name="wide_gap", parameters={"width": 1.0})
    assert MapConfig(terrains=(GAP, wide)).sub_terrains == (GAP, wide)
