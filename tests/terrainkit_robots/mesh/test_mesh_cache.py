import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import trimesh

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.model import MeshFile, Source
from terrainkit_robots.lint.rule import rules
from terrainkit_robots.lint.runner import lint
from terrainkit_robots.mesh import mesh_cache as module
from terrainkit_robots.mesh.mesh_cache import MeshError, Meshes, TooLargeError
from tests.small_robots import joint, link, shape
from tests.terrainkit_robots.export.made_models import stl_of

BOX = stl_of(trimesh.creation.box([1, 2, 3]))
RING = stl_of(trimesh.creation.annulus(r_min=0.9, r_max=1.0, height=0.1))
SQUARE = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"


def use_of(path, scale=(1.0, 1.0, 1.0)):
    source = Source(file=Path("robot.urdf"), line=1)
    return MeshFile(source=source, filename=path.name, path=path, scale=scale)


@pytest.fixture
def mesh(tmp_path):
    """Return a function that writes a file and returns a use of it."""

    def make(data=BOX, name="a.stl", scale=(1.0, 1.0, 1.0)):
        (tmp_path / name).write_bytes(data)
        return use_of(tmp_path / name, scale)

    return make


def test_memory_of_an_stl_is_that_of_its_unique_vertices(mesh):
    ball = trimesh.creation.icosphere(subdivisions=5)
    use, meshes = mesh(stl_of(ball)), Meshes()
    meshes.exists(use.path)
    tracemalloc.start()
    meshes.vertices(use)
    meshes.welded(use.path)
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    # a half of a vertex per face in single and in double precision, and three indices of 4 bytes
    assert held < 1.2 * len(ball.faces) * (0.5 * (12 + 24) + 12)


def test_scale_is_applied_to_vertices(mesh):
    meshes, use = Meshes(), mesh(scale=(1, 10, -0.1))
    vertices = meshes.vertices(use)
    assert vertices.dtype == np.float64
    assert np.ptp(vertices, axis=0) == pytest.approx([1, 20, 0.3])
    assert meshes.diagonal(use) == pytest.approx((1 + 400 + 0.09) ** 0.5)


@pytest.mark.parametrize("factor", [float("nan"), float("inf"), 1e308, 2e6, -2e6])
def test_large_coordinates_are_rejected(mesh, factor):
    use = mesh(scale=(factor, 1, 1))
    assert not Meshes().is_readable(use)
    for ask in (Meshes().vertices, Meshes().solid_volume, Meshes().hull_volume):
        with pytest.raises(MeshError, match="coordinates beyond 1,000,000 m"):
            ask(use)
    Meshes().partial_diagonal(use)  # nor does it warn
    assert Meshes().is_readable(mesh(scale=(1.999e6, 1, 1)))  # the box has half a meter


def test_missing_file(tmp_path):
    use, meshes = use_of(tmp_path / "a.stl"), Meshes()
    assert not meshes.is_readable(use)
    assert not meshes.exists(use.path)
    for ask in (meshes.vertices, meshes.volume, meshes.hull_volume, meshes.is_flat):
        with pytest.raises(MeshError, match="does not exist"):
            ask(use)
    assert not meshes.opened


def test_volume_of_solid_and_hull(mesh):
    meshes, use = Meshes(), mesh(RING, scale=(2, 1, -1))
    solid = np.pi * (1 - 0.9**2) * 0.1 * 2
    assert meshes.volume(use) == meshes.solid_volume(use) == pytest.approx(solid, rel=0.02)
    assert meshes.hull_volume(use) == pytest.approx(np.pi * 0.1 * 2, rel=0.02)


def test_open_mesh_has_volume_of_hull(mesh):
    box = trimesh.creation.box([1, 2, 3])
    box.update_faces(np.arange(12) > 0)
    meshes, use = Meshes(), mesh(stl_of(box))
    assert meshes.solid_volume(use) is None
    assert meshes.volume(use) == pytest.approx(6.0)


def test_flat_mesh_has_no_volume(mesh):
    meshes, use = Meshes(), mesh(SQUARE, "a.obj")
    assert (meshes.volume(use), meshes.is_flat(use)) == (0.0, True)
    with pytest.raises(MeshError, match="flat"):
        meshes.hull_volume(use)
    use = mesh(scale=(1, 0, 1))
    assert (meshes.volume(use), meshes.is_flat(use)) == (0.0, True)


def test_file_is_read_once(mesh):
    meshes, use = Meshes(), mesh()
    assert meshes.exists(use.path)
    assert not meshes.opened
    assert meshes.header(use.path).faces == meshes.faces(use.path) == 12
    assert meshes.opened == {use.path: 1}
    other = use_of(use.path, (2, 2, 2))
    for ask in (meshes.vertices, meshes.volume, meshes.hull_volume, meshes.diagonal):
        ask(use), ask(other), ask(use)
    assert meshes.opened == {use.path: 2}  # its header, and all of it
    assert meshes.vertices(use) is meshes.vertices(use)


def test_broken_file_is_read_once(mesh):
    meshes, use = Meshes(), mesh(b"v 0 0 x\n", "a.obj")
    for _ in range(3):
        assert not meshes.is_readable(use)
        with pytest.raises(MeshError, match="text"):
            meshes.volume(use)
    assert meshes.opened == {use.path: 2}


def test_given_contents_replace_files(mesh, tmp_path):
    use = mesh(b"not an STL")
    held = Meshes({use.path: BOX})
    more = held.with_contents({tmp_path / "new.stl": BOX})
    for path in (use.path, tmp_path / "new.stl", tmp_path / "x/../new.stl"):
        assert more.volume(use_of(path)) == pytest.approx(6.0)
        assert more.exists(path)
        assert more.data(path) == BOX
    assert not more.opened
    found = [held.has_contents(tmp_path / name) for name in ("a.stl", "new.stl")]
    assert found == [True, False]
    assert Meshes().data(use.path) == b"not an STL"


OBJ = b"".join(b"v %d 0 0\n" % x for x in range(10_000)) + b"f 1 2 10000\n"


def dae(count, unit=b""):
    numbers = b" ".join(b"%d 0 0" % x for x in range(count))
    return b"<COLLADA><asset>%s</asset><float_array>%s</float_array></COLLADA>" % (unit, numbers)


def test_first_part_of_long_file(mesh):
    meshes, use = Meshes(), mesh(OBJ, "a.obj", (0.1, 1, 1))
    assert 100 < meshes.partial_diagonal(use) < 999.9
    assert meshes.diagonal(use) == pytest.approx(999.9)
    assert meshes.partial_diagonal(use) is None  # the whole is known by now


# A part has more than 20 vertices. The last one of a text may be cut off.
@pytest.mark.parametrize(
    ("name", "data", "diagonal"),
    [
        ("a.obj", OBJ[: 8 * 10 + 9 * 12], 20),
        ("a.obj", OBJ[: 8 * 10 + 9 * 11], None),
        ("a.dae", dae(1000, b"<unit name='mm' meter='0.001'/>"), 0.998),
        ("a.dae", dae(22), 20),
        ("a.dae", dae(21), None),
        ("a.dae", b"<COLLADA></COLLADA>", None),
        ("a.stl", BOX, 14**0.5),
        ("a.stl", bytes(100), None),
        ("b.obj", b"v a b c\n" * 50, None),
        ("b.ply", BOX, None),
    ],
)
def test_partial_diagonal(mesh, name, data, diagonal):
    found = Meshes().partial_diagonal(mesh(data, name))
    assert found == (None if diagonal is None else pytest.approx(diagonal))


@pytest.mark.parametrize(
    ("limit", "value", "ask", "data", "message"),
    [
        ("DEFAULT_MAX_BYTES", 684, "vertices", BOX, "has 684 bytes; expected at most 683"),
        ("MAX_TOTAL_BYTES", 684, "vertices", BOX, "exceeds the limit of 683 bytes"),
        ("MAX_TOTAL_WORDS", 21, "vertices", SQUARE, "exceeds the limit of 20 numbers"),
        ("MAX_WELDED_FACES", 12, "solid_volume", BOX, "has 12 faces; expected at most 11"),
    ],
)
def test_limits(mesh, monkeypatch, limit, value, ask, data, message):
    use = mesh(data, "a.stl" if data == BOX else "a.obj")
    monkeypatch.setattr(module, limit, value)
    getattr(Meshes(), ask)(use)
    monkeypatch.setattr(module, limit, value - 1)
    with pytest.raises(TooLargeError, match=message):
        getattr(Meshes(), ask)(use)
    if ask == "solid_volume":
        assert Meshes().hull_volume(use) == pytest.approx(6.0)


def test_limits_are_those_of_all_meshes(mesh, monkeypatch):
    monkeypatch.setattr(module, "MAX_TOTAL_BYTES", 2 * 684 - 1)
    meshes = Meshes()
    meshes.vertices(mesh())
    with pytest.raises(TooLargeError, match="limit of 1,367 bytes"):
        meshes.vertices(mesh(name="b.stl"))


def test_rules_read_no_visual_meshes(tmp_path):
    parts = joint("a", "b", "0 0 1")
    for name in "ab":
        (tmp_path / f"{name}.stl").write_bytes(BOX)
        parts += link(name, shape(f'mesh filename="{name}.stl" scale=".1 .1 .1"', kind="visual"))
    (tmp_path / "robot.urdf").write_text(f'<robot name="r">{parts}</robot>')
    robot = Facts(load_robot(tmp_path / "robot.urdf"))
    by_name = ("MSH001", "MSH002", "MSH003", "MSH004", "MSH012")
    lint(robot, [rule for rule in rules() if rule.code in by_name])
    assert not robot.meshes.opened
    lint(robot, [rule for rule in rules() if rule.family == "MSH"])
    # The header and the beginning of each.
    assert robot.meshes.opened == {tmp_path / "a.stl": 2, tmp_path / "b.stl": 2}
    assert robot.meshes._bytes == 0
