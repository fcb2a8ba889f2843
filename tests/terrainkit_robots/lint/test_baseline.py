import json

import pytest

from terrainkit.errors import TerrainkitError
from terrainkit_robots.lint.baseline import Baseline
from terrainkit_robots.lint.check import check_robot
from terrainkit_robots.lint.report import FORMATS, to_text
from terrainkit_robots.lint.settings import Settings
from tests.tables import read_table

LINK = '<link name="{}"><inertial><mass value="{}"/></inertial></link>'


@pytest.fixture
def robot(tmp_path):
    """Return a function that writes a robot with a negative mass in each named link."""

    def write(*links, name="arm.urdf", before=""):
        path = tmp_path / "robots" / name
        path.parent.mkdir(exist_ok=True)
        text = "".join(LINK.format(link, -1) for link in links) + LINK.format("good", 1)
        path.write_text(f'{before}<robot name="arm">{text}</robot>')
        return path

    return write


@pytest.fixture
def file(tmp_path):
    return tmp_path / "robots.baseline.json"


def check(path, *codes):
    return check_robot(path, Settings(select=codes or ("INR002",)))


def record(file, *reports):
    baseline = Baseline.read(file) if file.exists() else Baseline(path=file)
    baseline.updated(reports).write()
    return Baseline.read(file)


def subjects(report):
    return [finding.subject for finding in report.findings]


def unused(report):
    return [each.reason for each in report.skipped if each.kind == "unused"]


def test_baseline_accepts_recorded_findings_only(robot, file):
    baseline = record(file, check(robot("a", "b")))
    report = baseline.accept(check(robot("a", "b", "new", before="<!-- moved -->\n\n")))
    assert (subjects(report), report.verdict) == (["new"], "fail")
    accepted = [(each.kind, each.finding.subject) for each in report.skipped]
    assert accepted == [("suppressed", "a"), ("suppressed", "b")]
    assert baseline.accept(check(robot("a", "b"))).verdict == "pass"


def test_baseline_file_is_relative_and_sorted(robot, file, tmp_path, monkeypatch):
    baseline = record(file, check(robot("b", "a", name="z.urdf")), check(robot("c", name="a.urdf")))
    text = file.read_text()
    assert json.loads(text) == {
        "version": 1,
        "robots": {"robots/a.urdf": {"INR002": ["c"]}, "robots/z.urdf": {"INR002": ["a", "b"]}},
    }
    assert text.index("a.urdf") < text.index("z.urdf")
    monkeypatch.chdir(tmp_path / "robots")
    report = baseline.accept(check("a.urdf"))
    assert subjects(report) == []
    assert [each.kind for each in report.skipped] == ["suppressed"]


def test_baseline_reports_recorded_finding_that_was_fixed(robot, file, monkeypatch):
    baseline = record(file, check(robot("a", "b", "c")))
    monkeypatch.chdir(file.parent)
    report = baseline.accept(check(robot("b")))
    assert unused(report) == ["no longer needed in robots.baseline.json: a, c"]
    assert unused(baseline.accept(check(robot("b"), "XML"))) == []  # INR002 did not run
    assert unused(baseline.accept(check(robot("a", "b", "c")))) == []


def test_baseline_reports_more_findings_of_a_subject_than_recorded(robot, file):
    baseline = record(file, check(robot("a")))
    assert subjects(baseline.accept(check(robot("a", "a")))) == ["a", "a"]


def test_baseline_leaves_notes(file, robot):
    report = check_robot(robot())
    assert "note" in {finding.severity for finding in report.findings}
    accepted = record(file, report).accept(report)
    assert {finding.severity for finding in accepted.findings} == {"note"}
    assert accepted.verdict == "pass"


def test_baseline_update_keeps_what_was_not_checked(robot, file):
    first, second = robot("a", name="1.urdf"), robot("b", name="2.urdf")
    record(file, check(first), check(second))
    assert record(file, check(robot(name="1.urdf"))).robots == {"robots/2.urdf": {"INR002": ["b"]}}
    assert record(file, check(second, "XML")).robots == {"robots/2.urdf": {"INR002": ["b"]}}
    second.unlink()
    assert record(file).robots == {}


def test_baseline_update_keeps_file_names_that_are_not_text(robot, file):
    path = robot("a", name="arm \udcff\\udcff.urdf")
    record(file, check(path))
    content = json.loads(file.read_text())
    content["robots"] |= {"x" * 300: {"INR002": ["a"]}, "gone\0.urdf": {"INR002": ["a"]}}
    file.write_text(json.dumps(content))
    baseline = record(file)  # without a check of the robot
    assert list(baseline.robots) == ["robots/arm \udcff\\udcff.urdf"]
    assert baseline.accept(check(path)).verdict == "pass"


def test_every_format_hides_accepted_findings(robot, file):
    report = check(robot("a"))
    accepted = record(file, report).accept(report)
    for name in set(FORMATS) - {"sarif"}:  # which lists them as suppressed
        assert "mass of link a" in to_text([report], name)
        assert "mass of link a" not in to_text([accepted], name)


@pytest.mark.parametrize(
    "text",
    [
        *read_table(__file__, "malformed_baseline_is_rejected"),
        "\udcff",
        '{"version": 1, "robots": {}, "deep": ' + "[" * 100_000,
    ],
    ids=lambda text: text[:40],
)
def test_malformed_baseline_is_rejected(file, text):
    file.write_text(text, errors="surrogateescape")
    told = "expected a file written by --write-baseline"
    with pytest.raises(TerrainkitError, match=told) as error:
        Baseline.read(file)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 300
