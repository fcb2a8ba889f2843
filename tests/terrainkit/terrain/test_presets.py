"""Tests of the presets; sub-terrains are in presets.json, of published work in test_paper.py.

`make records` writes it anew.
"""

import json
from pathlib import Path

import pytest

from terrainkit.errors import ConfigError
from terrainkit.terrain import presets, registry
from terrainkit.terrain.paper import paper_names
from terrainkit.terrain.parameter import parameters_of

TABLES = Path(__file__).with_name("presets.json")
NAMES = [name for name in presets.preset_names() if name not in (*paper_names(), "all")]


def text_of_presets():
    tables = {name: [each.to_table() for each in presets.get_preset(name)] for name in NAMES}
    return json.dumps(tables, indent=1, default=lambda element: element.to_table()) + "\n"


def test_presets_keep_their_sub_terrains():
    assert json.loads(text_of_presets()) == json.loads(TABLES.read_text())


def test_get_preset_unknown_name_lists_presets():
    message = r"'leggedgym'; did you mean 'legged_gym'\? There are: legged_gym, legged_gym_rough"
    with pytest.raises(ConfigError, match=message):
        presets.get_preset("leggedgym")


def test_get_preset_all_has_every_terrain_but_the_course():
    mix = {choice.name: choice for choice in presets.get_preset("all")}
    expected = {name: registry.get_terrain(name).at(1.0) for name in registry.terrain_names()}
    del expected["course"]
    for name, built in list(expected.items()):
        if "inverted" in parameters_of(type(built)):
            expected[f"{name}_inverted"] = type(built)(inverted=True)
    assert {name: choice.at(1.0) for name, choice in mix.items()} == expected


if __name__ == "__main__":
    TABLES.write_text(text_of_presets())
