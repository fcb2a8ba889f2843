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
from terrainkit_robots.lint.runner import Finding, Report
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
        file=file,
        line=0,
        fix=fix,
    )


def looking(check, *files, kind="urdf"):
    """Return a look at files: `check` gets the elements of each, and yields findings."""

    def look(contents):
        findings = []
        for file in files:
            data = contents[file] if file in contents else file.read_bytes()
            for index, element in enumerate(etree.fromstring(data).iter(etree.Element)):
                findings += check(element, at(file, index))
        source = Source(file=files[0], line=0)
        model = RobotModel(name="r", kind=kind, file=files[0], source=source, sources=files)
        return Report(facts=SimpleNamespace(model=model), findings=tuple(findings))

    return look


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
    def test_fixes_what_it_can_and_writes_nothing(self, robot):
        result = fix_robot(robot, looking(positive_masses, robot))
        assert result.before == {robot: ROBOT.encode()}
        assert result.after == {robot: ROBOT.replace("-1", "1").replace("-2", "2").encode()}
        assert result.new == {}
        assert [f.subject for f in result.fixed] == ["a", "b"]
        assert result.unfixed == result.report.findings == ()
        assert robot.read_bytes() == ROBOT.encode()

    def test_finds_nothing_to_do_the_second_time(self, robot):
        write_fixes(fix_robot(robot, looking(positive_masses, robot)))
        result = fix_robot(robot, looking(positive_masses, robot))
        assert result.after == result.before == {}
        assert result.fixed == result.unfixed == ()
        assert unified_diff(result) == ""

    def test_fixes_in_each_others_way_wait_for_the_next_round(self, robot):
        def three(element, source):
            for name in "xyz":
                if element.tag == "link" and element.get(name) is None:
                    edit = SetAttribute(source=source, name=name, value="1")
                    yield finding(element.get("name"), f"no {name}", source.file, edit)

        result = fix_robot(robot, looking(three, robot))
        assert len(result.fixed) == 6
        assert result.unfixed == ()
        root = etree.fromstring(result.after[robot])
        assert all(link.get(name) == "1" for link in root.iter("link") for name in "xyz")

    def test_a_fix_may_bring_up_what_can_be_fixed_in_turn(self, robot):
        def countdown(element, source):
            count = len(element.get("name", "")) if element.tag == "link" else 0
            if 0 < count < 4:
                edit = SetAttribute(source=source, name="name", value="a" * (count + 1))
                yield finding("link", f"a name of {count}", source.file, edit)

        result = fix_robot(robot, looking(countdown, robot))
        assert result.unfixed == ()
        assert result.after[robot].count(b"aaaa") == 2

    def test_unsafe_ones_only_on_demand(self, robot):
        def unsafe(element, source):
            if element.get("name") == "b":
                yield finding(
                    "b", "here", source.file, RemoveElement(source=source), safety="unsafe"
                )

        kept = fix_robot(robot, looking(unsafe, robot))
        assert kept.after == {}
        assert [u.reason for u in kept.unfixed] == [
            "its fix is unsafe: the robot would not stay the same"
        ]
        assert b'"b"' not in fix_robot(robot, looking(unsafe, robot), unsafe=True).after[robot]

    def test_what_has_no_fix_is_in_the_report_only(self, robot):
        result = fix_robot(robot, looking(lambda *_: [finding("a", "here", robot)], robot))
        assert result.fixed == result.unfixed == ()
        assert len(result.report.findings) == 3

    def test_a_fix_that_does_not_help_is_made_once(self, robot):
        def helpless(element, source):
            if element.tag == "robot":
                edit = InsertChild(source=source, xml="<link/>")
                yield finding("r", "too few links", source.file, edit)

        result = fix_robot(robot, looking(helpless, robot))
        assert result.after[robot].count(b"<link/>") == 1
        assert result.fixed == ()
        assert [u.reason for u in result.unfixed] == ["its fix was made, and did not help"]

    def test_a_fix_that_changes_nothing_is_told(self, robot):
        def idle(element, source):
            if element.tag == "robot":
                yield finding(
                    "r", "!", source.file, SetAttribute(source=source, name="name", value="r")
                )

        result = fix_robot(robot, looking(idle, robot))
        assert result.after == {}
        assert [u.reason for u in result.unfixed] == ["its fix changes nothing, or undoes another"]

    def test_fixes_that_undo_each_other_end(self, robot):
        def restless(element, source):
            if element.tag == "robot":
                other = "s" if element.get("name") == "r" else "r"
                yield finding(
                    "r", other, source.file, SetAttribute(source=source, name="name", value=other)
                )

        result = fix_robot(robot, looking(restless, robot))
        assert [u.reason for u in result.unfixed] == ["its fix changes nothing, or undoes another"]

    def test_fixes_without_end_end(self, robot):
        def endless(element, source):
            if element.tag == "robot":
                longer = element.get("name") + "r"
                yield finding(
                    "r", longer, source.file, SetAttribute(source=source, name="name", value=longer)
                )

        result = fix_robot(robot, looking(endless, robot))
        assert [u.reason for u in result.unfixed] == ["too many fixes wait for each other"]

    def test_a_fix_that_cannot_be_made_leaves_the_others(self, robot):
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

        result = fix_robot(robot, looking(check, robot))
        assert len(result.fixed) == 2
        assert [u.reason for u in result.unfixed] == [
            "there is no element 99; the file has 3 elements"
        ]
        assert b'x="1"' not in result.after[robot]

    def test_xacro_is_never_changed(self, robot):
        result = fix_robot(robot, looking(positive_masses, robot, kind="xacro"))
        assert result.after == {}
        assert {u.reason for u in result.unfixed} == {
            "the robot is made from xacro, which no fix can change"
        }


class TestWhichFilesAreChanged:
    def test_includes_in_the_folder_of_the_robot(self, robot):
        part = robot.parent / "parts" / "leg.xml"
        part.parent.mkdir()
        part.write_text(ROBOT)
        result = fix_robot(robot, looking(positive_masses, robot, part))
        assert set(result.after) == {robot, part}
        assert len(result.fixed) == 2  # the same of both
        assert result.report.findings == ()

    @pytest.mark.parametrize("link", [False, True])
    def test_includes_outside_are_left(self, robot, link):
        part = outside = robot.parent.parent / "leg.xml"
        outside.write_text(ROBOT)
        if link:
            part = robot.parent / "leg.xml"
            part.symlink_to(outside)
        result = fix_robot(robot, looking(positive_masses, robot, part))
        assert set(result.after) == {robot}
        assert {u.reason for u in result.unfixed} == {
            f"{part} is outside of {robot.parent}: it is left as it is"
        }

    def test_files_that_are_no_part_of_the_robot_are_left(self, robot):
        mesh = robot.parent / "foot.stl"
        mesh.write_bytes(b"solid")
        edit = ReplaceBytes(source=Source(file=mesh, line=0), start=0, end=5, replacement=b"")
        look = looking(lambda *_: [finding("foot", "ascii", mesh, edit)], robot)
        assert {u.reason for u in fix_robot(robot, look).unfixed} == {
            f"{mesh} is no text of this robot"
        }

    def test_one_that_is_read_under_two_names_is_changed_once(self, robot):
        other = robot.parent / ".." / "urdf" / "r.urdf"
        result = fix_robot(robot, looking(positive_masses, robot, other))
        assert set(result.after) == {robot}
        assert result.report.findings == ()


class TestNewFiles:
    def fix_with(self, robot, path, content=lambda: b"mesh"):
        """Return the result of one fix that writes a file and names it in the robot."""

        def check(element, source):
            if element.tag == "robot" and element.get("mesh") is None:
                name = SetAttribute(source=source, name="mesh", value="new")
                new = WriteFile(path=path, content=content)
                yield finding("r", "no mesh", source.file, new, name)

        return fix_robot(robot, looking(check, robot))

    @pytest.mark.parametrize("where", ["foot.stl", "meshes/foot.obj", "../meshes/foot.STL"])
    def test_in_the_folder_of_the_robot_or_beside_it(self, robot, where):
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
            ("foot.sh", "no mesh, to go by its name"),
            ("foot", "no mesh, to go by its name"),
            ("nowhere/foot.stl", "there is no folder"),
            ("there.stl", "is there, and is another file"),
            ("folder.stl", "is there, and is another file"),
            ("dangling.stl", "is there, and is another file"),
        ],
    )
    def test_nowhere_else_and_over_nothing(self, robot, where, reason):
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

    def test_one_that_is_there_already_is_taken(self, robot):
        path = robot.parent / "foot.stl"
        path.write_bytes(b"mesh")
        result = self.fix_with(robot, path)
        assert result.new == {}
        assert len(result.fixed) == 1
        write_fixes(result)

    def test_two_fixes_may_write_the_same_and_not_another(self, robot):
        path = robot.parent / "foot.stl"

        def check(element, source):
            if element.tag == "link" and element.get("mesh") is None:
                name, content = element.get("name"), element.get("mass").encode()
                new = WriteFile(path=path, content=lambda: content)
                edit = SetAttribute(source=source, name="mesh", value="new")
                yield finding(name, "no mesh", source.file, new, edit)

        result = fix_robot(robot, looking(check, robot))
        assert [f.subject for f in result.fixed] == ["a"]
        assert [u.reason for u in result.unfixed] == [f"{path} is there, and is another file"]
        robot.write_text(ROBOT.replace("-2", "-1"))
        result = fix_robot(robot, looking(check, robot))
        assert [f.subject for f in result.fixed] == ["a", "b"]
        assert result.new == {path: b"-1"}

    def test_content_that_cannot_be_made_is_told(self, robot):
        def content():
            raise MeshError("the mesh has no faces")

        result = self.fix_with(robot, robot.parent / "foot.stl", content)
        assert [u.reason for u in result.unfixed] == ["the mesh has no faces"]

    def test_nothing_is_added_to_the_root_of_the_disk_from_a_folder_in_it(self):
        path = Path("/nowhere-to-be-seen/foot.stl")
        look = looking(
            lambda *_: [finding("r", "!", path, WriteFile(path=path, content=bytes))], ROOTED
        )
        result = fix_robot(ROOTED, lambda _: look({ROOTED: b"<robot/>"}))
        assert "outside of" in result.unfixed[0].reason


ROOTED = Path("/some-folder/r.urdf")


class TestWriteFixes:
    def test_keeps_mode_link_and_line_ends(self, robot, tmp_path):
        text = b"\xef\xbb\xbf" + ROBOT.replace("\n", "\r\n").encode()
        robot.write_bytes(text)
        robot.chmod(0o640)
        link = tmp_path / "link.urdf"
        link.symlink_to(robot)
        write_fixes(fix_robot(link, looking(positive_masses, link)))
        assert link.is_symlink()
        assert robot.read_bytes() == text.replace(b"-1", b"1").replace(b"-2", b"2")
        assert robot.stat().st_mode & 0o777 == 0o640
        assert sorted(p.name for p in robot.parent.iterdir()) == ["r.urdf"]

    def test_not_over_what_somebody_else_wrote_meanwhile(self, robot):
        result = fix_robot(robot, looking(positive_masses, robot))
        robot.write_text("<robot/>")
        with pytest.raises(ExportError, match="has changed since it was read"):
            write_fixes(result)
        assert robot.read_text() == "<robot/>"

    def test_not_over_a_new_file_that_is_there_by_now(self, robot):
        path = robot.parent / "foot.stl"
        result = TestNewFiles().fix_with(robot, path)
        path.write_bytes(b"other")
        with pytest.raises(ExportError, match="exists"):
            write_fixes(result)
        assert path.read_bytes() == b"other"
        assert robot.read_text() == ROBOT

    @pytest.mark.skipif(os.geteuid() == 0, reason="root may write everything")
    def test_not_what_is_read_only(self, robot):
        robot.chmod(0o440)
        with pytest.raises(ExportError, match="read-only"):
            write_fixes(fix_robot(robot, looking(positive_masses, robot)))

    def test_what_is_gone_is_told(self, robot):
        result = fix_robot(robot, looking(positive_masses, robot))
        robot.unlink()
        with pytest.raises(TerrainkitError, match="no file"):
            write_fixes(result)


class TestUnifiedDiff:
    def test_names_the_file_and_shows_the_lines(self, robot, monkeypatch):
        monkeypatch.chdir(robot.parent)
        file = Path("r.urdf")
        assert unified_diff(fix_robot(file, looking(positive_masses, file))) == (
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
    def test_odd_line_ends(self, robot, text):
        robot.write_bytes(text.encode())
        diff = unified_diff(fix_robot(robot, looking(positive_masses, robot)))
        ending = "" if text.endswith("\n") else "\n\\ No newline at end of file\n"
        assert diff.endswith(f"-{text}{ending}+{text.replace('-', '')}{ending}")

    def test_other_encodings(self, robot):
        robot.write_bytes(
            '<?xml version="1.0" encoding="iso-8859-1"?><a name="é" mass="-1"/>'.encode("latin-1")
        )
        assert 'name="é"' in unified_diff(fix_robot(robot, looking(positive_masses, robot)))

    def test_new_files_have_a_line_each(self, robot):
        path = robot.parent / "foot.stl"
        diff = unified_diff(TestNewFiles().fix_with(robot, path))
        assert diff.startswith(f"New file {path} (4 bytes)\n--- {robot}\n")
