import dataclasses

import pytest

from terrainkit.errors import ConfigError
from terrainkit.terrain import parameter
from terrainkit.terrain.sub_terrain import SubTerrain
from terrainkit.terrains.flat import Flat
from tests.tables import read_table


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
        *read_table(__file__, "invalid_field_is_rejected"),
        ({"name": None}, "name: got None; expected a string"),
    ],
)
def test_invalid_field_is_rejected(given, message):
    with pytest.raises(ConfigError, match=message):
        SubTerrain(**{"terrain": "gap", **given})


@pytest.mark.parametrize(("parameters", "message"), read_table(__file__, "invalid_parameter"))
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


@pytest.mark.parametrize(("table", "message"), read_table(__file__, "invalid_table_is_rejected"))
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
