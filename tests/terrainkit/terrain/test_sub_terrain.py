import dataclasses
import math

import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.terrain.sub_terrain import SubTerrain


def test_name_defaults_to_the_terrain():
    assert SubTerrain(terrain="pit").name == "pit"
    assert SubTerrain(terrain="pit", name="crater").name == "crater"


def test_default_ranges_are_interpolated():
    gap = SubTerrain(terrain="gap")
    assert gap.at(0.0).width == 0.0
    assert gap.at(0.25).width == 0.25
    assert gap.at(1.0).width == 1.0


def test_parameters_replace_the_default_ranges():
    gap = SubTerrain(terrain="gap", parameters={"width": (0.2, 0.6), "depth": 2.0})
    assert [gap.at(d).width for d in (0.0, 0.5, 1.0)] == pytest.approx([0.2, 0.4, 0.6])
    assert [gap.at(d).depth for d in (0.0, 0.5, 1.0)] == [2.0, 2.0, 2.0]
    assert gap.at(0.5).platform == 3.0


def test_unknown_terrain_lists_known_ones():
    with pytest.raises(
        ConfigError, match=r"no terrain 'lava' is built in, .*; terrainkit list prints all"
    ):
        SubTerrain(terrain="lava")


def test_unknown_parameter_suggests_nearest_name():
    with pytest.raises(
        ConfigError, match=r"'widht'; did you mean 'width'. It has: width, depth, platform"
    ):
        SubTerrain(terrain="gap", parameters={"widht": 0.3})


@pytest.mark.parametrize(
    ("terrain", "parameters", "message"),
    [
        ("gap", {"width": -0.1}, r"gap\.width: got -0\.1; expected a number from 0 to 1000000"),
        ("gap", {"width": (0.1, -0.2)}, r"gap\.width: got -0\.2; expected a number from 0"),
        ("gap", {"width": (0.1, 1e9)}, r"gap\.width: got 1000000000\.0; expected a number"),
        (
            "gap",
            {"platform": (0.0, 3.0)},
            r"gap\.platform: got 0\.0; .* > 0 and <= 1000000",
        ),
        ("gap", {"width": "wide"}, r"gap\.width: got 'wide'; expected a number"),
        ("gap", {"width": (0.1, "wide")}, r"gap\.width: got 'wide'; expected a number"),
        (
            "gap",
            {"width": (0.1, 0.2, 0.3)},
            r"0\.3\]; expected .* pair \(easy, hard\)",
        ),
        ("wave", {"number": (1, 4)}, r"wave\.number: got \[1, 4\]; expected one value$"),
        (
            "slope",
            {"inverted": (False, True)},
            r"got \[False, True\]; expected one value$",
        ),
        ("slope", {"inverted": 1}, r"slope\.inverted: got 1; expected true or false"),
    ],
)
def test_invalid_parameter_is_rejected(terrain, parameters, message):
    with pytest.raises(ConfigError, match=message):
        SubTerrain(terrain=terrain, parameters=parameters)


@pytest.mark.parametrize(
    ("proportion", "said"), [(-1, "-1"), (2e6, r"2000000\.0"), (math.nan, "nan"), (math.inf, "inf")]
)
def test_proportion_out_of_range_is_rejected(proportion, said):
    with pytest.raises(ConfigError, match=rf"gap\.proportion: got {said}; .* from 0 to 1000000"):
        SubTerrain(terrain="gap", proportion=proportion)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"terrain": 3}, "terrain: got 3; expected a string"),
        ({"terrain": ["gap"]}, r"terrain: got \['gap'\]; expected a string"),
        ({"terrain": "gap", "proportion": "1"}, "proportion: got '1'; expected a number"),
        ({"terrain": "gap", "proportion": True}, "proportion: got True; expected a number"),
        ({"terrain": "gap", "name": None}, "name: got None; expected a string"),
    ],
)
def test_wrong_type_is_rejected(given, message):
    with pytest.raises(ConfigError, match=message):
        SubTerrain(**given)


def test_proportion_accepts_integers_and_numpy_scalars():
    assert type(SubTerrain(terrain="gap", proportion=2).proportion) is float
    assert type(SubTerrain(terrain="gap", proportion=np.float32(0.5)).proportion) is float


@pytest.mark.parametrize("difficulty", [-0.1, 1.1, math.nan])
def test_difficulty_out_of_range_is_rejected(difficulty):
    with pytest.raises(ConfigError, match=rf"difficulty: got {difficulty:g}; expected a"):
        SubTerrain(terrain="gap").at(difficulty)


@pytest.mark.parametrize(
    ("friction", "expected"),
    [
        (None, [None] * 3),
        (0.5, [0.5] * 3),
        ((1, 0.5), [1.0, 0.75, 0.5]),
        ([1, 0.5], [1, 0.75, 0.5]),
    ],
)
def test_friction_may_be_a_range(friction, expected):
    ice = SubTerrain(terrain="flat", friction=friction)
    assert [ice.friction_at(d) for d in (0.0, 0.5, 1.0)] == expected


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"friction": -1}, r"flat\.friction: got -1; expected a number from 0"),
        ({"friction": (1, 2, 3)}, r"flat\.friction: got \[1, 2, 3\]; expected one value or a pair"),
        (
            {"overlays": ("noise",)},
            r"flat\.overlays\[0\]: got 'noise'; expected a table",
        ),
        ({"overlays": 3}, r"flat\.overlays: got 3; expected a list"),
    ],
)
def test_invalid_friction_or_overlay_is_rejected(given, message):
    with pytest.raises(ConfigError, match=message):
        SubTerrain(terrain="flat", **given)


def test_list_is_converted_to_range():
    gap = SubTerrain(terrain="gap", parameters={"width": [0.2, 0.6]})
    assert gap == SubTerrain(terrain="gap", parameters={"width": (0.2, 0.6)})


def test_parameters_are_copied():
    parameters = {"width": 0.2}
    gap = SubTerrain(terrain="gap", parameters=parameters)
    parameters["width"] = -1.0
    assert gap.at(1.0).width == 0.2


def test_sub_terrain_is_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        SubTerrain(terrain="gap").proportion = 2.0


@pytest.mark.parametrize("value", [float("nan"), {}])
def test_sub_terrain_parameter_error_names_the_key(value):
    with pytest.raises(ConfigError, match=r"^crawl\.clearance: got .*; expected a finite value or"):
        SubTerrain(terrain="crawl", parameters={"clearance": value})
