"""Run all rules on the robot of every case, and on a quadruped with changed numbers.

A tenth of the robots is tested; all of them with TERRAINKIT_ALL_RULES=1, as every night. The
findings are in all_findings.json, without their texts. `make records` writes them anew; read the
difference. Rules that load the file in MuJoCo are left out, since its versions reject different
files.
"""

import json
import os
import re
import tempfile
from functools import cache
from pathlib import Path

import pytest

from terrainkit_robots.lint.rule import FAMILIES
from tests.tables import read_table
from tests.terrainkit_robots.lint.test_every_rule import ALL_CASES, Case, lint_case, text_of_robot

FINDINGS = Path(__file__).with_name("all_findings.json")

NUMBERS = read_table(__file__, "numbers")
"""Numbers of a URDF by name, as patterns with one group."""

STEP = 1 if os.environ.get("TERRAINKIT_ALL_RULES") or __name__ == "__main__" else 10
"""One in so many robots is tested."""

ONE = (-1, 0.5, 0.95, 1.05, 2)
EVERY = (0.01, 0.1, 0.5, 2, 100)


def scaled(pattern, factor, *, count):
    """Return the quadruped with its first `count` numbers multiplied; 0 is all of them."""

    def scale(match):
        start, end = (place - match.start() for place in match.span(1))
        return f"{match[0][:start]}{float(match[1]) * factor:.6g}{match[0][end:]}"

    return re.sub(pattern, scale, text_of_robot("quadruped.urdf"), count=count, flags=re.DOTALL)


def findings(title, robot, folder):
    """Return the findings of all rules, as lines."""
    case = robot if isinstance(robot, Case) else Case(code="", fails=True, title=title, robot=robot)
    report = lint_case(case, case.write(folder))
    assert not report.crashed, title
    return [brief(f, folder) for f in report.findings if not f.code.startswith("SIM")]


def brief(finding, folder):
    """Return a finding without its text, apart from the numbers."""
    message = finding.message.replace(str(folder), "")
    numbers = re.findall(r"(?<![\w.])-?\d+\.?\d*(?:e-?\d+)?", message)
    place = f"{finding.severity} {finding.certainty} {finding.subject}, line {finding.line}"
    return " ".join([finding.code, f"{place}:", *numbers])


def cases_with_robots(family):
    """Return the cases of a family, one of each robot.

    A robot that is compared with another file or a spec is left out, since XRF tests it.
    """
    robots = {
        (case.text, repr(case.files)): case
        for case in ALL_CASES
        if case.other_text is case.spec is None
    }
    return [case for case in robots.values() if case.code.startswith(family)]


def of_cases(family, folder):
    """Return the findings on the robots of the cases of a family, by the case."""
    found = {}
    for number, case in enumerate(cases_with_robots(family)[::STEP]):
        (folder / str(number)).mkdir()
        found[str(case)] = findings(str(case), case, folder / str(number))
    return found


def of_changes(name, folder):
    """Return the findings on the quadruped with one number, or every number of a kind, scaled."""
    changes = [("one", factor, 1) for factor in ONE] + [("every", factor, 0) for factor in EVERY]
    return {
        title: findings(title, scaled(NUMBERS[name], factor, count=count), folder)
        for word, factor, count in changes[::STEP]
        for title in [f"{word} {name} times {factor:g}"]
    }


@cache
def expected():
    return json.loads(FINDINGS.read_text(encoding="utf-8"))


@pytest.mark.parametrize("family", FAMILIES)
def test_all_findings_have_the_robots_of_all_cases(family):
    titles = [str(case) for case in cases_with_robots(family)]
    assert titles == [*expected()[family]], "`make records` writes the findings of a new case"


@pytest.mark.parametrize("family", FAMILIES)
def test_all_findings_on_the_robots_of_cases(family, tmp_path):
    found = of_cases(family, tmp_path)
    assert found == {title: expected()[family][title] for title in [*expected()[family]][::STEP]}


@pytest.mark.parametrize("name", NUMBERS)
def test_all_findings_on_a_quadruped_with_scaled_numbers(name, tmp_path):
    found = of_changes(name, tmp_path)
    assert found == {title: expected()[name][title] for title in [*expected()[name]][::STEP]}


def write_findings():
    """Write all_findings.json."""
    found = {}
    for make, names in ((of_cases, FAMILIES), (of_changes, NUMBERS)):
        for name in names:
            with tempfile.TemporaryDirectory() as folder:
                found[name] = make(name, Path(folder))
    FINDINGS.write_text(json.dumps(found, indent=0, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    write_findings()
