import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from terrainkit import registry, terrains
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

    def heights(self, plot, rng):  # noqa: ARG002
        return np.full(plot.shape, self.height)
"""


@pytest.fixture
def moon(tmp_path, monkeypatch):
    (tmp_path / "moon.py").write_text(MOON)
    monkeypatch.setattr(terrains, "__path__", [*terrains.__path__, str(tmp_path)])
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    registry.names.cache_clear()
    yield
    registry.names.cache_clear()
    registry.find.cache_clear()
    sys.modules.pop("terrainkit.terrains.moon", None)


def test_names_are_the_files_in_alphabetical_order():
    files = Path(terrains.__path__[0]).glob("*.py")
    assert list(registry.names()) == sorted({file.stem for file in files} - {"__init__"})


@pytest.mark.parametrize("name", registry.names())
def test_a_terrain_goes_by_the_name_of_its_file(name):
    assert registry.find(name).kind() == name


def test_a_terrain_that_uses_another_is_still_found_by_its_own_name():
    assert registry.find("rough_slope").__name__ == "RoughSlope"


def test_an_unknown_name_lists_those_that_exist():
    with pytest.raises(ConfigError, match=r"no terrain 'stair'; there are: flat, gap, .*, wave$"):
        registry.find("stair")


@pytest.mark.usefixtures("moon")
def test_a_new_file_is_a_new_terrain():
    assert "moon" in registry.names()
    terrain = registry.find("moon").at(0.5)
    heights = terrain.build(Grid(shape=(3, 2), cell=0.1), np.random.default_rng(0))
    assert heights.tolist() == [[2, 2], [2, 2], [2, 2]]


@dataclass(frozen=True, kw_only=True)
class _Careless(Terrain):
    number: int = 3

    def heights(self, plot, rng):  # noqa: ARG002
        return np.zeros(plot.shape)


@dataclass(frozen=True, kw_only=True)
class _Turned(Terrain):
    def heights(self, plot, rng):  # noqa: ARG002
        return np.zeros(plot.shape[::-1])


def test_a_plain_field_is_named():
    with pytest.raises(
        ConfigError, match="_Careless: number is a plain field; wanted one declared"
    ):
        _Careless()


def test_heights_of_another_shape_are_named():
    with pytest.raises(ConfigError, match=r"shape \(4, 8\); wanted \(8, 4\)"):
        _Turned().build(Grid(shape=(8, 4), cell=1.0), np.random.default_rng(0))
