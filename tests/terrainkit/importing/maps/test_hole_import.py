import numpy as np
import pytest
import trimesh

import terrainkit as tk
from terrainkit.errors import ConfigError
from terrainkit.feasibility import RobotLimits, assess_map
from terrainkit.importing import ImportOptions, import_map, import_terrain_mesh
from terrainkit.map.validate import validate
from terrainkit.terrains.imported import Imported
from tests.meshes import box


def sheet(x0, x1, y0, y1, z=0.0):
    corners = [[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]]
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def save(folder, parts, name="a.stl"):
    trimesh.util.concatenate(parts).export(folder / name)
    return folder / name


def frame(x0, x1, y0, y1, size=(8, 6)):
    """Return level ground of 8 m x 6 m around a hole."""
    x, y = size
    return [sheet(0, x0, 0, y), sheet(x1, x, 0, y), sheet(x0, x1, 0, y0), sheet(x0, x1, y1, y)]


STRIP = [sheet(0, 4, 0, 4), sheet(4.4, 9, 0, 4)]
RING = [*frame(2, 6, 1, 5), sheet(2.5, 5.5, 1.5, 4.5, 0.1)]
CASES = {
    "strip": (STRIP, (4.2, 2.0), 1.6, (2.0, 2.0)),
    "ring": (RING, (2.2, 3.0), 16 - 9, (4.0, 3.0)),
    "hole": (frame(2, 4, 1, 5), (3.0, 3.0), 8.0, (6.0, 3.0)),
    "border": ([sheet(0, 8, 2, 6), sheet(0, 3, 0, 2), sheet(5, 8, 0, 2)], (4, 1), 4.0, (4, 4)),
    "islands": (
        [sheet(0, 2, 0, 2), sheet(3, 5, 3, 5), sheet(6, 8, 0, 2, 0.2)],
        (2.5, 2.5),
        8 * 5 - 12,
        (4.0, 4.0),
    ),
}


@pytest.mark.parametrize("suffix", ["stl", "obj", "glb", "ply"])
@pytest.mark.parametrize("name", CASES)
def test_import_keeps_holes(tmp_path, recwarn, name, suffix):
    parts, inside, area, beside = CASES[name]
    path = save(tmp_path, parts, f"a.{suffix}")
    imported = import_map(path, ImportOptions(up="z"))
    terrain_map, report = imported.terrain_map, imported.report
    assert terrain_map.height(inside) == -2.0
    assert terrain_map.height(beside) >= 0.0
    assert report.hole_area == pytest.approx(area, abs=0.01)
    assert (report.num_missing, report.filled_area, report.lost_ground_area) == (0, 0, 0)
    assert (report.shares, report.max_error) == ((1, 1, 1), 0)
    assert (terrain_map.spawns[..., 2] >= 0).all()
    assert validate(terrain_map) == []
    assert not [warning for warning in recwarn if "missing" in str(warning.message)]


def test_import_takes_holes_as_missing_heights(tmp_path):
    with pytest.warns(tk.TerrainkitWarning, match="160 of 3600 heights are missing"):
        imported = import_map(save(tmp_path, STRIP), ImportOptions(hole_depth=0.0))
    assert imported.terrain_map.height([4.2, 2.0]) == 0.0
    assert imported.report.filled_area == pytest.approx(1.6, abs=0.01)
    assert imported.report.hole_area == 0
    assert imported.report.shares == (1, 1, 1)


def test_robot_with_a_smaller_gap_limit_cannot_cross(tmp_path):
    terrain_map = import_map(save(tmp_path, STRIP)).terrain_map
    limits = {"step_up": 0.2, "step_down": 0.25, "slope": 0.577, "foothold": 0.08}
    sizes = {"body_width": 0.4, "standing_height": 0.5, "crouched_height": 0.3}
    for gap, expected in ((0.3, False), (0.5, True)):
        found = assess_map(terrain_map, RobotLimits(**limits, **sizes, gap=gap))[0]
        assert found.is_passable == expected


def test_hole_in_the_middle_is_no_place_to_start(tmp_path):
    terrain_map = import_map(save(tmp_path, frame(2, 6, 2, 4))).terrain_map
    x, y, z, _ = terrain_map.spawns[0, 0, 0]
    assert z == 0.0
    assert not (2 < x < 6 and 2 < y < 4)


def test_outline_of_a_mesh_is_missing_data(tmp_path):
    angle = np.arange(64) * np.pi / 32
    corners = np.column_stack([3 + 3 * np.cos(angle), 3 + 3 * np.sin(angle), 0 * angle])
    faces = [[0, k, k + 1] for k in range(1, 63)]
    trimesh.Trimesh(corners, faces).export(tmp_path / "disk.stl")
    with pytest.warns(tk.TerrainkitWarning, match="heights are missing"):
        report = import_map(tmp_path / "disk.stl").report
    assert report.hole_area == 0
    # A polygon of 64 sides in a square of 6 m.
    assert report.filled_area == pytest.approx(36 - 32 * 9 * np.sin(np.pi / 32), abs=0.1)


def test_holes_in_a_scene(tmp_path):
    boxes = "".join(f'<geom type="box" size="1 2 0.5" pos="{x} 2 -0.5"/>' for x in (1, 3.3, 5.6))
    path = tmp_path / "a.xml"
    path.write_text(f"<mujoco><worldbody>{boxes}</worldbody></mujoco>")
    imported = import_map(path)
    xy = [[1, 2], [2.15, 2], [3.3, 2], [4.45, 2], [5.6, 2]]
    assert imported.terrain_map.height(xy).tolist() == pytest.approx([0, -2, 0, -2, 0])
    assert imported.report.hole_area == pytest.approx(2 * 0.3 * 4)


def test_holes_below_bodies_that_became_solids(tmp_path):
    parts = [*STRIP, box((1.0, 0.03, 0.3), (4.2, 2.0, 0.15))]  # a plank over the gap
    imported = import_map(save(tmp_path, parts), ImportOptions(solids=True))
    assert imported.terrain_map.height([4.2, 2.0]) == -2.0
    assert imported.terrain_map.scan([4.2, 2.0, 5.0]) == pytest.approx(0.3)


def test_error_of_walls_without_ground_names_the_holes(tmp_path):
    walls = [box((4, 0.3, 1), (2, y, 0.5)) for y in (0.15, 3.85)]
    walls += [box((0.3, 4, 1), (x, 2, 0.5)) for x in (0.15, 3.85)]
    with pytest.raises(ConfigError, match=r"or hole_depth 0: no robot starts in a hole$"):
        import_map(save(tmp_path, walls))


def test_holes_of_meshes_of_frameworks_and_of_curricula(tmp_path):
    mesh = trimesh.util.concatenate(frame(2, 6, 2, 4)).apply_translation([-4, -3, 0])
    made = import_terrain_mesh(mesh.vertices, mesh.faces, np.zeros((1, 1, 3)), (8.0, 6.0))
    assert made.terrain_map.height([0.0, 0.0]) == -2.0
    assert made.terrain_map.spawns[0, 0, 0, 2] == 0.0
    files = [save(tmp_path, frame(2, 6, 2, 4), f"{name}.stl") for name in "ab"]
    several = tk.import_curriculum(files, ImportOptions(spawn_tolerance=0.01))
    start = several.height(several.spawns[:, 0, 0, :2])
    assert start.tolist() == [0.0, 0.0]  # on a platform in the hole, as high as the ground
    # Of 1 m, 0.8 m from the platform of 1.6 m: 3.2 m to 4.8 m along x.
    assert several.height([[2.45, 3.0]]) == pytest.approx(-1.6)


def test_holes_of_a_mesh_in_a_generated_map(tmp_path):
    path = save(tmp_path, frame(1, 3, 1, 5))
    terrain = tk.SubTerrain(
        terrain=Imported,
        parameters={"file": str(path), "crop": "center", "vertical_exaggeration": 1.0},
    )
    made = tk.generate(
        tk.MapConfig(rows=1, cols=1, patch_size=(8.0, 6.0), border=0.0, terrains=(terrain,))
    )
    assert made.height([2.0, 3.0]) == pytest.approx(-2.0, abs=0.01)


@pytest.mark.parametrize(("width", "is_hole"), [(0.001, False), (0.04, False), (0.06, True)])
def test_crack_narrower_than_half_a_cell_is_no_hole(tmp_path, width, is_hole):
    # The crack is at the samples of x = 4.05 m.
    parts = [sheet(0, 4.05 - width / 2, 0, 4, 0.1), sheet(4.05 + width / 2, 8, 0, 4, 0.1)]
    imported = import_map(save(tmp_path, parts))
    assert imported.terrain_map.height([4.05, 2.0]) == pytest.approx(-1.9 if is_hole else 0.1)
    assert imported.report.hole_area == pytest.approx(0.4 if is_hole else 0.0)
