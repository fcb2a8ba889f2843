import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.rule import get_rule
from terrainkit_robots.lint.runner import lint
from tests.robots import QUADRUPED
from tests.small_robots import URDF, box, facts, joint, link


@pytest.mark.parametrize("code", ["SYM001", "SYM002", "SYM003", "SYM006", "SYM007"])
def test_symmetry_of_bodies_is_not_checked_if_a_joint_of_unknown_type_may_merge_two(code):
    text = QUADRUPED.read_text().replace('FL_hip_joint" type="revolute', 'FL_hip_joint" type="turn')
    robot = Facts(load_robot(URDF, contents={URDF: text.encode()}))
    report = lint(robot, [get_rule(code)])
    reasons = [each.reason for each in report.skipped]
    assert (report.findings, reasons) == ((), ["the type of joint FL_hip_joint is unknown"])


def test_collision_shape_that_is_further_from_the_visual_one_is_wrong():
    """On the left, both are 0.14 m apart, on the right 0.03 m."""
    parts = [link("trunk", mass=10)]
    for side, y, collision, visual in (
        ("left", 0.2, "0.1 -0.1 -0.3", "0 0 -0.3"),
        ("right", -0.2, "0 0 -0.3", "0 0 -0.27"),
    ):
        shapes = box("0.1 0.1 0.1", collision), box("0.1 0.1 0.1", visual, kind="visual")
        parts += [link(f"{side}_thigh", center=f"0 {y} 0"), link(f"{side}_calf", *shapes)]
        parts += [joint("trunk", f"{side}_thigh", f"0 {y} 0")]
        parts += [joint(f"{side}_thigh", f"{side}_calf", "0 0 -0.3")]
    (finding,) = lint(facts(*parts), [get_rule("SYM013")]).findings
    assert finding.subject == "left_calf"
    assert finding.message.endswith("the shapes of left_calf contradict it")
