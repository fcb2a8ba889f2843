from pathlib import Path

import pytest

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.fix import Fix
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.model import Source
from terrainkit_robots.lint.rule import Rule, Violation, rules
from terrainkit_robots.lint.runner import INTERNAL, MOST_FINDINGS, lint

FILE = Path("/robots/robot.urdf")


def facts(text='<robot name="r"><link name="a"/></robot>'):
    return Facts(load_robot(FILE, contents={FILE: text.encode()}))


def violation(subject="a", line=1, **more):
    return Violation(subject=subject, source=Source(file=FILE, line=line), message="m", **more)


def rule(check, code="INR099", severity="error", *, needs=()):
    """Return a rule that finds what `check` yields; a list is found on every robot."""

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


def report(*chosen, robot=None):
    return lint(facts() if robot is None else robot, chosen)


def test_a_finding_says_what_the_rule_and_the_defect_say():
    fix = Fix(safety="safe", description="d", edits=())
    source = Source(file=Path("/robots/part.urdf"), line=7)
    whole = Violation(
        subject="calf",
        source=source,
        message="the mass is -1 kg",
        measured={"mass": -1.0},
        certainty="likely",
        fix=fix,
    )
    (found,) = report(rule([whole])).findings
    assert (found.code, found.name) == ("INR099", "a-rule")
    assert (found.severity, found.certainty) == ("error", "likely")
    assert (found.subject, found.message) == ("calf", "the mass is -1 kg")
    assert (found.file, found.line) == (Path("/robots/part.urdf"), 7)
    assert found.measured == {"mass": -1.0}
    assert found.fix is fix


def test_the_hint_is_the_rules_unless_the_defect_has_its_own():
    found = report(rule([violation(), violation(line=2, hint="Do that.")])).findings
    assert [each.hint for each in found] == ["Do this.", "Do that."]


def test_a_defect_may_be_less_severe_than_its_rule():
    found = report(rule([violation(severity="info")])).findings
    assert [each.severity for each in found] == ["info"]


def test_errors_come_first_then_the_place_in_the_file():
    found = report(
        rule([violation("a", 9), violation("b", 3)], "INR099", "warning"),
        rule([violation("c", 9), violation("d", 3)], "INR098", "error"),
        rule([violation("e", 1)], "INR097", "info"),
        rule([violation("f", 3)], "INR096", "error"),
    ).findings
    assert [each.subject for each in found] == ["f", "d", "c", "b", "a", "e"]


@pytest.mark.parametrize(
    ("severities", "verdict"),
    [
        ([], "pass"),
        (["info"], "pass"),
        (["warning", "info"], "warn"),
        (["info", "error", "warning"], "fail"),
    ],
)
def test_the_verdict_is_that_of_the_worst(severities, verdict):
    found = [violation(severity=severity) for severity in severities]
    assert report(rule(found)).verdict == verdict


def test_what_cannot_be_checked_is_told():
    def check(_):
        yield violation()
        raise CannotCheckError("there is nothing to go by")

    made = report(rule(check))
    assert made.findings == ()
    assert [(s.code, s.reason) for s in made.skipped] == [("INR099", "there is nothing to go by")]
    assert made.crashed == ()


def test_a_rule_for_legs_is_not_asked_of_a_robot_without():
    made = report(rule([violation()], needs=("legs",)))
    assert made.findings == ()
    assert made.skipped[0].reason == "no legs were found"
    robot = Facts(load_robot(bundled.find("biped")))
    assert len(report(rule([violation()], needs=("legs",)), robot=robot).findings) == 1


@pytest.mark.parametrize("family", ["LEG", "SYM"])
def test_limbs_are_not_compared_where_some_are_lost(family):
    text = (
        '<robot name="r"><link name="a"/><joint name="j" type="fixed"><parent link="a"/>'
        '<child link="lost"/></joint></robot>'
    )
    made = report(rule([violation()], f"{family}099"), robot=facts(text))
    assert made.findings == ()
    assert "missing from the tree" in made.skipped[0].reason
    assert len(report(rule([violation()], "INR099"), robot=facts(text)).findings) == 1


def test_a_rule_that_fails_costs_no_other():
    def broken(_):
        raise ZeroDivisionError("oh")
        yield

    made = report(rule(broken, "INR098"), rule([violation()]))
    assert [each.code for each in made.findings] == ["INR099"]
    assert [each.code for each in made.crashed] == ["INR098"]
    assert made.crashed[0].reason == f"{INTERNAL}: ZeroDivisionError: oh"


def test_a_rule_without_memory_ends_the_run():
    def greedy(_):
        raise MemoryError
        yield

    with pytest.raises(MemoryError):
        report(rule(greedy))


def test_of_endless_defects_the_first_are_told():
    def endless(_):
        line = 0
        while True:
            line += 1
            yield violation(line=line)

    made = report(rule(endless))
    assert [each.line for each in made.findings] == list(range(1, MOST_FINDINGS + 1))
    assert str(MOST_FINDINGS) in made.skipped[0].reason
    exactly = report(rule([violation(line=k) for k in range(MOST_FINDINGS)]))
    assert exactly.skipped == ()


def test_all_rules_are_asked_unless_told():
    asked = {each.code for each in rules()}
    made = lint(facts("<robot/>"))
    assert {each.code for each in (*made.findings, *made.skipped)} <= asked
    assert any(each.code == "XML003" for each in made.findings)
    assert lint(facts("<robot/>"), []).findings == ()


def test_the_same_robot_has_the_same_findings():
    robot = bundled.find("quadruped")
    first, second = (lint(Facts(load_robot(robot))) for _ in range(2))
    assert first.findings == second.findings
    assert first.skipped == second.skipped


@pytest.mark.parametrize("name", bundled.names())
@pytest.mark.parametrize("suffix", [".urdf", ".xml"])
def test_no_rule_fails_on_a_bundled_robot(name, suffix):
    made = lint(Facts(load_robot(bundled.find(name).with_suffix(suffix))))
    assert made.crashed == ()
    assert made.verdict == "pass"
