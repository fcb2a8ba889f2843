import sys
from dataclasses import replace

import numpy as np
import pytest
import trimesh

import terrainkit as tk
from terrainkit.importing import ImportOptions, import_map
from terrainkit.importing.maps import differences
from terrainkit.importing.maps import import_map as import_module
from terrainkit.importing.readers.mesh_source import MeshSource
from terrainkit.importing.readers.point_cloud import PointSource
from terrainkit.importing.readers.raster import Raster
from tests.meshes import save_bridge

CELL = 0.1


def ground():
    """Return 60 x 40 heights: steps at x = 3 m and y = 1 m, and a hole of 0.4 m x 0.6 m."""
    heights = np.zeros((60, 40))
    heights[30:] += 0.2
    heights[:, 10:] += 0.1
    heights[10:14, 20:26] = np.nan
    return heights


def save_ground(folder, suffix):
    """Write the ground as an array, as a level square for each sample, or as points in them."""
    heights = ground()
    path = folder / f"a.{suffix}"
    i, j = np.nonzero(~np.isnan(heights))
    z = heights[i, j]
    if suffix == "npy":
        np.save(path, heights)
    elif suffix == "ply":
        corners = [
            np.column_stack([(i + a) * CELL, (j + b) * CELL, z]) for a in (0, 1) for b in (0, 1)
        ]
        number = np.arange(len(z))
        faces = np.array([[0, 2, 3], [0, 3, 1]]) * len(z)
        faces = (number[:, None, None] + faces).reshape(-1, 3)
        trimesh.Trimesh(np.concatenate(corners), faces, process=False).export(path)
    else:
        shift = np.random.default_rng(0).random((9, len(z), 2))
        points = [np.column_stack([(np.column_stack([i, j]) + s) * CELL, z]) for s in shift]
        np.savetxt(path, np.concatenate(points))
    return path


def mirrored(heights):
    return heights[::-1].copy()


def shifted(heights):
    return heights[np.maximum(np.arange(len(heights)) - 1, 0)]


def filled(heights):
    return np.where(np.isnan(heights), 0.1, heights)


def break_sampler(monkeypatch, change):
    columns = MeshSource.columns

    def broken_columns(mesh, x, y):
        found = columns(mesh, x, y)
        return replace(found, top=change(found.top), floor=change(found.floor))

    monkeypatch.setattr(MeshSource, "columns", broken_columns)
    for kind in (Raster, PointSource):
        heights = kind.heights
        monkeypatch.setattr(kind, "heights", lambda self, x, y, f=heights: change(f(self, x, y)))


def report_of(path):
    options = {"file_cell": CELL} if path.suffix == ".npy" else {"up": "z"}
    return import_map(
        path, ImportOptions(cell=CELL, missing="lowest", hole_depth=0.0, **options)
    ).report


SUFFIXES = ("npy", "ply", "xyz")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_report_of_a_true_map_is_silent(tmp_path, suffix):
    report = report_of(save_ground(tmp_path, suffix))
    assert report.num_missing == 24
    assert report.shares[0] > 0.998
    if suffix != "xyz":  # points near the hole are within a cell of it
        assert (report.shares, report.max_error_at) == ((1, 1, 1), None)
        assert report.filled_area == pytest.approx(0.24, abs=0.01)
        assert report.covered_area == pytest.approx(23.76, abs=0.01)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("change", [shifted, mirrored])
def test_report_names_ground_in_another_place(tmp_path, monkeypatch, suffix, change):
    break_sampler(monkeypatch, change)
    report = report_of(save_ground(tmp_path, suffix))
    assert report.max_error > 0.18
    assert report.shares[0] < (0.997 if change is shifted else 0.05)
    if change is shifted:  # the wall of the file is at x = 3 m, and that of the map at 3.1 m
        at = [report.max_error_at[0], *(x for _, x, _ in report.further_errors)]
        assert min(abs(np.array(at) - 3.05)) < 0.1


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_report_names_a_filled_hole(tmp_path, monkeypatch, suffix):
    break_sampler(monkeypatch, filled)
    report = report_of(save_ground(tmp_path, suffix))
    assert report.num_missing == 0
    # Points less than a cell from the edge of the hole have a point of the cloud nearby.
    assert report.filled_area == pytest.approx(0.24, abs=0.01 if suffix != "xyz" else 0.2)
    assert report.filled_area > 0.05


def test_report_names_a_lost_storey(tmp_path, monkeypatch):
    columns = MeshSource.columns

    def without_storey(mesh, x, y):
        found = columns(mesh, x, y)
        return replace(found, top=found.floor, ceiling=np.full_like(found.top, np.nan))

    monkeypatch.setattr(MeshSource, "columns", without_storey)
    report = import_map(save_bridge(tmp_path)).report
    assert report.max_error == pytest.approx(1.2)  # the top of the deck, over a sixth of 6 m
    assert report.shares[2] == pytest.approx(5 / 6, abs=0.01)


def test_report_names_lost_solids(tmp_path, monkeypatch):
    monkeypatch.setattr(import_module, "overhang_solids", lambda *_: tk.Solids.empty())
    report = import_map(save_bridge(tmp_path), ImportOptions(solids=True)).report
    assert report.lost_area == pytest.approx(4.0)
    assert report.shares[2] == pytest.approx(5 / 6, abs=0.01)


def test_report_names_several_places(tmp_path):
    posts = [(1.0, 1.0, 0.2), (1.2, 1.0, 0.3), (4.0, 3.0, 0.1)]
    parts = [trimesh.creation.box(bounds=[[0, 0, -1], [6, 4, 0]])]
    parts += [
        trimesh.creation.box(bounds=[[x - 0.02, y - 0.02, 0], [x + 0.02, y + 0.02, z]])
        for x, y, z in posts
    ]
    trimesh.util.concatenate(parts).export(tmp_path / "a.stl")
    report = import_map(tmp_path / "a.stl").report
    assert report.max_error == pytest.approx(0.3)
    assert report.max_error_at == pytest.approx((1.2, 1.0), abs=0.03)
    # The post at (1, 1) is less than ten cells away.
    assert np.array(report.further_errors)[0] == pytest.approx([0.1, 4.0, 3.0], abs=0.03)


def test_report_of_our_own_mesh_has_no_difference(tmp_path, recwarn):
    terrains = (tk.SubTerrain(terrain="stepping_stones"),)
    made = tk.generate(tk.MapConfig(rows=16, cols=1, border=1.0, terrains=terrains))
    made.save(tmp_path / "a.stl")
    report = import_map(tmp_path / "a.stl").report  # 130 m x 10 m
    assert (report.shares, report.max_error, report.num_lost_faces) == ((1, 1, 1), 0, 0)
    assert not [warning for warning in recwarn if "millimeters" in str(warning.message)]


def test_report_without_embree_is_the_same(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex", None)
    report = report_of(save_ground(tmp_path, "ply"))
    assert (report.shares, report.max_error_at) == ((1, 1, 1), None)
    assert report.filled_area == pytest.approx(0.24, abs=0.01)


def test_report_of_a_large_raster_is_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr(differences, "MAX_POINTS", 100)
    report = report_of(save_ground(tmp_path, "npy"))
    assert 90 <= report.num_points <= 100
