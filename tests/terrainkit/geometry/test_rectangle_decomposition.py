import numpy as np
import pytest

from terrainkit.geometry.rectangle_decomposition import _maximal_rectangles, decompose_rectangles
from tests.tables import read_table
from tests.terrainkit.geometry.heightfields import MASKS, for_any


def mask(text):
    return np.array([[cell == "#" for cell in row] for row in text.split()])


def cells(spans, shape):
    count = np.zeros(shape, dtype=int)
    for i0, i1, j0, j1 in spans:
        count[i0:i1, j0:j1] += 1
    return count


@pytest.mark.parametrize(
    ("wanted", "allowed", "number"),
    read_table(__file__, "rectangle_decomposition_is_minimal_for_simple_shapes"),
)
def test_rectangle_decomposition_is_minimal_for_simple_shapes(wanted, allowed, number):
    wanted, allowed = mask(wanted), mask(allowed)
    spans = decompose_rectangles(wanted, allowed)
    count = cells(spans, wanted.shape)
    assert len(spans) == number
    assert (count[wanted] > 0).all()
    assert (count[~allowed] == 0).all()


def test_rectangle_decomposition_spans_are_first_index_first():
    assert decompose_rectangles(mask(".... .###"), mask(".... .###")) == [(1, 2, 1, 4)]


def test_rectangle_decomposition_prefers_the_largest_of_a_tie():
    """All three maximal rectangles cover the required cell: 1 x 3, 3 x 1 and 2 x 2 cells."""
    assert decompose_rectangles(mask("... ... .#."), mask("##. .## ###")) == [(1, 3, 1, 3)]


@pytest.mark.parametrize(
    ("required", "allowed", "rectangles"),
    read_table(__file__, "maximal_rectangles_cannot_grow_and_have_a_required_cell"),
)
def test_maximal_rectangles_cannot_grow_and_have_a_required_cell(required, allowed, rectangles):
    """Each bit of a number is a cell of a row."""
    assert [*map(list, _maximal_rectangles(required, allowed))] == rectangles


@for_any(allowed=MASKS, seed=MASKS)
def test_rectangle_decomposition_is_exact_and_not_redundant(allowed, seed):
    wanted = allowed & np.resize(seed, allowed.shape)
    spans = decompose_rectangles(wanted, allowed)
    count = cells(spans, wanted.shape)
    assert (count[wanted] > 0).all()
    assert (count[~allowed] == 0).all()
    for i0, i1, j0, j1 in spans:
        alone = count[i0:i1, j0:j1] == 1
        assert (alone & wanted[i0:i1, j0:j1]).any()
