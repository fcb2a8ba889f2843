import math
import re

import pytest

from terrainkit_robots.analysis.symmetry.asymmetry import (
    find_flipped_joints,
    find_flipped_pairs,
    find_misalignments,
    limits_match,
)
from terrainkit_robots.description import bundled
from tests.small_robots import facts, joint, link
from tests.tables import read_table


def arms(
    left, right, left_axis="0 1 0", right_axis="0 1 0", turned="0 0 0", com="0 0 0", right_com=None,
    leg_bodies=(),
):  # fmt: skip
    """Return the misalignments of two arms with elbows: links, is_axis, distance and angle.

    The joints of the arms are at `left` and `right`, and the right one is `turned`.
    """
    parts = [link("trunk"), link("left_arm", center=com)]
    parts += [link("right_arm", center=right_com or com)]
    parts += [joint("trunk", "left_arm", left, left_axis)]
    parts += [joint("trunk", "right_arm", right, right_axis, rpy=turned)]
    for side in ("left", "right"):
        parts += [link(f"{side}_elbow"), joint(f"{side}_arm", f"{side}_elbow", "0.3 0 0")]
    robot = facts(*parts)
    found, _ = find_misalignments(robot.mirror, robot.mirror_pairs, leg_bodies, {})
    return [(m.pair.right.body.name, m.is_axis, m.distance, m.angle) for m in found]


@pytest.mark.parametrize("degrees", [0.9, 1.1, 30.0])
def test_axis_is_mirrored_up_to_one_degree(degrees):
    angle = math.radians(degrees)
    found = arms("0.1 0.2 0", "0.1 -0.2 0", "0 1 0", f"{math.sin(angle)} {math.cos(angle)} 0")
    assert found == ([("right_arm", True, 0, pytest.approx(angle))] if degrees > 1 else [])


@pytest.mark.parametrize("axes", [("0 0 0", "0 1 0"), ("0 1 0", "0 0 0"), ("0 0 0", "0 0 0")])
def test_joint_without_an_axis_is_not_compared(axes):
    assert arms("0.1 0.2 0", "0.1 -0.2 0", *axes) == []
    assert arms("0.1 0.2 0", "0.1 -0.3 0", *axes) == []


@pytest.mark.parametrize("error", [0.0039, 0.0041])
def test_joint_is_mirrored_up_to_2_mm_and_a_hundredth_of_its_offset(error):
    # The tolerance is 0.002 m + 0.01 * 0.2 m of the shorter offset.
    found = arms("0 0.2 0", f"{error} -0.2 0")
    assert found == ([("right_arm", False, pytest.approx(error), 0)] if error > 0.004 else [])


@pytest.mark.parametrize(
    ("right", "count"),
    [("0.1 -0.2 -0.05", 0), ("-0.1 -0.2 0.05", 0), ("-0.1 -0.2 -0.05", 1), ("0.2 -0.2 0.05", 1)],
)
def test_arm_that_is_rotated_by_half_a_turn_is_no_misalignment(right, count):
    assert len(arms("0.1 0.2 0.05", right)) == count


@pytest.mark.parametrize(
    ("com", "right_com", "named"),
    [
        ("0 0 0", "0 0 0", "right_arm"),  # the frames show the rotation
        ("0.1 0 0", "0.1 0 0", "right_arm"),  # and so do the centers of mass
        ("0.0955 0 -0.0296", "0.1 0 0", "right_elbow"),  # the elbow is misplaced instead
    ],
)
def test_rotated_frame_of_a_leg_is_named_by_the_joint_below(com, right_com, named):
    turned = {"turned": "0 0.3 0", "com": com, "right_com": right_com, "leg_bodies": range(9)}
    ((name, is_axis, distance, angle),) = arms("0 0.2 0", "0 -0.2 0", **turned)
    assert (name, is_axis) == (named, False)
    # The elbow is 0.3 m away: the base of an isosceles triangle.
    apart = 2 * 0.3 * math.sin(0.15)
    expected = (0, 0.3) if named == "right_arm" else (apart, 0)
    assert (distance, angle) == pytest.approx(expected)
    if named == "right_arm":
        assert arms("0 0.2 0", "0 -0.2 0", **turned | {"leg_bodies": ()}) == []  # an arm's zero


@pytest.mark.parametrize(
    ("other", "sign", "expected"),
    read_table(__file__, "limits_are_mirrored_within_a_share_of_the_range"),
)
def test_limits_are_mirrored_within_a_share_of_the_range(other, sign, expected):
    assert limits_match((-0.2, 0.8), other, sign) is expected


def with_axes(robot, axes, limit="3"):
    """Return a bundled robot with other axes of some joints, whose limits are +- `limit`."""
    text = bundled.urdf_path(robot).read_text()
    for name, axis in axes.items():
        start = text.index(f'<joint name="{name}"')
        end = text.index("</joint>", start)
        block = re.sub(r'<axis xyz="[^"]*"', f'<axis xyz="{axis}"', text[start:end])
        limits = f'lower="-{limit}" upper="3"'
        block = re.sub(r'lower="[^"]*" upper="[^"]*"', limits, block)
        text = text[:start] + block + text[end:]
    return facts(text)


@pytest.mark.parametrize("leg", ["FL", "RR"])
def test_axis_against_those_of_the_three_other_legs_is_flipped(leg):
    robot = with_axes("quadruped", {f"{leg}_thigh_joint": "0 -1 0"})
    (found,) = find_flipped_joints(robot.legs, robot.bodies)
    assert (found.joint.name, found.others) == (f"{leg}_thigh_joint", 3)
    assert (found.axis.tolist(), found.expected_axis.tolist()) == ([0, -1, 0], [0, 1, 0])


def test_expected_axis_is_that_of_the_first_other_leg():
    axes = {"FL_thigh_joint": "0 -1 0", "RL_thigh_joint": "0.2 0.98 0"}
    robot = with_axes("quadruped", axes)
    (found,) = find_flipped_joints(robot.legs, robot.bodies)
    assert found.expected_axis.tolist() == [0, 1, 0]  # that of FR


def test_two_flipped_axes_are_a_convention():
    robot = with_axes("quadruped", {"FL_thigh_joint": "0 -1 0", "RL_thigh_joint": "0 -1 0"})
    assert list(find_flipped_joints(robot.legs, robot.bodies)) == []
    assert list(find_flipped_joints(robot.legs[:3], robot.bodies)) == []
    robot = with_axes("quadruped", {"FL_thigh_joint": "0.44 -0.89 0"})  # not parallel
    assert list(find_flipped_joints(robot.legs, robot.bodies)) == []


def flipped_pairs(robot):
    found = find_flipped_pairs(robot.legs, robot.mirror, robot.mirror_pairs, robot.leg_bodies)
    return [(pair.right.joint.name, others) for pair, others in found]


@pytest.mark.parametrize(
    ("joint", "axis"), [("knee", (0, 1, 0)), ("hip_yaw", (0, 0, 1)), ("hip_roll", (1, 0, 0))]
)
def test_one_flipped_pair_of_a_biped_is_an_outlier(joint, axis):
    """It is compared with the two other pairs that bend the legs, or that do not."""
    left, right = (" ".join(str(sign * x) for x in axis) for sign in (1, -1))
    axes = {f"left_{joint}_joint": left, f"right_{joint}_joint": right}
    assert flipped_pairs(with_axes("biped", axes)) == [(f"right_{joint}_joint", 2)]
    assert flipped_pairs(with_axes("biped", axes, limit="2")) == []  # they show the direction
    assert flipped_pairs(with_axes("biped", axes | {f"right_{joint}_joint": left})) == []


def test_two_flipped_pairs_and_quadrupeds_have_no_outlier():
    axes = {"right_knee_joint": "0 -1 0", "right_hip_pitch_joint": "0 -1 0"}
    axes |= {"left_knee_joint": "0 1 0", "left_hip_pitch_joint": "0 1 0"}
    assert flipped_pairs(with_axes("biped", axes)) == []
    assert flipped_pairs(with_axes("quadruped", {"FR_thigh_joint": "0 -1 0"})) == []
