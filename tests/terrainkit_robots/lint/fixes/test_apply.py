import os
from pathlib import Path
from types import SimpleNamespace

import pytest
from lxml import etree

from terrainkit import TerrainkitError
from terrainkit.errors import ExportError
from terrainkit_robots.description.fix import (
    Fix,
    InsertChild,
    RemoveElement,
    ReplaceBytes,
    SetAttribute,
    WriteFile,
)
from terrainkit_robots.description.model import RobotModel, Source
from terrainkit_robots.lint.fixes.apply import fix_robot, unified_diff, write_fixes
from terrainkit_robots.lint.rule import Finding
from terrainkit_robots.lint.runner import Report
from terrainkit_robots.mesh.mesh_cache import MeshError
from tests.tables import read_table

ROBOT = read_table(__file__, "robot")


def at(file, element):
    return Source(file=file, line=element + 1, element=element)


def finding(subject, message, source, *edits, safety="safe"):
    return Finding(
        code="INR002",
        name="negative-mass",
        severity="error",
        certainty="proven",
        subject=subject,
        message=message,
        hint="",
        source=source,
        fix=Fix(safety=safety, description="", edits=edits) if edits else None,
    )


def fixed(file, find, *parts, kind="urdf", unsafe=False):
    """Fix files; `find` yields the findings on an element and its source."""
    files = file, *parts

    def check(contents):
        findings = []
        for each in files:
            data = contents[each] if each in contents else each.read_bytes()
            for index, element in enumerate(etree.fromstring(data).iter(etree.Element)):
                findings += find(element, at(each, index))
        source = Source(file=file, line=0)
        model = RobotModel(name="r", kind=kind, file=file, source=source, sources=files)
        return Report(facts=SimpleNamespace(model=model), findings=tuple(findings))

    return fix_robot(file, check, unsafe=unsafe)


def positive_masses(element, source):
    mass = element.get("mass", "")
    if mass.startswith("-"):
        edit = SetAttribute(source=source, name="mass", value=mass[1:])
        yield finding(element.get("name"), f"a mass of {mass} kg", source, edit)


def renamed(new_name):
    """Return a check that wants another name of the root; `new_name` may return the same one."""

    def find(element, source):
        if element.tag == "robot":
            name = new_name(element.get("name"))
            yield finding("r", name, source, SetAttribute(source=source, name="name", value=name))

    return find


def with_mesh(path, content=lambda: b"mesh"):
    """Return a check that wants a mesh file, and its name in the robot."""

    def find(element, source):
        if element.tag == "robot" and element.get("mesh") is None:
            name = SetAttribute(source=source, name="mesh", value="new")
            yield finding("r", "no mesh", source, WriteFile(path=path, content=content), name)

    return find


def reasons(result):
    return [reason for _, reason in result.report.unfixed]


@pytest.fixture
def robot(tmp_path):
    folder = tmp_path / "package" / "urdf"
    folder.mkdir(parents=True)
    (folder / "r.urdf").write_bytes(ROBOT.encode())
    return folder / "r.urdf"


class TestFixRobot:
    def test_fixes_in_memory_only(self, robot):
        result = fixed(robot, positive_masses)
        assert result.before == {robot: ROBOT.encode()}
        assert result.after == {robot: ROBOT.replace("-1", "1").replace("-2", "2").encode()}
        assert result.new == {}
        assert [each.subject for each in result.report.fixed] == ["a", "b"]
        assert result.report.unfixed == result.report.findings == ()
        assert robot.read_bytes() == ROBOT.encode()

    def test_overlapping_fixes_take_several_rounds(self, robot):
        def find(element, source):
            for name in "xyz":
                if element.tag == "link" and element.get(name) is None:
                    edit = SetAttribute(source=source, name=name, value="1")
                    yield finding(element.get("name"), f"no {name}", source, edit)

        result = fixed(robot, find)
        assert (len(result.report.fixed), result.report.unfixed) == (6, ())
        links = etree.fromstring(result.after[robot]).iter("link")
        assert [[link.get(name) for name in "xyz"] for link in links] == [["1"] * 3] * 2

    def test_unsafe_fixes_need_the_option(self, robot):
        def find(element, source):
            if element.get("name") == "b":
                yield finding("b", "here", source, RemoveElement(source=source), safety="unsafe")

        kept = fixed(robot, find)
        assert kept.after == {}
        assert kept.report.fixed == kept.report.unfixed == ()
        assert b'"b"' not in fixed(robot, find, unsafe=True).after[robot]

    def test_findings_without_fix_stay_in_report(self, robot):
        result = fixed(robot, lambda _, source: [finding("a", "here", source)])
        assert result.report.fixed == result.report.unfixed == ()
        assert len(result.report.findings) == 3

    def test_ineffective_insertion_is_applied_once(self, robot):
        def find(element, source):
            if element.tag == "robot":
                edit = InsertChild(source=source, xml="<link/>")
                yield finding("r", "too few links", source, edit)

        result = fixed(robot, find)
        assert result.after[robot].count(b"<link/>") == 1
        assert result.report.fixed == ()
        assert reasons(result) == ["the fix was applied without effect"]

    @pytest.mark.parametrize(
        ("new_name", "reason", "letters"),
        [
            (lambda name: name, "the fix has no effect or reverts another", []),
            (lambda name: "rs"[name == "r"], "the fix has no effect or reverts another", []),
            (lambda name: name + "r", "not done after 50 rounds", [51]),
        ],
        ids=["same", "back and forth", "endless"],
    )
    def test_fixes_without_end_stop(self, robot, new_name, reason, letters):
        result = fixed(robot, renamed(new_name))
        assert reasons(result) == [reason]
        names = [len(etree.fromstring(data).get("name")) for data in result.after.values()]
        assert names == letters

    def test_impossible_fix_does_not_affect_others(self, robot):
        def find(element, source):
            yield from positive_masses(element, source)
            if element.tag == "robot":
                edits = (
                    SetAttribute(source=where, name="x", value="1")
                    for where in (source, at(source.file, 99))
                )
                yield finding("r", "nowhere", source, *edits)

        result = fixed(robot, find)
        assert len(result.report.fixed) == 2
        assert reasons(result) == ["element index: got 99; expected less than 3"]
        assert b'x="1"' not in result.after[robot]

    def test_xacro_is_not_changed(self, robot):
        result = fixed(robot, positive_masses, kind="xacro")
        assert result.after == {}
        assert reasons(result) == ["xacro files cannot be fixed"] * 2


class TestChangedFiles:
    def test_includes_below_the_robot_are_changed(self, robot):
        part = robot.parent / "parts" / "leg.xml"
        part.parent.mkdir()
        part.write_text(ROBOT)
        result = fixed(robot, positive_masses, part)
        assert set(result.after) == {robot, part}
        assert len(result.report.fixed) == 2  # equal findings in both files
        assert result.report.findings == ()

    @pytest.mark.parametrize("link", [False, True])
    def test_includes_outside_are_not_changed(self, robot, link):
        part = outside = robot.parent.parent / "leg.xml"
        outside.write_text(ROBOT)
        if link:
            part = robot.parent / "leg.xml"
            part.symlink_to(outside)
        result = fixed(robot, positive_masses, part)
        assert set(result.after) == {robot}
        assert set(reasons(result)) == {f"{part} is outside of {robot.parent} and is not changed"}

    def test_other_files_are_not_changed(self, robot):
        mesh = Source(file=robot.parent / "foot.stl", line=0)
        mesh.file.write_bytes(b"solid")
        edit = ReplaceBytes(source=mesh, start=0, end=5, replacement=b"")
        result = fixed(robot, lambda *_: [finding("foot", "ascii", mesh, edit)])
        assert set(reasons(result)) == {f"{mesh.file} is not a file of this robot"}

    def test_file_with_two_paths_is_changed_once(self, robot):
        result = fixed(robot, positive_masses, robot.parent / ".." / "urdf" / "r.urdf")
        assert set(result.after) == {robot}
        assert result.report.findings == ()


class TestNewFiles:
    @pytest.mark.parametrize("where", ["foot.stl", "meshes/foot.obj", "../meshes/foot.STL"])
    def test_created_in_package(self, robot, where):
        path = robot.parent / where
        path.parent.mkdir(exist_ok=True)
        result = fixed(robot, with_mesh(path))
        assert result.new == {path.resolve(): b"mesh"}
        assert not path.exists()
        write_fixes(result)
        assert path.read_bytes() == b"mesh"
        assert b'mesh="new"' in robot.read_bytes()
        again = fixed(robot, with_mesh(path))
        assert again.after == again.before == again.new == {}
        assert again.report.fixed == again.report.unfixed == ()
        assert unified_diff(again) == ""

    @pytest.mark.parametrize(
        ("where", "reason"), read_table(__file__, "invalid_paths_are_rejected")
    )
    def test_invalid_paths_are_rejected(self, robot, where, reason):
        package = robot.parent.parent
        other = package.parent / "other"
        for folder in (other, package / ".hidden", robot.parent / "folder.stl"):
            folder.mkdir()
        (robot.parent / "link").symlink_to(other)
        (robot.parent / "there.stl").write_bytes(b"mush")
        (robot.parent / "dangling.stl").symlink_to(other / "new.stl")
        result = fixed(robot, with_mesh(robot.parent / where))
        assert result.after == result.new == {}
        assert reason in reasons(result)[0]

    def test_equal_existing_file_is_used(self, robot):
        path = robot.parent / "foot.stl"
        path.write_bytes(b"mesh")
        result = fixed(robot, with_mesh(path))
        assert (result.new, len(result.report.fixed)) == ({}, 1)

    def test_two_fixes_must_write_equal_content(self, robot):
        path = robot.parent / "foot.stl"

        def find(element, source):
            if element.tag == "link" and element.get("mesh") is None:
                name, content = element.get("name"), element.get("mass").encode()
                new = WriteFile(path=path, content=lambda: content)
                edit = SetAttribute(source=source, name="mesh", value="new")
                yield finding(name, "no mesh", source, new, edit)

        result = fixed(robot, find)
        assert [each.subject for each in result.report.fixed] == ["a"]
        assert reasons(result) == [f"{path} exists with different content"]
        robot.write_text(ROBOT.replace("-2", "-1"))
        result = fixed(robot, find)
        assert [each.subject for each in result.report.fixed] == ["a", "b"]
        assert result.new == {path: b"-1"}

    def test_failed_content_is_unfixed(self, robot):
        def content():
            raise MeshError("the mesh has no faces")

        result = fixed(robot, with_mesh(robot.parent / "foot.stl", content))
        assert reasons(result) == ["the mesh has no faces"]


class TestWriteFixes:
    def test_keeps_mode_link_and_line_ends(self, robot, tmp_path):
        text = b"\xef\xbb\xbf" + ROBOT.replace("\n", "\r\n").encode()
        robot.write_bytes(text)
        robot.chmod(0o640)
        link = tmp_path / "link.urdf"
        link.symlink_to(robot)
        write_fixes(fixed(link, positive_masses))
        assert link.is_symlink()
        assert robot.read_bytes() == text.replace(b"-1", b"1").replace(b"-2", b"2")
        assert robot.stat().st_mode & 0o777 == 0o640
        assert [path.name for path in robot.parent.iterdir()] == ["r.urdf"]

    def test_changed_file_is_not_overwritten(self, robot):
        result = fixed(robot, positive_masses)
        robot.write_text("<robot/>")
        with pytest.raises(ExportError, match="has changed since it was read"):
            write_fixes(result)
        assert robot.read_text() == "<robot/>"
        robot.unlink()
        with pytest.raises(TerrainkitError, match="no file"):
            write_fixes(result)

    def test_existing_new_file_is_not_overwritten(self, robot):
        path = robot.parent / "foot.stl"
        result = fixed(robot, with_mesh(path))
        path.write_bytes(b"other")
        with pytest.raises(ExportError, match="exists"):
            write_fixes(result)
        assert (path.read_bytes(), robot.read_text()) == (b"other", ROBOT)

    @pytest.mark.skipif(os.geteuid() == 0, reason="root may write everything")
    def test_read_only_file_is_not_overwritten(self, robot):
        robot.chmod(0o440)
        with pytest.raises(ExportError, match="read-only"):
            write_fixes(fixed(robot, positive_masses))


class TestUnifiedDiff:
    def test_diff_of_a_file(self, robot, monkeypatch):
        monkeypatch.chdir(robot.parent)
        assert unified_diff(fixed(Path("r.urdf"), positive_masses)) == (
            "--- r.urdf\n"
            "+++ r.urdf\n"
            "@@ -1,6 +1,6 @@\n"
            ' <robot name="r">\n'
            "   <!-- kept -->\n"
            "-  <link name='a'  mass=\"-1\"/>\n"
            "+  <link name='a'  mass=\"1\"/>\n"
            '   <link name="b"\n'
            '-        mass="-2" />\n'
            '+        mass="2" />\n'
            " </robot>\n"
        )

    @pytest.mark.parametrize(
        "text", ['<a mass="-1"/>', '<a mass="-1"/>\r\n', '<a x="\u2028" mass="-1"/>']
    )
    def test_diff_keeps_line_ends(self, robot, text):
        robot.write_bytes(text.encode())
        diff = unified_diff(fixed(robot, positive_masses))
        ending = "" if text.endswith("\n") else "\n\\ No newline at end of file\n"
        assert diff.endswith(f"-{text}{ending}+{text.replace('-', '')}{ending}")

    def test_diff_decodes_other_encodings(self, robot):
        text = '<?xml version="1.0" encoding="iso-8859-1"?><a name="é" mass="-1"/>'
        robot.write_bytes(text.encode("latin-1"))
        assert 'name="é"' in unified_diff(fixed(robot, positive_masses))

    def test_new_files_are_listed(self, robot):
        path = robot.parent / "foot.stl"
        diff = unified_diff(fixed(robot, with_mesh(path)))
        assert diff.startswith(f"New file {path} (4 bytes)\n--- {robot}\n")
