import hashlib
import re

import numpy as np
import pytest
import trimesh

import terrainkit as tk
from terrainkit import ImportOptions, import_curriculum
from terrainkit.errors import ConfigError
from terrainkit.map.validate import validate
from tests.meshes import box
from tests.terrainkit.maps import contents

CELL = 0.1


def save(folder, name, heights):
    folder.mkdir(exist_ok=True)
    np.save(folder / f"{name}.npy", np.asarray(heights, dtype=np.float32))
    return folder / f"{name}.npy"


def ridges(height, shape=(30, 20)):
    """Return ground at 5 m with ridges along y beside a flat middle, none at the edges."""
    heights = np.full(shape, 5.0)
    heights[[3, -4], 3:-3] += height
    return heights


def curriculum(paths, **options):
    own = {name: options.pop(name) for name in ("blend",) if name in options}
    given = ImportOptions(**{"file_cell": CELL, "spawn_radius": 0.3, **options})
    return import_curriculum(paths, given, **own)


@pytest.fixture
def scans(tmp_path):
    """A folder of ridges whose height does not follow their names."""
    for name, height in (("a", 0.3), ("b", 0.1), ("c", 0.4), ("d", 0.2)):
        save(tmp_path / "scans", name, ridges(height))
    return tmp_path / "scans"


def test_import_curriculum_sorts_files_by_difficulty(scans):
    terrain_map = curriculum([scans], border=0.5)
    assert terrain_map.patch_names[:, 0].tolist() == ["b.npy", "d.npy", "a.npy", "c.npy"]
    assert terrain_map.difficulty[:, 0].tolist() == pytest.approx([0, 1 / 3, 2 / 3, 1])
    assert (terrain_map.config.patch_size, terrain_map.config.mode) == ((3.0, 2.0), "custom")
    heights = [terrain_map.patch(k, 0).heights.max() for k in range(4)]
    assert heights == pytest.approx([0.03, 0.06, 0.09, 0.12])  # 0.3 m from the edge, of 1 m
    assert (terrain_map.heights[:5] == 0).all()
    assert validate(terrain_map) == []
    requested = terrain_map.patch(0, 0).parameters.requested
    assert requested["file"] == "b.npy"
    assert requested["sha256"] == hashlib.sha256((scans / "b.npy").read_bytes()).hexdigest()


def test_import_curriculum_does_not_depend_on_the_order_of_paths(scans, monkeypatch):
    expected = contents(curriculum([scans]))
    files = sorted(scans.iterdir())
    assert contents(curriculum(files[::-1])) == expected
    assert contents(curriculum([files[2], scans])) == expected  # each file once
    monkeypatch.chdir(scans.parent)
    assert contents(curriculum(["scans"])) == expected


def test_import_curriculum_has_rows_and_columns(scans):
    terrain_map = curriculum([scans], cols=2)
    assert terrain_map.patch_names.tolist() == [["b.npy", "d.npy"], ["a.npy", "c.npy"]]
    with pytest.warns(tk.TerrainkitWarning, match="used 3 of 4 patches"):
        names = curriculum([scans], cols=1, rows=3).patch_names
    assert names.tolist() == [
        ["b.npy"],
        ["a.npy"],
        ["c.npy"],
    ]  # the easiest and the hardest are kept
    with pytest.raises(ConfigError, match="got 2 x 3; expected at most 4 patches"):
        curriculum([scans], cols=3, rows=2)


def test_import_curriculum_crops_at_the_center(tmp_path):
    x = 1e-3 * np.arange(16)[:, None] + np.zeros(12)
    paths = [save(tmp_path, "large", x), save(tmp_path, "small", np.zeros((10, 12)))]
    terrain_map = curriculum(paths, blend=0)
    assert terrain_map.config.patch_size == (1.0, 1.2)
    large = terrain_map.patch(1, 0).heights
    np.testing.assert_allclose(
        large[:, 0], 1e-3 * (np.arange(3, 13) - 7.5), atol=1e-8
    )  # the median of the edges
    pieces = curriculum(paths[:1], patch_size=(0.5, 0.6), spawn_radius=0.1, cols=2, blend=0)
    assert pieces.difficulty.shape == (3, 2)


@pytest.mark.parametrize(("blend", "expected"), [(0.0, [1, 1, 1, 1]), (0.2, [0, 0.5, 1, 1])])
@pytest.mark.filterwarnings("ignore:.*with heights over")
def test_import_curriculum_blends_the_edges(tmp_path, blend, expected):
    heights = np.ones((20, 20))
    heights[10:] = -1  # the median of the edges is 0
    heights[:, 0] += 10
    heights[:, -1] -= 10
    path = save(tmp_path, "a.npy", heights)
    terrain_map = curriculum([path], blend=blend, spawn_tolerance=5.0)
    np.testing.assert_allclose(terrain_map.heights[:4, 10], expected, atol=1e-6)


def test_import_curriculum_names_files_that_cannot_be_used(scans):
    (scans / "bad.npy").write_bytes(b"no array")
    save(scans, "tiny", ridges(0.2, (10, 10)))
    (scans / "notes.md").touch()
    (scans / "a.json").touch()
    with pytest.warns(tk.TerrainkitWarning) as caught:
        terrain_map = curriculum([scans], patch_size=(3.0, 2.0), cell=CELL)
    ignored, skipped = (str(each.message) for each in caught)
    assert ignored.endswith("what has no reader: notes.md")
    assert re.search(r"^skipped .*bad\.npy: .*, .*tiny\.npy: got 1 m x 1 m; ", skipped)
    assert terrain_map.patch_names[:, 0].tolist() == ["b.npy", "d.npy", "a.npy", "c.npy"]


def test_import_curriculum_rejects_what_it_cannot_do(scans, tmp_path):
    (tmp_path / "empty").mkdir()
    for paths, options, message in (
        ([tmp_path / "empty"], {}, "got no file to import; expected"),
        ([scans], {"origin": (0.0, 0.0, 0.0)}, "origin: got a position"),
        ([scans], {"solids": True}, "solids: got blend 1; expected 0"),
        (
            [scans / "a.npy"],
            {"patch_size": (9.0, 9.0)},
            "skipped all files: .*a.npy: got",
        ),
        ([scans], {"spawn_radius": 1.0}, r"a\.npy: patch \(0, 0\): no disk of radius 1 m"),
    ):
        with pytest.raises(tk.TerrainkitError, match=message):
            curriculum(paths, **options)


def test_import_curriculum_starts_on_the_flattest_disk(tmp_path):
    rng = np.random.default_rng(0)
    paths = [
        save(tmp_path, name, rng.uniform(0, h, (30, 20)))
        for name, h in zip("ab", (0.2, 0.1), strict=True)
    ]
    with pytest.warns(
        tk.TerrainkitWarning, match=r"2 of 2 patches: no free disk .* patch \(1, 0\)"
    ):
        terrain_map = curriculum(paths)
    assert validate(terrain_map) == []
    with pytest.raises(ConfigError, match="2 of 2 patches: no free disk"):
        curriculum(paths, spawn_tolerance=0.01)


def test_import_curriculum_divides_solids_of_a_file(tmp_path):
    # Tables, one of them 1.5 m high, and walls of 3 cm.
    sizes = (8, 4, 0.2), (1, 1, 0.1), (1, 1, 0.1), (0.03, 1, 0.5), (0.03, 1, 0.8)
    places = (4, 2, -0.1), (2.5, 2, 0.85), (6.5, 2, 1.55), (1, 2, 0.25), (5, 2, 0.4)
    parts = [box(size, place) for size, place in zip(sizes, places, strict=True)]
    trimesh.util.concatenate(parts).export(tmp_path / "a.stl")
    terrain_map = curriculum([tmp_path], solids=True, blend=0.0, patch_size=(4.0, 4.0))
    assert sorted(terrain_map.solids.patch.tolist()) == [[0, 0], [0, 0], [1, 0], [1, 0]]
    walls = np.sort(terrain_map.solids.boxes[terrain_map.solids.boxes[:, 2] < 0.5, 0])
    np.testing.assert_allclose(walls, [1.0, 5.0], atol=1e-5)
    clearance = terrain_map.clearance([[2.5, 2.0], [6.5, 2.0]])
    assert sorted(clearance) == pytest.approx([0.8, 1.5], abs=1e-3)
    assert validate(terrain_map) == []


def test_import_curriculum_distinguishes_files_of_one_name(tmp_path):
    for folder, height in (("x", 0.3), ("y", 0.1)):
        heights = ridges(height)
        heights[0, 0] = np.nan
        save(tmp_path / folder, "a", heights)
    with pytest.warns(tk.TerrainkitWarning, match="2 of 2 patches have missing heights") as caught:
        terrain_map = curriculum([tmp_path / "x", tmp_path / "y"])
    assert len(caught) == 1
    assert terrain_map.patch_names[:, 0].tolist() == ["a.npy (2)", "a.npy"]
    loaded = tk.TerrainMap.load(terrain_map.save(tmp_path / "map.npz"))
    assert [each.num_missing for each in loaded.import_reports] == [1, 1]
