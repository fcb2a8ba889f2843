"""Pairs of joints at the borders of what counts as mirrored."""

import math
from pathlib import Path

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.asymmetry import find_misalignments, limits_match
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
