"""Terrains and overlays that are not built in, and fail."""

import dataclasses
import sys
from dataclasses import dataclass

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate, make_patch
from terrainkit.errors import PluginError
from terrainkit.geometry.solids import Solids, make_boxes
from terrainkit.map.validate import validate
from terrainkit.terrain import Terrain, parameter, registry
from terrainkit.terrain.overlay import Overlay
from terrainkit.terrains.stairs import Stairs

BOX = make_boxes([1.0, 1.0, 0.1], [0.2, 0.2, 0.2])
NAN = float("nan")


class Stop(BaseException):
    """No subclass of Exception."""


def throw(error):
    raise error


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    monkeypatch.setattr(registry, "_registered", {})
    registry._get.cache_clear()
    yield
    registry._get.cache_clear()


def make_class(name, parent, **methods):
    """Return a terrain or overlay of a package called dune_pack, with one parameter."""
    fields = {"__annotations__": {"height": float}, "height": parameter.height(0.1, 0.5)}
    space = {"__module__": "dune_pack", "__qualname__": name, **fields, **methods}
    return dataclass(frozen=True, kw_only=True)(type(name, (parent,), space))


def dunes(**methods):
    flat = {"heights": lambda _, grid, __: np.zeros(grid.shape)}
    return SubTerrain(terrain=make_class("Dunes", Terrain, **flat | methods))


def lift(**changes):
    """Return flat ground with an overlay that changes fields of the patch."""
    made = make_class("Lift", Overlay, apply=lambda _, p, __: dataclasses.replace(p, **changes))
    return SubTerrain(terrain="flat", overlays=(made(),))


def map_of(*terrains):
    return MapConfig(rows=1, cols=len(terrains), border=0.0, terrains=terrains)


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (ValueError("two\nlines"), "ValueError: two lines"),
        (SystemExit(0), "SystemExit: 0"),
        (Stop("no"), "test_plugin_errors.Stop: no"),
        (StopIteration(), "StopIteration"),
        (MemoryError(), "MemoryError"),
    ],
)
@pytest.mark.parametrize("method", ["heights", "solids", "goals", "spawn", "realized"])
def test_exception_names_patch_and_terrain(method, error, told):
    config = map_of(SubTerrain(terrain="flat"), dunes(**{method: lambda *_: throw(error)}))
    with pytest.raises(PluginError) as caught:
        generate(config)
    text = str(caught.value)
    assert text.startswith("patch (0, 1): terrain dunes (dune_pack:Dunes): ")
    assert text.endswith(told)
    assert caught.value.__cause__ is error


@pytest.mark.parametrize("name", ["__post_init__", "at"])
def test_exception_of_constructor_names_the_terrain(name):
    bad = {"__post_init__": lambda _: sys.exit(3), "at": classmethod(lambda *_: sys.exit(3))}
    with pytest.raises(PluginError, match=r"^terrain dunes \(dune_pack:Dunes\): SystemExit: 3$"):
        dunes(**{name: bad[name]})


def test_invalid_parameter_is_no_error_of_the_terrain():
    terrain = dunes().terrain_class
    with pytest.raises(ValueError, match=r"^dunes\.height: got -1; expected") as caught:
        SubTerrain(terrain=terrain, parameters={"height": -1})
    assert not isinstance(caught.value, PluginError)


def test_ctrl_c_is_no_error_of_the_terrain():
    with pytest.raises(KeyboardInterrupt):
        generate(map_of(dunes(heights=lambda *_: throw(KeyboardInterrupt()))))


def test_exception_of_built_in_terrain_stays(monkeypatch):
    monkeypatch.setattr(Stairs, "heights", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        generate(map_of(SubTerrain(terrain="stairs")))


def test_exception_of_built_in_overlay_on_plugin_terrain_stays(monkeypatch):
    mirror = registry.get_overlay("mirror")
    monkeypatch.setattr(mirror, "apply", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        generate(map_of(dataclasses.replace(dunes(), overlays=(mirror(),))))


def test_exception_of_overlay_names_the_overlay():
    fails = make_class("Lift", Overlay, apply=lambda *_: 1 / 0)
    terrain = dataclasses.replace(dunes(), overlays=(fails(),))
    told = r"patch \(0, 0\): overlay lift \(dune_pack:Lift\): ZeroDivisionError: division by zero$"
    with pytest.raises(PluginError, match=told):
        make_patch(map_of(terrain), 0, 0)


@pytest.mark.parametrize("method", ["heights", "solids", "requested", "realized"])
def test_exception_of_element_names_the_element(method):
    element = dunes(**{method: lambda *_: throw(OSError("no file"))}).terrain
    told = r"course\.elements\[0\]: terrain dunes \(dune_pack:Dunes\): OSError: no file"
    with pytest.raises(PluginError, match=told):
        generate(map_of(SubTerrain(terrain="course", parameters={"elements": [
            {"terrain": element}]})))  # fmt: skip


def test_solids_of_element_are_checked():
    element = dunes(solids=lambda *_: None).terrain
    course = SubTerrain(terrain="course", parameters={"elements": [{"terrain": element}]})
    with pytest.raises(PluginError, match=r"elements\[0\]: terrain dunes .*got NoneType; expected"):
        generate(map_of(course))


@pytest.mark.parametrize(
    "heights",
    [None, "high", 1e300, 1e7, NAN, 1j, np.datetime64("2020-01-01")],
)
def test_invalid_heights_are_rejected(heights):
    bad = dunes(heights=lambda _, grid, __: np.full(grid.shape, heights))
    with pytest.raises(PluginError, match=r"^patch \(0, 0\): terrain dunes \(dune_pack:Dunes\): "):
        generate(map_of(bad))


@pytest.mark.parametrize(
    ("method", "result"),
    [
        ("goals", None),
        ("goals", [[1.0, 2.0, 3.0]]),
        ("goals", [[1.0, 1.0, np.inf, 0.0]]),
        ("goals", [[1.0, 1.0, 0.0, NAN]]),
        ("goals", [[1.0, 1.0, 0.0, 0.0]] * 1001),
        ("spawn", None),
        ("spawn", (NAN, 1.0)),
        ("spawn", (1.0, 1.0, 1.0)),
        ("realized", None),
        ("realized", {}),
        ("realized", {"height": NAN}),
        ("realized", {"height": np.float32(0.1)}),
        ("declarations", {}),
    ],
)
def test_invalid_result_is_rejected(method, result):
    with pytest.raises(PluginError, match=r"^patch \(0, 0\): terrain dunes \(dune_pack:Dunes\): "):
        generate(map_of(dunes(**{method: lambda *_: result})))


@pytest.mark.parametrize(
    "solids",
    [
        None,
        [BOX],
        dataclasses.replace(BOX, boxes=BOX.boxes.astype(float)),
        dataclasses.replace(BOX, boxes=BOX.boxes[:, :9]),
        dataclasses.replace(BOX, boxes=BOX.boxes * np.float32(NAN)),
        dataclasses.replace(BOX, boxes=BOX.boxes * np.float32(2)),  # no unit quaternion
        dataclasses.replace(BOX, friction=np.ones(5, np.float32)),
        dataclasses.replace(BOX, friction=-np.ones(1, np.float32)),
        dataclasses.replace(Solids.empty(), hull_counts=np.array([4], np.int32)),
    ],
)
def test_invalid_solids_are_rejected(solids):
    with pytest.raises(PluginError, match=r"^patch \(0, 0\): terrain dunes \(dune_pack:Dunes\): "):
        generate(map_of(dunes(solids=lambda *_: solids)))
    with pytest.raises(PluginError, match=r"^patch \(0, 0\): overlay lift \(dune_pack:Lift\): "):
        generate(map_of(lift(solids=solids)))


@pytest.mark.parametrize(
    "changes",
    [
        {"heights": None},
        {"heights": np.zeros((3, 3))},
        {"friction": None},
        {"friction": np.ones(3)},
        {"friction": np.full((80, 80), -0.1)},
        {"friction": np.full((80, 80), 1e300)},
        {"goals": None},
        {"spawn": (0.0, NAN)},
        {"heading": None},
        {"heading": NAN},
        {"spawn_radius": None},
    ],
)
def test_invalid_patch_of_overlay_is_rejected(changes):
    with pytest.raises(PluginError, match=r"^patch \(0, 0\): overlay lift \(dune_pack:Lift\): "):
        generate(map_of(lift(**changes)))


def test_overlay_without_result_is_rejected():
    silent = make_class("Lift", Overlay, apply=lambda *_: None)
    with pytest.raises(PluginError, match="got NoneType; expected a PatchGeometry"):
        generate(map_of(SubTerrain(terrain="flat", overlays=(silent(),))))


def test_results_of_other_types_are_converted(tmp_path):
    lists = dunes(
        heights=lambda _, grid, __: np.zeros(grid.shape, int).tolist(),
        spawn=lambda _, grid: np.array(grid.center),
        realized=lambda *_: {"height": np.float64(0.1)},
    )
    friction = lift(friction=np.full((80, 80), 0.7).tolist())
    made = generate(map_of(lists, friction))
    assert made.heights.dtype == made.friction.dtype == np.float32
    assert (made.friction[:, 80:] == np.float32(0.7)).all()
    assert validate(type(made).load(made.save(tmp_path / "map.npz"))) == []


def test_validate_raises_exception_of_terrain(monkeypatch):
    terrain = dunes()
    made = generate(map_of(terrain))
    monkeypatch.setattr(terrain.terrain_class, "heights", lambda *_: 1 / 0)
    with pytest.raises(PluginError, match=r"^patch \(0, 0\): terrain dunes .*ZeroDivisionError"):
        validate(made)
