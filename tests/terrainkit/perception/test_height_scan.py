import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit.perception import HeightScan, exact_surface
from tests.tables import read_table


@pytest.mark.parametrize(
    ("yaw", "expected"),
    [
        (0.0, [0, 0, 0.5, 0.5]),  # x = 0.9 and 1.1, y = 1 and 0.8
        (np.pi, [0, 0, 0, 0]),  # x = 0.9 and 0.7
        (np.pi / 2, [0, 0.5, 0, 0.5]),  # the points to the right are beyond the step
    ],
)
def test_grid_turns_with_the_robot(step_map, yaw, expected):
    scan = HeightScan(step_map, x=(0.0, 0.2), y=(0.0, -0.2))
    position = [[0.9, 1.0, 0.6]]
    assert scan.below(position, [yaw])[0].tolist() == pytest.approx(expected)
    x, y, _ = scan.points(position, [yaw])
    ahead = np.cos(yaw) * 0.2, np.sin(yaw) * 0.2
    assert (x[0, 2], y[0, 2]) == pytest.approx((0.9 + ahead[0], 1.0 + ahead[1]))


@pytest.mark.parametrize(
    ("z", "below", "above"),
    [(0.39, 0.0, 0.4), (0.41, 0.6, np.inf), (0.61, 0.6, np.inf)],
)
def test_layers_of_a_box_from_40_to_60_cm(solid_map, z, below, above):
    scan = HeightScan(solid_map, x=(0.0, 1.0), y=(0.0,))  # an invisible cylinder is 1 m ahead
    assert scan.below([[1, 6, z]], [0]).tolist() == [pytest.approx([below, 0])]
    assert scan.above([[1, 6, z]], [0]).tolist() == [pytest.approx([above, np.inf])]


@pytest.mark.parametrize("name", ["terrain_map", "solid_map"])
def test_heights_are_exact(name, request):
    terrain_map = request.getfixturevalue(name)
    grid, rng = terrain_map.grid, np.random.default_rng(0)
    xy = rng.uniform(np.subtract(grid.lower, 0.2), np.add(grid.upper, 0.2), (20_000, 2))
    xy = xy.astype(np.float32)
    found = exact_surface(terrain_map).height(*xy.T, 9.0, scan=True)
    expected = terrain_map.scan(np.column_stack([xy, np.full(len(xy), 9.0)]))
    # Single precision decides on which side of an edge a point is.
    assert (np.abs(found - expected) > 1e-4).sum() <= 2


def test_tensors_give_tensors(step_map):
    scan, position, yaw = HeightScan(step_map), torch.tensor([[0.9, 1.0, 0.6]]), torch.zeros(1)
    found = scan.below(position, yaw)
    assert found.shape == (1, 187)
    assert torch.equal(found, torch.tensor(scan.below(position.numpy(), yaw.numpy())))


@pytest.mark.parametrize(("position", "yaw", "message"), read_table(__file__, "invalid_poses"))
def test_invalid_poses_are_rejected(step_map, position, yaw, message):
    with pytest.raises(ConfigError, match=message):
        HeightScan(step_map).below(position, yaw)
