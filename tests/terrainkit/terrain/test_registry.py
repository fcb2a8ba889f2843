import importlib.metadata
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, TerrainMap, generate, terrains
from terrainkit.errors import ConfigError, MapFileError
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain, registry

MOON = """
from dataclasses import dataclass
import numpy as np
from terrainkit.terrain import parameter
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
    registry._module_names.cache_clear()
    yield
    registry._module_names.cache_clear()
    registry._get.cache_clear()
    sys.modules.pop("terrainkit.terrains.moon", None)


def test_terrain_names_are_the_modules():
    files = Path(terrains.__path__[0]).glob("*.py")
    assert list(registry.terrain_names()) == sorted({file.stem for file in files} - {"__init__"})


@pytest.mark.parametrize("name", registry.terrain_names())
def test_get_terrain_uses_the_module_name(name):
    assert registry.get_terrain(name).kind() == name


def test_get_terrain_ignores_imported_terrains():
    assert registry.get_terrain("rough_slope").__name__ == "RoughSlope"


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("stair", "did you mean 'stairs' or 'star' or 'open_stairs'? "),
        ("Obstacle", "did you mean 'obstacles'? "),
        ("moon", ""),
        ("x" * 1000, ""),
    ],
)
def test_get_terrain_unknown_name_suggests_terrains(name, near):
    with pytest.raises(ConfigError) as error:
        registry.get_terrain(name)
    assert str(error.value).endswith(f"register_terrain; {near}terrainkit list prints all")


def test_get_terrain_suggests_inverted_option():
    with pytest.raises(ConfigError, match=r"use pyramid_stairs with inverted = true$"):
        registry.get_terrain("pyramid_stairs_inverted")


@pytest.mark.parametrize("name", ["flat_inverted", "stair_inverted", "_inverted"])
def test_get_terrain_without_inverted_is_unknown(name):
    with pytest.raises(
        ConfigError,
        match=rf"no terrain '{name}' is built in, .*terrainkit list prints all$",
    ):
        registry.get_terrain(name)


@pytest.mark.usefixtures("moon")
def test_new_module_is_a_terrain():
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


def test_plain_field_is_rejected():
    with pytest.raises(
        ConfigError, match="_Careless: number is a plain field; expected one declared"
    ):
        _Careless()


def test_heights_of_wrong_shape_are_rejected():
    with pytest.raises(ConfigError, match=r"shape \(4, 8\); expected \(8, 4\)"):
        _Turned().build(Grid(shape=(8, 4), cell=1.0), np.random.default_rng(0))


@pytest.fixture
def plugin(monkeypatch):
    """Install an entry point called dunes, and forget what was found before and after."""

    def install(value, group="terrainkit.terrains"):
        point = importlib.metadata.EntryPoint("dunes", value, group)
        found = {group: (point,)}
        monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: found.get(group, ()))

    registry._get.cache_clear()
    yield install
    registry._get.cache_clear()


def test_get_terrain_loads_entry_point(plugin):
    plugin("terrainkit.terrains.wave:Wave")
    assert registry.get_terrain("dunes") is registry.get_terrain("wave")
    dunes = SubTerrain(terrain="dunes", parameters={"amplitude": 0.1})
    assert generate(MapConfig(rows=1, cols=1, border=0.0, terrains=(dunes,))).heights.max() > 0.09


def test_get_overlay_loads_entry_point(plugin):
    plugin("terrainkit.overlays.mirror:Mirror", "terrainkit.overlays")
    assert registry.get_overlay("dunes") is registry.get_overlay("mirror")
    assert set(registry.plugin_overlays()) == {"dunes"}
    assert registry.make_overlay("dunes", {"axis": "x"}).axis == "x"


def test_get_terrain_rejects_other_entry_point(plugin):
    plugin("math:pi")
    with pytest.raises(
        ConfigError, match=r"dunes \(math:pi\) cannot be loaded: .* got 3\.14.*; expected a subc"
    ):
        registry.get_terrain("dunes")


def test_get_terrain_error_suggests_plugins(plugin):
    plugin("terrainkit.terrains.wave:Wave")
    with pytest.raises(ConfigError, match=r"did you mean 'dunes' or 'tunnel'\? terrainkit list"):
        registry.get_terrain("dune")


@pytest.mark.parametrize("value", ["no_such_package:Dunes", "math:no_such_name"])
def test_get_terrain_reports_broken_entry_point(plugin, value):
    plugin(value)
    with pytest.raises(ConfigError, match=rf"dunes \({value}\) cannot be loaded: "):
        registry.get_terrain("dunes")


@pytest.fixture
def registered(monkeypatch):
    monkeypatch.setattr(registry, "_registered", {})
    registry._get.cache_clear()
    yield
    registry._get.cache_clear()


def make_ramp(module="__main__", **fields):
    """Return a terrain class RampUp of a module."""
    space = {"__module__": module, "heights": lambda _, grid, __: np.zeros(grid.shape)}
    return dataclass(frozen=True, kw_only=True)(type("RampUp", (Terrain,), space | fields))


@pytest.mark.usefixtures("registered")
def test_register_terrain_uses_the_class_name():
    ramp = make_ramp()
    assert registry.register_terrain(ramp) is ramp
    assert registry.get_terrain("ramp_up") is ramp
    assert registry.registered_terrains() == ("ramp_up",)
    assert (
        MapConfig.from_toml('[[terrains]]\nterrain = "ramp_up"').sub_terrains[0].at(0.5) == ramp()
    )


@pytest.mark.usefixtures("registered")
def test_register_terrain_replaces_class_defined_again():
    first, again = make_ramp(), make_ramp()
    earlier = SubTerrain(terrain=first)
    later = SubTerrain(terrain=again)
    assert registry.get_terrain("ramp_up") is later.terrain_class is again
    assert earlier.terrain_class is first


@pytest.mark.usefixtures("registered")
def test_register_terrain_rejects_name_of_another_class():
    registry.register_terrain(make_ramp())
    with pytest.raises(ConfigError, match=r"'ramp_up' of a\.RampUp is taken by __main__\.RampUp; "):
        registry.register_terrain(make_ramp("a"))
    stairs = type("Stairs", (registry.get_terrain("stairs"),), {"__module__": "a"})
    with pytest.raises(ConfigError, match=r"'stairs' of a\.Stairs is taken by terrainkit\.t"):
        registry.register_terrain(dataclass(frozen=True, kw_only=True)(stairs))


@pytest.mark.usefixtures("registered")
def test_register_terrain_accepts_built_in():
    stairs = registry.get_terrain("stairs")
    assert SubTerrain(terrain=stairs) == SubTerrain(terrain="stairs")
    assert registry.registered_terrains() == ()


@pytest.mark.usefixtures("registered")
@pytest.mark.parametrize(
    ("terrain", "message"),
    [
        (int, "terrain: got <class 'int'>; expected a subclass of Terrain"),
        (type("Dunes", (Terrain,), {}), "Dunes: got no method heights; expected one"),
        (
            type("Dunes", (Terrain,), {"heights": lambda *_: None}),
            r"Dunes lacks @dataclass\(frozen=True, kw_only=True\)",
        ),
    ],
)
def test_register_terrain_rejects_other_class(terrain, message):
    with pytest.raises(ConfigError, match=message):
        SubTerrain(terrain=terrain)


@pytest.mark.usefixtures("registered")
def test_map_of_registered_terrain_needs_registration(tmp_path):
    ramp = make_ramp()
    config = MapConfig(rows=1, cols=1, border=0.0, terrains=(SubTerrain(terrain=ramp),))
    path = generate(config).save(tmp_path / "map.npz")
    assert TerrainMap.load(path).terrain_names == ("ramp_up",)
    registry._registered.clear()
    registry._get.cache_clear()
    with pytest.raises(MapFileError, match="no terrain 'ramp_up' is built in, installed, or "):
        TerrainMap.load(path)


@pytest.mark.parametrize(
    ("name", "kind"), [("Wave", "wave"), ("RoughSlope", "rough_slope"), ("KRails", "k_rails")]
)
def test_kind_is_class_name_in_snake_case(name, kind):
    assert type(name, (Terrain,), {}).kind() == kind


LIFT = """
import dataclasses
from terrainkit.terrain import parameter
from terrainkit.terrain.overlay import Overlay

@dataclasses.dataclass(frozen=True, kw_only=True)
class Lift(Overlay):
    height: float = parameter.height(0.1, 0.5)

    def apply(self, patch, rng):
        return dataclasses.replace(patch, heights=patch.heights + self.height)
"""


def define_lift():
    """Run a cell of a notebook that defines the overlay Lift."""
    cell = {"__name__": "__main__"}
    exec(LIFT, cell)
    return cell["Lift"]


@pytest.mark.usefixtures("registered")
def test_register_overlay_uses_the_class_name():
    lift = define_lift()
    assert registry.register_overlay(lift) is lift
    assert registry.get_overlay("lift") is lift
    assert registry.registered_overlays() == ("lift",)
    assert registry.registered_terrains() == ()
    toml = '[[terrains]]\nterrain = "flat"\n[[terrains.overlays]]\noverlay = "lift"\nheight = 0.2'
    assert MapConfig.from_toml(toml).sub_terrains[0].overlays == (lift(height=0.2),)


@pytest.mark.usefixtures("registered")
def test_register_overlay_replaces_class_defined_again():
    first, again = define_lift(), define_lift()
    registry.register_overlay(first)
    registry.register_overlay(again)
    assert registry.get_overlay("lift") is again
    mirror = registry.get_overlay("mirror")
    assert registry.register_overlay(mirror) is mirror
    assert registry.registered_overlays() == ("lift",)


@pytest.mark.usefixtures("registered")
def test_map_of_own_overlay_needs_registration(tmp_path):
    flat = SubTerrain(terrain="flat", overlays=(define_lift()(),))
    config = MapConfig(rows=2, cols=1, border=0.0, terrains=(flat,))
    path = generate(config).save(tmp_path / "map.npz")
    loaded = TerrainMap.load(path)
    assert loaded.config == config
    assert loaded.env_origins[:, 0, 2].tolist() == pytest.approx([0.1, 0.5])
    assert generate(loaded.config).heights.tobytes() == loaded.heights.tobytes()
    registry._registered.clear()
    registry._get.cache_clear()
    with pytest.raises(MapFileError, match="no overlay 'lift' is built in, installed, or regist"):
        TerrainMap.load(path)


@pytest.mark.usefixtures("registered")
@pytest.mark.parametrize(
    ("overlay", "message"),
    [
        (registry.get_terrain("flat"), "overlay: got .*Flat'>; expected a subclass of Overlay"),
        (type("Lift", (registry.get_overlay("mirror"),), {}), r"Lift lacks @dataclass\(frozen"),
        (
            dataclass(frozen=True, kw_only=True)(
                type("Mirror", (registry.get_overlay("mirror"),), {"__module__": "a"})
            ),
            r"the name 'mirror' of a\.Mirror is taken by terrainkit\.overlays\.mirror\.Mirror; ",
        ),
    ],
)
def test_register_overlay_rejects_other_class(overlay, message):
    with pytest.raises(ConfigError, match=message):
        registry.register_overlay(overlay)
