import dataclasses
import re

import numpy as np
import pytest

import terrainkit
from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError, ExportError, TerrainkitWarning


@pytest.fixture(scope="module")
def slope_map():
    # Flat to x = 1, up at grade 0.5 to x = 3, down to x = 5, and flat again.
    slope = SubTerrain(terrain="slope", parameters={"grade": 0.5, "landing": 1.0})
    return generate(
        MapConfig(
            rows=1,
            cols=1,
            patch_size=(6.0, 3.0),
            border=0.0,
            terrains=(slope,),
            spawn_radius=0.2,
        )
    )


def with_heights(terrain_map, value):
    return dataclasses.replace(
        terrain_map, heights=np.full_like(terrain_map.heights, np.float32(value))
    )


def test_height_at_a_sample(terrain_map):
    x, y = (terrain_map.grid.axis(k) for k in (0, 1))
    xy = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    np.testing.assert_allclose(terrain_map.height(xy), terrain_map.heights, atol=1e-6)


def test_height_follows_the_axis_convention(terrain_map):
    # Border 1.2 m and cell 0.1 m: cell (30, 45) is centered at x = -1.2 + 3.05, y = -1.2 + 4.55.
    terrain_map = with_heights(terrain_map, 0.0)
    terrain_map.heights[30, 45] = 2.0
    assert terrain_map.height((1.85, 3.35)) == 2.0
    assert terrain_map.height((3.35, 1.85)) == 0.0


def test_first_sample_is_half_a_cell_inside(terrain_map):
    assert terrain_map.first_sample == pytest.approx((-1.15, -1.15))


@pytest.mark.parametrize("shape", [(2,), (5, 2), (3, 4, 2), (0, 2)])
def test_height_and_normal_keep_the_shape(terrain_map, shape):
    assert terrain_map.height(np.ones(shape)).shape == shape[:-1]
    assert terrain_map.normal(np.ones(shape)).shape == (*shape[:-1], 3)


def test_height_accepts_lists(terrain_map):
    points = [[1.0, 2.0], [9.0, 3.0]]
    assert terrain_map.height(points).tolist() == terrain_map.height(np.array(points)).tolist()


@pytest.mark.parametrize("view", ["height", "normal"])
@pytest.mark.parametrize(
    ("xy", "shape"),
    [
        (1.0, r"\(\)"),
        ([1.0, 2.0, 3.0], r"\(3,\)"),
        (np.zeros((2, 5)), r"\(2, 5\)"),
        ([], r"\(0,\)"),
        ([np.nan, 0.0], r"\(2,\)"),
        ([[0.0, np.inf]], r"\(1, 2\)"),
    ],
)
def test_height_rejects_invalid_points(terrain_map, view, xy, shape):
    with pytest.raises(
        ConfigError, match=rf"xy: got shape {shape}; expected finite values of shape \(\.\.\., 2\)"
    ):
        getattr(terrain_map, view)(xy)


@pytest.mark.parametrize("far", [1e3, 1e300])
def test_height_beyond_the_map_is_that_of_the_edge(slope_map, far):
    top = dataclasses.replace(slope_map, heights=slope_map.heights[:30])
    assert top.height((far, 1.0)) == slope_map.heights.max() > 0.9
    assert top.height((-far, 1.0)) == 0.0


def test_normal_of_level_ground_is_up(slope_map):
    assert slope_map.normal((0.3, 1.0)).tolist() == [0.0, 0.0, 1.0]


def test_normal_of_a_slope_is_downhill(slope_map):
    # Grade 0.5 along x: (-0.5, 0, 1) / sqrt(1.25)
    np.testing.assert_allclose(
        slope_map.normal((2.0, 1.0)), np.array([-0.5, 0, 1]) / np.sqrt(1.25), atol=1e-5
    )


def test_normal_beyond_the_map_has_no_cross_slope(slope_map):
    # Nothing but slope: its first row of samples is where the map ends.
    heights = np.roll(slope_map.heights, -20, axis=0)
    cut_short = dataclasses.replace(slope_map, heights=heights)
    assert cut_short.normal((0.5, 1.0))[0] < 0
    assert cut_short.normal((-5.0, 1.0)).tolist() == [0.0, 0.0, 1.0]


def test_normal_is_upward_unit_vector(terrain_map):
    rng = np.random.default_rng(0)
    xy = rng.uniform(terrain_map.grid.lower, terrain_map.grid.upper, size=(500, 2))
    normal = terrain_map.normal(xy)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0)
    assert (normal[:, 2] > 0).all()
    for k, step in enumerate(np.eye(2) * 1e-7):
        rise = terrain_map.height(xy + step) - terrain_map.height(xy - step)
        np.testing.assert_allclose(rise / 2e-7, -normal[:, k] / normal[:, 2], atol=1e-5)


def test_height_field_raw_matches_isaac_gym(terrain_map):
    raw = terrain_map.height_field_raw(vertical_scale=0.001)
    rows, columns = raw.shape  # nbRows, nbColumns
    # add_heightfield reads a flat buffer row by row; rows go along y and columns along x.
    index = np.arange(rows * columns)
    place = np.column_stack([index % columns, index // columns]) * terrain_map.config.cell
    xy = place + terrain_map.first_sample
    z = raw.ravel() * 0.001
    np.testing.assert_allclose(z, terrain_map.height(xy), atol=0.0005 + 1e-6)


def test_height_field_raw_is_int16_by_row(terrain_map):
    raw = terrain_map.height_field_raw()
    assert raw.dtype == np.int16
    assert raw.flags["C_CONTIGUOUS"]
    assert raw.shape == (144, 184)  # 3 * 40 + 2 * 12 along y, 2 * 80 + 2 * 12 along x


@pytest.mark.parametrize(
    ("height", "units"), [(0.0124, 2), (0.0126, 3), (-0.0124, -2), (-0.0126, -3), (0.3, 60)]
)
def test_height_field_raw_is_rounded(terrain_map, height, units):
    raw = with_heights(terrain_map, height).height_field_raw(vertical_scale=0.005)
    assert np.unique(raw).tolist() == [units]


@pytest.mark.parametrize(("height", "units"), [(163.835, 32767), (-163.84, -32768)])
def test_height_field_raw_uses_16_bits(terrain_map, height, units):
    assert with_heights(terrain_map, height).height_field_raw()[0, 0] == units


@pytest.mark.parametrize("height", [163.84, -163.85, 1e6])
def test_height_field_raw_rejects_overflow(terrain_map, height):
    with pytest.raises(
        ExportError, match=r"do not fit in int16 at vertical_scale 0\.005; expected at least .*"
    ):
        with_heights(terrain_map, height).height_field_raw()


@pytest.mark.parametrize("height", [10.0, -10.0, 163.84, 1e6])
def test_height_field_raw_suggested_scale_is_sufficient(terrain_map, height):
    high = with_heights(terrain_map, height)
    with pytest.raises(ExportError) as error:
        high.height_field_raw(vertical_scale=1e-5)
    wanted = float(re.search(r"expected at least (\S+)$", str(error.value)).group(1))
    assert high.height_field_raw(wanted)[0, 0] * wanted == pytest.approx(height, abs=wanted)


@pytest.mark.parametrize("scale", [0.0, -0.005, np.nan, np.inf])
def test_height_field_raw_rejects_invalid_scale(terrain_map, scale):
    with pytest.raises(ConfigError, match=f"vertical_scale: got {scale:g}; expected a number > 0"):
        terrain_map.height_field_raw(scale)


@pytest.mark.parametrize(("row", "col"), [(0, 0), (1, 0), (0, 1), (1, 2)])
def test_map_patch_equals_make_patch(terrain_map, row, col):
    part, alone = terrain_map.patch(row, col), terrainkit.make_patch(terrain_map.config, row, col)
    assert part.heights.tobytes() == alone.heights.tobytes()
    assert part.origin.tobytes() == alone.origin.tobytes()
    assert (part.terrain, part.difficulty) == (alone.terrain, alone.difficulty)
    assert part.parameters == alone.parameters
    assert part.grid == alone.grid


def test_map_patch_has_name_and_position(terrain_map):
    patch = terrain_map.patch(1, 2)
    assert patch.terrain == "rough_slope"
    assert patch.difficulty == 1.0
    assert patch.heights.shape == (80, 40)
    assert patch.grid.lower == pytest.approx((8.0, 8.0))
    assert patch.grid.upper == pytest.approx((16.0, 12.0))


@pytest.mark.parametrize(("row", "col"), [(2, 0), (0, 3), (-1, 0), (0, -1)])
def test_map_patch_rejects_unknown_index(terrain_map, row, col):
    with pytest.raises(
        IndexError, match=rf"no patch \({row}, {col}\) in a map of 2 rows and 3 columns"
    ):
        terrain_map.patch(row, col)


def test_assign_uses_level_and_column(terrain_map):
    start = terrain_map.assign(12, seed=4)
    assert start.columns.tolist() == [0] * 4 + [1] * 4 + [2] * 4
    assert set(start.levels.tolist()) == {0, 1}
    assert start.terrain_types.tolist() == start.columns.tolist()
    for origin, level, column in zip(start.env_origins, start.levels, start.columns, strict=True):
        assert origin.tolist() == terrain_map.patch(level, column).origin.tolist()


def test_assign_respects_max_init_level(terrain_map):
    assert terrain_map.assign(50, max_init_level=0).levels.tolist() == [0] * 50


def flat_map(**values):
    flat = SubTerrain(terrain="flat")
    return generate(MapConfig(rows=1, cols=3, border=0.0, terrains=(flat,), **values))


def test_assign_spreads_environments_over_spawns():
    start = flat_map(spawns_per_patch=16).assign(48)
    x, y, _ = start.env_origins.T
    distance = np.hypot(x[:, None] - x, y[:, None] - y)[np.triu_indices(48, 1)]
    assert distance.min() >= 1.0 - 1e-5
    assert start.headings.tolist() == [0.0] * 48


def test_assign_warns_of_shared_spawns():
    # On a patch of 6 m x 2 m, one disk of 0.8 m fits on each side of the origin.
    terrain_map = flat_map(patch_size=(6.0, 2.0), spawns_per_patch=100, spawn_radius=0.8)
    message = "3 of 12 environments share a spawn position with another; increase spawns_per_patch"
    with pytest.warns(TerrainkitWarning, match=message):
        start = terrain_map.assign(12)
    assert len(np.unique(start.env_origins, axis=0)) == 9


def test_assign_shares_single_origins_without_warning():
    assert len(np.unique(flat_map().assign(12).env_origins, axis=0)) == 3


@pytest.fixture(scope="module")
def bank():
    """Four variants of each level of two terrains."""
    terrains = tuple(SubTerrain(terrain=name) for name in ("rough", "obstacles"))
    return generate(MapConfig(rows=3, cols=8, border=0.0, terrains=terrains))


def test_bank_has_variants_of_each_type_and_level(bank):
    for level in range(1, 3):
        for columns in (range(4), range(4, 8)):
            variants = [bank.patch(level, column) for column in columns]
            assert len({(each.terrain, each.difficulty) for each in variants}) == 1
            assert len({each.heights.tobytes() for each in variants}) == 4


def test_resample_columns_changes_terrain_at_each_reset(bank):
    start = bank.assign(200, max_init_level=2)
    columns, visited = start.columns, [start.columns]
    for reset in range(60):
        columns = bank.resample_columns(start.levels, columns, seed=(0, reset))
        assert (bank.terrain_types[start.levels, columns] == start.terrain_types).all()
        visited.append(columns)
    assert all(len(set(each)) == 4 for each in np.transpose(visited).tolist())
    again = bank.resample_columns(start.levels, visited[-2], seed=(0, 59))
    assert again.tolist() == visited[-1].tolist()


def test_env_origins_are_on_the_ground(terrain_map):
    x, y, z = np.moveaxis(terrain_map.env_origins.astype(float), -1, 0)
    np.testing.assert_allclose(terrain_map.height(np.stack([x, y], axis=-1)), z, atol=1e-3)


def test_save_and_load_round_trip(terrain_map, tmp_path):
    path = terrain_map.save(tmp_path / "map.npz")
    assert type(terrain_map).load(path).heights.tobytes() == terrain_map.heights.tobytes()


def test_map_update_levels_equals_function(terrain_map):
    after = terrain_map.update_levels([0, 1, 1], [1.0, 0.2, 0.7], seed=1)
    assert after.tolist() == [1, 0, 1]


def test_repr_is_one_line(terrain_map):
    assert repr(terrain_map).startswith("<TerrainMap 2 x 3 patches, (")
    assert "\n" not in repr(terrain_map)


def test_scan_sees_visible_solids_and_clearance_those_that_collide(solid_map):
    over = [[1, 6, 2], [5, 6, 2], [2, 6, 2]]  # the box, one that does not collide, a hidden one
    assert solid_map.scan(over) == pytest.approx([0.6, 0.6, 0.0])
    xy = np.array(over)[:, :2]
    assert solid_map.clearance(xy) == pytest.approx([0.4, np.inf, 0.0])
    assert solid_map.intervals(xy)[0] == pytest.approx(np.array([[0, 0.4], [0.6, np.inf]]))


@pytest.mark.parametrize("shape", [(3,), (2, 3), (2, 5, 3), (0, 3)])
def test_scan_keeps_the_shape(solid_map, shape):
    points = np.ones(shape)
    assert solid_map.scan(points).shape == shape[:-1]
    assert solid_map.clearance(points[..., :2]).shape == shape[:-1]
    assert solid_map.intervals(points[..., :2]).shape == (*shape[:-1], 1, 2)


@pytest.mark.parametrize(
    ("points", "direction", "message"),
    [
        ([0.0, 0.0], "down", "points: got shape"),
        ([0.0, 0.0, np.nan], "down", "points: got"),
        ([0.0, 0.0, 0.0], "left", "direction: got 'left'; expected one of: down, up"),
    ],
)
def test_scan_rejects_invalid_input(solid_map, points, direction, message):
    with pytest.raises(ConfigError, match=message):
        solid_map.scan(points, direction)


def test_heightfield_formats_reject_solids(solid_map, tmp_path):
    with pytest.raises(ExportError, match="got a map with 4 solids, which a heightfield cannot"):
        solid_map.height_field_raw()
    with pytest.raises(ExportError, match="4 solids, which an image of heights cannot represent"):
        solid_map.save(tmp_path / "map.png")
    assert list(tmp_path.iterdir()) == []
