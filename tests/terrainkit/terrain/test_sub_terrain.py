import dataclasses
import math

import pytest

from terrainkit.errors import ConfigError
from terrainkit.terrain import parameter
from terrainkit.terrain.sub_terrain import SubTerrain
from terrainkit.terrains.flat import Flat


@pytest.mark.parametrize(
    ("parameters", "widths", "depth"),
    [({}, [0.0, 0.25, 1.0], 5.0), ({"width": [0.2, 0.6], "depth": 2}, [0.2, 0.3, 0.6], 2.0)],
)
def test_ranges_are_interpolated(parameters, widths, depth):
    gap = SubTerrain(terrain="gap", parameters=parameters)
    built = [gap.at(difficulty) for difficulty in (0.0, 0.25, 1.0)]
    assert [each.width for each in built] == pytest.approx(widths)
    assert [(each.depth, each.platform) for each in built] == [(depth, 3.0)] * 3


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"terrain": 3}, "terrain: got 3; expected a string"),
        ({"name": None}, "name: got None; expected a string"),
        ({"proportion": "1"}, r"gap\.proportion: got '1'; expected a number"),
        ({"proportion": -1}, r"gap\.proportion: got -1; .* from 0 to 1000000"),
        ({"friction": -1}, r"gap\.friction: got -1; expected a number from 0"),
        ({"friction": (1, 2, 3)}, r"gap\.friction: got \[1, 2, 3\]; expected one value or a pair"),
        ({"overlays": ("noise",)}, r"gap\.overlays\[0\]: got 'noise'; expected a table"),
        ({"overlays": 3}, r"gap\.overlays: got 3; expected a list"),
    ],
)
def test_invalid_field_is_rejected(given, message):
    with pytest.raises(ConfigError, match=message):
        SubTerrain(**{"terrain": "gap", **given})


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"widht": 0.3}, "'widht'; did you mean 'width'. It has: width, depth, platform"),
        ({"width": (0.1, -0.2)}, r"gap\.width: got -0\.2; expected a number from 0"),
        ({"platform": (0.0, 3.0)}, r"gap\.platform: got 0\.0; .* > 0 and <= 1000000"),
        ({"width": (0.1, 0.2, 0.3)}, r"0\.3\]; expected .* pair \(easy, hard\)"),
        ({"width": math.nan}, r"^gap\.width: got nan; expected a number from 0 to 1000000"),
    ],
)
def test_invalid_parameter_is_rejected(parameters, message):
    with pytest.raises(ConfigError, match=message):
        SubTerrain(terrain="gap", parameters=parameters)


@pytest.mark.parametrize(
    ("friction", "expected"),
    [(None, [None] * 3), (0.5, [0.5] * 3), ((1, 0.5), [1, 0.75, 0.5]), ([1, 0.5], [1, 0.75, 0.5])],
)
def test_friction_may_be_a_range(friction, expected):
    ice = SubTerrain(terrain="flat", friction=friction)
    assert [ice.friction_at(d) for d in (0.0, 0.5, 1.0)] == expected


@pytest.mark.usefixtures("own_registry")
def test_parameters_with_the_names_of_other_keys_are_rejected():
    @dataclasses.dataclass(frozen=True, kw_only=True)
    class Named(Flat):
        friction: float = parameter.scalar(1.0)
        name: str = parameter.text()

    with pytest.raises(ConfigError, match="named: got parameters with the names friction, name; "):
        SubTerrain(terrain=Named)


def test_sub_terrain_has_a_copy_of_its_parameters():
    parameters = {"width": 0.2}
    gap = SubTerrain(terrain="gap", parameters=parameters)
    parameters["width"] = -1.0
    assert gap.at(1.0).width == 0.2


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            {"terrain": "gap", "overlays": 3},
            r"overlays: got 3; expected \[\[terrains\.ov",
        ),
        ({"terrain": "gap", "overlays": ["noise"]}, r"overlays: got .*; expected \[\[terrains"),
        ({"terrain": "gap", "overlays": [{}]}, r"overlays\[0\]: overlay: got None; expected a str"),
        ({"terain": "gap"}, r"got the key 'terain'; did you mean 'terrain'\?"),
        ({"terrain": "gap", "elements": {}}, r"elements: got a table; expected \[\[terrains\.elem"),
    ],
)
def test_invalid_table_is_rejected(table, message):
    with pytest.raises(ConfigError, match=rf"^terrains: {message}"):
        SubTerrain.from_table(table, path="terrains.")


def test_sub_terrain_of_a_table_is_the_same():
    table = {
        "terrain": "gap",
        "proportion": 2.0,
        "name": "moat",
        "friction": (1.0, 0.5),
        "overlays": [{"overlay": "mirror", "axis": "x"}],
        "width": (0.2, 0.6),
    }
    moat = SubTerrain.from_table(table)
    written = moat.to_table()
    assert {**written, "overlays": [each.to_table() for each in written["overlays"]]} == table
    assert SubTerrain(terrain="gap").to_table() == {"terrain": "gap", "proportion": 1.0}
    assert list(moat.declarations) == ["width", "depth", "platform", "overlays[0].axis"]
