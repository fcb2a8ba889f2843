import hashlib

import cv2
import numpy as np
import pytest
import trimesh

import terrainkit as tk
from terrainkit.errors import ConfigError, HeightFileError
from terrainkit.importing import ImportOptions, import_map
from terrainkit.map.validate import validate


def save(tmp_path, heights):
    np.save(tmp_path / "a.npy", heights)
    return tmp_path / "a.npy"


def import_array(tmp_path, heights, **options):
    return import_map(save(tmp_path, heights), ImportOptions(**{"file_cell": 0.1, **options}))


def steps():
    """Return 60 x 40 heights: a step of 0.2 m at x = 3 m, and one of 0.1 m at y = 2 m."""
    heights = np.zeros((60, 40))
    heights[30:] += 0.2
    heights[:, 20:] += 0.1
    return heights


def test_import_whole_file_is_one_patch(tmp_path):
    terrain_map = import_array(tmp_path, steps()).terrain_map
    assert terrain_map.config.patch_size == (6.0, 4.0)
    assert terrain_map.config.mode == "custom"
    assert terrain_map.terrain_names == ("a",)
    np.testing.assert_allclose(terrain_map.heights, steps(), atol=1e-6)
    assert terrain_map.height([4.55, 0.55]) == pytest.approx(0.2)
    assert terrain_map.height([0.55, 3.55]) == pytest.approx(0.1)
    assert validate(terrain_map) == []


def test_import_records_the_file(tmp_path):
    terrain_map = import_array(tmp_path, steps()).terrain_map
    digest = hashlib.sha256((tmp_path / "a.npy").read_bytes()).hexdigest()
    loaded = tk.TerrainMap.load(terrain_map.save(tmp_path / "map.npz"))
    parameters = loaded.patch(0, 0).parameters.requested
    assert (parameters["file"], parameters["sha256"]) == ("a.npy", digest)
    assert parameters["file_cell"] == 0.1
    assert loaded.config.terrains[0].terrain == "imported"


def test_import_split_into_patches(tmp_path):
    terrain_map = import_array(tmp_path, steps(), patch_size=(3.0, 2.0)).terrain_map
    np.testing.assert_allclose(terrain_map.env_origins[..., 2], [[0, 0.1], [0.2, 0.3]], atol=1e-6)
    np.testing.assert_allclose(terrain_map.env_origins[1, 0, :2], [4.5, 1.0], atol=1e-6)
    assert validate(terrain_map) == []


def test_import_origin_and_size_crop(tmp_path):
    terrain_map = import_array(
        tmp_path,
        steps(),
        origin=(2.0, 1.0, 0.1),
        rows=1,
        cols=2,
        patch_size=(4.0, 1.5),
        spawn_radius=0.3,
    ).terrain_map
    np.testing.assert_allclose(terrain_map.heights, steps()[20:, 10:] - 0.1, atol=1e-6)
    assert terrain_map.grid.lower == (0.0, 0.0)


def test_import_rows_and_cols_divide_the_file(tmp_path):
    config = import_array(tmp_path, steps(), rows=4, cols=3, spawn_radius=0.2).terrain_map.config
    # 40 cells along y are three times 13 cells, and one is left.
    assert config.patch_size == (1.5, 1.3)


def test_import_border_is_of_the_file_then_its_edge(tmp_path):
    terrain_map = import_array(
        tmp_path,
        steps(),
        origin=(1.0, 1.0, 0.0),
        rows=1,
        cols=1,
        patch_size=(4.0, 2.0),
        border=2.0,
        spawn_radius=0.3,
    ).terrain_map
    # From -1 m to 7 m along x and from -1 m to 5 m along y of the file.
    expected = np.pad(steps(), 10, mode="edge")
    np.testing.assert_allclose(terrain_map.heights, expected, atol=1e-6)


def test_import_other_cell_interpolates(tmp_path):
    x, y = np.meshgrid(np.arange(30) + 0.5, np.arange(20) + 0.5, indexing="ij")
    slope = 0.01 * x - 0.02 * y
    terrain_map = import_array(
        tmp_path, slope, file_cell=1.0, cell=0.25, slope_threshold=None, spawn_tolerance=0.1
    ).terrain_map
    assert terrain_map.grid.shape == (120, 80)
    xy = np.array([[3.3, 4.7], [15.0, 10.0], [29.0, 1.0]])
    expected = 0.01 * xy[:, 0] - 0.02 * xy[:, 1]
    np.testing.assert_allclose(terrain_map.height(xy), expected, atol=1e-6)


def test_import_missing_heights_are_rejected(tmp_path):
    heights = steps()
    heights[35, 12:14] = np.nan
    with pytest.raises(HeightFileError, match=r"2 of 2400 heights are missing.*\(3\.55, 1\.25\)"):
        import_array(tmp_path, heights)


@pytest.mark.parametrize(("missing", "expected"), [("nearest", 0.2), ("lowest", -0.5)])
def test_import_fills_missing_heights(tmp_path, missing, expected):
    heights = steps()
    heights[0, 0] = -0.5
    heights[35, 12:14] = np.nan
    imported = import_array(tmp_path, heights, missing=missing)
    assert imported.report.num_missing == 2
    assert imported.terrain_map.heights[35, 12] == pytest.approx(expected)
    assert validate(imported.terrain_map) == []


def test_import_of_missing_heights_only_is_rejected(tmp_path):
    with pytest.raises(HeightFileError, match="2400 of 2400 heights are missing"):
        import_array(tmp_path, np.full((60, 40), np.nan), missing="nearest")


def test_import_difficulty_is_rank(tmp_path):
    heights = np.zeros((40, 40))
    heights[25, 5] = 0.1
    heights[::4, 20:25] = 0.1
    terrain_map = import_array(
        tmp_path, heights, patch_size=(2.0, 2.0), spawn_radius=0.3
    ).terrain_map
    np.testing.assert_allclose(terrain_map.difficulty, [[0, 1], [0.5, 1]])


def test_import_without_flat_disc_is_an_error(tmp_path):
    rough = np.random.default_rng(0).uniform(0, 0.05, (60, 40))
    with pytest.raises(ConfigError, match=r"patch \(0, 0\): no disk .* increase .*spawn_tolerance"):
        import_array(tmp_path, rough)
    terrain_map = import_array(tmp_path, rough, spawn_tolerance=0.06).terrain_map
    assert validate(terrain_map) == []


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"patch_size": (7.0, 1.0)}, r"patches along x: got 1 of 7 m; .* has 6 m from the origin"),
        ({"rows": 4, "patch_size": (2.0, 1.0)}, r"patches along x: got 4 of 2 m; .* has 6 m"),
        ({"cols": 100}, r"patches along y: got 100 of 0\.1 m; .* has 4 m"),
        ({"origin": (0.0, 4.0, 0.0)}, "origin: got y = 4 m; the file extends from 0 m to 4 m"),
        ({"origin": (-1.0, 0.0, 0.0)}, "origin: got x = -1 m; the file extends from 0 m to 6 m"),
        ({"patch_size": (1.05, 1.0)}, r"patch_size: got 1\.05 m; expected a whole number of cells"),
        ({"solids": True}, r"solids: got .*a\.npy; expected a mesh"),
        ({"scale": 1e5}, r"got 1 heights beyond 1,000,000 m"),
    ],
)
def test_import_rejects_options(tmp_path, options, message):
    heights = steps()
    heights[0, 0] = 20.0
    with pytest.raises(tk.TerrainkitError, match=message):
        import_array(tmp_path, heights, **options)


def test_import_of_exported_image_is_the_same(tmp_path):
    config = tk.MapConfig(rows=2, cols=10, patch_size=(8.0, 6.0), border=1.5)
    terrain_map = tk.generate(config)
    path = terrain_map.save(tmp_path / "map.png")
    assert cv2.imread(str(path), cv2.IMREAD_UNCHANGED).dtype == np.uint16
    options = ImportOptions(origin=(0.0, 0.0, 0.0), patch_size=(8.0, 6.0), border=1.5)
    imported = import_map(path, options).terrain_map
    assert imported.grid == terrain_map.grid
    np.testing.assert_allclose(imported.heights, terrain_map.heights, atol=1e-3)
    np.testing.assert_allclose(
        imported.env_origins[..., 2], terrain_map.env_origins[..., 2], atol=1e-3
    )
    whole = import_map(path).terrain_map
    np.testing.assert_allclose(whole.heights, terrain_map.heights, atol=1e-3)


@pytest.mark.parametrize("y_up", [False, True])
@pytest.mark.usefixtures("real_child")
def test_import_of_exported_mesh_is_the_same(tmp_path, y_up):
    stairs = tk.SubTerrain(terrain="pyramid_stairs")
    config = tk.MapConfig(rows=2, cols=1, patch_size=(8.0, 6.0), border=1.0, terrains=(stairs,))
    terrain_map = tk.generate(config)
    path = terrain_map.save(tmp_path / "map.glb", y_up=y_up)
    imported = import_map(path, ImportOptions(up="y" if y_up else "z")).terrain_map
    np.testing.assert_allclose(imported.heights, terrain_map.heights, atol=1e-3)


@pytest.mark.parametrize("name", ["a.npz", "a", "a.jpg"])
def test_import_of_other_suffix_is_rejected(tmp_path, name):
    with pytest.raises(HeightFileError, match=r"there are: .*\.asc"):
        import_map(tmp_path / name)


def test_import_of_missing_file_is_rejected(tmp_path):
    with pytest.raises(HeightFileError, match=r"^no file"):
        import_map(tmp_path / "a.npy")
    (tmp_path / "b.npy").mkdir()
    with pytest.raises(HeightFileError, match="got a special file or folder"):
        import_map(tmp_path / "b.npy")


def test_import_mesh_reports_what_a_heightfield_loses(tmp_path):
    imported = import_map(bridge(tmp_path), ImportOptions())
    report = imported.report
    # A deck of 1 m x 4 m whose top is 1.2 m above the ground.
    assert report.overhang_area == pytest.approx(4.0)
    assert report.lost_area == pytest.approx(4.0)
    assert report.max_error == pytest.approx(1.2)
    x, _ = report.max_error_at
    assert 2.5 < x < 3.5
    assert imported.terrain_map.height([3.0, 2.0]) == pytest.approx(1.2)
    assert len(imported.terrain_map.solids) == 0


def test_import_mesh_keeps_overhangs_as_solids(tmp_path):
    imported = import_map(bridge(tmp_path), ImportOptions(solids=True, patch_size=(3.0, 4.0)))
    terrain_map, report = imported.terrain_map, imported.report
    assert (report.overhang_area, report.lost_area) == (pytest.approx(4.0), 0.0)
    assert report.max_error < 1e-3
    assert len(terrain_map.solids.hull_counts) == 1
    assert terrain_map.height([3.0, 2.0]) == pytest.approx(0.0, abs=1e-6)
    assert terrain_map.clearance([3.0, 2.0]) == pytest.approx(1.0, abs=1e-4)
    assert terrain_map.scan([3.0, 2.0, 5.0]) == pytest.approx(1.2, abs=1e-4)
    assert terrain_map.clearance([2.4, 2.0]) == np.inf
    assert validate(terrain_map) == []


def test_import_table_has_legs_and_solids(tmp_path):
    imported = import_map(table(tmp_path), ImportOptions(solids=True, cell=0.05))
    terrain_map, report = imported.terrain_map, imported.report
    assert report.lost_area == 0.0
    assert report.max_error < 0.05
    # The top is 0.05 m thick at 0.7 m, with legs of 0.1 m at its corners.
    assert terrain_map.clearance([2.0, 1.5]) == pytest.approx(0.7, abs=0.02)
    assert terrain_map.height([2.0, 1.5]) == pytest.approx(0.0, abs=1e-6)
    assert terrain_map.height([1.525, 1.225]) == pytest.approx(0.75, abs=1e-3)
    assert validate(terrain_map) == []


@pytest.mark.usefixtures("real_child")
def test_import_arch_is_decomposed(tmp_path):
    ring = trimesh.creation.annulus(1.0, 1.4, 2.0)
    ring.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0)))
    ring.apply_translation((3, 2, 0))
    trimesh.util.concatenate([box((6, 4, 1), (3, 2, -0.5)), ring]).export(tmp_path / "a.stl")
    imported = import_map(tmp_path / "a.stl", ImportOptions(solids=True))
    terrain_map, report = imported.terrain_map, imported.report
    # The opening is 2 m wide and 2 m deep.
    assert report.overhang_area == pytest.approx(4.0)
    assert report.lost_area == 0.0
    assert report.max_error < 0.02
    assert len(terrain_map.solids) > 3
    assert terrain_map.clearance([3.0, 2.0]) == pytest.approx(1.0, abs=0.02)
    assert terrain_map.clearance([3.6, 2.0]) == pytest.approx(0.8, abs=0.02)
    assert terrain_map.scan([3.0, 2.0, 5.0]) == pytest.approx(1.4, abs=0.02)
    assert validate(terrain_map) == []


def test_import_one_body_with_tunnel(tmp_path):
    block = trimesh.creation.box((4, 3, 2), trimesh.transformations.translation_matrix((2, 1.5, 0)))
    hole = trimesh.creation.box(
        (1.2, 5, 0.8), trimesh.transformations.translation_matrix((2, 1.5, 0))
    )
    trimesh.boolean.difference([block, hole], engine="manifold").export(tmp_path / "a.stl")
    imported = import_map(tmp_path / "a.stl", ImportOptions(solids=True))
    terrain_map = imported.terrain_map
    # The floor is at -0.4 m, the ceiling at 0.4 m, and the top at 1 m.
    assert terrain_map.height([2.0, 1.5]) == pytest.approx(-0.4, abs=1e-6)
    assert terrain_map.clearance([2.0, 1.5]) == pytest.approx(0.8, abs=1e-3)
    assert terrain_map.scan([2.0, 1.5, 5.0]) == pytest.approx(1.0, abs=1e-3)
    assert terrain_map.height([0.5, 1.5]) == pytest.approx(1.0)
    assert imported.report.max_error < 1e-3
    assert validate(terrain_map) == []


def test_import_overhang_of_open_mesh_is_rejected(tmp_path):
    mesh = trimesh.load(bridge(tmp_path), force="mesh")
    mesh.update_faces(np.arange(len(mesh.faces)) % 12 > 5)  # three sides of each box
    mesh.export(tmp_path / "open.stl")
    with pytest.raises(HeightFileError, match="solids: got a mesh without closed bodies"):
        import_map(tmp_path / "open.stl", ImportOptions(solids=True, missing="nearest"))


def box(size, center):
    return trimesh.creation.box(size, trimesh.transformations.translation_matrix(center))


def bridge(tmp_path):
    floor = box((6, 4, 1), (3, 2, -0.5))
    deck = box((1, 4, 0.2), (3, 2, 1.1))
    trimesh.util.concatenate([floor, deck]).export(tmp_path / "bridge.stl")
    return tmp_path / "bridge.stl"


def table(tmp_path):
    parts = [box((1.2, 0.8, 0.05), (2.0, 1.5, 0.725))]
    parts += [box((0.1, 0.1, 0.72), (x, y, 0.36)) for x in (1.53, 2.47) for y in (1.23, 1.77)]
    body = trimesh.boolean.union(parts, engine="manifold")
    trimesh.util.concatenate([box((4, 3, 1), (2, 1.5, -0.5)), body]).export(tmp_path / "table.ply")
    return tmp_path / "table.ply"


def test_import_map_rejects_infinite_extent(tmp_path):
    path = tmp_path / "a.asc"
    header = "ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1e308\n"
    path.write_text(header + "1 2 3\n1 2 3\n")
    with pytest.raises(ConfigError, match="the file extends from 0 m to inf m"):
        import_map(path)
