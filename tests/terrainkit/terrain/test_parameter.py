from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import parameter
from terrainkit.terrain.parameter import Parameter
from terrainkit.terrains.flat import Flat
from tests.tables import read_table


@dataclass(frozen=True, kw_only=True)
class Hurdle(Flat):
    rise: float = parameter.height(0.1, 0.4)
    width: float = parameter.length(0.2)
    gap: float = parameter.length(0.0, 1.0, allow_zero=True)
    landing: float = parameter.platform(3.0)
    grade: float = parameter.scalar(0.4)
    spacing: float = parameter.scalar(0.2, allow_zero=False)
    bar: float = parameter.size(0.1)
    number: int = parameter.count(4)
    rungs: int = parameter.count(12, 1)
    inverted: bool = parameter.switch()
    surface: str = parameter.text("rubber")
    profile: str = parameter.choice("straight", "curved")
    turns: int = parameter.choice(1, 2, 4)
    offset: tuple[float, float, float] = parameter.vector((0, 0, -1))


HURDLE = parameter.parameters_of(Hurdle)
GRID = Grid(shape=(80, 40), cell=0.1)
OTHERS = {"surface": "a:b, c", "profile": "curved", "turns": 4, "offset": (1, 2, 3)}
EASY = {
    "rise": 0.1, "width": 0.2, "gap": 0.0, "landing": 3.0, "grade": 0.4, "spacing": 0.2, "bar": 0.1,
    "number": 4, "rungs": 12, "inverted": False, "surface": "rubber", "profile": "straight",
    "turns": 1, "offset": (0.0, 0.0, -1.0),
}  # fmt: skip


@pytest.mark.parametrize(
    ("difficulty", "ranges"),
    [
        (0.0, {}),
        (0.5, {"rise": 0.25, "gap": 0.5, "rungs": 6}),
        (1.0, {"rise": 0.4, "gap": 1.0, "rungs": 1}),
    ],
)
def test_parameter_ranges_are_linear_in_field_order(difficulty, ranges):
    found = Hurdle.at(difficulty).requested()
    assert list(found) == list(EASY)
    assert found == EASY | ranges
    assert {name: type(value) for name, value in found.items()} == {
        name: type(value) for name, value in EASY.items()
    }
    assert Hurdle.at(difficulty, {"rungs": (12, 1)}) == Hurdle.at(difficulty)


def test_parameter_default_is_the_hard_end():
    assert Hurdle() == Hurdle.at(1.0)


def test_parameters_of_other_types_are_kept():
    hurdle = Hurdle.at(0.5, OTHERS)
    assert OTHERS.items() <= hurdle.requested().items()
    assert OTHERS.items() <= hurdle.realized(GRID).items()
    assert type(hurdle.offset[0]) is float


@settings(deadline=None, derandomize=True)
@given(easy=st.floats(-1e6, 1e6), hard=st.floats(-1e6, 1e6), d=st.floats(0, 1))
def test_at_difficulty_is_exact_at_both_ends(easy, hard, d):
    assert parameter.at_difficulty((easy, hard), 0.0) == easy
    assert parameter.at_difficulty((easy, hard), 1.0) == hard
    margin = 1e-9 * (abs(easy) + abs(hard))
    between = parameter.at_difficulty((easy, hard), d)
    assert min(easy, hard) - margin <= between <= max(easy, hard) + margin


def test_at_difficulty_rounds_integers_and_keeps_equal_ends():
    assert [parameter.at_difficulty((12, 1), d) for d in (0.4, 0.6, 0.9)] == [8, 5, 2]
    assert parameter.at_difficulty(0.3, 0.7) == 0.3
    assert {parameter.at_difficulty((0.31, 0.31), k / 9) for k in range(10)} == {0.31}


@pytest.mark.parametrize(("name", "value", "realized"), read_table(__file__, "parameter_realized"))
def test_parameter_realized_snaps_to_cells(name, value, realized):
    assert HURDLE[name].realized(value, GRID) == realized


def test_realized_length_is_shorter_where_ground_sloped_edge():
    grid = Grid(shape=(80, 51), cell=0.1)
    for snap, sloped_edge, realized in (
        ("cells", True, 1.95),
        ("centered", True, (1.9, 2.0)),
        ("centered", False, (2.0, 2.1)),
    ):
        length = Parameter(easy=1.0, hard=1.0, snap=snap, sloped_edge=sloped_edge)
        assert length.realized(2.0, grid) == realized


@pytest.mark.parametrize(("declared", "allowed"), read_table(__file__, "parameter_deviates"))
def test_parameter_deviates_by_more_than_snapping(declared, allowed):
    known = Parameter(easy=1.0, hard=1.0, **declared)
    for sign in (-1, 1):
        within, beyond = 2.0 + sign * allowed, 2.0 + sign * (allowed + 1e-5)
        assert not known.deviates(2.0, within, 0.1)
        assert known.deviates(2.0, beyond, 0.1)
        assert not known.deviates(2.0, (within, 2.0), 0.1)
        assert known.deviates(2.0, (beyond, 2.0), 0.1)
        assert known.deviates(2.0, (2.0, beyond), 0.1)


def test_parameter_that_became_zero_deviates_in_spite_of_its_tolerance():
    known = Parameter(easy=1.0, hard=1.0, tolerance=0.5)
    assert not known.deviates(0.4, 0.1, 0.1)
    assert known.deviates(0.4, 0.0, 0.1)
    assert known.deviates(0.4, (0.4, 0.0), 0.1)


def test_parameter_of_other_type_deviates_if_it_differs():
    text, vector = HURDLE["surface"], HURDLE["offset"]
    cases = [("a", "a"), ("a", "b"), ("", "b")]
    assert [text.deviates(*each, 0.1) for each in cases] == [False, True, False]
    assert vector.deviates((1.0, 2.0, 3.0), (1.0, 2.0, 3.5), 0.1)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        *read_table(__file__, "parameter_rejects_invalid_values"),
        ("surface", 201 * "x", "expected a string of at most 200 characters"),
    ],
)
def test_parameter_rejects_invalid_values(name, value, message):
    with pytest.raises(ConfigError, match=rf"hurdle\.{name}: .*{message}"):
        Hurdle.at(0.5, {name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("rise", 0),
        ("rise", 1e6),
        ("gap", 0.0),
        ("grade", 0.0),
        ("number", 1),
        ("number", 10_000),
        ("surface", 200 * "x"),
        ("offset", (1e6, -1e6, 0)),
        ("rise", np.float32(0.5)),
        ("number", np.int64(4)),
        ("inverted", np.True_),
    ],
)
def test_parameter_accepts_limits_and_numpy_scalars(name, value):
    found = getattr(Hurdle.at(0.5, {name: value}), name)
    assert found == value
    assert type(found) is type(EASY[name])


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.31, "0.31"), (3, "3"), (True, "true"), ("a", "a"), ((0.5, -1.0), "[0.5, -1]")],
)
def test_format_value_is_command_line_text(value, text):
    assert parameter.format_value(value) == text
