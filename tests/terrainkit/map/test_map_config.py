import math
from dataclasses import replace

import pytest

from terrainkit import MapConfig, SubTerrain, generate, make_boxes
from terrainkit.errors import ConfigError, TerrainkitWarning
from terrainkit.terrain import presets
from tests.tables import read_table

FLAT, GAP = SubTerrain(terrain="flat"), SubTerrain(terrain="gap")


def test_default_map_has_the_layout_of_legged_gym():
    config = MapConfig()
    assert config.sub_terrains == presets.get_preset("legged_gym")
    # 10 x 8 m of patches and 2 x 25 m of border are 130 m, at 0.1 m.
    assert (config.grid.shape, config.grid.lower) == ((1300, 1300), (-25.0, -25.0))
    assert config.patch_start(0, 0) == (250, 250)
    assert config.patch_grid(0, 0).lower == (0.0, 0.0)


def test_rows_run_along_x_and_columns_along_y():
    config = MapConfig(rows=3, cols=4, patch_size=(8.0, 4.0), border=2.0)
    assert config.patch_start(2, 3) == (20 + 2 * 80, 20 + 3 * 40)
    assert config.patch_cells(2, 3) == (slice(180, 260), slice(140, 180))
    assert [edges.tolist() for edges in config.patch_edges] == [
        [20, 100, 180, 260],
        [20, 60, 100, 140, 180],
    ]
    patch = config.patch_grid(2, 3)
    assert patch.shape == config.patch_shape == (80, 40)
    assert patch.lower == pytest.approx((16.0, 12.0))


def test_patch_positions_do_not_drift():
    config = MapConfig(rows=11, patch_size=(8.2, 8.2))
    assert config.patch_grid(10, 0).lower[0] == pytest.approx(82.0)


def test_centered_map_has_origin_at_center():
    config = MapConfig(rows=3, cols=5, patch_size=(8.0, 4.0), border=1.0, centered=True)
    # 3 x 8 + 2 = 26 m along x, 5 x 4 + 2 = 22 m along y.
    assert config.grid.lower == pytest.approx((-13.0, -11.0))
    assert config.patch_grid(1, 2).center == pytest.approx((0.0, 0.0))


@pytest.mark.parametrize(("row", "col"), [(3, 0), (0, 5), (-1, 0), (0, -1)])
def test_check_patch_rejects_unknown_index(row, col):
    config = MapConfig(rows=3, cols=5)
    config.check_patch(0, 0)
    config.check_patch(2, 4)
    message = rf"no patch \({row}, {col}\) in a map of 3 rows and 5 columns"
    with pytest.raises(IndexError, match=message):
        config.check_patch(row, col)


def test_custom_terrains_replace_the_preset():
    wide = SubTerrain(terrain="gap", name="wide_gap", parameters={"width": 1.0})
    config = MapConfig(preset="rough", terrains=(GAP, wide, FLAT))
    assert (config.sub_terrains, config.preset) == ((GAP, wide, FLAT), "")


def test_wall_threshold_includes_rounding_tolerance():
    wall = MapConfig(slope_threshold=0.5, cell=0.2, border=0.0).wall_threshold
    assert wall == pytest.approx(0.10001, abs=1e-9)
    assert MapConfig(slope_threshold=None).wall_threshold == math.inf


def test_preset_stairs_has_a_threshold_of_its_own():
    """Its lowest steps, of 0.05 m on cells of 0.1 m, are vertical: 0.5 is above 0.2."""
    config = MapConfig(preset="stairs", rows=1, cols=1, border=1.0)
    with pytest.warns(TerrainkitWarning, match="no column|cliffs"):
        terrain_map = generate(config)
    assert terrain_map.height([[1.999, 4.0], [2.001, 4.0]]) == pytest.approx([0.0, 0.05])
    assert MapConfig(preset="rough").slope_threshold == 0.75
    assert MapConfig.from_toml('preset = "stairs"').slope_threshold == 0.2
    assert MapConfig(preset="stairs", slope_threshold=0.75).slope_threshold == 0.75
    assert replace(MapConfig(), preset="stairs").slope_threshold == 0.2


def test_repr_has_what_is_not_the_default_and_shapes():
    assert repr(MapConfig(preset="rough", rows=2)) == "MapConfig(rows=2, preset='rough')"
    boxes = make_boxes([[0.0, 0.0, 0.5]], size=(1.0, 1.0, 1.0))
    assert repr(boxes).startswith("Solids(boxes: (1, 10), cylinders: (0, 10)")


def test_map_side_is_limited_to_a_million_cells():
    # 12 500 patches of 80 cells.
    assert MapConfig(rows=12_500, border=0.0).grid.shape[0] == 1_000_000
    with pytest.raises(ConfigError, match=r"along x: got 1000080; expected at most 1000000"):
        MapConfig(rows=12_501, border=0.0)
    with pytest.raises(ConfigError, match=r"map along y: got 8\.00005e\+07"):
        MapConfig(cols=10**6)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        *read_table(__file__, "map_config_rejects_invalid_values"),
        ("terrains", (FLAT, "gap"), r"\[1\]: got 'gap'; expected a table \(SubTerrain\)"),
        ("terrains", (GAP, FLAT, GAP), "got 2 of name 'gap'; expected unique names"),
    ],
)
def test_map_config_rejects_invalid_values(name, value, message):
    with pytest.raises(ConfigError, match=f"^{name}.*{message}"):
        MapConfig(**{name: value})


def test_map_config_suggests_what_is_near():
    message = r"patch_size: got 8 m; expected a whole number of cells of 0\.3 m, such as 7\.8 m"
    with pytest.raises(ConfigError, match=message):
        MapConfig(cell=0.3)
    with pytest.raises(ConfigError, match="no preset 'stair'; did you mean 'stairs'"):
        MapConfig(preset="stair")


def test_map_config_rejects_terrains_that_do_not_fit_the_mode():
    with pytest.raises(ConfigError, match=r"mode selected: got 2 terrains \(gap, flat\); expected"):
        MapConfig(mode="selected", terrains=(GAP, FLAT))
    with pytest.raises(ConfigError, match=r"mode selected: got 9 terrains .* expected one"):
        MapConfig(mode="selected")
    none = SubTerrain(terrain="gap", proportion=0.0)
    with pytest.raises(ConfigError, match="proportions of gap: got a sum of 0; expected a sum"):
        MapConfig(terrains=(none,))
    assert MapConfig(mode="selected", terrains=(GAP,)).sub_terrains == (GAP,)
