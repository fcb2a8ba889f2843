import dataclasses
import tracemalloc

import numpy as np
import pytest

import terrainkit as tk
from terrainkit.geometry.mesh import TriMesh
from terrainkit.map.validate import validate
from terrainkit.terrain import presets


@pytest.fixture(scope="module")
def sound():
    return tk.generate(tk.MapConfig(rows=3, patch_size=(8.0, 8.0), border=1.0))


def found(terrain_map, mesh=None):
    return [(finding.check, finding.message) for finding in validate(terrain_map, mesh)]


def changed(terrain_map, name, index, value):
    array = getattr(terrain_map, name).copy()
    array[index] = value
    return dataclasses.replace(terrain_map, **{name: array})


def moved_origin(terrain_map, row, col, origin):
    return changed(terrain_map, "spawns", (row, col, 0, slice(3)), origin)


@pytest.mark.parametrize(
    "config",
    [
        tk.MapConfig(rows=2, border=1.0, preset="legged_gym"),
        tk.MapConfig(rows=2, cols=16, border=0.0, preset="all", seed=4, centered=True),
        tk.MapConfig(rows=2, cols=5, border=1.0, mode="randomized", preset="rough"),
        tk.MapConfig(rows=4, cols=1, border=1.0, difficulty_jitter=1.0, slope_threshold=None),
        tk.MapConfig(rows=1, cols=1, border=0.0, terrains=(tk.SubTerrain(terrain="wave"),)),
        tk.MapConfig(
            rows=1,
            border=1.0,
            preset="all",
            cols=16,
            difficulty_range=(1.0, 1.0),
            spawns_per_patch=9,
        ),
    ],
    ids=["legged_gym", "all", "randomized", "jitter", "one patch", "spawns"],
)
@pytest.mark.filterwarnings("ignore::terrainkit.TerrainkitWarning")
def test_validate_generated_map_has_no_issues(config):
    terrain_map = tk.generate(config)
    assert found(terrain_map) == []
    assert found(terrain_map, terrain_map.mesh(merged=False)) == []


@pytest.mark.parametrize("preset", presets.preset_names())
def test_validate_presets_realize_their_parameters(preset):
    # Proportions below or above 1 need more columns.
    cols = {"legged_gym_rough": 20, "parkour_course": 10}.get(preset)
    cols = cols or len(presets.get_preset(preset))
    terrain_map = tk.generate(tk.MapConfig(rows=3, cols=cols, border=0.0, preset=preset))
    assert found(terrain_map) == []


def test_validate_large_disc_is_one_issue(sound):
    config = dataclasses.replace(sound.config, spawn_radius=1e6)
    messages = found(dataclasses.replace(sound, config=config))
    assert ("spawn", "no disk of radius 1e+06 m fits in a patch of 8 m x 8 m") in messages
    assert not any("border" in message for _, message in messages)


def test_validate_finds_non_finite_height(sound):
    assert found(changed(sound, "heights", (3, 4), np.nan)) == [
        ("finite", "heights: 1 values are not finite, the first at (3, 4)")
    ]


def test_validate_finds_non_finite_vertex(sound):
    mesh = sound.mesh()
    vertices = mesh.vertices.copy()
    vertices[7, 2] = np.nan
    messages = found(sound, TriMesh(vertices=vertices, triangles=mesh.triangles))
    assert ("finite", "vertices: 1 values are not finite, the first at (7, 2)") in messages


def test_validate_finds_origin_above_ground(sound):
    origin = sound.env_origins[1, 2] + np.float32([0, 0, 0.5])
    assert found(moved_origin(sound, 1, 2, origin)) == [
        ("spawn", "patch (1, 2): the spawn origin is 0.500 m above the ground")
    ]


def test_validate_finds_origin_on_uneven_ground(sound):
    x, y = sound.config.patch_grid(2, 5).center
    origin = [x + 2.0, y, sound.height([x + 2.0, y])]
    moved, (check, message) = found(moved_origin(sound, 2, 5, origin))
    assert moved == (
        "patches",
        "patch (2, 5): the spawn origin is 2.000 m from its place in the config",
    )
    assert check == "spawn"
    assert message.startswith(
        "patch (2, 5): the spawn origin is not on flat ground: heights within 0.5 m differ by 0."
    )


def test_validate_finds_moved_origin(sound):
    origin = sound.env_origins[0, 3] + np.float32([0.3, 0, 0])
    assert found(moved_origin(sound, 0, 3, origin)) == [
        ("patches", "patch (0, 3): the spawn origin is 0.300 m from its place in the config")
    ]


def test_validate_finds_origin_outside_pit():
    # A disk of 1 m and the cells around it do not fit in a pit of 1 m.
    pit = tk.SubTerrain(terrain="pit", parameters={"side": 1.0})
    config = tk.MapConfig(rows=2, cols=1, border=1.0, terrains=(pit,))
    with pytest.warns(tk.TerrainkitWarning, match="at the preferred spawn position: pit on 1 "):
        terrain_map = tk.generate(config)
    ((check, message),) = found(terrain_map)
    assert check == "patches"
    assert message.startswith("patch (1, 0): no flat disk at the spawn position of pit: the origin")


def test_validate_finds_origin_outside_patch(sound):
    findings = found(moved_origin(sound, 0, 0, sound.env_origins[0, 1]))
    assert ("spawn", "patch (0, 0): the spawn origin is outside the patch") in findings


@pytest.fixture(scope="module")
def with_spawns():
    flat = tk.SubTerrain(terrain="flat")
    config = tk.MapConfig(rows=1, cols=1, border=0.0, spawns_per_patch=3, terrains=(flat,))
    return tk.generate(config)


def test_validate_finds_spawns_on_one_another(with_spawns):
    # The origin is at (4, 4).
    edited = changed(with_spawns, "spawns", (0, 0, slice(1, 3), 0), [2.0, 2.75])
    edited = changed(edited, "spawns", (0, 0, slice(1, 3), 1), 4.0)
    assert found(edited) == [
        ("patches", "patch (0, 0): the spawn positions differ from its config"),
        (
            "spawn",
            "patch (0, 0): spawn 2 is 0.750 m from spawn 1; expected at least 1 m, two spawn radii",
        ),
    ]


def test_validate_finds_missing_spawn(with_spawns):
    edited = changed(with_spawns, "spawns", (0, 0, 2), np.nan)
    assert found(edited) == [
        ("patches", "patch (0, 0): the spawn positions differ from its config")
    ]


def test_validate_finds_spawn_above_ground(with_spawns):
    edited = changed(with_spawns, "spawns", (0, 0, 1, 2), 0.25)
    assert ("spawn", "patch (0, 0): spawn 1 is 0.250 m above the ground") in found(edited)


def test_validate_finds_edited_patch(sound):
    i, j = sound.config.patch_start(1, 6)
    findings = found(changed(sound, "heights", (i + 1, j + 1), 3.0))
    assert [check for check, _ in findings] == ["patches"]
    assert findings[0][1].startswith("patch (1, 6): heights differ by up to 3.")


def test_validate_finds_swapped_axes():
    square = tk.generate(tk.MapConfig(rows=10, border=1.0, preset="legged_gym"))
    findings = found(dataclasses.replace(square, heights=square.heights.T.copy()))
    assert any("with axes swapped" in message for _, message in findings)


def test_validate_finds_uneven_border(sound):
    assert ("patches", "the border is not flat at height 0") in found(
        changed(sound, "heights", (0, 0), 0.01)
    )


def test_validate_finds_incomplete_difficulty(sound):
    stale = sound.difficulty * np.float32(0.9)
    findings = found(dataclasses.replace(sound, difficulty=stale))
    assert ("difficulty", "row 2: got difficulty 0.9; expected exactly 1") in findings


def test_validate_finds_decreasing_difficulty(sound):
    messages = found(changed(sound, "difficulty", (1, 3), 1.5))
    assert ("difficulty", "difficulty decreases from row 1 to row 2 in column 3") in messages


def test_validate_finds_deviating_width():
    # A moat of 1 m around a platform of 3 m: a patch of 8 m x 4 m has 0.5 m for it along y.
    config = tk.MapConfig(
        rows=2, cols=1, patch_size=(8.0, 4.0), terrains=(tk.SubTerrain(terrain="gap"),)
    )
    with pytest.warns(tk.TerrainkitWarning, match="gap.width on 1 patches; the map records"):
        terrain_map = tk.generate(config)
    assert found(terrain_map) == [
        ("realized", "patch (1, 0), gap: width is (1.0, 0.5); requested 1")
    ]


def test_validate_finds_hole_in_mesh(sound):
    mesh = sound.mesh()
    holed = TriMesh(vertices=mesh.vertices, triangles=mesh.triangles[100:])
    messages = " ".join(message for _, message in found(sound, holed))
    assert "edges have only one face" in messages
    assert "the mesh covers" in messages


def test_validate_finds_flipped_face(sound):
    mesh = sound.mesh()
    turned = mesh.triangles.copy()
    turned[0] = turned[0, ::-1]
    messages = [m for _, m in found(sound, TriMesh(vertices=mesh.vertices, triangles=turned))]
    assert "1 faces point downward" in messages
    assert any("or by faces of opposite winding" in message for message in messages)


def test_validate_finds_mesh_of_another_map(sound):
    lifted = sound.mesh().vertices + np.float32([0, 0, 0.25])
    findings = found(sound, TriMesh(vertices=lifted, triangles=sound.mesh().triangles))
    assert [check for check, _ in findings] == ["mesh"]
    assert findings[0][1].startswith("the mesh differs from the heights by up to 0.250 m")


def test_validate_finds_mesh_without_faces(sound):
    empty = TriMesh(vertices=sound.mesh().vertices, triangles=np.empty((0, 3), dtype=np.int32))
    assert found(sound, empty) == [("mesh", "the mesh has no faces")]


def test_validate_takes_at_most_twice_the_memory_of_the_mesh():
    terrain_map = tk.generate(tk.MapConfig(rows=16, cols=16))
    peaks = []
    for work in (terrain_map.mesh, lambda: validate(terrain_map)):
        tracemalloc.start()
        work()
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 2 * peaks[0]
