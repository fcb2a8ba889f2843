from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.meshes.uses import (
    _unused_path,
    is_missing,
    mesh_uses,
    relative_name,
    rename_edits,
)
from terrainkit_robots.description.fix import WriteFile
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.fixes.edits import EditedBytes
from tests.tables import read_table

TWO_LINKS = read_table(__file__, "two_links")


@pytest.fixture
def robot(tmp_path):
    """Return a function that loads a robot from a folder with m/foot.stl."""

    def make(text=TWO_LINKS, name="robot.urdf"):
        (tmp_path / "m").mkdir()
        (tmp_path / "m/foot.stl").write_bytes(b"x")
        (tmp_path / name).write_text(text)
        return Facts(load_robot(tmp_path / name))

    return make


def test_mesh_uses_of_every_link(robot):
    uses = mesh_uses(robot().model)
    assert [(use.link.name, use.mesh.filename, use.is_collision) for use in uses] == [
        ("a", "./m/foot.stl", True),
        ("a", "m/foot.stl", False),
        ("b", "m/foot.stl", True),
        ("b", "m/hand.stl", False),
    ]


def test_mesh_names_group_equal_names(robot):
    used = robot().mesh_names
    assert [(u.label, len(u.uses), u.source.line, u.strict, is_missing(u)) for u in used] == [
        ("./m/foot.stl (collision mesh of a)", 1, 4, True, False),
        ("m/foot.stl (collision mesh of b)", 2, 3, True, False),
        ("m/hand.stl (visual mesh of b)", 1, 8, False, True),
    ]


def test_mesh_files_skip_missing_files(robot):
    (used,) = robot().mesh_files
    assert (used.name, used.source.line, len(used.uses)) == ("m/foot.stl", 3, 3)
    assert used.role == "collision mesh of a, b"
    assert [use.link.name for use in used.collisions] == ["a", "b"]


def replaced(robot, suffix="_hull.stl"):
    """Return the edits that replace the only mesh file."""
    (used,) = robot.mesh_files
    return used.replace_edits(robot.model, used.uses, suffix, lambda: b"hull")


def test_replace_edits_change_every_use(robot):
    write, *edits = replaced(robot())
    assert isinstance(write, WriteFile)
    assert (write.path.name, write.content()) == ("foot_hull.stl", b"hull")
    assert [(edit.source.line, edit.name, edit.value) for edit in edits] == [
        (line, "filename", "m/foot_hull.stl") for line in (3, 4, 7)
    ]


def test_replace_edits_keep_existing_files(robot, tmp_path):
    given = robot()
    (tmp_path / "m/foot_hull.stl").write_bytes(b"somebody's")
    assert replaced(given)[0].path.name == "foot_hull_2.stl"


def test_relative_name_of_mesh(robot, tmp_path):
    facts = robot()
    assert relative_name(facts.model, tmp_path / "m/foot.stl") == "m/foot.stl"
    assert relative_name(facts.model, tmp_path.parent / "x/foot.stl") == "../x/foot.stl"


def test_relative_name_through_symbolic_link(robot, tmp_path):
    robot()
    elsewhere = tmp_path / "far/away"
    elsewhere.mkdir(parents=True)
    (tmp_path / "linked").symlink_to(elsewhere)
    (elsewhere / "robot.urdf").write_text(TWO_LINKS)
    facts = Facts(load_robot(tmp_path / "linked/robot.urdf"))
    name = relative_name(facts.model, tmp_path / "m/foot.stl")
    assert (tmp_path / "linked" / name).samefile(tmp_path / "m/foot.stl")


def test_replace_edits_of_mjcf_are_relative_to_meshdir(robot):
    text = """<mujoco><compiler meshdir="m"/>
      <asset><mesh name="f" file="foot.stl"/></asset>
      <worldbody><body name="a"><freejoint/><geom type="mesh" mesh="f" mass="1"/></body></worldbody>
    </mujoco>"""
    write, edit = replaced(robot(text, "robot.xml"))
    assert (write.path.name, edit.name, edit.value) == ("foot_hull.stl", "file", "foot_hull.stl")


@pytest.mark.parametrize("mesh", ['file="foot.stl"', 'class="c" file="foot.stl"'])
def test_replaced_mesh_keeps_the_name_that_its_file_implied(robot, mesh):
    text = f"""<mujoco><compiler meshdir="m"/><default><default class="c"/></default>
      <asset><mesh {mesh}/></asset>
      <worldbody><body name="a"><freejoint/>
        <geom type="mesh" mesh="foot" mass="1"/></body></worldbody>
    </mujoco>"""
    facts = robot(text, "robot.xml")
    _, *edits = replaced(facts)
    edited = EditedBytes(text.encode())
    edited.apply(edited.prepare(edits))
    assert f'<mesh {mesh.replace("foot", "foot_hull")} name="foot"/>' in edited.result().decode()


def test_replace_edits_of_xacro_and_malformed_files_are_none(robot):
    given = robot()
    expanded = Facts(replace(given.model, kind="xacro"))
    (used,) = expanded.mesh_files
    assert rename_edits(expanded.model, used.uses, "x") is None
    assert replaced(expanded) is None
    given.model.file.write_text(TWO_LINKS.replace("</robot>", ""))
    assert replaced(Facts(load_robot(given.model.file))) is None


@pytest.mark.parametrize(
    ("number", "expected"), [(0, "a_hull.stl"), (1, "a_hull_2.stl"), (99, "a_hull.stl")]
)
def test_unused_path_has_the_first_free_number(number, expected):
    taken = ["a_hull.stl", *(f"a_hull_{k}.stl" for k in range(2, 101))][:number]
    meshes = SimpleNamespace(exists=lambda path: path.name in taken)
    assert _unused_path(meshes, Path("m/a.dae"), "_hull.stl") == Path("m", expected)
