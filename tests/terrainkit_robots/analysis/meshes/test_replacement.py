import pytest
import trimesh

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.meshes import uses
from terrainkit_robots.description.load import load_robot
from tests.small_robots import link, shape

BALL = trimesh.creation.icosphere(subdivisions=3)  # 1280 faces, 642 vertices


@pytest.fixture
def used(tmp_path):
    """Return a function that writes a mesh and returns its use."""

    def make(mesh=BALL, name="a.stl", kind="collision", scale="1 1 1"):
        mesh.export(tmp_path / name)
        part = link("a", shape(f'mesh filename="{name}" scale="{scale}"', kind=kind))
        (tmp_path / "robot.urdf").write_text(f'<robot name="r">{part}</robot>')
        return Facts(load_robot(tmp_path / "robot.urdf")).mesh_files[0]

    return make


def faces(stl):
    return int.from_bytes(stl[80:84], "little")


def test_dense_mesh_is_replaced_by_its_hull(used, monkeypatch):
    mesh = used(trimesh.creation.annulus(0.9, 1, 1))
    for limit, expected in ((256, 256), (255, 124)):
        monkeypatch.setattr(uses, "MAX_COLLISION_FACES", limit)
        assert faces(mesh.stl_or_hull()) == expected
    assert mesh.count_faces() == 256
    assert faces(used().hull_stl()) < 1000  # 500 vertices


@pytest.mark.parametrize(
    ("name", "kind", "expected"),
    [("a.stl", "visual", 1280), ("a.obj", "visual", None), ("a.obj", "collision", 1280)],
)
def test_faces_of_visual_meshes_are_counted_by_the_header(used, name, kind, expected):
    mesh = used(name=name, kind=kind)
    assert mesh.count_faces() == expected
    mesh.mesh.path.write_bytes(b"")
    mesh.meshes._cache.clear()
    assert mesh.count_faces() is None


def test_flat_mesh_has_no_hull(used):
    for scale, expected in (("1 1 1", True), ("1 0 1", False)):
        mesh = used(scale=scale)
        assert mesh.has_hull(mesh.uses) == expected


def test_simplified_mesh_has_few_faces(used, monkeypatch):
    mesh = used()
    assert mesh.simplified_stl()[84:] != b""
    assert faces(mesh.simplified_stl()) == 1280
    monkeypatch.setattr(uses, "MAX_SIMPLIFIED_FACES", 300)
    assert 100 < faces(mesh.simplified_stl()) <= 300
    monkeypatch.setattr(uses, "MAX_SIMPLIFIED_FACES", 1)
    with pytest.raises(uses.MeshError, match="has no faces left"):
        mesh.simplified_stl()
