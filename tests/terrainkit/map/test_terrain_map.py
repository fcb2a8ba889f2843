import dataclasses
import re

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError, ExportError, TerrainkitWarning
from tests.tables import read_table
from tests.terrainkit.maps import plot

RAMP = plot(np.tile(0.05 * np.arange(20)[:, None], (1, 12)))
"""Ground of grade 0.5 along x, from 0 m at x = 0.05 m to 0.95 m at x = 1.95 m."""


def with_heights(terrain_map, value):
    heights = np.full_like(terrain_map.heights, np.float32(value))
    return dataclasses.replace(terrain_map, heights=heights)


def test_height_at_a_sample(terrain_map):
    assert terrain_map.first_sample == pytest.approx((-1.15, -1.15))
    x, y = (terrain_map.grid.axis(k) for k in (0, 1))
    xy = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    np.testing.assert_allclose(terrain_map.height(xy), terrain_map.heights, atol=1e-6)
    assert (terrain_map.height(xy.tolist()) == terrain_map.height(xy)).all()


@pytest.mark.parametrize("shape", [(), (5,), (3, 4), (0,)])
def test_views_of_the_surface_keep_the_shape(solid_map, shape):
    points = np.ones((*shape, 3))
    xy = points[..., :2]
    assert solid_map.height(xy).shape == solid_map.clearance(xy).shape == shape
    assert solid_map.scan(points).shape == shape
    assert solid_map.normal(xy).shape == (*shape, 3)
    assert solid_map.intervals(xy).shape == (*shape, 1, 2)


@pytest.mark.parametrize(
    ("view", "points", "message"),
    read_table(__file__, "views_of_the_surface_reject_invalid_points"),
)
def test_views_of_the_surface_reject_invalid_points(solid_map, view, points, message):
    with pytest.raises(ConfigError, match=message):
        getattr(solid_map, view)(points)
    with pytest.raises(ConfigError, match="direction: got 'left'; expected one of: down, up"):
        solid_map.scan([0.0, 0.0, 0.0], "left")


@pytest.mark.parametrize("far", [1e3, 1e300])
def test_beyond_the_map_the_edge_continues(far):
    heights = [float(RAMP.height((x, 0.5))) for x in (-far, 1.0, far)]
    assert heights == pytest.approx([0.0, 0.475, 0.95])
    normals = [RAMP.normal((x, 0.5)).tolist() for x in (-far, 1.0, far)]
    # Downhill, (-0.5, 0, 1) / sqrt(1.25)
    slope = pytest.approx([-0.447214, 0.0, 0.894427], abs=1e-5)
    assert normals == [[0.0, 0.0, 1.0], slope, [0.0, 0.0, 1.0]]


def test_scan_sees_visible_solids_and_clearance_solids_that_collide(solid_map):
    over = [[1, 6, 2], [5, 6, 2], [2, 6, 2]]  # the box, one that does not collide, a hidden one
    assert solid_map.scan(over) == pytest.approx([0.6, 0.6, 0.0])
    assert solid_map.scan([[1, 6, 0.2], [2, 6, 0.2]], "up") == pytest.approx(
        [0.4, np.nan], nan_ok=True
    )
    xy = np.array(over)[:, :2]
    assert solid_map.clearance(xy) == pytest.approx([0.4, np.inf, 0.0])
    assert solid_map.intervals(xy)[0] == pytest.approx(np.array([[0, 0.4], [0.6, np.inf]]))


def test_height_field_raw_has_the_format_of_isaac_gym(terrain_map):
    raw = terrain_map.height_field_raw(vertical_scale=0.001)
    assert (raw.dtype, raw.flags["C_CONTIGUOUS"]) == (np.int16, True)
    # Rows go along y and columns along x: 3 * 40 + 2 * 12, and 2 * 80 + 2 * 12.
    assert raw.shape == (144, 184)
    np.testing.assert_allclose(raw.T * 0.001, terrain_map.heights, atol=0.0005 + 1e-6)


@pytest.mark.parametrize(
    ("height", "units"),
    [(0.0124, 2), (0.0126, 3), (-0.0124, -2), (-0.0126, -3), (163.835, 32767), (-163.84, -32768)],
)
def test_height_field_raw_is_rounded_to_16_bits(height, units):
    assert np.unique(with_heights(RAMP, height).height_field_raw()).tolist() == [units]


@pytest.mark.parametrize("height", [163.84, -163.85, 1e6])
def test_height_field_raw_suggests_a_scale_that_is_sufficient(height):
    high = with_heights(RAMP, height)
    message = r"do not fit in int16 at vertical_scale 0\.005; expected at least (\S+)$"
    with pytest.raises(ExportError, match=message) as error:
        high.height_field_raw()
    wanted = float(re.search(message, str(error.value))[1])
    assert wanted == pytest.approx(1.01 * abs(height) / 32768, rel=0.01)
    assert high.height_field_raw(wanted)[0, 0] * wanted == pytest.approx(height, abs=wanted)


@pytest.mark.parametrize("scale", [0.0, -0.005, np.nan, np.inf])
def test_height_field_raw_rejects_invalid_scale(scale):
    with pytest.raises(ConfigError, match=f"vertical_scale: got {scale:g}; expected a number > 0"):
        RAMP.height_field_raw(scale)


def test_height_field_raw_rejects_solids(solid_map):
    with pytest.raises(ExportError, match="got a map with 4 solids, which a heightfield cannot"):
        solid_map.height_field_raw()


def test_map_patch_has_its_part_of_the_map(solid_map):
    empty, patch = (solid_map.patch(0, col) for col in (0, 1))
    assert (patch.terrain, patch.difficulty) == ("flat", 0.0)
    assert (patch.heights.shape, patch.friction.shape) == ((60, 40), (60, 40))
    assert patch.grid.lower == pytest.approx((0.0, 4.0))
    assert patch.grid.upper == pytest.approx((6.0, 8.0))
    assert (len(empty.solids), len(patch.solids)) == (0, 4)
    assert (empty.goals.shape, patch.goals.tolist()) == ((0, 4), solid_map.goals[0, 1].tolist())
    with pytest.raises(IndexError, match=r"no patch \(0, 2\) in a map of 1 rows and 2 columns"):
        solid_map.patch(0, 2)


def test_patch_names_follow_the_types(terrain_map):
    assert terrain_map.patch_names.tolist() == [["stairs", "obstacles", "rough_slope"]] * 2
    names = "stairs, obstacles, rough_slope"
    assert repr(terrain_map) == f"<TerrainMap 2 x 3 patches, (184, 144) samples: {names}>"


def test_assign_uses_level_and_column(terrain_map):
    start = terrain_map.assign(12, seed=4)
    assert start.columns.tolist() == start.terrain_types.tolist() == [0] * 4 + [1] * 4 + [2] * 4
    assert set(start.levels.tolist()) == {0, 1}
    assert start.env_origins.tolist() == [
        terrain_map.patch(level, column).origin.tolist()
        for level, column in zip(start.levels, start.columns, strict=True)
    ]
    assert terrain_map.assign(50, max_init_level=0).levels.tolist() == [0] * 50


def flat_map(**values):
    flat = SubTerrain(terrain="flat")
    return generate(MapConfig(rows=1, cols=3, border=0.0, terrains=(flat,), **values))


def test_assign_warns_of_shared_spawns():
    # On a patch of 6 m x 2 m, one disk of 0.8 m fits on each side of the origin.
    terrain_map = flat_map(patch_size=(6.0, 2.0), spawns_per_patch=100, spawn_radius=0.8)
    message = "3 of 12 environments share a spawn position with another; increase spawns_per_patch"
    with pytest.warns(TerrainkitWarning, match=message):
        start = terrain_map.assign(12)
    assert len(np.unique(start.env_origins, axis=0)) == 9
    # A single origin is always shared.
    assert len(np.unique(flat_map().assign(12).env_origins, axis=0)) == 3


def test_levels_and_columns_are_those_of_the_curriculum(terrain_map):
    levels, columns = np.array([0, 1, 1]), np.array([0, 1, 2])
    after = terrain_map.update_levels(levels, [1.0, 0.2, 0.7], seed=1, top_levels=1)
    assert after.tolist() == [1, 0, 1]
    for seed in range(5):
        other = terrain_map.resample_columns(levels, columns, seed=seed)
        assert other.tolist() == [0, 1, 2]  # each type has one column
