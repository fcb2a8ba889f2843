from dataclasses import replace

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, make_patch
from terrainkit.feasibility.columns import MAX_SPACING, sample_columns
from tests.limits import columns_of


def columns_of_patch(terrain, **parameters):
    config = MapConfig(
        terrains=(SubTerrain(terrain=terrain, parameters=parameters),), rows=1, cols=1
    )
    patch = make_patch(config, 0, 0)
    return patch, sample_columns(patch, config.wall_threshold)


def test_patch_without_solids_has_its_samples():
    patch, columns = columns_of_patch("rough")
    assert columns.floor[..., 0].tolist() == patch.heights.astype(float).tolist()
    assert np.isinf(columns.ceiling).all()
    node = np.array([0, 81])
    assert columns.positions(node)[:, :2] == pytest.approx(np.array([[0.05, 0.05], [0.15, 0.15]]))


def test_patch_with_solids_has_ground_and_roof():
    _, columns = columns_of_patch("ceiling", clearance=0.45)
    assert columns.spacing <= MAX_SPACING
    assert columns.shape == (240, 240)
    i, j = np.argwhere(np.isfinite(columns.ceiling[..., 0]))[5000]
    low, high = columns.floor[i, j]
    assert low == 0.0
    assert columns.ceiling[i, j, 0] == pytest.approx(0.45)
    assert high > 0.45
    x, y = np.array(columns.lower) + np.array([i, j]) * columns.spacing
    for z in (low, high):
        node = np.array([columns.node_at(np.array([x, y, z]))])
        assert columns.positions(node)[0] == pytest.approx([x, y, z])


@pytest.mark.parametrize(
    ("x", "y", "node"), [(0, 0, 0), (-0.3, -0.3, 0), (0.5, 0.6, 11), (0.5, -0.3, 8), (0.1, 0.2, 6)]
)
def test_node_at_a_place_is_the_nearest_one_of_the_patch(x, y, node):
    columns = columns_of(np.zeros((3, 4)))
    assert columns.node_at(np.array([x, y, 0.0])) == node
    assert columns.column(np.array([node])) == ([node // 4], [node % 4])


def test_node_at_a_height_is_the_floor_of_this_height():
    floor = np.zeros((3, 3, 2))
    floor[..., 1] = np.nan
    floor[1, 1, 1] = 0.5
    columns = replace(columns_of(floor), lower=(1.0, 2.0))
    assert columns.node_at(np.array([1.1, 2.1, 0.2])) == 8
    assert columns.node_at(np.array([1.1, 2.1, 0.3])) == 9
    assert columns.positions(np.array([9])).tolist() == [[1.1, 2.1, 0.5]]
