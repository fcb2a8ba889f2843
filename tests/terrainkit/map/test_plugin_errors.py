"""Terrains and overlays that are not built in, and fail."""

import dataclasses
import sys
from dataclasses import dataclass

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate, make_patch
from terrainkit.errors import ConfigError, PluginError
from terrainkit.geometry.solids import make_boxes
from terrainkit.map.validate import validate
from terrainkit.terrain import Terrain, parameter, registry
from terrainkit.terrain.overlay import Overlay
from terrainkit.terrains.stairs import Stairs

BOX = make_boxes([1.0, 1.0, 0.1], [0.2, 0.2, 0.2])
NAN = float("nan")


class Stop(BaseException):
    """No subclass of Exception."""


pytestmark = pytest.mark.usefixtures("own_registry")


def throw(error):
    raise error


def make_class(name, parent, **methods):
    """Return a terrain or overlay of a package called dune_pack, with one parameter."""
    fields = {"__annotations__": {"height": float}, "height": parameter.height(0.1, 0.5)}
    space = {"__module__": "dune_pack", "__qualname__": name, **fields, **methods}
    return dataclass(frozen=True, kw_only=True)(type(name, (parent,), space))


def dunes(**methods):
    flat = {"heights": lambda _, grid, __: np.zeros(grid.shape)}
    return SubTerrain(terrain=make_class("Dunes", Terrain, **flat | methods))


def lifted(apply):
    """Return flat ground with an overlay."""
    return SubTerrain(terrain="flat", overlays=(make_class("Lift", Overlay, apply=apply)(),))


def lift(**changes):
    """Return flat ground with an overlay that changes fields of the patch."""
    return lifted(lambda _, patch, __: dataclasses.replace(patch, **changes))


def map_of(*terrains):
    return MapConfig(rows=1, cols=len(terrains), border=0.0, terrains=terrains)


@pytest.mark.parametrize(
    ("method", "error", "told"),
    [
        ("heights", ValueError("two\nlines"), "ValueError: two lines"),
        ("solids", SystemExit(0), "SystemExit: 0"),
        ("goals", Stop("no"), "test_plugin_errors.Stop: no"),
        ("spawn", StopIteration(), "StopIteration"),
        ("realized", MemoryError(), "MemoryError"),
    ],
)
def test_exception_names_patch_and_terrain(method, error, told):
    config = map_of(SubTerrain(terrain="flat"), dunes(**{method: lambda *_: throw(error)}))
    with pytest.raises(PluginError) as caught:
        generate(config)
    text = str(caught.value)
    assert text.startswith("patch (0, 1): terrain dunes (dune_pack:Dunes): ")
    assert text.endswith(told)
    assert caught.value.__cause__ is error


def test_exception_of_constructor_names_the_terrain():
    for fails in (
        {"__post_init__": lambda _: sys.exit(3)},
        {"at": classmethod(lambda *_: sys.exit(3))},
    ):
        message = r"^terrain dunes \(dune_pack:Dunes\): SystemExit: 3$"
        with pytest.raises(PluginError, match=message):
            dunes(**fails)


def test_invalid_parameter_is_no_error_of_the_terrain():
    terrain = dunes().terrain_class
    with pytest.raises(ValueError, match=r"^dunes\.height: got -1; expected") as caught:
        SubTerrain(terrain=terrain, parameters={"height": -1})
    assert not isinstance(caught.value, PluginError)


def test_ctrl_c_is_no_error_of_the_terrain():
    with pytest.raises(KeyboardInterrupt):
        generate(map_of(dunes(heights=lambda *_: throw(KeyboardInterrupt()))))


def test_exception_of_what_is_built_in_stays(monkeypatch):
    mirror = registry.get_overlay("mirror")
    monkeypatch.setattr(mirror, "apply", lambda *_: 1 / 0)
    monkeypatch.setattr(Stairs, "heights", lambda *_: 1 / 0)
    mirrored = dataclasses.replace(dunes(), overlays=(mirror(),))
    for terrain in (SubTerrain(terrain="stairs"), mirrored):
        with pytest.raises(ZeroDivisionError):
            generate(map_of(terrain))


def course(**methods):
    elements = [{"terrain": dunes(**methods).terrain}]
    return map_of(SubTerrain(terrain="course", parameters={"elements": elements}))


@pytest.mark.parametrize("method", ["heights", "solids", "requested", "realized"])
def test_exception_of_element_names_the_element(method):
    told = r"course\.elements\[0\]: terrain dunes \(dune_pack:Dunes\): OSError: no file"
    with pytest.raises(PluginError, match=told):
        generate(course(**{method: lambda *_: throw(OSError("no file"))}))


def test_solids_of_element_are_checked():
    with pytest.raises(PluginError, match=r"elements\[0\]: terrain dunes .*got NoneType; expected"):
        generate(course(solids=lambda *_: None))


SOLIDS = [
    None,
    [BOX],
    dataclasses.replace(BOX, boxes=BOX.boxes.astype(float)),
    dataclasses.replace(BOX, boxes=BOX.boxes * np.float32(NAN)),
]
GRID = (80, 80)
FAR = make_boxes([7.902, 1.0, 0.1], [0.2, 0.2, 0.2])  # 2 mm beyond its patch
RESULTS = {
    "heights": [None, *(np.full(GRID, value) for value in ("high", 1e7, NAN, 1j))],
    "goals": [
        None,
        [[1.0, 2.0, 3.0]],
        [[1.0, 1.0, np.inf, 0.0]],
        [[1.0, 1.0, 0.0, NAN]],
        [[1.0, 1.0, 0.0, 0.0]] * 1001,
    ],
    "spawn": [None, (NAN, 1.0), (1.0, 1.0, 1.0)],
    "realized": [None, {}, {"height": NAN}, {"height": np.float32(0.1)}],
    "declarations": [{}],
    "solids": SOLIDS,
}
PATCHES = {
    "heights": [None, np.zeros((3, 3))],
    "friction": [None, np.ones(3), np.full(GRID, -0.1), np.full(GRID, 1e300)],
    "goals": [None],
    "spawn": [(0.0, NAN)],
    "heading": [None, NAN],
    "spawn_radius": [None],
    "solids": SOLIDS,
}


@pytest.mark.parametrize("method", RESULTS)
def test_invalid_results_of_a_terrain_are_rejected(method):
    for result in RESULTS[method]:
        with pytest.raises(PluginError, match=r"^patch \(0, 0\): terrain dunes \(dune_pack:Dunes"):
            generate(map_of(dunes(**{method: lambda *_, result=result: result})))


@pytest.mark.parametrize("field", PATCHES)
def test_invalid_patches_of_an_overlay_are_rejected(field):
    for value in PATCHES[field]:
        with pytest.raises(
            PluginError, match=r"^patch \(0, 0\): overlay lift \(dune_pack:Lift\): "
        ):
            generate(map_of(lift(**{field: value})))


@pytest.mark.parametrize(
    ("apply", "told"),
    [
        (lambda *_: 1 / 0, "ZeroDivisionError: division by zero$"),
        (lambda *_: None, "got NoneType; expected a PatchGeometry"),
    ],
)
def test_exception_of_overlay_names_the_overlay(apply, told):
    message = rf"patch \(0, 0\): overlay lift \(dune_pack:Lift\): .*{told}"
    with pytest.raises(PluginError, match=message):
        make_patch(map_of(lifted(apply)), 0, 0)


@pytest.mark.parametrize(
    ("method", "result", "message"),
    [
        ("solids", FAR, r"dunes: solids\(\): got a solid 0\.002 m beyond its patch"),
        ("goals", [[8.01, 1.0, 0, 0]], r"dunes: goals\(\): got a goal outside of the patch"),
        ("goals", [[1.0, -0.01, 0, 0]], r"dunes: goals\(\): got a goal outside of the patch"),
    ],
)
def test_solids_and_goals_are_within_the_patch(method, result, message):
    with pytest.raises(ConfigError, match=message):
        generate(map_of(dunes(**{method: lambda *_: result})))


def test_goals_without_a_height_are_on_the_ground():
    goals = [[8.0, 8.0, NAN, 0.0], [0.0, 0.0, 0.5, 1.0]]
    bar = make_boxes([7.9009, 1.0, 0.1], [0.2, 0.2, 0.2])  # 0.9 mm beyond
    made = generate(map_of(dunes(goals=lambda *_: goals, solids=lambda *_: bar)))
    assert made.goals[0, 0].tolist() == [[8.0, 8.0, 0.0, 0.0], [0.0, 0.0, 0.5, 1.0]]
    assert made.solids.patch.tolist() == [[0, 0]]


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
