import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from terrainkit.geometry.rectangle_cover import rectangle_cover


def mask(text):
    return np.array([[cell == "#" for cell in row] for row in text.split()])


def cells(spans, shape):
    count = np.zeros(shape, dtype=int)
    for i0, i1, j0, j1 in spans:
        count[i0:i1, j0:j1] += 1
    return count


@pytest.mark.parametrize(
    ("shape", "number"),
    [
        ("....", 0),
        ("#", 1),
        ("#### ####", 1),
        ("#... #... ####", 2),  # an L
        (".#. ### .#.", 2),  # a cross: two bars that overlap
        ("#### #..# ####", 4),  # a ring
        ("#.. .#. ..#", 3),  # corners that only touch
        ("#... ##.. ###. ####", 4),  # stairs
        ("###...### ###...### #########", 3),  # a U
        ("##..## ...... ##..##", 4),
    ],
)
def test_rectangle_cover_is_minimal_for_simple_shapes(shape, number):
    wanted = mask(shape)
    spans = rectangle_cover(wanted, wanted)
    assert len(spans) == number
    assert np.array_equal(cells(spans, wanted.shape) > 0, wanted)


@pytest.mark.parametrize(
    ("wanted", "allowed", "number"),
    [
        ("##### #...# #####", "##### ##### #####", 1),  # a ring that may be filled
        ("#.# ... #.#", "### ### ###", 1),
        ("#..# .... ....", "#### #..# ####", 1),
        ("#...# #...#", "##### #...#", 2),
    ],
)
def test_rectangle_cover_may_use_allowed_cells(wanted, allowed, number):
    assert len(rectangle_cover(mask(wanted), mask(allowed))) == number


def test_rectangle_cover_spans_are_first_index_first():
    assert rectangle_cover(mask(".... .###"), mask(".... .###")) == [(1, 2, 1, 4)]


MASKS = arrays(
    bool, array_shapes(min_dims=2, max_dims=2, max_side=10), elements=st.booleans()
).flatmap(
    lambda allowed: arrays(bool, allowed.shape, elements=st.booleans()).map(
        lambda wanted: (wanted & allowed, allowed)
    )
)


@given(MASKS)
@settings(deadline=None, derandomize=True, max_examples=150)
def test_rectangle_cover_is_exact_and_not_redundant(masks):
    wanted, allowed = masks
    spans = rectangle_cover(wanted, allowed)
    count = cells(spans, wanted.shape)
    assert (count[wanted] > 0).all()
    assert (count[~allowed] == 0).all()
    for i0, i1, j0, j1 in spans:
        alone = count[i0:i1, j0:j1] == 1
        assert (alone & wanted[i0:i1, j0:j1]).any()


def test_rectangle_cover_of_large_shape_is_small():
    wanted = np.zeros((400, 300), dtype=bool)
    wanted[20:380, 30:60] = wanted[20:380, 200:230] = wanted[100:130, 30:230] = True
    assert len(rectangle_cover(wanted, wanted)) == 3
