import tomllib
from pathlib import Path

import pytest

from terrainkit_robots.lint.rule import SEVERITIES, get_rule
from tests.terrainkit_robots.lint.test_every_rule import Case, lint_case

TABLE = tomllib.loads(Path(__file__).with_name("thresholds.toml").read_text())["threshold"]


def severity(folder, code, of, old, new):
    """Return the highest severity of the findings of a rule on an edited bundled robot, or None."""
    against = of if code.startswith("XRF") else None
    case = Case(code=code, fails=True, title="", of=of, replace=((old, new),), against_of=against)
    report = lint_case(case, case.write(folder), selected=[get_rule(code)])
    assert report.skipped == ()
    return min((f.severity for f in report.findings), key=SEVERITIES.index, default=None)


@pytest.mark.parametrize("each", TABLE, ids=lambda each: f"{each['code']} {each['beyond']}")
def test_rule_finds_only_what_is_beyond_its_threshold(each, tmp_path):
    robot = (each["code"], each.get("of", "quadruped.urdf"), each["text"])
    found = [
        severity(tmp_path, *robot, each["with"].replace("#", f"{each[side]:.9g}"))
        for side in ("within", "beyond")
    ]
    assert found == [each.get("within_is"), each["severity"]]
