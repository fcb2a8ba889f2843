import importlib.metadata
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, TerrainMap, generate, make_patch, terrains
from terrainkit.errors import ConfigError, MapFileError, TerrainkitWarning
from terrainkit.map.validate import validate
from terrainkit.settings.toml_text import value_text
from terrainkit.terrain import Terrain, parameter, registry
from terrainkit.terrain.overlay import Overlay
from tests.terrainkit.maps import contents

declared = dataclass(frozen=True, kw_only=True)
FLAT, MIRROR = registry.get_terrain("flat"), registry.get_overlay("mirror")


pytestmark = pytest.mark.usefixtures("own_registry")


@pytest.fixture
def add_module(tmp_path, monkeypatch):
    """Return a function that adds the module moon to the terrains."""

    def add(text):
        (tmp_path / "moon.py").write_text(text)
        registry._module_names.cache_clear()

    monkeypatch.setattr(terrains, "__path__", [*terrains.__path__, str(tmp_path)])
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    yield add
    registry._module_names.cache_clear()
    sys.modules.pop("terrainkit.terrains.moon", None)


@pytest.fixture
def plugin(monkeypatch):
    """Return a function that installs an entry point called dunes."""

    def install(value, group="terrainkit.terrains"):
        point = importlib.metadata.EntryPoint("dunes", value, group)
        found = {group: (point,)}
        monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: found.get(group, ()))

    return install


def make_ramp(name="RampUp", parent=Terrain, module="__main__", **fields):
    """Return a terrain class of a module."""
    space = {"__module__": module, "heights": lambda _, grid, __: np.zeros(grid.shape)}
    return declared(type(name, (parent,), space | fields))


def make_lift(module="__main__"):
    """Return an overlay class that lifts the ground."""

    @declared
    class Lift(Overlay):
        height: float = parameter.height(0.1, 0.5)

        def apply(self, patch, rng):  # noqa: ARG002
            return replace(patch, heights=patch.heights + self.height)

    Lift.__module__, Lift.__qualname__ = module, "Lift"
    return Lift


def test_names_are_the_modules():
    for package, names in (
        (terrains.__path__, registry.terrain_names()),
        ([Path(terrains.__path__[0]).with_name("overlays")], registry.overlay_names()),
    ):
        files = Path(package[0]).glob("*.py")
        assert list(names) == sorted({file.stem for file in files} - {"__init__"})


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("stair", "did you mean 'stairs' or 'star' or 'staircase'? terrainkit list prints all"),
        ("Obstacle", "register_terrain; did you mean 'obstacles'? terrainkit list prints all"),
        ("x" * 1000, "register_terrain; terrainkit list prints all"),
        ("stair_inverted", "register_terrain; terrainkit list prints all"),
        ("stairs_inverted", "no terrain 'stairs_inverted'; use stairs with inverted = true"),
    ],
)
def test_get_terrain_unknown_name_suggests_terrains(name, near):
    with pytest.raises(ConfigError) as error:
        registry.get_terrain(name)
    assert str(error.value).endswith(near)


def test_module_without_its_class_is_rejected(add_module):
    add_module("from terrainkit.terrains.wave import Wave")
    with pytest.raises(ConfigError, match=r"moon\.py: got 0 subclasses of Terrain named like the "):
        registry.get_terrain("moon")


def test_plain_field_is_rejected():
    careless = make_ramp("Careless", __annotations__={"number": int}, number=3)
    with pytest.raises(ConfigError, match="Careless: number is a plain field; expected one decl"):
        careless()


def test_get_terrain_loads_entry_point(plugin):
    plugin("terrainkit.terrains.wave:Wave")
    assert registry.get_terrain("dunes") is registry.get_terrain("wave")
    dunes = SubTerrain(terrain="dunes", parameters={"amplitude": 0.1})
    assert generate(MapConfig(rows=1, cols=1, border=0.0, terrains=(dunes,))).heights.max() > 0.09
    with pytest.raises(ConfigError, match=r"did you mean 'dunes' or 'tunnel'\? terrainkit list"):
        registry.get_terrain("dune")
    with pytest.raises(ConfigError, match=r"'dunes' of __main__\.Dunes is taken by terrainkit\.t"):
        registry.register_terrain(make_ramp("Dunes"))


def test_get_overlay_loads_entry_point(plugin):
    plugin("terrainkit.overlays.mirror:Mirror", "terrainkit.overlays")
    assert registry.get_overlay("dunes") is MIRROR
    assert set(registry.plugins(registry.OVERLAYS)) == {"dunes"}
    assert registry.plugins(registry.TERRAINS) == {}
    assert registry.make_overlay("dunes", {"axis": "x"}).axis == "x"
    with pytest.raises(ConfigError, match=r"dunes has no parameter 'axes'; did you mean 'axis'"):
        registry.make_overlay("dunes", {"axes": "x"})


@pytest.mark.parametrize(
    ("value", "problem"),
    [
        ("math:pi", r".* got 3\.14.*; expected a subclass of Terrain"),
        ("no_such_package:Dunes", ""),
        ("math:no_such_name", ""),
    ],
)
def test_get_terrain_reports_broken_entry_point(plugin, value, problem):
    plugin(value)
    with pytest.raises(ConfigError, match=rf"dunes \({value}\) cannot be loaded: {problem}"):
        registry.get_terrain("dunes")


def test_register_terrain_uses_the_class_name():
    ramp = make_ramp()
    assert registry.register_terrain(ramp) is registry.register_terrain(ramp) is ramp
    assert registry.get_terrain("ramp_up") is ramp
    assert registry.registered_names(registry.TERRAINS) == ("ramp_up",)
    assert registry.registered_names(registry.OVERLAYS) == ()
    (sub_terrain,) = MapConfig.from_toml('[[terrains]]\nterrain = "ramp_up"').sub_terrains
    assert sub_terrain.at(0.5) == ramp()
    assert sub_terrain.plugin == "terrain ramp_up (__main__:RampUp)"


def test_register_terrain_replaces_class_defined_again():
    first, again = make_ramp(), make_ramp()
    earlier, later = SubTerrain(terrain=first), SubTerrain(terrain=again)
    assert registry.get_terrain("ramp_up") is later.terrain_class is again
    assert earlier.terrain_class is first


def test_register_accepts_built_in():
    stairs = registry.get_terrain("stairs")
    assert SubTerrain(terrain=stairs) == SubTerrain(terrain="stairs")
    assert registry.register_overlay(MIRROR) is MIRROR
    assert not registry.registered_names(registry.TERRAINS)
    assert not registry.registered_names(registry.OVERLAYS)


@pytest.mark.parametrize(
    ("register", "item", "message"),
    [
        (registry.register_terrain, int, "terrain: got <class 'int'>; expected a subclass of Ter"),
        (registry.register_overlay, FLAT, "overlay: got .*Flat'>; expected a subclass of Overlay"),
        (
            registry.register_terrain,
            type("Dunes", (Terrain,), {}),
            "Dunes: got no method heights; expected one",
        ),
        (
            registry.register_overlay,
            type("Lift", (MIRROR,), {}),
            r"Lift lacks @dataclass\(frozen=True, kw_only=True\)",
        ),
        (
            registry.register_terrain,
            make_ramp(module="a"),
            r"'ramp_up' of a\.RampUp is taken by __main__\.RampUp; ",
        ),
        (
            registry.register_terrain,
            make_ramp("Flat", FLAT, "a"),
            r"'flat' of a\.Flat is taken by terrainkit\.t",
        ),
    ],
)
def test_register_rejects_other_class(register, item, message):
    registry.register_terrain(make_ramp())
    with pytest.raises(ConfigError, match=message):
        register(item)


def test_register_overlay_replaces_class_defined_again():
    registry.register_overlay(make_lift())
    again = make_lift()
    assert registry.register_overlay(again) is again
    assert registry.get_overlay("lift") is again
    assert registry.registered_names(registry.OVERLAYS) == ("lift",)
    assert registry.registered_names(registry.TERRAINS) == ()
    toml = '[[terrains]]\nterrain = "flat"\n[[terrains.overlays]]\noverlay = "lift"\nheight = 0.2'
    assert MapConfig.from_toml(toml).sub_terrains[0].overlays == (again(height=0.2),)


def test_map_of_own_classes_is_custom_without_them(own_registry, tmp_path):
    ramp, lift = make_ramp(), make_lift()
    sub_terrains = (SubTerrain(terrain=ramp, overlays=(lift(),)),)
    config = MapConfig(rows=2, cols=1, border=0.0, terrains=sub_terrains)
    path = generate(config).save(tmp_path / "map.npz")
    loaded = TerrainMap.load(path)
    assert loaded.config == config
    assert loaded.env_origins[:, 0, 2].tolist() == pytest.approx([0.1, 0.5])
    assert generate(loaded.config).heights.tobytes() == loaded.heights.tobytes()
    for register, own, problem in (
        (registry.register_overlay, lift, "no terrain 'ramp_up' is built in, installed, or "),
        (registry.register_terrain, ramp, r"overlays\[0\]: no overlay 'lift' is built in, inst"),
    ):
        own_registry()
        register(own)
        loaded = load_custom(path, problem)
        assert loaded.save(tmp_path / "copy.npz", overwrite=True).read_bytes() == path.read_bytes()
        for build in (generate, lambda config: make_patch(config, 0, 0)):
            with pytest.raises(ConfigError, match=f"{problem}.*--plugin FILE.py"):
                build(loaded.config)
        edited = loaded.edited(heights=loaded.heights + 1).save(tmp_path / "b.npz", overwrite=True)
        again = load_custom(edited, problem)
        assert contents(again) == contents(loaded.edited(heights=loaded.heights + 1))
        registry.register_overlay(lift)
        registry.register_terrain(ramp)
        assert TerrainMap.load(edited).config == replace(config, mode="custom")


def load_custom(path, problem):
    with pytest.warns(TerrainkitWarning, match=f"loaded as a custom map.*{problem}") as warned:
        loaded = TerrainMap.load(path)
    assert len(warned) == 1
    assert loaded.config.mode == "custom"
    assert validate(loaded) == []
    return loaded


def test_map_is_custom_where_its_class_rejects_the_parameters(tmp_path):
    registry.register_terrain(
        make_ramp(height=parameter.height(0.1), __annotations__={"height": float})
    )
    ramp = SubTerrain(terrain="ramp_up", parameters={"height": 0.2})
    path = generate(MapConfig(rows=2, cols=1, terrains=(ramp,))).save(tmp_path / "map.npz")
    registry.register_terrain(make_ramp())  # written anew, without the parameter
    load_custom(path, "ramp_up has no parameter 'height'")


def test_map_with_own_element_of_a_course_is_custom_without_it(own_registry, tmp_path):
    registry.register_terrain(make_ramp())
    elements = {"elements": [{"terrain": "ramp_up"}, {"terrain": "flat"}]}
    course = SubTerrain(terrain="course", parameters=elements)
    config = MapConfig(rows=2, cols=1, border=0.0, terrains=(course,))
    path = generate(config).save(tmp_path / "map.npz")
    own_registry()
    load_custom(path, r"course.elements\[0\].*no terrain 'ramp_up'")
    registry.register_terrain(make_ramp())
    assert TerrainMap.load(path).config == config


@pytest.mark.parametrize(
    ("table", "problem"),
    [
        ({"terrain": "stairs", "height": 1.0}, r"config: terrains\[1\]: .*no parameter 'height'"),
        ({"terrain": "ramp_up", "proportion": -1.0}, "config: .*proportion: got -1.0"),
        ({"terrain": "x\n" * 1000, "name": "ramp_up"}, "terrains: got 2 of name 'ramp_up'"),
    ],
)
def test_map_with_invalid_values_is_no_custom_map(tmp_path, table, problem):
    text = MapConfig(terrains=(SubTerrain(terrain="flat"),)).to_toml()
    own, other = ({"terrain": "ramp_up"}, table)
    tables = "".join(f"[[terrains]]\n{''.join(map(line, t.items()))}" for t in (own, other))
    arrays = {"format_version": np.int64(1), "config": np.array(text.partition("\n#")[0] + tables)}
    np.savez(tmp_path / "map.npz", **arrays)
    with pytest.raises(MapFileError, match=problem):
        TerrainMap.load(tmp_path / "map.npz")


def line(item):
    return f"{item[0]} = {value_text(item[1])}\n"
