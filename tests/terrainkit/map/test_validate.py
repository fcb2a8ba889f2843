from dataclasses import replace

import numpy as np
import pytest

import terrainkit as tk
from terrainkit.geometry.mesh import TriMesh
from terrainkit.geometry.solids import make_boxes
from terrainkit.map.validate import validate
from terrainkit.overlays.noise import Noise
from terrainkit.terrain import presets
from tests.tables import read_table
from tests.terrainkit.maps import changed, plot


@pytest.fixture(scope="module")
def sound():
    return tk.generate(tk.MapConfig(rows=3, patch_size=(8.0, 8.0), border=1.0))


def found(terrain_map, mesh=None):
    return [(finding.check, finding.message) for finding in validate(terrain_map, mesh)]


@pytest.mark.parametrize(
    "config",
    [
        tk.MapConfig(rows=2, cols=16, border=0.0, preset="all", seed=4, centered=True),
        tk.MapConfig(rows=2, cols=5, border=1.0, mode="randomized", preset="rough"),
        tk.MapConfig(rows=4, cols=1, border=1.0, difficulty_jitter=1.0, slope_threshold=None),
        tk.MapConfig(
            rows=1,
            border=1.0,
            preset="all",
            cols=16,
            difficulty_range=(1.0, 1.0),
            spawns_per_patch=9,
        ),
    ],
    ids=["all", "randomized", "jitter", "spawns"],
)
@pytest.mark.filterwarnings("ignore::terrainkit.TerrainkitWarning")
def test_validate_generated_map_has_no_issues(config):
    terrain_map = tk.generate(config)
    assert found(terrain_map) == []
    assert found(terrain_map, terrain_map.mesh(merged=False)) == []


@pytest.mark.parametrize("preset", presets.preset_names())
def test_validate_presets_realize_their_parameters_without_cliffs(preset):
    # Proportions below or above 1 need more columns.
    more = {"legged_gym_rough": 20, "parkour_course": 10, "humanoid_gym": 10, "ame_2": 20}
    cols = (more | {"hard": 24}).get(preset) or len(presets.get_preset(preset))
    # A cliff would be a warning, which is an error here.
    assert found(tk.generate(tk.MapConfig(rows=3, cols=cols, border=1.0, preset=preset))) == []


@pytest.mark.parametrize(
    ("name", "index", "change", "messages"),
    [
        *read_table(__file__, "validate_finds_changed_values"),
        ("spawns", (1, 2, 0, slice(3)), 9e-4, []),
    ],
)
def test_validate_finds_changed_values(sound, name, index, change, messages):
    index = tuple(index)
    edited = changed(sound, name, index, getattr(sound, name)[index] + np.float32(change))
    issues = found(edited)
    assert len(issues) == len(messages)
    assert all(part in text for part, (_, text) in zip(messages, issues, strict=True))


def test_validate_finds_vertices_that_are_not_finite(sound):
    mesh = sound.mesh()
    vertices = mesh.vertices.copy()
    vertices[7, 2] = vertices[8, 1] = np.inf
    message = "vertices: 2 values are not finite, the first at (7, 2)"
    assert found(sound, replace(mesh, vertices=vertices)) == [("finite", message)]


def test_validate_compares_type_parameters_solids_and_goals():
    crawl, noise = tk.SubTerrain(terrain="crawl"), Noise(amplitude=0.02)
    config = tk.MapConfig(rows=1, cols=1, border=0.0, terrains=(crawl,))
    made = tk.generate(config)
    other = tk.MapConfig(rows=1, cols=1, border=0.0, terrains=(tk.SubTerrain(terrain="flat"),))
    moved = made.solids.transform(np.eye(3), [0, 0, 2e-3])
    moved = replace(moved, patch=made.solids.patch)
    goals = made.goals + np.float32([0, 0, 2e-3, 0])
    friction = made.friction.copy()
    friction[20, 20] = 0.5
    for edited, message in (
        (replace(made, friction=friction), "the friction coefficients differ from its config"),
        (replace(made, solids=moved), "the solids differ from its config"),
        (replace(made, goals=goals), "the goals differ from its config"),
        (
            replace(made, config=other, terrain_names=("crawl",)),
            "got terrain crawl; expected flat by its config",
        ),
    ):
        texts = [message for check, message in found(edited) if check == "patches"]
        assert f"patch (0, 0): {message}" in texts
    noisy = replace(crawl, overlays=(noise,))
    (first, *_) = found(replace(made, config=replace(config, terrains=(noisy,))))
    assert first[1].startswith("patch (0, 0): the recorded parameters differ from its config: over")


def test_validate_finds_patch_that_cannot_be_generated(sound):
    config = replace(sound.config, spawn_radius=1e6)
    findings = found(replace(sound, config=config))
    assert ("spawn", "no disk of radius 1e+06 m fits in a patch of 8 m x 8 m") in findings
    assert findings[0][1].startswith("cannot be generated from the config: patch (0, 0): ")
    assert len(findings) == 31


@pytest.mark.parametrize(
    ("terrain", "parameters", "issue"),
    read_table(__file__, "validate_finds_what_generate_warns_of"),
)
def test_validate_finds_what_generate_warns_of(terrain, parameters, issue):
    sub_terrain = tk.SubTerrain(terrain=terrain, parameters=parameters)
    config = tk.MapConfig(rows=2, cols=1, patch_size=(8.0, 4.0), terrains=(sub_terrain,))
    with pytest.warns(tk.TerrainkitWarning, match=f"{terrain}.* on 1 patches"):
        ((check, message),) = found(tk.generate(config))
    assert [check, message[: len(issue[1])]] == issue


@pytest.mark.parametrize("offset", [(8.0, 0, 0), (0, 8.0, 0), (-4.1, 0, 0), (0, -4.1, 0)])
def test_validate_finds_origin_outside_patch(sound, offset):
    origin = sound.env_origins[1, 1] + np.float32(offset)
    findings = found(changed(sound, "spawns", (1, 1, 0, slice(3)), origin))
    assert ("spawn", "patch (1, 1): the spawn origin is outside the patch") in findings


@pytest.mark.parametrize(("x", "messages"), read_table(__file__, "validate_finds_spawns"))
def test_validate_finds_spawns_on_one_another(x, messages):
    flat = tk.SubTerrain(terrain="flat")
    config = tk.MapConfig(rows=1, cols=1, border=0.0, spawns_per_patch=3, terrains=(flat,))
    made = tk.generate(config)
    # The origin is at (4, 4).
    edited = changed(made, "spawns", (0, 0, slice(1, 3), 0), x)
    edited = changed(edited, "spawns", (0, 0, slice(1, 3), 1), 4.0)
    differ = ("patches", "patch (0, 0): the spawn positions differ from its config")
    assert found(edited) == [differ, *(("spawn", f"patch (0, 0): {each}") for each in messages)]
    assert found(changed(made, "spawns", (0, 0, 2), np.nan)) == [differ]
    lifted = found(changed(made, "spawns", (0, 0, 1, 2), 0.25))
    assert ("spawn", "patch (0, 0): spawn 1 is 0.250 m above the ground") in lifted


def test_validate_finds_solid_above_the_origin():
    flat = plot(np.zeros((40, 30)))
    for bottom, messages in ((0.998, 1), (0.9995, 0)):
        board = make_boxes([2.0, 1.5, bottom + 0.1], [0.2, 0.2, 0.2])
        config = replace(flat.config, mode="custom")
        issues = found(replace(flat, config=config, solids=board))
        text = "patch (0, 0): the spawn origin has 0.998 m of headroom; expected 1 m"
        assert issues == [("spawn", text)] * messages


def large_map(tmp_path, heights, cell):
    """Return the map of heights, whose corners single precision does not represent."""
    np.save(tmp_path / "a.npy", heights.astype(np.float32))
    return tk.import_map(tmp_path / "a.npy", tk.ImportOptions(file_cell=cell, rows=2)).terrain_map


@pytest.mark.filterwarnings("ignore::terrainkit.TerrainkitWarning")
@pytest.mark.parametrize("cell", [599.7131, 4321.987])
def test_validate_accepts_the_rounding_of_large_maps(tmp_path, cell):
    along, across = np.indices((140, 90)) * cell
    rough = np.random.default_rng(0).normal(0, cell, along.shape)
    for heights in (np.sin(along / cell), 0.5 * along - 0.3 * across, rough):
        terrain_map = large_map(tmp_path, heights, cell)
        assert found(terrain_map) == []
        assert found(terrain_map, terrain_map.mesh(merged=False)) == []


@pytest.mark.filterwarnings("ignore::terrainkit.TerrainkitWarning")
def test_validate_finds_small_errors_in_large_maps(tmp_path):
    terrain_map = large_map(tmp_path, np.zeros((140, 90)), 599.7131)
    for dx, dz, message in ((0.02, 0.0, "edges have only one face"), (0.0, 0.002, "0.002 m")):
        mesh = terrain_map.mesh(merged=False)
        moved = mesh.vertices - np.array([dx, 0.0, dz])
        vertices = np.where(mesh.vertices[:, :1] > 83e3, moved, mesh.vertices).astype(np.float32)
        issues = found(terrain_map, TriMesh(vertices=vertices, triangles=mesh.triangles))
        assert any(message in text for _, text in issues)


def hole(mesh):
    return replace(mesh, triangles=mesh.triangles[100:])


def flip(mesh):
    return replace(mesh, triangles=np.vstack([mesh.triangles[:1, ::-1], mesh.triangles[1:]]))


def lift(height):
    return lambda mesh: replace(mesh, vertices=mesh.vertices + np.float32([0, 0, height]))


def point(mesh):
    return replace(mesh, triangles=np.vstack([mesh.triangles, np.zeros((1, 3), np.int32)]))


def empty(mesh):
    return replace(mesh, triangles=mesh.triangles[:0])


@pytest.mark.parametrize(
    ("change", "messages"),
    [
        (hole, ["the mesh covers", "edges have only one face, for example at"]),
        (flip, ["1 faces point downward", "by faces of opposite winding"]),
        (lift(0.25), ["the mesh differs from the heights by up to 0.250 m, most at"]),
        (lift(9e-4), []),
        (point, ["1 faces have no area", "edges are shared by more than two faces or"]),
        (empty, ["the mesh has no faces"]),
    ],
)
def test_validate_finds_invalid_faces(sound, change, messages):
    issues = found(sound, change(sound.mesh()))
    assert [check for check, _ in issues] == ["mesh"] * len(messages)
    assert all(part in text for part, (_, text) in zip(messages, issues, strict=True))


def test_validate_compares_the_solids_of_the_mesh(solid_map):
    custom = replace(solid_map, config=replace(solid_map.config, mode="custom"))
    mesh = custom.mesh()
    differ = ("mesh", "the last faces of the mesh differ from the solids of the map")
    assert differ not in found(custom, mesh)
    moved = mesh.vertices.copy()
    moved[-1, 0] += 2e-3
    turned = mesh.triangles.copy()
    turned[-1] = turned[-1, ::-1]
    for vertices, triangles in ((moved, mesh.triangles), (mesh.vertices, turned)):
        assert found(custom, replace(mesh, vertices=vertices, triangles=triangles))[-1] == differ
    few = TriMesh(vertices=mesh.vertices[:3], triangles=np.array([[0, 1, 2]], np.int32))
    assert found(custom, few)[-1] == differ
