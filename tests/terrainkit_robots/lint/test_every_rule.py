"""Every rule on its cases: robots in cases/<CODE>.toml, on which it finds something or nothing."""

import re
import struct
import tomllib
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import terrainkit_robots
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.fixes.apply import fix_robot, write_fixes
from terrainkit_robots.lint.rule import FAMILIES, get_rule, rules
from terrainkit_robots.lint.runner import lint
from terrainkit_robots.mesh.mesh_cache import Meshes

CASES = Path(__file__).parent / "cases"
BUNDLED = Path(terrainkit_robots.__file__).parent / "description/bundled"


@dataclass(frozen=True, kw_only=True)
class Case:
    """A robot, and what one rule is to say of it."""

    code: str
    fails: bool
    title: str
    robot: str | None = None
    of: str | None = None
    replace: tuple[tuple[str, str], ...] = ()
    name: str = ""
    files: dict[str, dict[str, object]] = field(default_factory=dict)
    subject: str | None = None
    line: int | None = None
    severity: str | None = None
    only: bool = False
    against: str | None = None
    against_of: str | None = None
    against_replace: tuple[tuple[str, str], ...] = ()
    spec: str | None = None

    def __post_init__(self):
        assert (self.robot is None) != (self.of is None), f"{self}: wanted either robot or of"
        assert None in (self.against, self.against_of), f"{self}: two robots to compare with"
        assert not self.replace or self.of, f"{self}: replace is for of"
        assert not self.against_replace or self.against_of, f"{self}: against_of is missing"

    def __str__(self):
        return f"{self.code} {'fails' if self.fails else 'passes'}: {self.title}"

    @property
    def text(self):
        """Return the robot's file."""
        return self._edited(self.of, self.replace) if self.robot is None else self.robot

    @property
    def other_text(self):
        """Return the file that the robot is compared with; None if there is none."""
        if self.against_of is None:
            return self.against
        return self._edited(self.against_of, self.against_replace)

    def _edited(self, of, replace):
        text = bundled(of)
        for old, new in replace:
            assert old in text, f"{self}: {old!r} is not in {of}"
            text = text.replace(old, new, 1)
        return text

    def write(self, folder):
        """Return the path of the robot, with all of its files in `folder`."""
        text = self.text
        path = folder / (self.name or f"robot{suffix_of(text)}")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text.encode())
        for name, content in self.files.items():
            file = folder / name
            assert file.resolve().is_relative_to(folder.resolve()), f"{self}: {name} is outside"
            file.parent.mkdir(parents=True, exist_ok=True)
            if "symlink" in content:
                file.symlink_to(content["symlink"])
            else:
                file.write_bytes(bytes_of(**content))
        return path

    def facts(self, path, contents=None):
        """Return the facts of the robot that was written to `path`, with all that it goes with."""
        other = spec = None
        if self.other_text is not None:
            file = path.parent / f"other{suffix_of(self.other_text)}"
            file.write_bytes(self.other_text.encode())
            other = Facts(load_robot(file))
        if self.spec is not None:
            from terrainkit_robots.spec.spec_file import from_toml

            spec = from_toml(self.spec)
        model = load_robot(path, contents=contents)
        return Facts(model, Meshes(contents), against=other, spec=spec)


def suffix_of(text):
    """Return what the name of a file with this text ends with."""
    return ".urdf" if "<robot" in text or "<mujoco" not in text else ".xml"


@cache
def bundled(name):
    return (BUNDLED / Path(name).stem / name).read_text(encoding="utf-8")


# Files beside the robot.


def bytes_of(*, radius=1.0, **content):
    """Return what a file is described to hold."""
    ((kind, value),) = content.items()
    match kind:
        case "text":
            return value.encode()
        case "hex":
            return bytes.fromhex(value)
        case "zeros":
            return bytes(value)
        case "box":
            return stl(box(*value))
        case "ascii_box":
            return ascii_stl(box(*value))
        case "sphere_faces":
            return sphere(value, radius)
    raise AssertionError(f"no such content of a file: {kind}")


def box(x, y, z):
    """Return the triangles of a box with these sides about the origin, shape (12, 3, 3)."""
    corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]) / 2
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return (corners * [x, y, z])[np.array(faces)]


def stl(triangles):
    """Return a binary STL."""
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    records = np.zeros(len(triangles), record)
    records["corners"] = triangles
    return bytes(80) + struct.pack("<I", len(triangles)) + records.tobytes()


def ascii_stl(triangles):
    """Return an ASCII STL."""
    lines = ["solid box"]
    for triangle in triangles:
        corners = [f"      vertex {x:g} {y:g} {z:g}" for x, y, z in triangle]
        lines += ["  facet normal 0 0 0", "    outer loop", *corners, "    endloop", "  endfacet"]
    return "\n".join([*lines, "endsolid box", ""]).encode()


@cache
def sphere(faces, radius):
    """Return a binary STL of a sphere with at least so many faces."""
    import trimesh

    fourfold = 0
    while 20 * 4**fourfold < faces:
        fourfold += 1
    return stl(trimesh.creation.icosphere(subdivisions=fourfold, radius=radius).triangles)


def test_the_box_is_closed_and_as_large_as_asked():
    import trimesh

    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(box(1.0, 2.0, 3.0)))
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(6.0)
    assert len(bytes_of(box=[1, 1, 1])) == 84 + 12 * 50
    assert len(bytes_of(sphere_faces=1000, radius=0.1)) == 84 + 1280 * 50


# Cases.


def cases_of(code):
    """Return the cases of a rule; none if it has no file."""
    path = CASES / f"{code}.toml"
    if not path.exists():
        return []
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    assert set(table) <= {"fails", "passes"}, f"{path.name} has {sorted(table)}"
    return [
        Case(code=code, fails=kind == "fails", **each | pairs_of(each))
        for kind in ("fails", "passes")
        for each in table.get(kind, [])
    ]


def pairs_of(case):
    """Return the edits of a case, as pairs."""
    names = ("replace", "against_replace")
    return {name: tuple((old, new) for old, new in case.get(name, [])) for name in names}


def sound_cases_of(code):
    """Return the cases of a rule; none if its file is broken, which has a test of its own."""
    try:
        return cases_of(code)
    except (AssertionError, TypeError, ValueError):
        return []


ALL_CASES = [case for rule in rules() for case in sound_cases_of(rule.code)]
every_rule = pytest.mark.parametrize("code", [rule.code for rule in rules()])


def every_case(chosen):
    return pytest.mark.parametrize("case", [pytest.param(c, id=str(c)) for c in chosen])


def look_at(case, path, contents=None, chosen=None):
    """Return the report on the robot of a case, which was written to `path`.

    Only a rule that is asked by itself may simulate.
    """
    return lint(case.facts(path, contents), chosen, simulate=chosen is not None)


def what(report):
    return [f"{f.code} {f.subject}: {f.message}" for f in report.findings]


@every_case([case for case in ALL_CASES if case.fails])
def test_what_is_wrong_is_found(case, tmp_path):
    path = case.write(tmp_path)
    report = look_at(case, path, chosen=None if case.only else [get_rule(case.code)])
    found = [f for f in report.findings if f.code == case.code]
    assert found, f"nothing was found; skipped: {report.skipped}"
    for finding in found:
        check_text(case, finding)
        assert finding.file.is_relative_to(tmp_path)
        assert finding.fix is None or get_rule(case.code).fixes != "no", "the rule claims no fix"
    for name in ("subject", "line", "severity"):
        wanted = getattr(case, name)
        if wanted is not None:
            have = [getattr(f, name) for f in found]
            assert wanted in have, f"{name}: wanted {wanted!r}, have {have}"
            found = [f for f in found if getattr(f, name) == wanted]
    if case.only:
        others = [f for f in report.findings if f.code != case.code and f.severity != "info"]
        assert not others, what(report)


def check_text(case, finding):
    """Fail if a finding cannot be read by itself, on one line of any terminal."""
    assert finding.subject
    assert finding.hint
    assert finding.message == " ".join(finding.message.split())
    assert finding.message.isascii() or not (case.text + (case.other_text or "")).isascii()


@every_case([case for case in ALL_CASES if not case.fails])
def test_what_is_right_is_left_in_peace(case, tmp_path):
    report = look_at(case, case.write(tmp_path), chosen=[get_rule(case.code)])
    assert not report.findings, what(report)


@every_rule
def test_every_rule_has_cases(code):
    cases = cases_of(code)
    assert cases, f"there is no {code}.toml in {CASES}"
    assert any(case.fails for case in cases), f"{code}.toml has no [[fails]]"
    assert any(not case.fails for case in cases), f"{code}.toml has no [[passes]]"
    titles = [str(case) for case in cases]
    assert len(set(titles)) == len(titles), f"{code}.toml has two cases of the same title"


@every_rule
def test_every_rule_is_asked_on_a_case_that_passes(code, tmp_path):
    reasons = []
    for number, case in enumerate(case for case in cases_of(code) if not case.fails):
        (tmp_path / str(number)).mkdir()
        path = case.write(tmp_path / str(number))
        skipped = look_at(case, path, chosen=[get_rule(code)]).skipped
        if not skipped:
            return
        reasons += [each.reason for each in skipped]
    # One that only informs may have something to say whenever it is asked.
    assert not reasons or get_rule(code).severity == "info", f"skipped on all of them: {reasons}"


def test_every_case_belongs_to_a_rule():
    codes = {rule.code for rule in rules()}
    assert {path.stem for path in CASES.glob("*.toml")} <= codes


# Pages.


@every_rule
def test_every_rule_has_a_page(code):
    rule = get_rule(code)
    assert re.fullmatch(r"[A-Z]{3}\d{3}", code)
    assert rule.family in FAMILIES
    assert re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", rule.name)
    assert rule.title.endswith(".")
    assert len(rule.title) <= 100
    for part in (rule.why, rule.how_to_fix, rule.reference):
        assert part.endswith((".", ")", "`")), part
        assert len(part) > 20, part


def test_names_are_unique():
    names = [rule.name for rule in rules()]
    assert len(set(names)) == len(names)


# Fixes.


@every_case([case for case in ALL_CASES if case.fails and get_rule(case.code).fixes != "no"])
def test_a_fix_removes_the_finding_and_brings_no_other(case, tmp_path):
    path = case.write(tmp_path)
    unsafe = get_rule(case.code).fixes == "unsafe"
    reports = []

    def look(contents):
        reports.append(look_at(case, path, contents))
        return reports[-1]

    result = fix_robot(path, look, unsafe=unsafe)
    own = [f for f in reports[0].findings if f.code == case.code]
    if not any(f.fix and (unsafe or f.fix.safety == "safe") for f in own):
        assert {f.message for f in own} <= {f.message for f in result.report.findings}
        return
    assert case.code in {f.code for f in result.fixed}, result.unfixed
    assert len([f for f in result.report.findings if f.code == case.code]) < len(own)
    assert places(result.report) <= places(reports[0])
    write_fixes(result)
    again = fix_robot(path, look, unsafe=unsafe)
    assert again.after == again.new == {}
    assert places(again.report) == places(result.report)


def places(report):
    """Return what is wrong, and with what.

    What only informs may well be said for the first time once a robot is repaired.
    """
    return {(f.code, f.subject) for f in report.findings if f.severity != "info"}


@pytest.mark.parametrize("code", [rule.code for rule in rules() if rule.fixes != "no"])
def test_every_rule_with_fixes_has_a_case_with_one(code, tmp_path):
    safeties = set()
    for number, case in enumerate(case for case in cases_of(code) if case.fails):
        (tmp_path / str(number)).mkdir()
        report = look_at(case, case.write(tmp_path / str(number)), chosen=[get_rule(code)])
        safeties |= {finding.fix.safety for finding in report.findings if finding.fix}
    assert get_rule(code).fixes in safeties
