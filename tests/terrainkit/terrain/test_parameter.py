import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import parameter
from terrainkit.terrains.flat import Flat


@dataclass(frozen=True, kw_only=True)
class Hurdle(Flat):
    rise: float = parameter.height(0.1, 0.4)
    width: float = parameter.length(0.2)
    gap: float = parameter.length(0.0, 1.0, allow_zero=True)
    landing: float = parameter.platform(3.0)
    grade: float = parameter.scalar(0.4)
    spacing: float = parameter.scalar(0.2, allow_zero=False)
    number: int = parameter.count(4)
    inverted: bool = parameter.switch()


HURDLE = parameter.parameters_of(Hurdle)


def test_parameters_of_keeps_field_order():
    assert list(HURDLE) == [
        "rise", "width", "gap", "landing", "grade", "spacing", "number", "inverted",
    ]  # fmt: skip


def test_parameter_default_is_the_hard_end():
    hurdle = Hurdle()
    assert hurdle.rise == 0.4
    assert hurdle.width == 0.2
    assert hurdle.gap == 1.0


@pytest.mark.parametrize(("difficulty", "rise"), [(0.0, 0.1), (0.5, 0.25), (1.0, 0.4)])
def test_parameter_range_is_linear(difficulty, rise):
    assert HURDLE["rise"].at(difficulty) == pytest.approx(rise)


def test_parameter_count_and_switch_are_constant():
    assert HURDLE["number"].at(0.3) == 4
    assert isinstance(HURDLE["number"].at(0.3), int)
    assert HURDLE["inverted"].at(0.3) is False


@pytest.mark.parametrize(("difficulty", "number"), [(0.0, 12), (0.5, 6), (0.6, 5), (1.0, 1)])
def test_parameter_count_range_is_rounded(difficulty, number):
    @dataclass(frozen=True, kw_only=True)
    class Star(Flat):
        number: int = parameter.count(12, 1)

    built = Star.at(difficulty)
    assert built.number == number
    assert isinstance(built.number, int)
    assert Star.at(difficulty, {"number": (12, 1)}) == built


@settings(deadline=None, derandomize=True)
@given(easy=st.floats(-1e6, 1e6), hard=st.floats(-1e6, 1e6), d=st.floats(0, 1))
def test_at_difficulty_is_exact_at_both_ends(easy, hard, d):
    assert parameter.at_difficulty((easy, hard), 0.0) == easy
    assert parameter.at_difficulty((easy, hard), 1.0) == hard
    margin = 1e-9 * (abs(easy) + abs(hard))
    between = parameter.at_difficulty((easy, hard), d)
    assert min(easy, hard) - margin <= between <= max(easy, hard) + margin


def test_at_difficulty_of_single_value():
    assert parameter.at_difficulty(0.3, 0.7) == 0.3


@pytest.mark.parametrize(
    ("name", "value", "realized"),
    [
        ("rise", 0.123, 0.123),
        ("width", 0.31, 0.3),
        ("width", 0.04, 0.1),
        ("gap", 0.04, 0.0),
        ("landing", 3.1, 3.2),
        ("grade", 0.35, 0.35),
        ("spacing", 0.27, 0.27),
        ("number", 7, 7),
        ("inverted", True, True),
    ],
)
def test_parameter_realized_snaps_to_cells(name, value, realized):
    assert HURDLE[name].realized(value, Grid(shape=(80, 40), cell=0.1)) == realized


def test_parameter_platform_may_be_a_pair():
    assert HURDLE["landing"].realized(3.0, Grid(shape=(80, 51), cell=0.1)) == (3.0, 3.1)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("rise", -0.1, r"hurdle\.rise: got -0\.1; expected a number from 0 to 1000000"),
        ("rise", 1.1e6, r"hurdle\.rise: got 1100000\.0; expected a number from 0 to 1000000"),
        ("rise", math.nan, r"hurdle\.rise: got nan; expected a number from 0 to 1000000"),
        ("rise", math.inf, r"hurdle\.rise: got inf; expected a number from 0 to 1000000"),
        ("rise", "high", r"hurdle\.rise: got 'high'; expected a number"),
        ("rise", True, r"hurdle\.rise: got True; expected a number"),
        ("rise", None, r"hurdle\.rise: got None; expected a number"),
        ("width", 0.0, r"hurdle\.width: got 0\.0; expected a number > 0 and <= 1000000"),
        ("landing", 0, r"hurdle\.landing: got 0; expected a number > 0 and <= 1000000"),
        ("spacing", 0.0, r"hurdle\.spacing: got 0\.0; expected a number > 0 and <= 1000000"),
        ("number", 0, r"hurdle\.number: got 0; expected an integer > 0 and <= 10000"),
        ("number", 10_001, r"hurdle\.number: got 10001; expected an integer > 0 and <= 10000"),
        pytest.param("number", 10**400, r"hurdle\.number: got an integer beyond", id="10**400"),
        ("number", 4.0, r"hurdle\.number: got 4\.0; expected an integer"),
        ("number", True, r"hurdle\.number: got True; expected an integer"),
        ("inverted", 1, r"hurdle\.inverted: got 1; expected true or false"),
    ],
)
def test_convert_parameter_rejects_invalid_values(name, value, message):
    with pytest.raises(ConfigError, match=message):
        parameter.convert_parameter("hurdle", name, value, HURDLE[name])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("rise", 0),
        ("rise", parameter.MAX_VALUE),
        ("gap", 0.0),
        ("grade", 0.0),
        ("number", 1),
        ("number", 10_000),
        ("inverted", True),
        ("rise", np.float32(0.1)),
        ("number", np.int64(4)),
        ("inverted", np.True_),
    ],
)
def test_convert_parameter_accepts_limits_and_numpy_scalars(name, value):
    parameter.convert_parameter("hurdle", name, value, HURDLE[name])


def test_realized_length_is_shorter_where_ground_slopes_away():
    grid = Grid(shape=(80, 51), cell=0.1)
    length = parameter.Parameter(easy=1.0, hard=1.0, snap="cells", slopes_away=True)
    square = parameter.Parameter(easy=1.0, hard=1.0, snap="centered", slopes_away=True)
    assert length.realized(2.0, grid) == 1.95
    assert square.realized(2.0, grid) == (1.9, 2.0)
    assert not square.deviates(2.0, (1.9, 1.8), 0.1)
    assert square.deviates(2.0, (1.9, 1.7), 0.1)


@dataclass(frozen=True, kw_only=True)
class Ramp(Flat):
    surface: str = parameter.text("rubber")
    profile: str = parameter.choice("straight", "curved")
    turns: int = parameter.choice(1, 2, 4)
    offset: tuple[float, float, float] = parameter.vector((0, 0, -1))


GRID = Grid(shape=(80, 80), cell=0.1)
RAMP = parameter.parameters_of(Ramp)


@pytest.mark.parametrize("difficulty", [0.0, 0.5, 1.0])
def test_parameter_of_other_type_is_constant(difficulty):
    ramp = Ramp.at(difficulty)
    assert ramp.requested() == {
        "surface": "rubber", "profile": "straight", "turns": 1, "offset": (0.0, 0.0, -1.0),
    }  # fmt: skip
    assert ramp.realized(GRID) == ramp.requested()
    given = {"surface": "a:b, c", "profile": "curved", "turns": 4, "offset": (1, 2, 3)}
    assert Ramp.at(difficulty, given).requested() == given
    assert type(Ramp.at(difficulty, given).offset[0]) is float


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"surface": 3}, r"ramp\.surface: got 3; expected a string of at most 200 characters$"),
        ({"surface": 201 * "x"}, "expected a string of at most 200 characters"),
        ({"surface": ("a", "b")}, r"ramp\.surface: got \['a', 'b'\]; expected one value$"),
        ({"profile": "curvd"}, "expected one of: straight, curved; did you mean 'curved'"),
        ({"turns": 3}, r"ramp\.turns: got 3; expected one of: 1, 2, 4"),
        ({"turns": True}, r"ramp\.turns: got True; expected one of: 1, 2, 4"),
        (
            {"offset": (1, 2)},
            r"ramp\.offset: got \[1, 2\]; expected 3 values, each a number",
        ),
        ({"offset": (1, 2, math.nan)}, "expected 3 values, each a number"),
        ({"offset": 1}, r"ramp\.offset: got 1; expected 3 values"),
    ],
)
def test_parameter_of_other_type_is_checked(given, message):
    with pytest.raises(ConfigError, match=message):
        Ramp.at(0.5, given)


def test_parameter_of_other_type_deviates_if_it_differs():
    assert not RAMP["surface"].deviates("a", "a", 0.1)
    assert RAMP["surface"].deviates("a", "b", 0.1)
    assert RAMP["offset"].deviates((1.0, 2.0, 3.0), (1.0, 2.0, 3.5), 0.1)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.31, "0.31"), (3, "3"), (True, "true"), ("a", "a"), ((0.5, -1.0), "[0.5, -1]")],
)
def test_format_value_is_command_line_text(value, text):
    assert parameter.format_value(value) == text
