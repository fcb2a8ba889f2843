from importlib import metadata

import numpy as np
import pytest
import trimesh

from terrainkit.errors import TerrainkitError
from terrainkit.files.isolated import ProcessLimits
from terrainkit.geometry import convex_decomposition
from terrainkit_robots.export.collision_simplification import convex_parts as module
from terrainkit_robots.export.collision_simplification.convex_parts import convex_parts
from terrainkit_robots.mesh.surface import MeshError, Surface, signed_volume


def surface_of(mesh):
    return Surface(points=np.asarray(mesh.vertices), faces=np.asarray(mesh.faces))


# an angle: two boxes of 3 x 1 x 1 and 1 x 1 x 2
ANGLE = surface_of(
    trimesh.creation.extrude_polygon(
        trimesh.path.polygons.Polygon([(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]), 1.0
    )
)


@pytest.fixture
def calls(monkeypatch):
    """Return the surfaces that CoACD was called with."""
    made, decompose = [], module.convex_decomposition

    def counted(*arguments):
        made.append(arguments)
        return decompose(*arguments)

    monkeypatch.setattr(module, "convex_decomposition", counted)
    return made


def test_angle_is_two_boxes(capfd):
    parts = convex_parts(ANGLE, None)
    volumes = sorted(signed_volume(part) for part in parts)
    assert sum(volumes) == pytest.approx(5, rel=0.02)
    assert len(parts) == 2
    assert volumes == pytest.approx([2, 3], rel=0.05)
    for part in parts:
        assert len(part.points) <= module.PARAMETERS["max_ch_vertex"]
        assert trimesh.Trimesh(part.points, part.faces).is_convex
    assert capfd.readouterr() == ("", "")


def test_parts_are_cached_by_content(tmp_path, calls):
    first = convex_parts(ANGLE, tmp_path)
    again = convex_parts(Surface(points=ANGLE.points.copy(), faces=ANGLE.faces.copy()), tmp_path)
    assert len(calls) == 1
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a.points, b.points)
        np.testing.assert_array_equal(a.faces, b.faces)
    other = convex_parts(Surface(points=2 * ANGLE.points, faces=ANGLE.faces), tmp_path)
    assert len(calls) == 2
    assert sum(map(signed_volume, other)) == pytest.approx(8 * sum(map(signed_volume, first)))


def test_parts_are_deterministic():
    first, second = convex_parts(ANGLE, None), convex_parts(ANGLE, None)
    assert [part.points.tobytes() for part in first] == [part.points.tobytes() for part in second]


def test_key_depends_on_version(monkeypatch):
    before = module._key(ANGLE)
    monkeypatch.setattr(metadata, "version", lambda _: "0.0.1")
    assert module._key(ANGLE) != before


def test_key_depends_on_parameters(monkeypatch):
    before = module._key(ANGLE)
    monkeypatch.setattr(module, "PARAMETERS", {**module.PARAMETERS, "threshold": 0.06})
    assert module._key(ANGLE) != before


def test_damaged_cache_file_is_replaced(tmp_path, calls):
    convex_parts(ANGLE, tmp_path)
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:200])
    assert len(convex_parts(ANGLE, tmp_path)) == 2
    assert len(calls) == 2


class TestFailures:
    def test_time_limit(self, monkeypatch, tmp_path):
        monkeypatch.setattr(convex_decomposition, "LIMITS", ProcessLimits(seconds=0.01))
        with pytest.raises(MeshError, match=r"^makes CoACD fail: takes more than 0\.01 s$"):
            convex_parts(ANGLE, tmp_path)
        assert not list(tmp_path.iterdir())

    def test_process_failure(self, monkeypatch):
        monkeypatch.setattr(module, "PARAMETERS", {"no_such_parameter": 1})
        with pytest.raises(MeshError, match=r"makes CoACD fail: .*no_such_parameter"):
            convex_parts(ANGLE, None)

    def test_not_installed(self, monkeypatch):
        def missing(name):
            raise metadata.PackageNotFoundError(name)

        monkeypatch.setattr(metadata, "version", missing)
        with pytest.raises(TerrainkitError, match="needs the package coacd"):
            convex_parts(ANGLE, None)
