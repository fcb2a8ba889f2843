from collections import Counter
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
from terrainkit_robots.mesh.surface import Surface, binary_stl
from tests.robots import REAL_ROBOTS


def stl_of(mesh):
    return binary_stl(Surface(points=np.asarray(mesh.vertices), faces=np.asarray(mesh.faces)))


BOX = stl_of(trimesh.creation.box([1, 2, 3]))
RING = stl_of(trimesh.creation.annulus(r_min=0.9, r_max=1.0, height=0.1))


def use_of(path, scale=(1.0, 1.0, 1.0)):
    return MeshFile(
        source=Source(file=Path("robot.urdf"), line=1), filename=path.name, path=path, scale=scale
    )


@pytest.fixture
def mesh(tmp_path):
    """Return a function that writes a file and returns a use of it."""

    def make(data=BOX, name="a.stl", scale=(1.0, 1.0, 1.0)):
        (tmp_path / name).write_bytes(data)
        return use_of(tmp_path / name, scale)

    return make


class TestVertices:
    def test_scale_is_applied(self, mesh):
        vertices = Meshes().vertices(mesh(scale=(1, 10, -0.1)))
        assert vertices.dtype == np.float64
        assert np.ptp(vertices, axis=0) == pytest.approx([1, 20, 0.3])

    @pytest.mark.parametrize("factor", [float("nan"), float("inf"), 1e308, 1e7])
    def test_large_coordinates_are_rejected(self, mesh, factor):
        use = mesh(scale=(factor, 1, 1))
        assert not Meshes().is_readable(use)
        with pytest.raises(MeshError, match="coordinates beyond 1,000,000 m"):
            Meshes().vertices(use)
        Meshes().partial_diagonal(use)  # nor does it warn

    def test_missing_file(self, tmp_path):
        use = use_of(tmp_path / "a.stl")
        meshes = Meshes()
        assert not meshes.is_readable(use)
        assert not meshes.exists(use.path)
        for ask in (meshes.vertices, meshes.volume, meshes.hull_volume, meshes.is_flat):
            with pytest.raises(MeshError, match="does not exist"):
                ask(use)
        assert not meshes.opened


class TestVolume:
    def test_solid_and_hull(self, mesh):
        meshes, use = Meshes(), mesh(RING, scale=(2, 1, -1))
        solid = np.pi * (1 - 0.9**2) * 0.1 * 2
        assert meshes.volume(use) == meshes.solid_volume(use) == pytest.approx(solid, rel=0.02)
        assert meshes.hull_volume(use) == pytest.approx(np.pi * 0.1 * 2, rel=0.02)

    def test_open_mesh_has_volume_of_hull(self, mesh):
        box = trimesh.creation.box([1, 2, 3])
        box.update_faces(np.arange(12) > 0)
        meshes, use = Meshes(), mesh(stl_of(box))
        assert meshes.solid_volume(use) is None
        assert meshes.volume(use) == pytest.approx(6.0)

    def test_flat_mesh_has_no_volume(self, mesh):
        square = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"
        meshes, use = Meshes(), mesh(square, "a.obj")
        assert meshes.volume(use) == 0.0
        assert meshes.is_flat(use)
        with pytest.raises(MeshError, match="flat"):
            meshes.hull_volume(use)

    def test_zero_scale_is_flat(self, mesh):
        meshes, use = Meshes(), mesh(scale=(1, 0, 1))
        assert meshes.is_flat(use)
        assert meshes.volume(use) == 0.0


class TestCaching:
    def test_file_is_read_once(self, mesh):
        meshes, use = Meshes(), mesh()
        other = use_of(use.path, (2, 2, 2))
        for ask in (meshes.vertices, meshes.volume, meshes.hull_volume, meshes.diagonal):
            ask(use), ask(other), ask(use)
        assert meshes.opened == {use.path: 2}  # its header, and all of it
        assert meshes.vertices(use) is meshes.vertices(use)

    def test_broken_file_is_read_once(self, mesh):
        meshes, use = Meshes(), mesh(b"v 0 0 x\n", "a.obj")
        for _ in range(3):
            assert not meshes.is_readable(use)
            with pytest.raises(MeshError, match="text"):
                meshes.volume(use)
        assert meshes.opened == {use.path: 2}

    def test_header_does_not_read_data(self, mesh):
        meshes, use = Meshes(), mesh()
        assert meshes.header(use.path).faces == meshes.faces(use.path) == 12
        assert meshes.opened == {use.path: 1}

    def test_exists_opens_nothing(self, mesh):
        meshes, use = Meshes(), mesh()
        assert meshes.exists(use.path)
        assert not meshes.opened


class TestContents:
    def test_contents_replace_file(self, mesh, tmp_path):
        use = mesh(b"not an STL")
        meshes = Meshes({use.path: BOX, tmp_path / "new.stl": BOX})
        assert meshes.volume(use) == pytest.approx(6.0)
        assert meshes.exists(tmp_path / "new.stl")
        assert meshes.volume(use_of(tmp_path / "x/../new.stl")) == pytest.approx(6.0)
        assert not meshes.opened


class TestPartialDiagonal:
    OBJ = b"".join(b"v %d 0 0\n" % x for x in range(10_000)) + b"f 1 2 10000\n"

    def test_first_part_of_long_file(self, mesh):
        meshes, use = Meshes(), mesh(self.OBJ, "a.obj", (0.1, 1, 1))
        about = meshes.partial_diagonal(use)
        assert about is not None
        assert 100 < about < 999.9
        assert meshes.diagonal(use) == pytest.approx(999.9)
        assert meshes.partial_diagonal(use) is None  # the whole is known by now

    def test_too_few_vertices(self, mesh):
        assert Meshes().partial_diagonal(mesh(self.OBJ[:100] + b"\nf 1 2 3\n", "a.obj")) is None

    def test_unit_of_collada(self, mesh):
        numbers = b" ".join(b"%d 0 0" % x for x in range(1000))
        data = (
            b'<COLLADA><asset><unit name="mm" meter="0.001"/></asset><float_array id="a">'
            + numbers
            + b"</float_array></COLLADA>"
        )
        assert Meshes().partial_diagonal(mesh(data, "a.dae")) == pytest.approx(0.998)

    def test_stl(self, mesh):
        assert Meshes().partial_diagonal(mesh()) == pytest.approx(14**0.5)

    def test_broken_file(self, mesh):
        assert Meshes().partial_diagonal(mesh(b"\0" * 100)) is None
        assert Meshes().partial_diagonal(mesh(b"v a b c\n" * 50, "b.obj")) is None


class TestLimits:
    def test_file_size(self, mesh, monkeypatch):
        monkeypatch.setattr(module, "_DEFAULT_MAX_BYTES", 100)
        with pytest.raises(TooLargeError, match="has 684 bytes; expected at most 100"):
            Meshes().vertices(mesh())

    def test_total_size(self, mesh, monkeypatch):
        monkeypatch.setattr(module, "_MAX_TOTAL_BYTES", 1000)
        meshes = Meshes()
        meshes.vertices(mesh())
        with pytest.raises(TooLargeError, match="limit of 1,000 bytes"):
            meshes.vertices(mesh(name="b.stl"))

    def test_total_numbers(self, mesh, monkeypatch):
        monkeypatch.setattr(module, "_MAX_TOTAL_WORDS", 100)
        with pytest.raises(TooLargeError, match="limit of 100 numbers"):
            Meshes().vertices(mesh(b"v 0 0 0\n" * 50, "a.obj"))

    def test_welded_faces(self, mesh, monkeypatch):
        monkeypatch.setattr(module, "_MAX_WELDED_FACES", 10)
        with pytest.raises(TooLargeError, match="12 faces"):
            Meshes().solid_volume(mesh())
        assert Meshes().hull_volume(mesh()) == pytest.approx(6.0)


AGREED = {
    # a mesh that is named and not there: MuJoCo does not load this file
    ("go2_mjcf/go2.xml", "MSH001", "base_4.obj"),
    # what is drawn, taken for what collides
    ("h1/urdf/h1.urdf", "MSH009", "../meshes/torso_link.STL"),
    ("h1/h1.xml", "MSH009", "torso_link.STL"),
    ("g1/g1_29dof.urdf", "MSH009", "meshes/torso_link.STL"),
    ("g1/g1_29dof.urdf", "MSH009", "meshes/pelvis_contour_link.STL"),
    ("g1/g1_29dof.xml", "MSH009", "torso_link.STL"),
    ("g1/g1_29dof.xml", "MSH009", "pelvis_contour_link.STL"),
}


class TestRobots:
    """What the rules make of robots that other people published."""

    @pytest.mark.parametrize("name", REAL_ROBOTS)
    def test_only_known_findings(self, robot_file, name):
        own = [rule for rule in rules() if rule.family == "MSH" and rule.severity != "note"]
        findings = lint(Facts(load_robot(robot_file(name))), own).findings
        told = {(name, f.code, f.subject) for f in findings if f.severity != "note"}
        assert told == {agreed for agreed in AGREED if agreed[0] == name}
        assert {f.code for f in findings if f.severity == "error"} <= {"MSH001"}

    @pytest.mark.parametrize("name", ["go2/urdf/go2.urdf", "h1/urdf/h1.urdf"])
    def test_name_rules_open_no_meshes(self, robot_file, name):
        facts = Facts(load_robot(robot_file(name)))
        by_name = ("MSH001", "MSH002", "MSH003", "MSH004", "MSH012")
        lint(facts, [rule for rule in rules() if rule.code in by_name])
        assert facts.meshes.opened == Counter()

    def test_visual_meshes_are_not_read(self, robot_file):
        facts = Facts(load_robot(robot_file("go2/urdf/go2.urdf")))
        lint(facts, [rule for rule in rules() if rule.family == "MSH"])
        # each header, and the beginning of each
        assert len(facts.meshes.opened) == 7
        assert set(facts.meshes.opened.values()) == {2}
        assert facts.meshes._bytes == 0


def test_with_contents(tmp_path):
    (tmp_path / "here.stl").write_bytes(b"here")
    held = Meshes({tmp_path / "held.stl": b"held"})
    more = held.with_contents({tmp_path / "more.stl": b"more"})
    for name in ("here", "held", "more"):
        assert more.data(tmp_path / f"{name}.stl") == name.encode()
    assert more.has_contents(tmp_path / "more.stl")
    assert not held.has_contents(tmp_path / "more.stl")
