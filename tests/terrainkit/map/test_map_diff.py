import dataclasses
from dataclasses import replace

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, TerrainMap, generate
from terrainkit.geometry.solids import make_boxes, make_cylinders
from terrainkit.map.map_diff import diff_maps
from terrainkit.overlays.mirror import Mirror

CRAWL, ROUGH, STAIRS = (SubTerrain(terrain=name) for name in ("crawl", "rough", "stairs"))
CONFIG = MapConfig(
    rows=2, cols=3, border=0.5, spawns_per_patch=2, terrains=(CRAWL, ROUGH, STAIRS), seed=3
)


@pytest.fixture(scope="module")
def terrain_map():
    return generate(CONFIG)


def changed(terrain_map, name, index, value):
    array = getattr(terrain_map, name).copy()
    array[index] = value
    return replace(terrain_map, **{name: array})


def test_diff_maps_of_equal_maps_is_empty(terrain_map, tmp_path):
    assert not diff_maps(terrain_map, generate(CONFIG))
    read = TerrainMap.load(terrain_map.save(tmp_path / "map.npz"))
    assert not diff_maps(read, terrain_map)


@pytest.mark.parametrize(
    ("changes", "lines"),
    [
        ({"seed": 4}, ["seed: 3 -> 4"]),
        ({"slope_threshold": None}, ["slope_threshold: 0.75 -> none"]),
        ({"terrains": (CRAWL, ROUGH)}, ['terrains[2].terrain: "stairs" -> none']),
        ({"terrains": (), "preset": "rough"}, ['preset: none -> "rough"']),
        (
            {"terrains": (CRAWL, replace(ROUGH, parameters={"amplitude": 0.1}), STAIRS)},
            ["terrains[1].amplitude: none -> 0.1"],
        ),
        (
            {"terrains": (CRAWL, replace(ROUGH, overlays=(Mirror(),), friction=0.5), STAIRS)},
            [
                "terrains[1].friction: none -> 0.5",
                'terrains[1].overlays[0].overlay: none -> "mirror"',
                'terrains[1].overlays[0].axis: none -> "y"',
            ],
        ),
    ],
)
def test_diff_maps_names_config_keys(terrain_map, changes, lines):
    found = diff_maps(terrain_map, replace(terrain_map, config=replace(CONFIG, **changes)))
    assert set(lines) <= set(found.config)
    assert found.patches == {}


def test_diff_maps_compares_heights(terrain_map):
    # Patch (1, 2) begins at cell 5 + 80 along x, 5 + 160 along y.
    height = terrain_map.heights[90, 170]
    edited = changed(terrain_map, "heights", (slice(90, 92), 170), height + np.float32(0.25))
    assert diff_maps(terrain_map, edited).patches == {
        (1, 2): ("heights differ by up to 0.25 m at 2 of 6,400 samples",)
    }
    border = diff_maps(terrain_map, changed(terrain_map, "heights", (2, 3), 0.5))
    assert border.grid == ("the border: heights differ by up to 0.5 m",)
    assert border.patches == {}


def test_diff_maps_compares_friction(terrain_map):
    friction = terrain_map.friction.copy()
    friction[85 + 3, 6] = friction[85 + 4, 6] = 0.5
    diff = diff_maps(replace(terrain_map, friction=friction), terrain_map)
    assert diff.patches == {(1, 0): ("friction differs in 2 of 6,400 cells",)}


def test_diff_maps_reports_invalid_heights(terrain_map):
    edited = changed(terrain_map, "heights", (90, 170), np.nan)
    assert diff_maps(terrain_map, edited).patches == {
        (1, 2): ("heights differ by up to nan m at 1 of 6,400 samples",)
    }


def test_diff_maps_compares_spawns_and_goals(terrain_map):
    x = terrain_map.spawns[1, 1, 0, 0]
    moved = changed(terrain_map, "spawns", (1, 1, 0, 0), x + np.float32(0.5))
    assert diff_maps(terrain_map, moved).patches == {(1, 1): ("spawn origin moved by 0.5 m",)}
    fewer = changed(terrain_map, "spawns", (1, 2, 1), np.nan)
    assert diff_maps(terrain_map, fewer).patches == {(1, 2): ("1 -> 0 spawn positions",)}
    heading = terrain_map.goals[0, 0, 0, 3]
    turned = changed(terrain_map, "goals", (0, 0, 0, 3), heading + np.float32(0.25))
    assert diff_maps(terrain_map, turned).patches == {
        (0, 0): ("goals differ by up to 0.25 m or rad",)
    }


def test_diff_maps_compares_solids(terrain_map):
    solids = terrain_map.solids
    rough = dataclasses.replace(solids, friction=np.full_like(solids.friction, 0.4))
    found = diff_maps(terrain_map, replace(terrain_map, solids=rough)).patches
    assert found == {(row, 0): ("solids differ: friction",) for row in range(2)}
    none = replace(terrain_map, solids=solids.select(solids.patch[:, 0] == 1))
    number = int((solids.patch[:, 0] == 0).sum())
    assert diff_maps(terrain_map, none).patches == {(0, 0): (f"{number} -> 0 solids",)}
    box = make_boxes([4.0, 4.0, 1.0], [0.2, 0.2, 0.2])
    cylinder = make_cylinders([4.0, 4.0, 1.0], 0.1, 0.2)
    found = diff_maps(replace(terrain_map, solids=box), replace(terrain_map, solids=cylinder))
    assert found.patches == {(0, 0): ("solids differ: boxes, cylinders",)}


def test_diff_maps_compares_type_difficulty_and_parameters(terrain_map):
    edited = changed(terrain_map, "terrain_types", (0, 1), 2)
    assert diff_maps(terrain_map, edited).patches == {(0, 1): ("terrain rough -> stairs",)}
    edited = changed(terrain_map, "difficulty", (0, 1), 0.5)
    assert diff_maps(terrain_map, edited).patches == {(0, 1): ("difficulty 0 -> 0.5",)}
    parameters = terrain_map.parameters.copy()
    requested = {**parameters[1, 2].requested, "step_width": 0.5}
    parameters[1, 2] = dataclasses.replace(parameters[1, 2], requested=requested)
    found = diff_maps(terrain_map, replace(terrain_map, parameters=parameters))
    assert found.patches == {(1, 2): ("parameters differ: step_width",)}


def test_diff_maps_ignores_the_frame(terrain_map):
    found = diff_maps(terrain_map, generate(replace(CONFIG, centered=True)))
    assert found.config == ("centered: false -> true",)
    assert found.grid == ()
    assert found.patches == {}


def test_diff_maps_compares_common_patches():
    small, large = (
        generate(MapConfig(rows=1, cols=cols, border=0.0, terrains=(ROUGH,))) for cols in (2, 3)
    )
    found = diff_maps(small, large)
    assert found.config == ("cols: 2 -> 3",)
    assert found.grid == ("1 x 2 -> 1 x 3 patches; the common ones are compared",)
    assert found.patches == {}


def test_diff_maps_with_other_cells_compares_the_config():
    fine, coarse = (
        generate(MapConfig(rows=1, cols=1, border=0.0, cell=cell, terrains=(ROUGH,)))
        for cell in (0.1, 0.2)
    )
    found = diff_maps(fine, coarse)
    assert found.config == ("cell: 0.1 -> 0.2",)
    assert found.grid == (
        "patches of 80 x 80 cells of 0.1 m -> 40 x 40 cells of 0.2 m; their contents are not "
        "compared",
    )


@pytest.mark.parametrize(
    ("name", "index", "message"),
    [
        ("heights", (0, 0), "the border: heights differ by up to nan m"),
        ("heights", (20, 20), "heights differ by up to nan m at 1 of 6,400 samples"),
        ("spawns", (0, 0, 0, 2), "spawn origin moved by nan m"),
        ("difficulty", (0, 0), "difficulty 0 -> nan"),
    ],
)
def test_diff_maps_finds_values_that_are_not_finite(name, index, message):
    terrain_map = generate(MapConfig(rows=1, cols=1, border=1.0, terrains=(ROUGH,)))
    array = getattr(terrain_map, name).copy()
    array[index] = np.nan
    invalid = dataclasses.replace(terrain_map, **{name: array})
    found = diff_maps(terrain_map, invalid)
    assert [*found.grid, *found.patches.get((0, 0), ())] == [message]
    assert not diff_maps(invalid, invalid)
