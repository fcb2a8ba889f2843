import re

import numpy as np
import pytest
import trimesh

import terrainkit as tk
from tests.meshes import box, save_bridge

pytestmark = pytest.mark.usefixtures("import_in_process")


@pytest.fixture
def bridge(tmp_path):
    return save_bridge(tmp_path).name


def test_import_writes_map_and_report(terrainkit, rejected, tmp_path, bridge):
    run = terrainkit("import", bridge, "-o", "a.npz", "--patch-size", 3, 4)
    assert (run.returncode, run.stderr) == (0, "")
    assert "wrote a.npz: 2 x 1 patches of 3 m x 4 m, 60 x 40 samples" in run.stdout
    assert (
        "overhangs over 4.00 m2, of which 4.00 m2 are lost; largest error 1.200 m at ("
        in run.stdout
    )
    assert re.search(r"compared with the file at \d+ points: all within 1 cm\n", run.stdout)
    assert tk.TerrainMap.load(tmp_path / "a.npz").config.mode == "custom"
    run = terrainkit("check-map", "a.npz")
    assert run.returncode == 0, run.stdout
    error = rejected("generate --config a.npz -o b.npz")
    assert error.startswith("mode custom: the map was imported or edited")
    assert "a.npz exists" in rejected(f"import {bridge} -o a.npz")
    run = terrainkit("import", bridge, "-o", "b.npz", "--solids", "--cell", 0.2)
    assert "of which 0.00 m2 are lost" in run.stdout
    assert len(tk.TerrainMap.load(tmp_path / "b.npz").solids) == 1
    assert terrainkit("export", "b.npz", "-o", "b.xml").returncode == 0


def test_import_fills_missing_heights(terrainkit, rejected, tmp_path):
    heights = np.zeros((30, 20))
    heights[3, 4] = np.nan
    np.save(tmp_path / "a.npy", heights)
    words = ("import", "a.npy", "-o", "a.npz", "--file-cell", 0.1)
    error = rejected(*words, "--missing", "reject")
    assert error.startswith("a.npy: 1 of 600 heights are missing")
    assert not (tmp_path / "a.npz").exists()
    run = terrainkit(*words)
    assert "warning: a.npy: 1 of 600 heights are missing" in run.stderr
    assert (
        "filled missing heights: 1; the map has ground over 0.01 m2 where the file has "
        "none\n" in run.stdout
    )


@pytest.mark.parametrize("name", ["bad.png", "bad.tif", "bad.npy", "bad.asc", "bad.stl", "bad.glb"])
def test_import_of_bad_file_is_one_line(rejected, tmp_path, name):
    (tmp_path / name).write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(200))
    assert rejected(f"import {name} -o a.npz --file-cell 1").startswith(f"{name}: ")
    assert not (tmp_path / "a.npz").exists()


def test_import_folder_prints_its_sources(terrainkit, rejected, tmp_path):
    (tmp_path / "scans").mkdir()
    for name, height in (("steep", 0.4), ("gentle", 0.1)):
        heights = np.zeros((20, 20))
        heights[2:5] = height
        heights[0, 0] = np.nan
        np.save(tmp_path / "scans" / f"{name}.npy", heights)
    words = ("import", "scans", "--file-cell", 0.1, "--missing", "nearest", "-o")
    run = terrainkit(*words, "a.npz")
    assert run.returncode == 0
    assert "scans/gentle.npy: 1 of 400 heights are missing" in run.stderr
    assert "wrote a.npz: 2 x 1 patches of 2 m x 2 m" in run.stdout
    assert "row 0: gentle.npy\nrow 1: steep.npy\nheights are relative to" in run.stdout
    info = terrainkit("info", "a.npz").stdout.splitlines()
    assert info[-3].split() == ["file", "SHA-256", "patches"]
    assert info[-2].split()[0::2] == ["scans/gentle.npy", "(0,"]
    assert terrainkit("generate", "--config", "a.npz", "-o", "again.npz").returncode == 0
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "again.npz").read_bytes()
    assert terrainkit("check-map", "a.npz").returncode == 0
    files = ("scans/steep.npy", "scans/gentle.npy")
    assert terrainkit("import", *files, *words[2:], "b.npz").returncode == 0
    a, b = (tk.TerrainMap.load(tmp_path / f"{name}.npz").heights for name in "ab")
    assert np.array_equal(a, b)
    error = rejected(*words, "c.npz", "--solids")
    assert error == "solids: got True for several files; expected one file, alone\n"
    assert rejected("import -o c.npz").startswith("FILE...: missing (")


def test_import_reports_what_is_lost(terrainkit, tmp_path):
    parts = [box((4, 2, 0.1), (2, 1, -0.05)), box((0.03, 2, 0.5), (2, 1, 0.25))]
    trimesh.util.concatenate(parts).export(tmp_path / "a.stl")
    lost = terrainkit("import", "a.stl", "-o", "a.npz").stdout
    assert (
        "parts narrower than a cell are lost: 10 faces reach more than half a cell above the map "
        "(smaller --cell, or --solids for closed bodies)\n" in lost
    )
    kept = terrainkit("import", "a.stl", "-o", "b.npz", "--solids").stdout
    assert "closed bodies narrower than a cell, now solids: 1" in kept
    assert "lost" not in kept
    # A wall of 3 cm on 4 m.
    found = re.search(r" points: (\S+)% within 1 cm; largest differences: 0\.500 m at ", lost)
    assert float(found[1]) == pytest.approx(99.25, abs=0.5)
