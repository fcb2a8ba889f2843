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

ROBOT = """<robot name="r">
  <!-- kept -->
  <link name='a'  mass="-1"/>
  <link name="b"
        mass="-2" />
</robot>
"""


def at(file, element):
    return Source(file=file, line=element + 1, element=element)


def finding(subject, message, file, *edits, safety="safe"):
    fix = Fix(safety=safety, description="", edits=edits) if edits else None
    return Finding(
        code="INR002",
        name="negative-mass",
        severity="error",
        certainty="proven",
        subject=subject,
        message=message,
        hint="",
        source=Source(file=file, line=0),
        fix=fix,
    )


def make_check(find, *files, kind="urdf"):
    """Return a check of files. `find` yields the findings on an element."""

    def check(contents):
        findings = []
        for file in files:
            data = contents[file] if file in contents else file.read_bytes()
            for index, element in enumerate(etree.fromstring(data).iter(etree.Element)):
                findings += find(element, at(file, index))
        source = Source(file=files[0], line=0)
        model = RobotModel(name="r", kind=kind, file=files[0], source=source, sources=files)
        return Report(facts=SimpleNamespace(model=model), findings=tuple(findings))

    return check


def positive_masses(element, source):
    mass = element.get("mass", "")
    if mass.startswith("-"):
        edit = SetAttribute(source=source, name="mass", value=mass[1:])
        yield finding(element.get("name"), f"a mass of {mass} kg", source.file, edit)


@pytest.fixture
def robot(tmp_path):
    folder = tmp_path / "package" / "urdf"
    folder.mkdir(parents=True)
    (folder / "r.urdf").write_bytes(ROBOT.encode())
    return folder / "r.urdf"


class TestFixRobot:
    def test_fixes_in_memory_only(self, robot):
        result = fix_robot(robot, make_check(positive_masses, robot))
        assert result.before == {robot: ROBOT.encode()}
        assert result.after == {robot: ROBOT.replace("-1", "1").replace("-2", "2").encode()}
        assert result.new == {}
        assert [f.subject for f in result.fixed] == ["a", "b"]
        assert result.unfixed == result.report.findings == ()
        assert robot.read_bytes() == ROBOT.encode()

    def test_second_run_changes_nothing(self, robot):
        write_fixes(fix_robot(robot, make_check(positive_masses, robot)))
        result = fix_robot(robot, make_check(positive_masses, robot))
        assert result.after == result.before == {}
        assert result.fixed == result.unfixed == ()
        assert unified_diff(result) == ""

    def test_overlapping_fixes_take_several_rounds(self, robot):
        def three(element, source):
            for name in "xyz":
                if element.tag == "link" and element.get(name) is None:
                    edit = SetAttribute(source=source, name=name, value="1")
                    yield finding(element.get("name"), f"no {name}", source.file, edit)

        result = fix_robot(robot, make_check(three, robot))
        assert len(result.fixed) == 6
        assert result.unfixed == ()
        root = etree.fromstring(result.after[robot])
        assert all(link.get(name) == "1" for link in root.iter("link") for name in "xyz")

    def test_new_findings_are_fixed(self, robot):
        def countdown(element, source):
            count = len(element.get("name", "")) if element.tag == "link" else 0
            if 0 < count < 4:
                edit = SetAttribute(source=source, name="name", value="a" * (count + 1))
                yield finding("link", f"a name of {count}", source.file, edit)

        result = fix_robot(robot, make_check(countdown, robot))
        assert result.unfixed == ()
        assert result.after[robot].count(b"aaaa") == 2

    def test_unsafe_fixes_need_the_option(self, robot):
        def unsafe(element, source):
            if element.get("name") == "b":
                yield finding(
                    "b", "here", source.file, RemoveElement(source=source), safety="unsafe"
                )

        kept = fix_robot(robot, make_check(unsafe, robot))
        assert kept.after == {}
        assert [u.reason for u in kept.unfixed] == [
            "the fix is unsafe, because it changes the robot"
        ]
        assert b'"b"' not in fix_robot(robot, make_check(unsafe, robot), unsafe=True).after[robot]

    def test_findings_without_fix_stay_in_report(self, robot):
        result = fix_robot(robot, make_check(lambda *_: [finding("a", "here", robot)], robot))
        assert result.fixed == result.unfixed == ()
        assert len(result.report.findings) == 3

    def test_ineffective_insertion_is_applied_once(self, robot):
        def helpless(element, source):
            if element.tag == "robot":
                edit = InsertChild(source=source, xml="<link/>")
                yield finding("r", "too few links", source.file, edit)

        result = fix_robot(robot, make_check(helpless, robot))
        assert result.after[robot].count(b"<link/>") == 1
        assert result.fixed == ()
        assert [u.reason for u in result.unfixed] == ["the fix was applied without effect"]

    def test_fix_without_change_is_unfixed(self, robot):
        def idle(element, source):
            if element.tag == "robot":
                yield finding(
                    "r", "!", source.file, SetAttribute(source=source, name="name", value="r")
                )

        result = fix_robot(robot, make_check(idle, robot))
        assert result.after == {}
        assert [u.reason for u in result.unfixed] == ["the fix has no effect or reverts another"]

    def test_fixes_that_revert_each_other_stop(self, robot):
        def restless(element, source):
            if element.tag == "robot":
                other = "s" if element.get("name") == "r" else "r"
                yield finding(
                    "r", other, source.file, SetAttribute(source=source, name="name", value=other)
                )

        result = fix_robot(robot, make_check(restless, robot))
        assert [u.reason for u in result.unfixed] == ["the fix has no effect or reverts another"]

    def test_number_of_rounds_is_limited(self, robot):
        def endless(element, source):
            if element.tag == "robot":
                longer = element.get("name") + "r"
                yield finding(
                    "r", longer, source.file, SetAttribute(source=source, name="name", value=longer)
                )

        result = fix_robot(robot, make_check(endless, robot))
        assert [u.reason for u in result.unfixed] == ["not done after 50 rounds"]
        (after,) = result.after.values()
        assert after.count(b"r" * 51) == 1  # the name began with one

    def test_impossible_fix_does_not_affect_others(self, robot):
        def check(element, source):
            yield from positive_masses(element, source)
            if element.tag == "robot":
                nowhere = SetAttribute(source=at(source.file, 99), name="x", value="1")
                yield finding(
                    "r",
                    "nowhere",
                    source.file,
                    SetAttribute(source=source, name="x", value="1"),
                    nowhere,
                )

        result = fix_robot(robot, make_check(check, robot))
        assert len(result.fixed) == 2
        assert [u.reason for u in result.unfixed] == ["element index: got 99; expected less than 3"]
        assert b'x="1"' not in result.after[robot]

    def test_xacro_is_not_changed(self, robot):
        result = fix_robot(robot, make_check(positive_masses, robot, kind="xacro"))
        assert result.after == {}
        assert {u.reason for u in result.unfixed} == {"xacro files cannot be fixed"}


class TestChangedFiles:
    def test_includes_below_the_robot_are_changed(self, robot):
        part = robot.parent / "parts" / "leg.xml"
        part.parent.mkdir()
        part.write_text(ROBOT)
        result = fix_robot(robot, make_check(positive_masses, robot, part))
        assert set(result.after) == {robot, part}
        assert len(result.fixed) == 2  # equal findings in both files
        assert result.report.findings == ()

    @pytest.mark.parametrize("link", [False, True])
    def test_includes_outside_are_not_changed(self, robot, link):
        part = outside = robot.parent.parent / "leg.xml"
        outside.write_text(ROBOT)
        if link:
            part = robot.parent / "leg.xml"
            part.symlink_to(outside)
        result = fix_robot(robot, make_check(positive_masses, robot, part))
        assert set(result.after) == {robot}
        assert {u.reason for u in result.unfixed} == {
            f"{part} is outside of {robot.parent} and is not changed"
        }

    def test_other_files_are_not_changed(self, robot):
        mesh = robot.parent / "foot.stl"
        mesh.write_bytes(b"solid")
        edit = ReplaceBytes(source=Source(file=mesh, line=0), start=0, end=5, replacement=b"")
        check = make_check(lambda *_: [finding("foot", "ascii", mesh, edit)], robot)
        assert {u.reason for u in fix_robot(robot, check).unfixed} == {
            f"{mesh} is not a file of this robot"
        }

    def test_file_with_two_paths_is_changed_once(self, robot):
        other = robot.parent / ".." / "urdf" / "r.urdf"
        result = fix_robot(robot, make_check(positive_masses, robot, other))
        assert set(result.after) == {robot}
        assert result.report.findings == ()


class TestNewFiles:
    def fix_with(self, robot, path, content=lambda: b"mesh"):
        """Return the result of a fix that writes a file and refers to it in the robot."""

        def check(element, source):
            if element.tag == "robot" and element.get("mesh") is None:
                name = SetAttribute(source=source, name="mesh", value="new")
                new = WriteFile(path=path, content=content)
                yield finding("r", "no mesh", source.file, new, name)

        return fix_robot(robot, make_check(check, robot))

    @pytest.mark.parametrize("where", ["foot.stl", "meshes/foot.obj", "../meshes/foot.STL"])
    def test_created_in_package(self, robot, where):
        path = robot.parent / where
        path.parent.mkdir(exist_ok=True)
        result = self.fix_with(robot, path)
        assert result.new == {path.resolve(): b"mesh"}
        assert not path.exists()
        write_fixes(result)
        assert path.read_bytes() == b"mesh"
        assert b'mesh="new"' in robot.read_bytes()

    @pytest.mark.parametrize(
        ("where", "reason"),
        [
            ("../../foot.stl", "outside of"),
            ("../../other/foot.stl", "outside of"),
            ("link/foot.stl", "outside of"),
            ("../.hidden/foot.stl", "outside of"),
            ("foot.sh", "expected .obj or .stl"),
            ("foot", "expected .obj or .stl"),
            ("nowhere/foot.stl", "does not exist"),
            ("there.stl", "exists with different content"),
            ("folder.stl", "exists with different content"),
            ("dangling.stl", "exists with different content"),
        ],
    )
    def test_invalid_paths_are_rejected(self, robot, where, reason):
        package = robot.parent.parent
        (package.parent / "other").mkdir()
        (package / ".hidden").mkdir()
        (robot.parent / "link").symlink_to(package.parent / "other")
        (robot.parent / "there.stl").write_bytes(b"mush")
        (robot.parent / "folder.stl").mkdir()
        (robot.parent / "dangling.stl").symlink_to(package.parent / "other" / "new.stl")
        result = self.fix_with(robot, robot.parent / where)
        assert result.after == result.new == {}
        assert reason in result.unfixed[0].reason

    def test_equal_existing_file_is_used(self, robot):
        path = robot.parent / "foot.stl"
        path.write_bytes(b"mesh")
        result = self.fix_with(robot, path)
        assert result.new == {}
        assert len(result.fixed) == 1
        write_fixes(result)

    def test_two_fixes_must_write_equal_content(self, robot):
        path = robot.parent / "foot.stl"

        def check(element, source):
            if element.tag == "link" and element.get("mesh") is None:
                name, content = element.get("name"), element.get("mass").encode()
                new = WriteFile(path=path, content=lambda: content)
                edit = SetAttribute(source=source, name="mesh", value="new")
                yield finding(name, "no mesh", source.file, new, edit)

        result = fix_robot(robot, make_check(check, robot))
        assert [f.subject for f in result.fixed] == ["a"]
        assert [u.reason for u in result.unfixed] == [f"{path} exists with different content"]
        robot.write_text(ROBOT.replace("-2", "-1"))
        result = fix_robot(robot, make_check(check, robot))
        assert [f.subject for f in result.fixed] == ["a", "b"]
        assert result.new == {path: b"-1"}

    def test_failed_content_is_unfixed(self, robot):
        def content():
            raise MeshError("the mesh has no faces")

        result = self.fix_with(robot, robot.parent / "foot.stl", content)
        assert [u.reason for u in result.unfixed] == ["the mesh has no faces"]

    def test_no_file_is_created_in_root(self):
        path = Path("/nowhere-to-be-seen/foot.stl")
        check = make_check(
            lambda *_: [finding("r", "!", path, WriteFile(path=path, content=bytes))], ROOTED
        )
        result = fix_robot(ROOTED, lambda _: check({ROOTED: b"<robot/>"}))
        assert "outside of" in result.unfixed[0].reason


ROOTED = Path("/some-folder/r.urdf")


class TestWriteFixes:
    def test_keeps_mode_link_and_line_ends(self, robot, tmp_path):
        text = b"\xef\xbb\xbf" + ROBOT.replace("\n", "\r\n").encode()
        robot.write_bytes(text)
        robot.chmod(0o640)
        link = tmp_path / "link.urdf"
        link.symlink_to(robot)
        write_fixes(fix_robot(link, make_check(positive_masses, link)))
        assert link.is_symlink()
        assert robot.read_bytes() == text.replace(b"-1", b"1").replace(b"-2", b"2")
        assert robot.stat().st_mode & 0o777 == 0o640
        assert sorted(p.name for p in robot.parent.iterdir()) == ["r.urdf"]

    def test_changed_file_is_not_overwritten(self, robot):
        result = fix_robot(robot, make_check(positive_masses, robot))
        robot.write_text("<robot/>")
        with pytest.raises(ExportError, match="has changed since it was read"):
            write_fixes(result)
        assert robot.read_text() == "<robot/>"

    def test_existing_new_file_is_not_overwritten(self, robot):
        path = robot.parent / "foot.stl"
        result = TestNewFiles().fix_with(robot, path)
        path.write_bytes(b"other")
        with pytest.raises(ExportError, match="exists"):
            write_fixes(result)
        assert path.read_bytes() == b"other"
        assert robot.read_text() == ROBOT

    @pytest.mark.skipif(os.geteuid() == 0, reason="root may write everything")
    def test_read_only_file_is_not_overwritten(self, robot):
        robot.chmod(0o440)
        with pytest.raises(ExportError, match="read-only"):
            write_fixes(fix_robot(robot, make_check(positive_masses, robot)))

    def test_missing_file_is_an_error(self, robot):
        result = fix_robot(robot, make_check(positive_masses, robot))
        robot.unlink()
        with pytest.raises(TerrainkitError, match="no file"):
            write_fixes(result)


class TestUnifiedDiff:
    def test_diff_of_a_file(self, robot, monkeypatch):
        monkeypatch.chdir(robot.parent)
        file = Path("r.urdf")
        assert unified_diff(fix_robot(file, make_check(positive_masses, file))) == (
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
        diff = unified_diff(fix_robot(robot, make_check(positive_masses, robot)))
        ending = "" if text.endswith("\n") else "\n\\ No newline at end of file\n"
        assert diff.endswith(f"-{text}{ending}+{text.replace('-', '')}{ending}")

    def test_diff_decodes_other_encodings(self, robot):
        robot.write_bytes(
            '<?xml version="1.0" encoding="iso-8859-1"?><a name="é" mass="-1"/>'.encode("latin-1")
        )
        assert 'name="é"' in unified_diff(fix_robot(robot, make_check(positive_masses, robot)))

    def test_new_files_are_listed(self, robot):
        path = robot.parent / "foot.stl"
        diff = unified_diff(TestNewFiles().fix_with(robot, path))
        assert diff.startswith(f"New file {path} (4 bytes)\n--- {robot}\n")
