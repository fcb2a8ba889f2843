"""Run every rule on its cases: robots in cases/<CODE>.toml that violate it or not.

The texts of all findings are in findings.json. `make records` writes them anew; read the
difference.
"""

import json
import math
import re
import tempfile
import tomllib
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import pytest
import trimesh

import terrainkit_robots
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.check import lint_selected
from terrainkit_robots.lint.fixes.apply import fix_robot, write_fixes
from terrainkit_robots.lint.rule import get_rule, rules
from terrainkit_robots.lint.runner import lint
from terrainkit_robots.lint.settings import Settings
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.spec.robot_spec import RobotSpec
from terrainkit_robots.text import short_path

CASES = Path(__file__).parent / "cases"
FINDINGS = CASES.with_name("findings.json")
OTHERS_SENTENCE = re.compile(r"(malformed XML|cannot load the file|rejects <geom>): .*")
SIMULATED = ("DYN", *(f"OPT{number:03}" for number in range(4, 10)))
"""Families and codes of the rules whose results depend on the version of MuJoCo."""
BUNDLED = Path(terrainkit_robots.__file__).parent / "description/bundled"


@dataclass(frozen=True, kw_only=True)
class Case:
    """A robot, and the expected result of one rule."""

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
        assert (self.robot is None) != (self.of is None), f"{self}: expected either robot or of"
        assert None in (self.against, self.against_of), f"{self}: two robots to compare with"
        assert not self.replace or self.of, f"{self}: replace is for of"
        assert not self.against_replace or self.against_of, f"{self}: against_of is missing"

    def __str__(self):
        return f"{self.code} {'fails' if self.fails else 'passes'}: {self.title}"

    @property
    def text(self):
        """Return the content of the robot's file."""
        return self._edited(self.of, self.replace) if self.robot is None else self.robot

    @property
    def other_text(self):
        """Return the content of the file to compare with, or None."""
        if self.against_of is None:
            return self.against
        return self._edited(self.against_of, self.against_replace)

    def _edited(self, of, replace):
        text = text_of_robot(of)
        for old, new in replace:
            assert old in text, f"{self}: {old!r} is not in {of}"
            text = text.replace(old, new, 1)
        return text

    def write(self, folder):
        """Write the robot and its files to `folder` and return its path."""
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
        """Return the facts of the robot at `path`, including the other file and the spec."""
        other = spec = None
        if self.other_text is not None:
            file = path.parent / f"other{suffix_of(self.other_text)}"
            file.write_bytes(self.other_text.encode())
            other = Facts(load_robot(file))
        if self.spec is not None:
            spec = RobotSpec.from_toml(self.spec)
        model = load_robot(path, contents=contents)
        return Facts(model, Meshes(contents), against=other, spec=spec)


def suffix_of(text):
    """Return the suffix of a file with this text."""
    return ".urdf" if "<robot" in text or "<mujoco" not in text else ".xml"


@cache
def text_of_robot(name):
    """Return the text of a robot of the cases, or of a bundled one."""
    file = CASES / name
    return (file if file.exists() else BUNDLED / file.stem / name).read_text(encoding="utf-8")


# Files beside the robot.


def bytes_of(*, radius=1.0, **content):
    """Return the bytes that a case describes."""
    ((kind, value),) = content.items()
    match kind:
        case "text":
            return value.encode()
        case "hex":
            return bytes.fromhex(value)
        case "zeros":
            return bytes(value)
        case "box":
            return trimesh.creation.box(value).export(file_type="stl")
        case "ascii_box":
            return ascii_stl(trimesh.creation.box(value).triangles)
        case "sphere_faces":
            return sphere(value, radius)
    raise AssertionError(f"unknown kind of file content: {kind}")


def ascii_stl(triangles):
    """Return an ASCII STL, whose size does not depend on trimesh."""
    lines = ["solid box"]
    for triangle in triangles:
        corners = [f"      vertex {x:g} {y:g} {z:g}" for x, y, z in triangle]
        lines += ["  facet normal 0 0 0", "    outer loop", *corners, "    endloop", "  endfacet"]
    return "\n".join([*lines, "endsolid box", ""]).encode()


@cache
def sphere(faces, radius):
    """Return a binary STL of a sphere with at least `faces` faces."""
    subdivisions = math.ceil(math.log(max(faces / 20, 1), 4))
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return sphere.export(file_type="stl")


# Cases.


def cases_of(code):
    """Return the cases of a rule, or an empty list if it has no file."""
    path = CASES / f"{code}.toml"
    table = tomllib.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
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


ALL_CASES = [case for rule in rules() for case in cases_of(rule.code)]


def lint_case(case, path, contents=None, selected=None):
    """Return the report on the robot of a case at `path`.

    Simulation is enabled only if rules are selected.
    """
    facts = case.facts(path, contents)
    if selected is None:
        return lint_selected(facts, Settings(simulate=False), contents)
    return lint(facts, selected)


def messages(report):
    return [f"{f.code} {f.subject}: {f.message}" for f in report.findings]


@pytest.mark.parametrize("case", [case for case in ALL_CASES if case.fails], ids=str)
def test_failing_case_is_found(case, tmp_path):
    path = case.write(tmp_path)
    report = lint_case(case, path, selected=None if case.only else [get_rule(case.code)])
    found = [f for f in report.findings if f.code == case.code]
    assert found, f"no finding; skipped: {report.skipped}"
    if not case.code.startswith(SIMULATED):
        texts = expected_texts().get(str(case))
        assert texts, "`make records` writes the texts of a new case"
        assert [text_of(finding, tmp_path) for finding in found] == texts
    for finding in found:
        check_text(case, finding)
        assert finding.file.is_relative_to(tmp_path)
        assert finding.fix is None or get_rule(case.code).fixes != "no", "the rule claims no fix"
    expected = {
        name: value
        for name in ("subject", "line", "severity")
        if (value := getattr(case, name)) is not None
    }
    assert expected in [{name: getattr(f, name) for name in expected} for f in found]
    if case.only:
        others = [f for f in report.findings if f.code != case.code and f.severity != "note"]
        assert not others, messages(report)


@cache
def expected_texts():
    """Return the texts of the findings of each case, by its title."""
    return json.loads(FINDINGS.read_text(encoding="utf-8"))


def text_of(finding, folder):
    """Return a finding as a line, with three digits of what was measured.

    The folder and the sentences of libxml2 and MuJoCo are left out.
    """
    measured = [
        f"{name} {value:.3g}" if isinstance(value, float) else f"{name} {value}"
        for name, value in finding.measured.items()
    ]
    about = f"{finding.severity} {finding.certainty} {finding.subject}, line {finding.line}"
    text = finding.message.replace(str(folder), "FOLDER").replace(short_path(folder), "FOLDER")
    message = OTHERS_SENTENCE.sub(r"\1: ...", text)
    return "; ".join([f"{about}: {message}", *measured])


def check_text(case, finding):
    """Check that a finding has a subject, a hint and a one-line message."""
    assert finding.subject
    assert finding.hint
    assert finding.message == " ".join(finding.message.split())
    assert finding.message.isascii() or not (case.text + (case.other_text or "")).isascii()


def test_every_rule_has_cases():
    assert {path.stem for path in CASES.glob("*.toml")} == {rule.code for rule in rules()}
    kinds = {(case.code, case.fails) for case in ALL_CASES}
    assert kinds == {(rule.code, fails) for rule in rules() for fails in (False, True)}
    assert len(set(map(str, ALL_CASES))) == len(ALL_CASES), "two cases of the same title"


@pytest.mark.parametrize("code", [rule.code for rule in rules()])
def test_passing_cases_have_no_findings(code, tmp_path):
    reasons = []
    for number, case in enumerate(case for case in cases_of(code) if not case.fails):
        (tmp_path / str(number)).mkdir()
        path = case.write(tmp_path / str(number))
        report = lint_case(case, path, selected=[get_rule(code)])
        assert not report.findings, f"{case}: {messages(report)}"
        reasons.append([each.reason for each in report.skipped])
    # The rule runs on one of them at least; an info rule may report on every robot.
    assert [] in reasons or not reasons or get_rule(code).severity == "note", reasons


# Fixes.


@pytest.mark.parametrize("code", [rule.code for rule in rules() if rule.fixes != "no"])
def test_fixes_remove_the_findings(code, tmp_path):
    safeties = set()
    for number, case in enumerate(case for case in cases_of(code) if case.fails):
        (tmp_path / str(number)).mkdir()
        safeties |= safeties_of_fixes(case, tmp_path / str(number))
    assert get_rule(code).fixes in safeties, "no case can be fixed"


def safeties_of_fixes(case, folder):
    """Fix the robot of a case; return which kinds of fixes the rule offered."""
    path = case.write(folder)
    unsafe = get_rule(case.code).fixes == "unsafe"
    reports = []

    def look(contents):
        reports.append(lint_case(case, path, contents))
        return reports[-1]

    result = fix_robot(path, look, unsafe=unsafe)
    own = [f for f in reports[0].findings if f.code == case.code]
    safeties = {f.fix.safety for f in own if f.fix}
    if not (safeties if unsafe else "safe" in safeties):
        assert {f.message for f in own} <= {f.message for f in result.report.findings}, case
        return safeties
    assert case.code in {f.code for f in result.report.fixed}, (case, result.report.unfixed)
    assert len([f for f in result.report.findings if f.code == case.code]) < len(own), case
    assert problems(result.report) <= problems(reports[0]), case
    write_fixes(result)
    again = fix_robot(path, look, unsafe=unsafe)
    assert again.after == again.new == {}, case
    assert problems(again.report) == problems(result.report), case
    return safeties


def problems(report):
    """Return codes and subjects; notes may appear only after a robot is fixed."""
    return {(f.code, f.subject) for f in report.findings if f.severity != "note"}


def write_texts():
    """Write findings.json."""
    texts = {}
    for case in (each for each in ALL_CASES if each.fails and not each.code.startswith(SIMULATED)):
        with tempfile.TemporaryDirectory() as folder:
            report = lint_case(case, case.write(Path(folder)), selected=[get_rule(case.code)])
            texts[str(case)] = [text_of(finding, folder) for finding in report.findings]
    FINDINGS.write_text(json.dumps(texts, indent=0, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    write_texts()
