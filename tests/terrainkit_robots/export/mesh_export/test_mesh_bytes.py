from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

from terrainkit_robots.export.mesh_export import mesh_bytes as module
from terrainkit_robots.export.mesh_export.mesh_bytes import has_no_volume, mesh_bytes, scaled
from terrainkit_robots.mesh.mesh_cache import MeshError, Meshes
from terrainkit_robots.mesh.surface import Surface, binary_stl, signed_volume, welded
from tests.terrainkit_robots.export.made_models import mesh, stl_of, surface_of

# a wedge: no two of its axes are alike, so that a mirror or a turn shows
CORNERS = [(0, 0, 0), (3, 0, 0), (0, 2, 0), (0, 0, 1), (3, 0, 0.5), (1, 1, 1)]
WEDGE = trimesh.convex.convex_hull(CORNERS)
SURFACE = surface_of(WEDGE)
STL = binary_stl(SURFACE)


def content(data, name="a.stl", scale=(1.0, 1.0, 1.0)):
    return mesh_bytes(Meshes({Path(name): data}), mesh(name, scale).mesh)


def read(packed):
    """Return the surface that a reader makes of it."""
    surface = Meshes({Path("a.stl"): packed.data}).surface(Path("a.stl"))
    return welded(Surface(points=surface.points * packed.scale, faces=surface.faces))


def assert_wedge(packed, scale):
    """Compare bounds and volume; a surface that is inside out has a negative one."""
    surface, corners = read(packed), WEDGE.vertices * scale
    assert surface.points.min(axis=0) == pytest.approx(corners.min(axis=0))
    assert surface.points.max(axis=0) == pytest.approx(corners.max(axis=0))
    volume = WEDGE.volume * abs(np.prod(scale))
    assert signed_volume(surface) == pytest.approx(volume, rel=1e-6)


def test_valid_binary_stl_is_unchanged():
    data = b"x" * 80 + STL[80:]
    packed = content(data, "a.STL", scale=(0.001, 0.002, 0.003))
    assert (packed.data, packed.scale, packed.change) == (data, (0.001, 0.002, 0.003), "")
    assert content(b"solid".ljust(80) + STL[80:]).data == STL  # it looks like text


def msh():
    counts = np.array([len(SURFACE.points), 0, 0, len(SURFACE.faces)], "<i4")
    points, faces = SURFACE.points.astype("<f4"), SURFACE.faces.astype("<i4")
    return counts.tobytes() + points.tobytes() + faces.tobytes()


FORMATS = {name: WEDGE.export(file_type=name) for name in ("obj", "ply", "glb")}
FORMATS |= {"stl": WEDGE.export(file_type="stl_ascii"), "msh": msh()}


@pytest.mark.parametrize("suffix", FORMATS)
def test_formats_become_binary_stl(suffix):
    text = FORMATS[suffix]
    data = text.encode() if isinstance(text, str) else text
    packed = content(data, f"a.{suffix}", (1, 2, 1))
    assert_wedge(packed, (1, 2, 1))
    assert packed.data[:6] == b"binary"
    assert content(data, f"a.{suffix}").data == packed.data
    spec = mujoco.MjSpec()
    spec.add_mesh(name="m", file="a.stl")
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="m")
    spec.assets = {"a.stl": packed.data}
    assert spec.compile().nmesh == 1


@pytest.mark.parametrize("scale", [(1, -1, 1), (-0.5, 2, 1), (-1, -1, -2), (-1, -1, 1)])
def test_mirrored_mesh_faces_outward(scale):
    packed = content(STL, scale=scale)
    assert packed.scale == (1, 1, 1)
    assert_wedge(packed, scale)


def test_scaled_surface():
    assert signed_volume(scaled(SURFACE, (1, -1, 1))) == pytest.approx(WEDGE.volume)
    assert scaled(SURFACE, (1, 2, 1)).faces is SURFACE.faces


def test_mesh_with_too_many_faces_is_decimated(monkeypatch):
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    monkeypatch.setattr(module, "MAX_FACES", 1280)
    assert content(stl_of(ball)).change == ""
    monkeypatch.setattr(module, "MAX_FACES", 1279)
    packed = content(stl_of(ball), scale=(1, 1, -1))
    count = len(read(packed).faces)
    assert packed.change == f"was decimated from 1,280 to {count:,} faces"
    assert signed_volume(read(packed)) == pytest.approx(ball.volume, rel=0.05)


@pytest.mark.parametrize(
    ("scale", "flat"),
    [((1, 1, 0), True), ((0.78e-5,) * 3, False), ((0.77e-5,) * 3, True)],
)
def test_scale_makes_mesh_flat(scale, flat):
    """The wedge has 2.167 m3, and the smallest volume is 1e-15 m3."""
    assert has_no_volume(Meshes({Path("a.stl"): STL}), mesh("a.stl", scale).mesh) is flat


def test_meshes_without_volume_are_errors():
    with pytest.raises(MeshError, match="is flat"):
        content(STL, scale=(1, 1, 0))
    with pytest.raises(MeshError, match="does not exist"):
        mesh_bytes(Meshes(), mesh("nowhere.stl").mesh)
