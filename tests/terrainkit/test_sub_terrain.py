import dataclasses
import math

import numpy as np
import pytest

from terrainkit.sub_terrain import SubTerrain
from terrainkit.errors import ConfigError


def test_a_choice_is_called_as_its_terrain_unless_named():
    assert SubTerrain(terrain="pit").name == "pit"
    assert SubTerrain(terrain="pit", name="crater").name == "crater"


def test_defaults_are_interpolated():
    gap = SubTerrain(terrain="gap")
    assert gap.at(0.0).width == 0.0
    assert gap.at(0.25).width == 0.25
    assert gap.at(1.0).width == 1.0


def test_a_range_replaces_the_default_and_a_value_holds_throughout():
    gap = SubTerrain(terrain="gap", parameters={"width": (0.2, 0.6), "depth": 2.0})
    assert [gap.at(d).width for d in (0.0, 0.5, 1.0)] == pytest.approx([0.2, 0.4, 0.6])
    assert [gap.at(d).depth for d in (0.0, 0.5, 1.0)] == [2.0, 2.0, 2.0]
    assert gap.at(0.5).platform == 3.0


def test_an_unknown_terrain_lists_those_that_exist():
    with pytest.raises(ConfigError, match=r"no terrain 'lava'; there are: flat, gap, "):
        SubTerrain(terrain="lava")


def test_an_unknown_parameter_lists_those_of_the_terrain():
    with pytest.raises(
        ConfigError, match="gap has no parameter 'widht'; it has: width, depth, platform"
    ):
        SubTerrain(terrain="gap", parameters={"widht": 0.3})


@pytest.mark.parametrize(
    ("terrain", "parameters", "message"),
    [
        ("gap", {"width": -0.1}, r"gap: width is -0\.1; wanted 0 to 1e\+06"),
        ("gap", {"width": (0.1, -0.2)}, r"gap: width is -0\.2; wanted 0 to 1e\+06"),
        ("gap", {"width": (0.1, 1e9)}, r"gap: width is 1e\+09; wanted 0 to 1e\+06"),
        ("gap", {"platform": (0.0, 3.0)}, r"gap: platform is 0; wanted above 0 to 1e\+06"),
        ("gap", {"width": "wide"}, "gap: width is 'wide'; wanted a number"),
        ("gap", {"width": (0.1, "wide")}, "gap: width is 'wide'; wanted a number"),
        ("gap", {"width": (0.1, 0.2, 0.3)}, r"\(0\.1, 0\.2, 0\.3\); wanted .* pair \(easy, hard\)"),
        ("wave", {"number": (1, 4)}, r"wave: number is \(1, 4\); wanted one value$"),
        ("slope", {"inverted": (False, True)}, r"inverted is \(False, True\); wanted one value$"),
        ("slope", {"inverted": 1}, "slope: inverted is 1; wanted true or false"),
    ],
)
def test_a_parameter_that_cannot_be_is_refused_at_once(terrain, parameters, message):
    with pytest.raises(ConfigError, match=message):
        SubTerrain(terrain=terrain, parameters=parameters)


@pytest.mark.parametrize(
    ("proportion", "said"), [(-1, "-1"), (2e6, r"2e\+06"), (math.nan, "nan"), (math.inf, "inf")]
)
def test_a_proportion_is_0_to_a_million(proportion, said):
    with pytest.raises(ConfigError, match=rf"gap: proportion is {said}; wanted 0 to 1e\+06"):
        SubTerrain(terrain="gap", proportion=proportion)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"terrain": 3}, "terrain is 3; wanted a text"),
        ({"terrain": ["gap"]}, r"terrain is \['gap'\]; wanted a text"),
        ({"terrain": "gap", "proportion": "1"}, "proportion is '1'; wanted a number"),
        ({"terrain": "gap", "proportion": True}, "proportion is True; wanted a number"),
        ({"terrain": "gap", "name": None}, "name is None; wanted a text"),
    ],
)
def test_a_field_of_the_wrong_kind_is_refused(given, message):
    with pytest.raises(ConfigError, match=message):
        SubTerrain(**given)


def test_whole_numbers_and_numpys_are_taken_for_a_proportion():
    assert type(SubTerrain(terrain="gap", proportion=2).proportion) is float
    assert type(SubTerrain(terrain="gap", proportion=np.float32(0.5)).proportion) is float


@pytest.mark.parametrize("difficulty", [-0.1, 1.1, math.nan])
def test_a_difficulty_beyond_its_range_is_refused(difficulty):
    with pytest.raises(ConfigError, match=f"gap: difficulty is {difficulty:g}; wanted 0 to 1"):
        SubTerrain(terrain="gap").at(difficulty)


def test_a_list_is_a_range():
    gap = SubTerrain(terrain="gap", parameters={"width": [0.2, 0.6]})
    assert gap == SubTerrain(terrain="gap", parameters={"width": (0.2, 0.6)})


def test_the_callers_parameters_may_change_later():
    parameters = {"width": 0.2}
    gap = SubTerrain(terrain="gap", parameters=parameters)
    parameters["width"] = -1.0
    assert gap.at(1.0).width == 0.2


def test_a_choice_does_not_change():
    with pytest.raises(dataclasses.FrozenInstanceError):
        SubTerrain(terrain="gap").proportion = 2.0
