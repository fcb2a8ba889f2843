"""Pairs of joints at the borders of what counts as mirrored."""

import math
import re
from pathlib import Path

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.asymmetry import (
    find_flipped_joints,
    find_flipped_pairs,
    find_misalignments,
    limits_match,
)
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot

FILE = Path("/robots/robot.urdf")


def arms(left, right, left_axis="0 1 0", right_axis="0 1 0"):
    """Return the misalignments of two arms whose joints are at `left` and `right`."""
    joints = "".join(
        f'<joint name="{side}_joint" type="continuous"><parent link="trunk"/>'
        f'<child link="{side}_arm"/><origin xyz="{xyz}"/><axis xyz="{axis}"/></joint>'
        for side, xyz, axis in (("left", left, left_axis), ("right", right, right_axis))
    )
    links = '<link name="trunk"/><link name="left_arm"/><link name="right_arm"/>'
    text = f'<robot name="r">{links}{joints}</robot>'
    facts = Facts(load_robot(FILE, contents={FILE: text.encode()}))
    return find_misalignments(facts.mirror, facts.mirror_pairs, set())[0]


@pytest.mark.parametrize("degrees", [0.9, 1.1, 30.0])
def test_axis_is_mirrored_up_to_one_degree(degrees):
    angle = math.radians(degrees)
    axis = f"{math.sin(angle)} {math.cos(angle)} 0"
    found = arms("0.1 0.2 0", "0.1 -0.2 0", "0 1 0", axis)
    if degrees < 1:
        assert found == []
    else:
        assert [(each.is_axis, each.distance) for each in found] == [(True, 0.0)]
        assert math.degrees(found[0].angle) == pytest.approx(degrees)


@pytest.mark.parametrize("axes", [("0 0 0", "0 1 0"), ("0 1 0", "0 0 0"), ("0 0 0", "0 0 0")])
def test_joint_without_an_axis_is_not_compared(axes):
    assert arms("0.1 0.2 0", "0.1 -0.2 0", *axes) == []
    assert arms("0.1 0.2 0", "0.1 -0.3 0", *axes) == []


@pytest.mark.parametrize("error", [0.0039, 0.0041])
def test_joint_is_mirrored_up_to_2_mm_and_a_hundredth_of_its_offset(error):
    # The tolerance is 0.002 m + 0.01 * 0.2 m of the shorter offset.
    found = arms("0 0.2 0", f"0 -{0.2 + error} 0")
    assert [each.distance for each in found] == ([pytest.approx(error)] if error > 0.004 else [])
    assert not any(each.is_axis or each.angle for each in found)


@pytest.mark.parametrize(
    ("other", "sign", "expected"),
    [
        # The range of 1 rad has a tolerance of 0.01 + 0.02 * 1 rad.
        ((-0.229, 0.8), 1, True),
        ((-0.231, 0.8), 1, False),
        ((-0.2, 0.829), 1, True),
        ((-0.2, 0.831), 1, False),
        ((-0.8, 0.2), 1, False),
        ((-0.8, 0.2), -1, True),
        ((-0.831, 0.2), -1, False),
        ((-0.2, 0.8), -1, False),
    ],
)
def test_limits_are_mirrored_within_a_share_of_the_range(other, sign, expected):
    assert limits_match((-0.2, 0.8), other, sign) is expected


def with_axes(robot, axes, limit="3"):
    """Return a bundled robot with other axes of some joints, whose limits are +- `limit`."""
    file = bundled.urdf_path(robot)
    text = file.read_text()
    for joint, axis in axes.items():
        start = text.index(f'<joint name="{joint}"')
        end = text.index("</joint>", start)
        block = re.sub(r'<axis xyz="[^"]*"', f'<axis xyz="{axis}"', text[start:end])
        limits = f'lower="-{limit}" upper="3"'
        block = re.sub(r'lower="[^"]*" upper="[^"]*"', limits, block)
        text = text[:start] + block + text[end:]
    return Facts(load_robot(file, contents={file: text.encode()}))


@pytest.mark.parametrize("leg", ["FL", "RR"])
def test_axis_against_those_of_the_three_other_legs_is_flipped(leg):
    facts = with_axes("quadruped", {f"{leg}_thigh_joint": "0 -1 0"})
    (found,) = find_flipped_joints(facts.legs, facts.bodies)
    assert (found.joint.name, found.others) == (f"{leg}_thigh_joint", 3)
    assert (found.axis.tolist(), found.expected_axis.tolist()) == ([0, -1, 0], [0, 1, 0])


def test_expected_axis_is_that_of_the_first_other_leg():
    axes = {"FL_thigh_joint": "0 -1 0", "RL_thigh_joint": "0.2 0.98 0"}
    facts = with_axes("quadruped", axes)
    (found,) = find_flipped_joints(facts.legs, facts.bodies)
    assert found.expected_axis.tolist() == [0, 1, 0]  # that of FR


def test_two_flipped_axes_are_a_convention():
    facts = with_axes("quadruped", {"FL_thigh_joint": "0 -1 0", "RL_thigh_joint": "0 -1 0"})
    assert list(find_flipped_joints(facts.legs, facts.bodies)) == []


def flipped_pairs(facts):
    found = find_flipped_pairs(facts.legs, facts.mirror, facts.mirror_pairs, facts.leg_bodies)
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
