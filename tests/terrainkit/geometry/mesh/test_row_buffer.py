import numpy as np
import pytest

from terrainkit.geometry.mesh.row_buffer import RowBuffer


@pytest.mark.parametrize("lengths", [(), (0,), (1, 0, 2), (5, 3000, 1, 70_000)])
def test_row_buffer_has_all_rows(lengths):
    parts = [np.random.default_rng(n).integers(0, 9, (n, 3)) for n in lengths]
    buffer = RowBuffer(np.int32)
    for part in parts:
        buffer.append(part - len(buffer), offset=len(buffer))
    array = buffer.array()
    assert (array.dtype, array.shape) == (np.int32, (sum(lengths), 3))
    np.testing.assert_array_equal(array, np.concatenate([np.empty((0, 3)), *parts]))
