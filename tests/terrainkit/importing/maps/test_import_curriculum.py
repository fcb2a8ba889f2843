import hashlib
import re

import numpy as np
import pytest

import terrainkit as tk
from terrainkit import ImportOptions, import_curriculum
from terrainkit.map.validate import validate
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
    return import_curriculum(
        paths, ImportOptions(**{"file_cell": CELL, "spawn_radius": 0.3, **options})
    )


def file_names(terrain_map):
    return [[p.realized["file"].split("/")[-1] for p in row] for row in terrain_map.parameters]


@pytest.fixture
def scans(tmp_path):
    """A folder of ridges whose height does not follow their names."""
    for name, height in (("a", 0.3), ("b", 0.1), ("c", 0.4), ("d", 0.2)):
        save(tmp_path / "scans", name, ridges(height))
    return tmp_path / "scans"


SORTED = [["b.npy"], ["d.npy"], ["a.npy"], ["c.npy"]]


def test_import_curriculum_sorts_files_by_difficulty(scans):
    terrain_map = curriculum([scans], border=0.5)
    assert file_names(terrain_map) == SORTED
    assert terrain_map.difficulty[:, 0].tolist() == pytest.approx([0, 1 / 3, 2 / 3, 1])
    assert (terrain_map.config.patch_size, terrain_map.config.mode) == ((3.0, 2.0), "curriculum")
    heights = [terrain_map.patch(k, 0).heights.max() for k in range(4)]
    assert heights == pytest.approx([0.021, 0.042, 0.063, 0.084])
    # 0.3 m from the edge and 0.7 m from the platform, of 1 m
    assert (terrain_map.heights[:5] == 0).all()
    assert validate(terrain_map) == []
    digest = hashlib.sha256((scans / "b.npy").read_bytes()).hexdigest()
    assert terrain_map.patch(0, 0).parameters.realized["sha256"] == digest
    assert contents(tk.generate(terrain_map.config)) == contents(terrain_map)


def test_import_curriculum_does_not_depend_on_the_order_of_paths(scans, tmp_path):
    files = sorted(scans.iterdir())
    expected = curriculum(files)
    assert contents(curriculum(files[::-1])) == contents(expected)
    assert contents(curriculum([files[2], scans])) == contents(expected)  # each file once
    assert (curriculum([scans]).heights == expected.heights).all()
    loaded = tk.TerrainMap.load(expected.save(tmp_path / "map.npz"))
    assert contents(tk.generate(loaded.config)) == contents(expected)


def test_import_curriculum_has_rows_and_columns(scans):
    assert file_names(curriculum([scans], rows=2, cols=1)) == [["b.npy"], ["c.npy"]]
    pair = curriculum([scans], rows=3, cols=2, patch_size=(2.8, 1.8))
    assert file_names(pair) == [["b.npy"] * 2, ["a.npy"] * 2, ["c.npy"] * 2]
    left, right = pair.patch(2, 0).heights, pair.patch(2, 1).heights
    assert (left != right).any()  # other parts of one file
    # Every row of a column has the same part.
    np.testing.assert_allclose(left / 4, pair.patch(0, 0).heights, atol=1e-6)


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
    assert file_names(terrain_map) == SORTED
    assert contents(tk.generate(terrain_map.config)) == contents(terrain_map)


def test_import_curriculum_rejects_what_it_cannot_do(scans, tmp_path):
    (tmp_path / "empty").mkdir()
    many = [save(tmp_path / "many", str(k), np.zeros((10, 10))) for k in range(65)]
    for paths, options, message in (
        ([tmp_path / "empty"], {}, "got no file to import; expected"),
        ([scans], {"origin": (0.0, 0.0, 0.0)}, r"^origin: got .* several files; expected one file"),
        ([scans], {"solids": True}, "^solids: got True for several files; expected one file"),
        ([scans], {"height_range": (1.0, 0.0)}, "^height_range: got 1 0; expected the lower"),
        ([scans / "a.npy"], {"patch_size": (9.0, 9.0)}, "skipped all files: .*a.npy: got"),
        ([scans], {"spawn_radius": 1.0}, r"^patch \(0, 0\): imported: no disk of radius 1 m"),
        (many, {}, "got 65 files; expected at most 64, or one folder"),
    ):
        with pytest.raises(tk.TerrainkitError, match=message):
            curriculum(paths, **options)
