"""XRF rules on real robots in two formats."""

import re
import subprocess
import sys

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.rule import rules
from terrainkit_robots.lint.runner import lint

XRF = [rule for rule in rules() if rule.family == "XRF" and "against" in rule.needs]
GO2 = [3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8]


def compared(one, other):
    report = lint(Facts(load_robot(one), against=Facts(load_robot(other))), XRF)
    assert report.skipped == ()
    return report


def told(report, *, info=False):
    return sorted((f.code, f.subject) for f in report.findings if (f.severity == "note") == info)


def test_go2(robot_file):
    report = compared(robot_file("go2/urdf/go2.urdf"), robot_file("go2_mjcf/go2.xml"))
    assert told(report) == [
        ("XRF005", "go2_description"),
        ("XRF006", "FL_calf_joint"),
        ("XRF007", "go2_description"),
    ]
    order, effort, mass = sorted(
        (f for f in report.findings if f.severity != "note"), key=lambda f: f.code
    )
    assert f"ctrl = joints[{GO2}]" in order.message
    assert "4 joints" in effort.message
    assert "35.55 N m here and 45.43 N m in go2.xml" in effort.message
    assert "15.019 kg here and 15.206 kg in go2.xml, 1.2%" in mass.message
    assert "FL_calf 0.194 and 0.2414 kg" in mass.message


def test_permutation_in_message_is_correct(robot_file):
    """The list in the message reorders values from joint order to actuator order."""
    report = compared(robot_file("go2_mjcf/go2.xml"), robot_file("go2/urdf/go2.urdf"))
    (finding,) = [f for f in report.findings if f.code == "XRF005"]
    pasted = re.search(r"ctrl = joints\[\[([\d, ]+)\]\]", finding.message)[1]
    model = report.facts.model
    joints = [joint.name for joint in report.facts.joints]
    order = [joints[int(word)] for word in pasted.split(",")]
    assert order == [actuator.joint for actuator in model.actuators]


def test_h1(robot_file):
    """Both declare 51.65 kg; MuJoCo drops most of it from the URDF, and the ankles differ."""
    report = compared(robot_file("h1/urdf/h1.urdf"), robot_file("h1/h1.xml"))
    assert told(report) == [("XRF009", "left_ankle_link"), ("XRF009", "right_ankle_link")]
    assert told(report, info=True) == [("XRF007", "pelvis")]
    (dropped,) = [f for f in report.findings if f.severity == "note"]
    assert dropped.measured["dropped"] == pytest.approx(29.847)
    assert dropped.measured["declared"] == pytest.approx(51.649896)


def test_g1_agrees(robot_file):
    report = compared(robot_file("g1/g1_29dof.urdf"), robot_file("g1/g1_29dof.xml"))
    assert told(report) == []
    assert report.verdict == "pass"


@pytest.mark.parametrize(
    "name",
    [
        "a1/urdf/a1.urdf",
        "anymal_c/urdf/anymal_c.urdf",
        "cassie/urdf/cassie.urdf",
        "h1/h1.xml",
        "g1/g1_29dof.urdf",
    ],
)
def test_robot_agrees_with_itself(robot_file, name):
    assert compared(robot_file(name), robot_file(name)).findings == ()


def test_different_robots_differ(robot_file):
    report = compared(robot_file("a1/urdf/a1.urdf"), robot_file("go2/urdf/go2.urdf"))
    codes = {f.code for f in report.findings}
    assert {"XRF003", "XRF004", "XRF006", "XRF007", "XRF008"} <= codes
    (order,) = [f for f in report.findings if f.code == "XRF004"]
    assert f"theirs = ours[{GO2}]" in order.message


@pytest.mark.parametrize("name", ["quadruped", "biped"])
@pytest.mark.parametrize("suffixes", [(".urdf", ".xml"), (".xml", ".urdf")])
def test_bundled_robots_agree(robot_of, name, suffixes):
    one, other = (robot_of(name + suffix) for suffix in suffixes)
    report = lint(Facts(one.model, against=other), XRF)
    assert report.findings == ()
    assert report.skipped == ()


def test_robot_without_links_is_skipped(robot_of):
    empty = robot_of('<robot name="nothing"/>')
    report = lint(Facts(robot_of("quadruped.urdf").model, against=empty), XRF)
    assert report.findings == ()
    assert len(report.skipped) == len(XRF)
    assert not report.crashed
    assert "has no links" in report.skipped[0].reason


def test_no_comparison_does_not_import_yourdfpy(robot_of):
    file = robot_of("quadruped.urdf").model.file
    code = (
        "import sys; from pathlib import Path; from terrainkit_robots.analysis.facts import Facts; "
        "from terrainkit_robots.lint.selection import lint_selected; "
        "from terrainkit_robots.lint.settings import Settings; "
        "from terrainkit_robots.description.load import load_robot; "
        f"facts = Facts(load_robot(Path({str(file)!r}))); "
        "report = lint_selected(facts, Settings(simulate=False)); "
        "assert not any(f.code.startswith('XRF') for f in report.findings); "
        "assert 'yourdfpy' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env={"PYTHONPATH": ":".join(sys.path)})
