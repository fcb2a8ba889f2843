from dataclasses import replace

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, TerrainMap, generate
from terrainkit.geometry.solids import make_boxes, make_cylinders
from terrainkit.map.map_diff import MapDiff, diff_maps
from terrainkit.overlays.mirror import Mirror
from tests.tables import read_table
from tests.terrainkit.maps import changed

NAN = float("nan")

CRAWL, ROUGH, STAIRS = (SubTerrain(terrain=name) for name in ("crawl", "rough", "stairs"))
CONFIG = MapConfig(
    rows=2, cols=3, border=0.5, spawns_per_patch=2, terrains=(CRAWL, ROUGH, STAIRS), seed=3
)


@pytest.fixture(scope="module")
def terrain_map():
    return generate(CONFIG)


def test_diff_maps_of_equal_maps_is_empty(terrain_map, tmp_path):
    read = TerrainMap.load(terrain_map.save(tmp_path / "map.npz"))
    assert not diff_maps(read, generate(CONFIG))


@pytest.mark.parametrize(
    ("changes", "lines"),
    [
        ({"seed": 4}, ["seed: 3 -> 4"]),
        ({"slope_threshold": None}, ["slope_threshold: 0.75 -> none"]),
        ({"terrains": (CRAWL, ROUGH)}, ['terrains[2].terrain: "stairs" -> none']),
        ({"terrains": (), "preset": "rough"}, ['preset: none -> "rough"']),
        (
            {"terrains": (CRAWL, replace(ROUGH, overlays=(Mirror(),), friction=0.5), STAIRS)},
            ["terrains[1].friction: none -> 0.5", 'terrains[1].overlays[0].axis: none -> "y"'],
        ),
    ],
)
def test_diff_maps_names_config_keys(terrain_map, changes, lines):
    found = diff_maps(terrain_map, replace(terrain_map, config=replace(CONFIG, **changes)))
    assert set(lines) <= set(found.config)
    assert found.patches == {}


@pytest.mark.parametrize(
    ("name", "index", "value", "messages"),
    [
        # Patch (1, 2) begins at cell 5 + 80 along x, 5 + 160 along y.
        (
            "heights",
            (slice(90, 92), 170),
            9.0,
            {(1, 2): "heights differ by up to 8.75 m at 2 of 6,400 samples"},
        ),
        (
            "heights",
            (90, 170),
            NAN,
            {(1, 2): "heights differ by up to nan m at 1 of 6,400 samples"},
        ),
        ("heights", (2, 3), 0.5, {None: "the border: heights differ by up to 0.5 m"}),
        ("friction", (slice(88, 90), 6), 0.5, {(1, 0): "friction differs in 2 of 6,400 cells"}),
        ("spawns", (1, 1, 0, 0), 12.5, {(1, 1): "spawn origin moved by 0.5 m"}),
        ("spawns", (1, 1, 0, 2), NAN, {(1, 1): "spawn origin moved by nan m"}),
        ("spawns", (1, 1, 0, 0), 12.00009, {}),
        ("spawns", (1, 2, 1), NAN, {(1, 2): "1 -> 0 spawn positions"}),
        ("goals", (0, 0, 0, 3), 0.25, {(0, 0): "goals differ by up to 0.25 m or rad"}),
        ("terrain_types", (0, 1), 2, {(0, 1): "terrain rough -> stairs"}),
        ("difficulty", (0, 1), 0.5, {(0, 1): "difficulty 0 -> 0.5"}),
    ],
)
def test_diff_maps_compares_arrays(terrain_map, name, index, value, messages):
    terrain_map = changed(terrain_map, "heights", (slice(90, 92), 170), 0.25)
    edited = changed(terrain_map, name, index, value)
    found = diff_maps(terrain_map, edited)
    border = (messages[None],) if None in messages else ()
    patches = {place: (text,) for place, text in messages.items() if place}
    assert (found.config, found.grid, found.patches) == ((), border, patches)
    assert not diff_maps(edited, edited)


def test_diff_maps_compares_parameters(terrain_map):
    parameters = terrain_map.parameters.copy()
    requested = {**parameters[1, 2].requested, "step_width": 0.5}
    parameters[1, 2] = replace(parameters[1, 2], requested=requested)
    found = diff_maps(terrain_map, replace(terrain_map, parameters=parameters))
    assert found.patches == {(1, 2): ("parameters differ: step_width",)}


def test_diff_maps_compares_solids(terrain_map):
    solids = terrain_map.solids
    rough = replace(solids, friction=np.full_like(solids.friction, 0.4))
    found = diff_maps(terrain_map, replace(terrain_map, solids=rough)).patches
    assert found == {(row, 0): ("solids differ: friction",) for row in range(2)}
    none = replace(terrain_map, solids=solids.select(solids.patch[:, 0] == 1))
    number = int((solids.patch[:, 0] == 0).sum())
    assert diff_maps(terrain_map, none).patches == {(0, 0): (f"{number} -> 0 solids",)}
    box = make_boxes([4.0, 4.0, 1.0], [0.2, 0.2, 0.2])
    cylinder = make_cylinders([4.0, 4.0, 1.0], 0.1, 0.2)
    found = diff_maps(replace(terrain_map, solids=box), replace(terrain_map, solids=cylinder))
    assert found.patches == {(0, 0): ("solids differ: boxes, cylinders",)}


def test_diff_maps_ignores_the_frame(terrain_map):
    found = diff_maps(terrain_map, generate(replace(CONFIG, centered=True)))
    assert found == MapDiff(config=("centered: false -> true",), grid=(), patches={})


@pytest.mark.parametrize(
    ("change", "config", "grid"),
    read_table(__file__, "diff_maps_with_other_grids_compares_what_is_common"),
)
def test_diff_maps_with_other_grids_compares_what_is_common(change, config, grid):
    small = MapConfig(rows=1, cols=2, border=0.0, terrains=(ROUGH,))
    found = diff_maps(generate(small), generate(replace(small, **change)))
    assert found == MapDiff(config=(config,), grid=(grid,), patches={})
