import dataclasses
import importlib.util
import sys

import mujoco
import numpy as np
import pytest
import torch

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.geometry.solids import make_cylinders
from terrainkit.integrations.mujoco import make_spec
from terrainkit.perception import RayCaster, depth_directions, lidar_directions
from tests.tables import read_table
from tests.terrainkit.test_every_view import mesh_model


@pytest.fixture(autouse=True, params=["embree", "numpy"])
def engine(request, monkeypatch):
    if request.param == "numpy":
        monkeypatch.setitem(sys.modules, "embreex", None)
    elif importlib.util.find_spec("embreex") is None:
        pytest.skip("embreex has no wheel here")


@pytest.mark.parametrize(
    ("origin", "direction", "distance"), read_table(__file__, "distance_to_a_step")
)
def test_distance_to_a_step(step_map, origin, direction, distance):
    found = RayCaster(step_map).cast([origin], [direction])
    assert found.tolist() == [pytest.approx(distance, abs=1e-5)]


def cast(model, origins, directions):
    data, normal, geom = mujoco.MjData(model), np.zeros(3), np.zeros(1, np.int32)
    mujoco.mj_forward(model, data)
    seen = np.array([1, 1, 1, 0, 1, 1], np.uint8)
    pairs = zip(origins, directions, strict=True)
    found = [mujoco.mj_ray(model, data, *pair, seen, 1, -1, geom, normal) for pair in pairs]
    return np.where(np.array(found) < 0, np.inf, found)


@pytest.mark.parametrize("name", ["terrain_map", "level_map", "solid_map"])
def test_distances_are_those_of_mujoco(name, request):
    terrain_map = request.getfixturevalue(name)
    boxes = name == "solid_map"  # its mesh has no solids that do not collide
    spec = make_spec(terrain_map, collision="boxes").compile() if boxes else None
    model = spec or mesh_model(terrain_map.mesh())
    rng, grid = np.random.default_rng(0), terrain_map.grid
    xy = rng.uniform(np.add(grid.lower, 0.3), np.subtract(grid.upper, 0.3), (1500, 2))
    origins = np.column_stack([xy, terrain_map.height(xy) + rng.uniform(0.05, 0.9, len(xy))])
    directions = rng.standard_normal((len(xy), 3)) * [1, 1, 0.3]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    expected = cast(model, origins, directions)
    expected[expected > 10] = np.inf
    rays = RayCaster(terrain_map)
    # Rounding decides whether a ray passes an edge, and rays that graze the ground multiply it.
    moved = [
        rays.cast(origins + 1e-4 * np.array(offset), directions)
        for offset in np.stack(np.meshgrid(*[(-1, 0, 1)] * 3), -1).reshape(-1, 3)
    ]
    assert (np.min(moved, axis=0) - 1e-3 <= expected).all()
    assert (np.max(moved, axis=0) + 1e-3 >= expected).all()
    assert (np.isclose(moved[13], expected, 0, 1e-3)).mean() > 0.995
    assert np.isfinite(expected).mean() > 0.3


def test_ray_that_starts_in_a_solid_meets_its_far_side(solid_map):
    found = RayCaster(solid_map).cast([[5.2, 6.2, 0.5]] * 2, [[0, 0, 1], [0, 1, 0]])
    assert found.tolist() == pytest.approx([0.1, 0.3])


def test_round_side_of_a_cylinder_is_exact(solid_map):
    pole = make_cylinders((2, 2, 0.5), 0.2, 1.0)
    rays = RayCaster(solid_map.edited(solids=pole))
    y = np.array([0.0, 0.1, 0.12, 0.19])
    origins = np.column_stack([np.ones(4), 2 + y, np.full(4, 0.5)])
    expected = 1 - np.sqrt(0.2**2 - y**2)
    assert rays.cast(origins, [[1, 0, 0]] * 4).tolist() == pytest.approx(expected, abs=1e-6)


@pytest.fixture(scope="module")
def long_slope():
    """Return ground that rises by 1/8 along x, 1,600 m long; its heights are exact."""
    flat = SubTerrain(terrain="flat")
    config = MapConfig(rows=1, cols=1, patch_size=(1600, 8), cell=0.5, border=0, terrains=(flat,))
    heights = np.arange(3200, dtype=np.float32)[:, None] / 16 + np.zeros((3200, 16), np.float32)
    return dataclasses.replace(generate(config), heights=heights)


def test_rays_far_from_the_origin_are_exact(long_slope):
    x = np.array([20.0, 800.3, 1580.3])  # the first sample is at 0.25 m
    origins = np.column_stack([x, np.full(3, 4.1), (x - 0.25) / 8 + 0.5])
    found = RayCaster(long_slope).cast(origins, [[1, 0, 0], [1, 0, 0], [0, 0, -1]])
    assert found.tolist() == pytest.approx([4.0, 4.0, 0.5], abs=1e-6)


@pytest.mark.parametrize("name", ["terrain_map", "level_map", "step_map"])
def test_no_ray_passes_between_triangles(name, request):
    terrain_map = request.getfixturevalue(name)
    grid = terrain_map.grid
    # All samples, and all points between them, where walls are.
    x, y = (grid.lower[k] + np.arange(1, 2 * grid.shape[k]) * grid.cell / 2 for k in (0, 1))
    xy = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    top = terrain_map.heights.max() + 1.0
    origins = np.column_stack([xy, np.full(len(xy), top)])
    found = top - RayCaster(terrain_map).cast(origins, np.tile([0.0, 0.0, -1.0], (len(xy), 1)))
    beside = [
        terrain_map.height(xy + 1e-3 * np.array(offset))
        for offset in ((-1, -1), (-1, 1), (1, -1), (1, 1))
    ]
    assert (found >= np.min(beside, axis=0) - 0.01).all()
    assert (found <= np.max(beside, axis=0) + 0.01).all()


def test_sensors_turn_with_their_quaternion(step_map):
    half = np.sqrt(0.5)
    quat = torch.tensor([[1.0, 0, 0, 0], [half, 0, half, 0], [half, 0, 0, half]])
    position = torch.tensor([[0.45, 1.0, 0.25]]).expand(3, 3)
    found = RayCaster(step_map).sense(position, quat, [[[1.0, 0, 0]]], max_distance=0.6)
    assert isinstance(found, torch.Tensor)
    assert found.shape == (3, 1, 1)
    assert found.flatten().tolist() == pytest.approx([0.55, 0.25, np.inf])  # ahead, down, left


def test_directions_of_sensors():
    image = depth_directions(4, 2, fov=np.pi / 2)  # the edges are at y = 1 and -1
    assert image.shape == (2, 4, 3)
    assert (image[0, 0] / image[0, 0, 0]).tolist() == pytest.approx([1, 0.75, 0.25])
    assert (image[1, 3] / image[1, 3, 0]).tolist() == pytest.approx([1, -0.75, -0.25])
    ring = lidar_directions([0.0, np.pi / 6], 4)
    assert ring[1, 1].tolist() == pytest.approx([0, 3**0.5 / 2, 0.5])


def test_invalid_rays_are_rejected(step_map):
    rays = RayCaster(step_map)
    with pytest.raises(ConfigError, match="got a length of 0"):
        rays.cast([[0, 0, 0]], [[0, 0, 0]])
    with pytest.raises(ConfigError, match="max_distance: got 0"):
        rays.cast([[0, 0, 0]], [[0, 0, 1]], 0)
    with pytest.raises(ConfigError, match=r"fov: got 4\.0; expected a number, 0\.001 to 3\.14"):
        depth_directions(4, 2, fov=4.0)
    with pytest.raises(ConfigError, match=r"width: got 4\.5; expected a whole number"):
        depth_directions(4.5, 2)
    with pytest.raises(ConfigError, match="num_azimuths: got 0; expected a whole number"):
        lidar_directions([0.0], 0)


def test_rays_of_any_length_and_number(step_map):
    rays = RayCaster(step_map)
    lengths = np.array([[0, 0, -1e-300], [0, 0, -1.0], [0, 0, -1e300]])
    assert len(set(rays.cast([[1, 1, 2]] * 3, lengths).tolist())) == 1
    assert rays.sense([[1, 1, 2]], [[1, 0, 0, 0]], np.zeros((0, 3))).shape == (1, 0)
