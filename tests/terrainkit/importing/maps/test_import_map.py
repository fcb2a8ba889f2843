import hashlib
import re
from contextlib import nullcontext

import numpy as np
import pytest
import trimesh

import terrainkit as tk
from terrainkit.errors import (
    ConfigError,
    HeightFileError,
    MapFileError,
    MemoryLimitError,
    TerrainkitWarning,
)
from terrainkit.files import memory
from terrainkit.importing import ImportOptions, import_map
from terrainkit.importing.maps.differences import _height_errors
from terrainkit.map.import_report import ImportReport
from terrainkit.map.validate import validate
from terrainkit.perception import HeightScan, RayCaster
from tests.meshes import box, save_bridge
from tests.tables import read_table


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


def test_import_whole_file_is_one_patch_that_records_it(tmp_path):
    terrain_map = import_array(tmp_path, steps()).terrain_map
    assert terrain_map.config.patch_size == (6.0, 4.0)
    assert terrain_map.config.mode == "custom"
    assert (terrain_map.terrain_names, terrain_map.goals.shape) == (("a",), (1, 1, 0, 4))
    assert (terrain_map.friction == 1.0).all()
    np.testing.assert_allclose(terrain_map.heights, steps(), atol=1e-6)
    assert validate(terrain_map) == []
    loaded = tk.TerrainMap.load(terrain_map.save(tmp_path / "map.npz"))
    assert loaded.patch(0, 0).parameters.requested == {
        "file": "a.npy",
        "sha256": hashlib.sha256((tmp_path / "a.npy").read_bytes()).hexdigest(),
        "vertical_exaggeration": 1.0,
        "file_cell": 0.1,
        "file_cell_y": 0.0,
        "height_span": 0.0,
        "scale": 0.0,
        "up": "auto",
        "missing": "nearest",
        "files": (),
        "rank": 0.0,
        "hole_depth": 2.0,
        "crop": "random",
        "platform": 2.0,
    }
    assert loaded.config.terrains[0].terrain == "imported"


def test_import_wraps_its_steps_for_a_progress_bar(tmp_path):
    seen = []

    def progress(steps, total):
        for number, step in enumerate(steps):
            seen.append((number, total))
            yield step

    options = ImportOptions(file_cell=0.1)
    imported = import_map(save(tmp_path, steps()), options, progress=progress)
    assert seen == [(0, 4), (1, 4), (2, 4), (3, 4)]
    assert imported.terrain_map.grid.shape == (60, 40)


def test_import_split_into_patches(tmp_path):
    terrain_map = import_array(tmp_path, steps(), patch_size=(3.0, 2.0)).terrain_map
    np.testing.assert_allclose(terrain_map.env_origins[..., 2], [[0, 0.1], [0.2, 0.3]], atol=1e-6)
    np.testing.assert_allclose(terrain_map.env_origins[1, 0, :2], [4.5, 1.0], atol=1e-6)
    assert validate(terrain_map) == []


@pytest.mark.parametrize(
    ("options", "patch_size", "heights"),
    [
        # 40 cells along y are three times 13 cells, and one is left.
        ({"rows": 4, "cols": 3}, (1.5, 1.3), steps()[:, :39]),
        (
            {"origin": (2.0, 1.0, 0.1), "patch_size": (4.0, 1.5)},
            (4.0, 1.5),
            steps()[20:, 10:] - 0.1,
        ),
        # The border has the heights of the file, and then of its edge: here from -1 m to 7 m along
        # x and from -1 m to 5 m along y.
        (
            {"origin": (1.0, 1.0, 0.0), "patch_size": (4.0, 2.0), "border": 2.0},
            (4.0, 2.0),
            np.pad(steps(), 10, mode="edge"),
        ),
    ],
)
def test_import_options_divide_crop_and_extend_the_file(tmp_path, options, patch_size, heights):
    terrain_map = import_array(tmp_path, steps(), spawn_radius=0.2, **options).terrain_map
    assert terrain_map.config.patch_size == patch_size
    np.testing.assert_allclose(terrain_map.heights, heights, atol=1e-6)
    border = terrain_map.config.border
    assert terrain_map.grid.lower == (-border, -border)


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


@pytest.mark.parametrize(
    ("options", "message"),
    [
        *read_table(__file__, "import_rejects_options"),
        ({"origin": (-0.049, -0.049, 0.0)}, None),  # half of a cell before the file
        ({"rows": 2, "cols": 1, "patch_size": (3.0, 4.0), "origin": (0.049, 0.049, 0.0)}, None),
    ],
)
def test_import_rejects_options(tmp_path, options, message):
    heights = steps()
    heights[0, 0] = 20.0
    expected = pytest.raises(tk.TerrainkitError, match=message) if message else nullcontext()
    with expected:
        import_array(tmp_path, heights, **options)


@pytest.mark.parametrize(("number", "missing"), [(2, "reject"), (2400, "nearest")])
def test_import_missing_heights_are_rejected(tmp_path, number, missing):
    heights = steps()
    heights[35, 12:14] = np.nan
    heights = heights if number == 2 else np.full((60, 40), np.nan)
    with pytest.raises(HeightFileError, match=rf"{number} of 2400 heights are missing"):
        import_array(tmp_path, heights, missing=missing)


@pytest.mark.parametrize(("missing", "expected"), [("nearest", 0.2), ("lowest", -0.5)])
def test_import_fills_missing_heights(tmp_path, missing, expected):
    heights = steps()
    heights[0, 0] = -0.5
    heights[35, 12:14] = np.nan
    message = r"2 of 2400 heights are missing, the first at \(3\.55, 1\.25\).* `missing='reject'"
    is_default = missing == "nearest"
    with pytest.warns(tk.TerrainkitWarning, match=message) if is_default else nullcontext():
        imported = import_array(tmp_path, heights, **({} if is_default else {"missing": missing}))
    assert imported.report.num_missing == 2
    assert imported.terrain_map.heights[35, 12] == pytest.approx(expected)
    assert validate(imported.terrain_map) == []


def test_import_of_too_many_samples_names_a_cell_that_fits(tmp_path, monkeypatch):
    monkeypatch.setattr(memory, "MIN_CHECKED_BYTES", 100_000)
    monkeypatch.setattr(memory, "free_memory", lambda: 120_000)
    # 2400 samples of 200 bytes are 4 times as much as is free: cells of 0.2 m, and some more.
    with pytest.raises(MemoryLimitError, match=r"map of 2400 samples .*; `cell=0\.21` would fit"):
        import_array(tmp_path, steps())
    assert import_array(tmp_path, steps(), cell=0.21).terrain_map.grid.shape == (28, 19)


def test_import_difficulty_is_rank(tmp_path):
    heights = np.zeros((40, 40))
    heights[25, 5] = 0.1
    heights[::4, 20:25] = 0.1
    terrain_map = import_array(
        tmp_path, heights, patch_size=(2.0, 2.0), spawn_radius=0.3
    ).terrain_map
    np.testing.assert_allclose(terrain_map.difficulty, [[0, 1], [0.5, 1]])


def rough_but_for_one_patch():
    heights = np.random.default_rng(0).uniform(0, 0.05, (60, 40))
    heights[:30, :20] = 0.0
    return heights


def test_import_without_flat_disk_starts_on_the_flattest(tmp_path):
    options = {"rows": 2, "cols": 2}
    expected = "3 of 4 patches: no free disk .* flat within 0.01 m; .* robots start there$"
    with pytest.warns(tk.TerrainkitWarning, match=expected) as caught:
        terrain_map = import_array(tmp_path, rough_but_for_one_patch(), **options).terrain_map
    assert len(caught) == 1
    tolerance = terrain_map.config.spawn_tolerance
    assert f"`spawn_tolerance={tolerance:g}` accepts" in str(caught[0].message)
    assert 0.04 < tolerance <= 0.05
    assert validate(terrain_map) == []
    assert terrain_map.env_origins[0, 0].tolist() == [1.5, 1.0, 0.0]  # flat, so at the center
    loaded = tk.TerrainMap.load(terrain_map.save(tmp_path / "map.npz"))
    raised = loaded.edited(heights=loaded.heights + 1)
    np.testing.assert_allclose(raised.spawns, loaded.spawns + np.array([0, 0, 1, 0]), atol=1e-6)
    heights = rough_but_for_one_patch()
    given = import_array(tmp_path, heights, **options, spawn_tolerance=tolerance).terrain_map
    assert validate(given) == []
    with pytest.raises(ConfigError, match=r"3 of 4 patches: .* 0\.02 m; .*`spawn_tolerance=0\.0"):
        import_array(tmp_path, heights, **options, spawn_tolerance=0.02)


def test_import_with_several_spawn_positions_that_are_as_flat(tmp_path):
    slope = np.broadcast_to(0.02 * np.arange(60)[:, None], (60, 60))
    with pytest.warns(tk.TerrainkitWarning, match="and at up to 3 positions that are as flat$"):
        terrain_map = import_array(tmp_path, slope, spawns_per_patch=4).terrain_map
    assert terrain_map.spawns[0, 0, 0, :2].tolist() == [3.0, 3.0]
    assert not np.isnan(terrain_map.spawns).any()
    assert terrain_map.config.spawn_tolerance == 0.24  # over 12 cells
    assert validate(terrain_map) == []


@pytest.mark.parametrize(
    ("number", "radius", "message"),
    [
        (12, 0.5, None),
        (11, 0.5, r"in a patch of 1\.1 m x 4 m; .* a spawn_radius below 0\.45 m"),
        (11, 0.45, None),
        (2, 0.5, "spawn_radius below 0.045 m$"),
    ],
)
def test_import_of_tiny_patch(tmp_path, number, radius, message):
    expected = pytest.raises(ConfigError, match=message) if message else nullcontext()
    with expected:
        import_array(tmp_path, np.zeros((number, 40)), spawn_radius=radius)


def test_import_of_other_files_is_rejected(tmp_path):
    (tmp_path / "b.npy").mkdir()
    for name, message in (
        ("a.xyz0", r"there are: .*\.asc"),
        ("a", r"there are: .*\.asc"),
        ("a.npy", "^no file"),
        ("b.npy", "got a special file or folder"),
    ):
        with pytest.raises(HeightFileError, match=message):
            import_map(tmp_path / name)


def test_import_mesh_reports_what_a_heightfield_loses(tmp_path):
    imported = import_map(save_bridge(tmp_path), ImportOptions())
    # The top of a deck of 1 m x 4 m, from x = 2.5 m on, is 1.2 m above the ground.
    assert imported.report == ImportReport(
        num_missing=0,
        num_points=imported.report.num_points,
        shares=(1.0, 1.0, 1.0),
        covered_area=pytest.approx(24.0),
        overhang_area=pytest.approx(4.0),
        lost_area=pytest.approx(4.0),
        overhang_error=pytest.approx(1.2),
        overhang_error_at=pytest.approx((2.55, 0.05)),
    )
    saved = imported.terrain_map.save(tmp_path / "a.npz")
    assert tk.TerrainMap.load(saved).import_reports == (imported.report,)
    assert imported.terrain_map.height([3.0, 2.0]) == pytest.approx(1.2)
    assert len(imported.terrain_map.solids) == 0


def test_import_report_sees_solids_where_the_file_has_ground(tmp_path):
    trimesh.creation.box((8, 8, 1)).export(tmp_path / "flat.obj")
    terrain_map = import_map(tmp_path / "flat.obj", ImportOptions()).terrain_map
    edited = terrain_map.edited(solids=tk.make_boxes(center=[4, 4, 3], size=[2, 2, 0.2]))
    points = np.array([[4.0, 4.0, 0.5], [1.0, 1.0, 0.5]])  # the top of the file
    errors = _height_errors(edited, points, only_above=False)
    assert errors.tolist() == pytest.approx([2.6, 0.0])


def test_import_mesh_reports_floors_without_thickness(tmp_path):
    def sheet(low, high, z):
        corners = [[low, low, z], [high, low, z], [high, high, z], [low, high, z]]
        return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)

    sunk = trimesh.creation.box((1, 1, 2), trimesh.transformations.translation_matrix([4, 4, 0]))
    for sheets, area in (([sheet(1, 3, 2)], 4.0), ([], 0.0), ([sheet(1, 3, 0.01)], 0.0)):
        mesh = trimesh.util.concatenate([sheet(0, 5, 0), sunk, *sheets])
        mesh.export(tmp_path / "floors.obj")
        report = import_map(tmp_path / "floors.obj", ImportOptions()).report
        assert report.hidden_area == pytest.approx(area)


def test_import_mesh_keeps_overhangs_as_solids(tmp_path):
    imported = import_map(save_bridge(tmp_path), ImportOptions(solids=True, patch_size=(3.0, 4.0)))
    terrain_map, report = imported.terrain_map, imported.report
    assert (report.overhang_area, report.lost_area) == (pytest.approx(4.0), 0.0)
    assert report.max_error < 1e-3
    np.testing.assert_allclose(
        np.sort(terrain_map.solids.boxes[0, 3:6]), [0.1, 0.5, 2.0], rtol=1e-5
    )
    assert terrain_map.height([3.0, 2.0]) == pytest.approx(0.0, abs=1e-6)
    assert terrain_map.clearance([3.0, 2.0]) == pytest.approx(1.0, abs=1e-4)
    assert terrain_map.scan([3.0, 2.0, 5.0]) == pytest.approx(1.2, abs=1e-4)
    assert terrain_map.clearance([2.4, 2.0]) == np.inf
    assert validate(terrain_map) == []
    part = {"origin": (1.0, 0.5, 0.25), "rows": 1, "cols": 1, "patch_size": (4.0, 3.0)}
    made = import_map(save_bridge(tmp_path), ImportOptions(solids=True, **part)).terrain_map
    at = [2.0, 1.5]
    found = [made.height(at), made.clearance(at), made.scan([*at, 5.0])]
    assert found == pytest.approx([-0.25, 1.0, 0.95], abs=1e-4)


def test_import_of_open_bodies_is_reported_or_rejected(tmp_path):
    wall = box((0.03, 4, 0.5), (4.0, 2, 0.25))
    wall.update_faces(np.arange(12) != 3)
    trimesh.util.concatenate([box((8, 4, 0.1), (4, 2, -0.05)), wall]).export(tmp_path / "a.stl")
    report = import_map(tmp_path / "a.stl", ImportOptions(solids=True)).report
    assert (report.num_open_bodies, report.num_thin_bodies) == (1, 0)
    assert report.num_lost_faces > 0
    mesh = trimesh.load(save_bridge(tmp_path), force="mesh")
    mesh.update_faces(np.arange(len(mesh.faces)) % 12 > 5)  # three sides of each box
    mesh.export(tmp_path / "open.stl")
    with pytest.raises(HeightFileError, match="solids: got a mesh without closed bodies"):
        import_map(tmp_path / "open.stl", ImportOptions(solids=True, missing="nearest"))


def save_wall(folder, center=4.0, width=0.03):
    """Write a floor of 8 m x 4 m with a wall across it, 0.5 m high."""
    parts = [box((8, 4, 0.1), (4, 2, -0.05)), box((width, 4, 0.5), (center, 2, 0.25))]
    trimesh.util.concatenate(parts).export(folder / "wall.stl")
    return folder / "wall.stl"


@pytest.mark.parametrize(
    ("center", "width", "is_lost", "is_thin"),
    read_table(__file__, "import_of_a_thin_wall_is_reported_or_a_solid"),
)
def test_import_of_a_thin_wall_is_reported_or_a_solid(tmp_path, center, width, is_lost, is_thin):
    path = save_wall(tmp_path, center, width)
    report = import_map(path).report
    if is_lost:
        # The two faces of its top, and the eight of its sides.
        assert (report.num_lost_faces, report.max_error) == (10, pytest.approx(0.5))
        assert report.max_error_at[0] == pytest.approx(4.0, abs=0.02)
    else:
        assert report.num_lost_faces == 0
        assert report.max_error < 1e-6
    imported = import_map(path, ImportOptions(solids=True))
    solids, report = imported.terrain_map.solids, imported.report
    assert (report.num_thin_bodies, report.num_lost_faces) == (int(is_thin), 0)
    assert report.max_error < 1e-6
    if is_thin:
        assert (imported.terrain_map.heights == 0).all()
        half = np.sort(solids.boxes[0, 3:6])
        np.testing.assert_allclose(half, [width / 2, 0.25, 2.0], rtol=1e-4)
        np.testing.assert_allclose(solids.boxes[0, :3], [center, 2.0, 0.25], atol=1e-6)


def test_import_reports_the_difference_between_samples(tmp_path):
    # A roof from 0 m at x = 1 m and 3 m to 0.4 m at x = 2.03 m, and a cell of 0.4 m.
    x, z = np.array([0, 1, 2.03, 3, 4] * 2), np.array([0, 0, 0.4, 0, 0] * 2)
    vertices = np.column_stack([x, np.repeat([0, 4], 5), z])
    faces = [face for k in range(4) for face in ([k, k + 1, k + 6], [k, k + 6, k + 5])]
    trimesh.Trimesh(vertices, faces).export(tmp_path / "roof.ply")
    options = ImportOptions(cell=0.4, slope_threshold=None, spawn_tolerance=1.0, up="z")
    report = import_map(tmp_path / "roof.ply", options).report
    # Samples at 1.8 m and 2.2 m; the file has its ridge in between, less 0.1 % of the face.
    low, high = 0.4 * 0.8 / 1.03, 0.4 * 0.8 / 0.97
    expected = 0.4 - (low + (high - low) * 0.23 / 0.4)
    assert report.max_error == pytest.approx(expected, abs=5e-4)
    assert report.max_error_at[0] == pytest.approx(2.03, abs=2e-3)
    assert report.num_lost_faces == 0


def test_import_reports_what_a_coarser_cell_loses_of_heights(tmp_path):
    heights = np.zeros((40, 40))
    heights[10, 11] = 0.05
    report = import_array(tmp_path, heights, cell=0.2, slope_threshold=1.0).report
    # Means of 3 x 3 samples: 1/9 of it at (1.1, 1.1), and 1/18 at (0.9, 1.1) and (1.1, 1.3).
    # The point (1.05, 1.15) has a half of the first, and a quarter of each of the others.
    assert report.max_error == pytest.approx(0.05 - 0.05 / 12, abs=1e-6)
    assert report.max_error_at == pytest.approx((1.05, 1.15))
    assert import_array(tmp_path, heights).report.max_error_at is None


def test_import_reports_what_resampling_to_squares_loses(tmp_path):
    # One sample of 1 m at (22.5, 15) in cells of 15 m x 10 m; the map has samples at 5, 15, 25 m.
    heights = np.zeros((8, 12))
    heights[1, 1] = 1.0
    np.save(tmp_path / "a.npy", heights)
    options = {"file_cell": (15.0, 10.0), "spawn_radius": 5.0}
    report = import_map(tmp_path / "a.npy", ImportOptions(**options)).report
    # It is between samples with 1/2 and 5/6 of it, in a quarter and three quarters of the cell.
    assert report.max_error == pytest.approx(1 - (0.25 / 2 + 0.75 * 5 / 6), abs=1e-6)
    assert report.max_error_at == pytest.approx((22.5, 15.0))


def test_import_reports_single_samples(tmp_path):
    heights = np.zeros((40, 40))
    heights[::4, ::4] = 0.05
    options = {"cell": 0.4, "slope_threshold": None, "spawn_tolerance": 0.1}
    report = import_array(tmp_path, heights, **options).report
    assert 0.03 < report.max_error < 0.05  # the means of 5 x 5 samples are about 0.003


def test_import_proposes_a_part_at_the_center(tmp_path):
    rows = "\n".join(" ".join(["-9999"] * 40 + ["5"] * 320 + ["-9999"] * 40) for _ in range(330))
    header = "ncols 400\nnrows 330\nxllcorner -7000.3\nyllcorner 500000\ncellsize 30\n"
    (tmp_path / "a.asc").write_text(header + rows)
    with pytest.warns(tk.TerrainkitWarning) as found:
        import_map(tmp_path / "a.asc")
    text = next(str(each.message) for each in found if "a part for a robot" in str(each.message))
    x, y, *size = re.search(
        r"origin=\((.+), (.+), 0\)` `patch_size=\((.+), (.+)\)` ", text
    ).groups()
    origin, size = (float(x), float(y), 0.0), (float(size[0]), float(size[1]))
    part = ImportOptions(cell=1.0, origin=origin, patch_size=size, rows=1, cols=1)
    report = import_map(tmp_path / "a.asc", part).report
    assert (size, report.num_missing) == ((50, 50), 0)


def test_import_of_a_cloud_has_its_cells(tmp_path):
    x, y = np.meshgrid(np.arange(0, 4, 0.05), np.arange(0, 4, 0.05), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), 0.1 * (x.ravel() > 1.96)])
    keep = np.random.default_rng(0).permutation(len(points))[: len(points) // 3]  # no regular grid
    np.savetxt(tmp_path / "a.xyz", points[keep] + [0.0, 0.0, 3.0])
    imported = import_map(tmp_path / "a.xyz", ImportOptions(cell=0.2, origin=(0, 0, 3)))
    heights = imported.terrain_map.heights
    assert heights.shape == (19, 19)
    np.testing.assert_allclose(
        heights, np.repeat(0.1 * (np.arange(19) > 9), 19).reshape(19, 19), atol=1e-6
    )
    with pytest.raises(ConfigError, match=r"solids: got .*a\.xyz; expected a mesh"):
        import_map(tmp_path / "a.xyz", ImportOptions(solids=True))


def test_import_of_a_part_has_only_the_solids_in_it(tmp_path):
    bridge = [box((6, 1, 0.1), (4, 3, 1.0)), *(box((1, 1, 1), (x, 3, 0.5)) for x in (1, 7))]
    walls = [box((0.03, 1, 0.5), (x, 1, 0.25)) for x in (1, 7)]
    long = box((6, 0.03, 0.5), (4, 0.5, 0.25))
    parts = [box((8, 4, 0.1), (4, 2, -0.05)), *bridge, *walls, long]
    trimesh.util.concatenate(parts).export(tmp_path / "a.stl")
    options = ImportOptions(solids=True, patch_size=(4.0, 4.0), rows=1, cols=1)
    imported = import_map(tmp_path / "a.stl", options)
    lower, upper = imported.terrain_map.solids.bounds()
    assert sorted(lower[:, 0].round(3).tolist()) == pytest.approx([0.985, 1.0, 1.5], abs=0.1)
    assert sorted(upper[:, 0].round(3).tolist()) == pytest.approx([1.015, 4.0, 4.0], abs=1e-3)
    assert imported.report.num_thin_bodies == 2


def ramp():
    """Return 60 x 40 heights: a ramp of 45 degrees from x = 2 m to 4 m, which ends at a wall."""
    heights = np.zeros((60, 40))
    heights[20:40] = 0.1 * np.arange(20)[:, None]
    return heights


def test_a_slope_above_the_threshold_stays_a_slope_in_every_view(tmp_path):
    imported = import_array(tmp_path, ramp())
    made, report = imported.terrain_map, imported.report
    assert (report.num_walls, report.num_steep_slopes) == (40, 19 * 40)
    made.save(tmp_path / "map.npz")
    loaded = tk.TerrainMap.load(tmp_path / "map.npz")
    points = np.random.default_rng(0).uniform([2.1, 0.1], [3.9, 3.9], (200, 2))
    on_ramp = points[:, 0] - 2.05
    above = np.column_stack([points, np.full(200, 5.0)])
    scan = HeightScan(loaded, [0.0], [0.0]).below(above, np.zeros(200))[:, 0]
    rays = 5 - RayCaster(loaded).cast(above, np.tile([0.0, 0.0, -1.0], (200, 1)))
    for seen in (made.height(points), loaded.height(points), scan, rays):
        np.testing.assert_allclose(seen, on_ramp, atol=1e-4)
    walls = loaded.height([[4.04, 2.0], [3.96, 2.0]])
    assert walls.tolist() == pytest.approx([0.0, 1.9], abs=1e-3)
    assert (loaded.walls > 0).sum() == 40
    assert tk.TerrainMap.load(tmp_path / "map.npz").edited(heights=loaded.heights).walls is None
    assert loaded.patch(0, 0).walls.shape == loaded.heights.shape


def test_a_robot_starts_on_the_ground_of_a_steep_slope(tmp_path):
    heights = np.tile(0.12 * np.arange(80)[:, None], 60)
    with pytest.warns(TerrainkitWarning, match="no free disk"):
        made = import_array(tmp_path, heights).terrain_map
    x, y, z = made.env_origins[0, 0].tolist()
    assert made.height((x, y)) == pytest.approx(z, abs=1e-4)
    assert [str(issue) for issue in validate(made)] == []


def test_walls_are_stored_only_where_the_threshold_would_differ(tmp_path):
    assert import_array(tmp_path, steps()).terrain_map.walls is None


@pytest.mark.parametrize("value", [4, 255])
def test_walls_out_of_range_are_rejected(tmp_path, value):
    import_array(tmp_path, ramp()).terrain_map.save(tmp_path / "map.npz")
    with np.load(tmp_path / "map.npz") as file:
        arrays = dict(file)
    arrays["walls"][3, 3] = value
    np.savez(tmp_path / "bad.npz", **arrays)
    with pytest.raises(MapFileError, match="walls: got an edge out of range"):
        tk.TerrainMap.load(tmp_path / "bad.npz")
