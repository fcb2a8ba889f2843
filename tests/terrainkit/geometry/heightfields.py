"""Random heightfields, and the samples that tests build surfaces, boxes and meshes from."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh.node_grid import NodeGrid

_SMALL = arrays(
    np.float32,
    array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=6),
    elements=st.integers(0, 3),
)

HEIGHTFIELDS = _SMALL | _SMALL.map(lambda z: np.kron(z, np.ones((2, 3), dtype=np.float32)))
"""Steps of 1 m; half of them are wide, with level ground and straight walls."""

MASKS = arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=8), elements=st.booleans())


def for_any(**strategies):
    """Run a test with the same 60 examples each time."""
    return lambda test: settings(derandomize=True, max_examples=60)(given(**strategies)(test))


any_ground = for_any(heights=HEIGHTFIELDS, threshold=st.sampled_from([0.5, 1.5, np.inf]))


def samples(rows):
    return np.array(rows, dtype=np.float32)


def mesh_of(build, heights, threshold, cell=1.0):
    heights = samples(heights)
    return build(heights, Grid(shape=heights.shape, cell=cell), threshold)


def node_grid_of(heights, threshold, **grid):
    heights = samples(heights)
    grid = Grid(**{"shape": heights.shape, "cell": 1.0} | grid)
    return NodeGrid.from_heights(heights, grid, threshold)
