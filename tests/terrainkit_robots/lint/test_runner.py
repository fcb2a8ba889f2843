import re
from dataclasses import replace
from itertools import count
from pathlib import Path

import pytest

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.fix import Fix
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.model import Source
from terrainkit_robots.lint.check import lint_selected
from terrainkit_robots.lint.rule import FAMILIES, Part, Rule, Violation, rules
from terrainkit_robots.lint.runner import INTERNAL_ERROR, MAX_FINDINGS, Skipped, has_inputs, lint
from terrainkit_robots.lint.settings import Settings
from tests.small_robots import URDF, facts, joint, link

LINK = link("a", mass=None)
UNITS = ((1, "mass"), (2, "length"))


def violation(subject="a", line=1, **more):
    part = Part(subject, Source(file=URDF, line=line))
    return Violation(element=part, message="m", **more)


def rule(check, code="INR099", severity="error", *, needs=()):
    """Return a rule that yields from `check`, a function or a list of violations."""

    def found(robot):
        """Something is wrong.

        Why.

        Fix:
            Do this.

        Source:
            A book.
        """
        yield from check(robot) if callable(check) else check

    return Rule(code=code, name="a-rule", severity=severity, check=found, needs=needs)


def report(*selected, robot=None):
    return lint(facts(LINK) if robot is None else robot, selected)


def test_finding_combines_rule_and_violation():
    whole = {
        "message": "the mass is -1 kg",
        "measured": {"mass": -1.0},
        "certainty": "likely",
        "fix": Fix(safety="safe", description="d", edits=()),
    }
    part = Part("calf", Source(file=Path("/robots/part.urdf"), line=7))
    (found,) = report(rule([Violation(element=part, **whole)])).findings
    about = {"code": "INR099", "name": "a-rule", "severity": "error", "hint": "Do this."}
    place = {"subject": "calf", "file": Path("/robots/part.urdf"), "line": 7}
    expected = whole | about | place
    assert {name: getattr(found, name) for name in expected} == expected


def test_violation_overrides_hint_and_severity_of_the_rule():
    other = violation(line=2, hint="Do that.", severity="note")
    found = report(rule([violation(), other])).findings
    assert [(each.hint, each.severity) for each in found] == [
        ("Do this.", "error"),
        ("Do that.", "note"),
    ]


def test_findings_are_sorted():
    found = report(
        rule([violation("a", 9), violation("b", 3)], "INR099", "warning"),
        rule([violation("c", 9), violation("d", 3)], "INR098", "error"),
        rule([violation("e", 1)], "INR097", "note"),
        rule([violation("f", 3)], "INR096", "error"),
        *(rule([violation(family)], f"{family}099") for family in ("COL", "NAM", "XML", "SIM")),
    ).findings
    # Errors that prevent loading come first.
    subjects = ["XML", "SIM", "f", "d", "c", "COL", "NAM", "b", "a", "e"]
    assert [each.subject for each in found] == subjects


@pytest.mark.parametrize(
    ("severities", "verdict"),
    [
        ([], "pass"),
        (["note"], "pass"),
        (["warning", "note"], "warn"),
        (["note", "error", "warning"], "fail"),
    ],
)
def test_verdict_is_the_worst_severity(severities, verdict):
    found = [violation(severity=severity) for severity in severities]
    assert report(rule(found)).verdict == verdict


def test_cannot_check_is_skipped_with_reason():
    def check(_):
        yield violation()
        raise CannotCheckError("no data")

    made = report(rule(check))
    assert made.findings == made.crashed == ()
    assert made.skipped == (Skipped(code="INR099", kind="cannot-check", reason="no data"),)


def test_leg_rules_need_legs():
    made = report(rule([violation()], needs=("legs",)))
    assert made.findings == ()
    assert made.skipped == (Skipped(code="INR099", kind="no-legs", reason="no legs detected"),)
    robot = Facts(load_robot(bundled.urdf_path("biped")))
    assert len(report(rule([violation()], needs=("legs",)), robot=robot).findings) == 1


@pytest.mark.parametrize(
    ("needs", "reason"),
    [
        (("simulation", "legs"), "simulation is disabled"),
        (("against",), "no second file to compare with; use --against FILE"),
        (("spec", "legs"), "no robot.toml to compare with; use --spec FILE"),
    ],
)
def test_rules_need_their_input(needs, reason):
    asked = rule([violation()], needs=needs)
    made = lint(facts(LINK), [asked], simulate=False)
    assert made.skipped == (Skipped(code="INR099", kind="no-input", reason=reason),)
    assert not has_inputs(asked, facts(LINK), simulate=False)
    assert has_inputs(rule([], needs=("legs",)), facts(LINK), simulate=False)


@pytest.mark.parametrize("family", ["LEG", "SYM", "DYN"])
def test_limb_rules_need_complete_tree(family):
    robot = facts(LINK, joint("a", "lost", kind="fixed"))
    made = report(rule([violation()], needs=FAMILIES[family].needs), robot=robot)
    assert made.findings == ()
    assert "missing from the kinematic tree" in made.skipped[0].reason
    assert len(report(rule([violation()], "INR099"), robot=robot).findings) == 1


def test_references_are_checked_only_with_all_included_files():
    robot = facts('<mujoco><include file="gone.xml"/><worldbody><body/></worldbody></mujoco>')
    shapes = rule([violation()], "COL099", needs=FAMILIES["COL"].needs)
    made = report(shapes, rule([violation()], "INR099"), robot=robot)
    assert [each.code for each in made.findings] == ["INR099"]
    assert made.skipped[0].reason == "an included file cannot be read (XML012)"


def test_only_xml_rules_run_on_an_unreadable_file():
    made = report(rule([violation()], "XML099"), rule([violation()]), robot=facts("<robot"))
    assert [each.code for each in made.findings] == ["XML099"]


def test_crash_of_a_rule_is_recorded():
    def broken(_):
        raise ZeroDivisionError("oh")

    made = report(rule(broken, "INR098"), rule([violation()]))
    assert [each.code for each in made.findings] == ["INR099"]
    assert [each.code for each in made.crashed] == ["INR098"]
    assert made.crashed[0].reason == f"{INTERNAL_ERROR}: ZeroDivisionError: oh"


def test_memory_error_is_raised():
    def greedy(_):
        raise MemoryError

    with pytest.raises(MemoryError):
        report(rule(greedy))


def test_findings_of_a_rule_are_limited():
    made = report(rule(lambda _: (violation(line=line) for line in count(1))))
    assert [each.line for each in made.findings] == list(range(1, MAX_FINDINGS + 1))
    assert [each.kind for each in made.skipped] == ["truncated"]
    assert str(MAX_FINDINGS) in made.skipped[0].reason
    exactly = report(rule([violation(line=k) for k in range(MAX_FINDINGS)]))
    assert exactly.skipped == ()


def test_only_given_rules_run():
    assert "XML003" in [each.code for each in lint(facts("<robot/>"), rules()).findings]
    assert lint(facts("<robot/>"), []).findings == ()


@pytest.mark.parametrize("name", bundled.robot_names())
@pytest.mark.parametrize("suffix", [".urdf", ".xml"])
def test_bundled_robots_pass_all_rules(name, suffix):
    made = lint_selected(Facts(load_robot(bundled.urdf_path(name).with_suffix(suffix))), Settings())
    assert made.crashed == ()
    assert made.verdict == "pass"


def test_wrong_unit_is_first_and_hides_its_consequences():
    text = re.sub(
        r'mass value="([^"]*)"', r'mass value="\g<1>e3"', bundled.urdf_path("quadruped").read_text()
    )
    report = lint(facts(text), rules(), simulate=False)
    assert report.findings[0].code == "UNI001"
    assert {finding.code for finding in report.findings if finding.severity != "note"} == {"UNI001"}
    reasons = {each.code: each.reason for each in report.skipped}
    assert reasons["INR010"] == reasons["JNT015"] == "a quantity has another unit (UNI001)"


def test_first_missing_input_is_the_reason():
    """The needs of a rule are in order, whichever unit was found to be wrong first."""
    units = [replace(rule([violation()], f"UNI00{k}"), name=f"{what}-unit") for k, what in UNITS]
    selected = [*units, rule([violation()], needs=("length-unit", "mass-unit", "legs"))]
    made = report(*selected)
    assert [each.code for each in made.findings] == ["UNI001", "UNI002"]
    (skipped,) = made.skipped
    assert (skipped.code, skipped.kind) == ("INR099", "cannot-check")
    assert skipped.reason == "a quantity has another unit (UNI002)"
