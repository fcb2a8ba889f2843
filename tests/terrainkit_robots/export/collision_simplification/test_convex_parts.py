from importlib import metadata

import numpy as np
import pytest
import trimesh

from terrainkit.errors import TerrainkitError
from terrainkit.files.child_process import ProcessLimits
from terrainkit.geometry import convex_decomposition
from terrainkit_robots.export.collision_simplification import convex_parts as module
from terrainkit_robots.export.collision_simplification.convex_parts import convex_parts
from terrainkit_robots.mesh.surface import MeshError, Surface, signed_volume
from tests.terrainkit_robots.export.made_models import surface_of

CORNERS = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]
ANGLE = surface_of(trimesh.creation.extrude_polygon(trimesh.path.polygons.Polygon(CORNERS), 1.0))
"""Two boxes of 3 x 1 x 1 and 1 x 2 x 1."""


@pytest.fixture
def calls(monkeypatch):
    """Return the arguments that CoACD was called with."""
    made, decompose = [], module.convex_decomposition

    def counted(*arguments):
        made.append(arguments)
        return decompose(*arguments)

    monkeypatch.setattr(module, "convex_decomposition", counted)
    return made


def test_angle_is_two_boxes(capfd):
    parts = convex_parts(ANGLE, None)
    assert sorted(map(signed_volume, parts)) == pytest.approx([2, 3], rel=0.05)
    assert all(trimesh.Trimesh(part.points, part.faces).is_convex for part in parts)
    assert capfd.readouterr() == ("", "")


def test_parts_are_cached_by_content(tmp_path, calls):
    def decomposed(surface):
        parts = convex_parts(surface, tmp_path)
        return [(part.points.tolist(), part.faces.tolist()) for part in parts]

    first = decomposed(ANGLE)
    assert decomposed(Surface(points=ANGLE.points.copy(), faces=ANGLE.faces.copy())) == first
    assert len(calls) == 1
    # The same mesh with its vertices in another order is another one.
    turned = Surface(points=ANGLE.points[::-1], faces=len(ANGLE.points) - 1 - ANGLE.faces)
    assert len(decomposed(turned)) == 2
    assert len(calls) == 2
    for file in tmp_path.iterdir():
        file.write_bytes(file.read_bytes()[:200])
    assert decomposed(ANGLE) == first
    assert len(calls) == 3


def test_key_depends_on_mesh_version_and_parameters(monkeypatch):
    others = [
        Surface(points=2 * ANGLE.points, faces=ANGLE.faces),
        Surface(points=ANGLE.points, faces=ANGLE.faces[::-1]),
    ]
    keys = set(map(module._key, [ANGLE, *others]))
    monkeypatch.setattr(module, "PARAMETERS", {**module.PARAMETERS, "threshold": 0.06})
    keys.add(module._key(ANGLE))
    monkeypatch.setattr(metadata, "version", lambda _: "0.0.1")
    keys.add(module._key(ANGLE))
    assert len(keys) == 5


def test_large_meshes_are_decimated(calls, monkeypatch):
    monkeypatch.setattr(module, "MAX_FACES", 300)
    convex_parts(surface_of(trimesh.creation.icosphere(subdivisions=3)), None)
    assert 100 < len(calls[0][1]) <= 300


def test_failures(monkeypatch, tmp_path):
    monkeypatch.setattr(convex_decomposition, "LIMITS", ProcessLimits(seconds=0.01))
    with pytest.raises(MeshError, match=r"^makes CoACD fail: takes more than 0\.01 s$"):
        convex_parts(ANGLE, tmp_path)
    assert not list(tmp_path.iterdir())
    empty = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)]
    for found in ([], [(empty[0][0], empty[1][0])]):
        monkeypatch.setattr(module, "convex_decomposition", lambda *_, found=found: found)
        with pytest.raises(MeshError, match="has no convex decomposition"):
            convex_parts(ANGLE, None)

    def missing(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", missing)
    with pytest.raises(TerrainkitError, match="needs the package coacd"):
        convex_parts(ANGLE, None)
