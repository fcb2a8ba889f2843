"""Test rules of the family SIM on own robots."""

from terrainkit_robots.lint.rule import findings_of
from tests.small_robots import chain, facts, joint, link


def test_feet_without_shapes_are_not_merged_feet():
    legs = [chain(name, f"0 {y} 0", (0.3, 0.3)) for name, y in (("a_leg", 0.1), ("b_leg", -0.1))]
    for each in ("a", "b"):
        legs += [link(f"{each}_foot"), joint(f"{each}_leg1", f"{each}_foot", kind="fixed")]
    robot = facts(link("trunk"), *legs)
    assert len(robot.legs) == 2
    assert not any("feet" in found.message for found in findings_of(robot, "SIM001"))
