"""Every view of a map is the same surface: scan, intervals, clearance, mesh and MuJoCo model."""

import mujoco
import numpy as np
import pytest

from terrainkit import MapConfig, TerrainMap, generate
from terrainkit.geometry.free_space import CONTACT
from terrainkit.terrain import presets
from tests.rays import cast_rays

POINTS = 1000
TOLERANCE = 1e-3

every_terrain = pytest.mark.parametrize(
    "sub_terrain", presets.get_preset("all"), ids=lambda sub_terrain: sub_terrain.name
)
every_grid = pytest.mark.parametrize(
    ("patch_size", "cell"), [((8.0, 8.0), 0.1), ((8.0, 4.0), 0.05)], ids=["8x8", "8x4 fine"]
)
coarse = pytest.mark.filterwarnings("ignore::terrainkit.TerrainkitWarning")


def sample_points(terrain_map):
    """Return random points on the map, half of them where the solids are, shape (n, 2)."""
    rng = np.random.default_rng(0)
    margin = terrain_map.grid.cell
    lower, upper = (np.array(c) for c in (terrain_map.grid.lower, terrain_map.grid.upper))
    xy = rng.uniform(lower + margin, upper - margin, (POINTS, 2))
    if len(terrain_map.solids):
        low, high = terrain_map.solids.bounds()
        solid = rng.integers(len(low), size=POINTS // 2)
        xy[: POINTS // 2] = rng.uniform(low[solid, :2], high[solid, :2])
    return xy[~is_near_edge(terrain_map, xy)]


def is_near_edge(terrain_map, xy):
    """Return whether a surface ends or is steep within 2 mm of each point: rounding decides."""
    offsets = 0.002 * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, -1]])
    around = np.nan_to_num(terrain_map.intervals(xy[:, None] + offsets), posinf=1e3, nan=-1e3)
    return (np.abs(around - around[:, :1]) > 0.02).any(axis=(1, 2, 3))


def is_near_wall(terrain_map, xy):
    """Return whether the ground between the four samples around each point has a wall."""
    index = ((xy - terrain_map.first_sample) / terrain_map.grid.cell).astype(int)
    i, j = index.T
    corners = [terrain_map.heights[i + di, j + dj] for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1))]
    steps = np.abs(np.diff([*corners, corners[0]], axis=0))
    return (steps > terrain_map.config.wall_threshold).any(axis=0)


def mesh_model(mesh):
    """Return a MuJoCo model of the triangles, which do not collide but are hit by rays."""
    spec = mujoco.MjSpec()
    spec.add_mesh(
        name="map",
        uservert=mesh.vertices.ravel(),
        userface=mesh.triangles.ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    geom = mujoco.mjtGeom.mjGEOM_MESH
    spec.worldbody.add_geom(type=geom, meshname="map", contype=0, conaffinity=0)
    return spec.compile()


def assert_close(found, expected):
    assert np.array_equal(np.isnan(found), np.isnan(expected))
    assert np.nanmax(np.abs(found - expected), initial=0.0) < TOLERANCE


@coarse
@every_grid
@every_terrain
def test_every_view_is_the_same_surface(sub_terrain, patch_size, cell, tmp_path):
    config = MapConfig(
        rows=3, cols=1, patch_size=patch_size, cell=cell, border=1.0, terrains=(sub_terrain,)
    )
    terrain_map = TerrainMap.load(generate(config).save(tmp_path / "map.npz"))
    xy = sample_points(terrain_map)
    assert len(xy) > POINTS / 2

    intervals, ground = terrain_map.intervals(xy), terrain_map.height(xy)
    is_bare = intervals[:, 0, 0] - ground < CONTACT
    free = np.where(is_bare, intervals[:, 0, 1] - ground, 0.0)
    np.testing.assert_allclose(
        terrain_map.clearance(xy, step_height=0.0), free, rtol=0, atol=TOLERANCE
    )

    # Start in any of the free intervals of a point, 1 m above the floor under the open sky.
    number = (~np.isnan(intervals[..., 0])).sum(axis=1)
    chosen = np.random.default_rng(1).integers(number)
    floor, ceiling = np.moveaxis(intervals[np.arange(len(xy)), chosen], -1, 0)
    is_open = np.isinf(ceiling)
    starts = np.column_stack([xy, np.where(is_open, floor + 1.0, (floor + ceiling) / 2)])
    expected = {"down": floor, "up": np.where(is_open, np.nan, ceiling)}
    mesh = mesh_model(terrain_map.mesh())
    path = terrain_map.save(tmp_path / "map.xml", collision="boxes")
    model = mujoco.MjModel.from_xml_path(str(path))
    # A heightfield of MuJoCo has slopes in the place of walls.
    exact = ~is_near_wall(terrain_map, xy) | terrain_map.boxes().box_mask.all()
    for direction, sign in (("down", -1), ("up", 1)):
        assert_close(terrain_map.scan(starts, direction), expected[direction])
        assert_close(cast_rays(mesh, starts, sign)[0], expected[direction])
        assert_close(cast_rays(model, starts[exact], sign)[0], expected[direction][exact])
