import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.rule import get_rule
from terrainkit_robots.lint.runner import lint
from tests.robots import QUADRUPED
from tests.small_robots import URDF


@pytest.mark.parametrize("code", ["SYM001", "SYM002", "SYM003", "SYM006", "SYM007"])
def test_symmetry_of_bodies_is_not_checked_if_a_joint_of_unknown_type_may_merge_two(code):
    text = QUADRUPED.read_text().replace('FL_hip_joint" type="revolute', 'FL_hip_joint" type="turn')
    robot = Facts(load_robot(URDF, contents={URDF: text.encode()}))
    report = lint(robot, [get_rule(code)])
    reasons = [each.reason for each in report.skipped]
    assert (report.findings, reasons) == ((), ["the type of joint FL_hip_joint is unknown"])
