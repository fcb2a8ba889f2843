import importlib.metadata
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate, registry, terrains
from terrainkit.errors import ConfigError
from terrainkit.grid import Grid
from terrainkit.terrain import Terrain

MOON = """
from dataclasses import dataclass
import numpy as np
from terrainkit import parameter
from terrainkit.terrain import Terrain

@dataclass(frozen=True, kw_only=True)
class Moon(Terrain):
    height: float = parameter.height(1.0, 3.0)

    def heights(self, grid, rng):  # noqa: ARG002
        return np.full(grid.shape, self.height)
"""


@pytest.fixture
def moon(tmp_path, monkeypatch):
    (tmp_path / "moon.py").write_text(MOON)
    monkeypatch.setattr(terrains, "__path__", [*terrains.__path__, str(tmp_path)])
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    registry.terrain_names.cache_clear()
    yield
    registry.terrain_names.cache_clear()
    registry.get_terrain.cache_clear()
    sys.modules.pop("terrainkit.terrains.moon", None)


def test_names_are_the_files_in_alphabetical_order():
    files = Path(terrains.__path__[0]).glob("*.py")
    assert list(registry.terrain_names()) == sorted({file.stem for file in files} - {"__init__"})


@pytest.mark.parametrize("name", registry.terrain_names())
def test_a_terrain_goes_by_the_name_of_its_file(name):
    assert registry.get_terrain(name).kind() == name


def test_a_terrain_that_uses_another_is_still_found_by_its_own_name():
    assert registry.get_terrain("rough_slope").__name__ == "RoughSlope"


def test_an_unknown_name_lists_those_that_exist():
    with pytest.raises(ConfigError, match=r"did you mean 'stairs'\? There are: flat, .*, wave$"):
        registry.get_terrain("stair")


def test_the_name_of_an_inverted_terrain_says_what_to_ask_for():
    with pytest.raises(ConfigError, match=r"use pyramid_stairs with inverted = true$"):
        registry.get_terrain("pyramid_stairs_inverted")


@pytest.mark.parametrize("name", ["flat_inverted", "stair_inverted", "_inverted"])
def test_what_cannot_be_inverted_is_unknown_as_any_other(name):
    with pytest.raises(ConfigError, match=rf"no terrain '{name}'; there are: flat, gap, .*, wave$"):
        registry.get_terrain(name)


@pytest.mark.usefixtures("moon")
def test_a_new_file_is_a_new_terrain():
    assert "moon" in registry.terrain_names()
    terrain = registry.get_terrain("moon").at(0.5)
    heights = terrain.build(Grid(shape=(3, 2), cell=0.1), np.random.default_rng(0))
    assert heights.tolist() == [[2, 2], [2, 2], [2, 2]]


@dataclass(frozen=True, kw_only=True)
class _Careless(Terrain):
    number: int = 3

    def heights(self, grid, rng):  # noqa: ARG002
        return np.zeros(grid.shape)


@dataclass(frozen=True, kw_only=True)
class _Turned(Terrain):
    def heights(self, grid, rng):  # noqa: ARG002
        return np.zeros(grid.shape[::-1])


def test_a_plain_field_is_named():
    with pytest.raises(
        ConfigError, match="_Careless: number is a plain field; expected one declared"
    ):
        _Careless()


def test_heights_of_another_shape_are_named():
    with pytest.raises(ConfigError, match=r"shape \(4, 8\); expected \(8, 4\)"):
        _Turned().build(Grid(shape=(8, 4), cell=1.0), np.random.default_rng(0))


@pytest.fixture
def plugin(monkeypatch):
    """Install an entry point called dunes, and forget what was found before and after."""

    def install(value):
        point = importlib.metadata.EntryPoint("dunes", value, registry.ENTRY_POINTS)
        found = {registry.ENTRY_POINTS: (point,)}
        monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: found[group])

    registry.get_terrain.cache_clear()
    yield install
    registry.get_terrain.cache_clear()


def test_a_terrain_of_another_package_is_found_by_its_entry_point(plugin):
    plugin("terrainkit.terrains.wave:Wave")
    assert registry.get_terrain("dunes") is registry.get_terrain("wave")
    dunes = SubTerrain(terrain="dunes", parameters={"amplitude": 0.1})
    assert generate(MapConfig(rows=1, cols=1, border=0.0, terrains=(dunes,))).heights.max() > 0.09


def test_an_entry_point_that_is_no_terrain_is_named(plugin):
    plugin("math:pi")
    with pytest.raises(
        ConfigError, match=r"dunes \(math:pi\): got 3\.14.*; expected a subclass of Terr"
    ):
        registry.get_terrain("dunes")


def test_terrains_of_other_packages_are_listed_among_those_there_are(plugin):
    plugin("terrainkit.terrains.wave:Wave")
    with pytest.raises(ConfigError, match=r"there are: flat, .*, wave, dunes"):
        registry.get_terrain("moon")


@pytest.mark.parametrize("value", ["no_such_package:Dunes", "math:no_such_name"])
def test_an_entry_point_that_leads_nowhere_is_named(plugin, value):
    plugin(value)
    with pytest.raises(ConfigError, match=rf"dunes \({value}\) cannot be loaded: "):
        registry.get_terrain("dunes")
