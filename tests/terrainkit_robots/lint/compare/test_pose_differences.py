import logging
import math

import numpy as np
import pytest

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.lint.compare.pose_differences import compare_link_poses, sample_positions
from terrainkit_robots.lint.compare.robot_pairs import pair_robots
from tests.tables import read_table

ARM = read_table(__file__, "arm")


@pytest.mark.parametrize("name", ["quadruped", "biped"])
def test_bundled_urdf_and_mjcf_agree(robot_of, name):
    one, other = robot_of(f"{name}.urdf"), robot_of(f"{name}.xml")
    gap = compare_link_poses(one, other, poses=100)
    assert max(gap.distance, gap.angle) < 1e-5
    assert (gap.poses, gap.links, gap.first) == (100, len(one.links), "")
    kinds = gap.is_within_tolerance, gap.is_base_offset, gap.is_rotation_only
    assert kinds == (True, False, False)


def test_first_different_link_is_named(robot_of):
    longer = ('<origin xyz="0 0 -0.213"/>', '<origin xyz="0 0 -0.223"/>')
    gap = compare_link_poses(robot_of("quadruped.urdf", longer), robot_of("quadruped.xml"))
    assert not gap.is_within_tolerance
    assert gap.distance == pytest.approx(0.01, abs=1e-6)
    assert gap.first == "FL_calf"
    assert gap.link in ("FL_calf", "FL_foot")
    assert 0 <= gap.pose < 20


def test_comparison_is_symmetric_and_deterministic(robot_of):
    one = robot_of(ARM)
    other = robot_of(ARM, ('rpy="0.2 -0.3 0.4"', 'rpy="0.2 -0.3 0.41"'))
    there, back = compare_link_poses(one, other), compare_link_poses(other, one)
    assert (there.distance, there.angle) == (back.distance, back.angle)
    assert there == compare_link_poses(one, other)
    assert there.angle == pytest.approx(0.01, rel=1e-6)
    assert there != compare_link_poses(one, other, seed=1)


def test_locked_joint_is_not_compared(robot_of):
    one, other = robot_of(ARM), robot_of(ARM, ('"0 0.6 0.8"', '"0 -0.6 -0.8"'))
    assert not compare_link_poses(one, other).is_within_tolerance
    assert compare_link_poses(one, other, locked=["turn"]).is_within_tolerance


@pytest.mark.parametrize(
    ("edit", "expected"),
    [
        (
            ('xyz="0.1 0 0" rpy="0.2', 'xyz="0.1 0 0.05" rpy="0.2'),
            {"is_base_offset": True, "base": ("a", "a"), "distance": pytest.approx(0.05)},
        ),
        (
            ('<origin xyz="0 0.2 0"/>', '<origin xyz="0 0.2 0" rpy="0 0 0.5"/>'),
            {"is_rotation_only": True, "link": "c", "first": "c", "angle": pytest.approx(0.5)},
        ),
    ],
    ids=["base offset", "constant rotation"],
)
def test_kind_of_difference_is_detected(robot_of, edit, expected):
    gap = compare_link_poses(robot_of(ARM), robot_of(ARM, edit))
    assert {name: getattr(gap, name) for name in expected} == expected


def test_chained_mimic_joints_follow(robot_of):
    more = """<link name="d"/><joint name="last" type="continuous"><parent link="c"/>
      <child link="d"/><mimic joint="turn" multiplier="-2"/></joint></robot>"""
    follows = ("<limit lower", '<mimic joint="slide" multiplier="2" offset="0.5"/><limit lower')
    robot = robot_of(ARM, follows, ("</robot>", more))
    pairs = pair_robots(robot, robot)
    ours, theirs = sample_positions(pairs, poses=7, seed=3)
    np.testing.assert_array_equal(ours["turn"], theirs["turn"])
    np.testing.assert_allclose(ours["turn"], 2 * ours["slide"] + 0.5)
    np.testing.assert_allclose(ours["last"], -2 * ours["turn"])
    held, _ = sample_positions(pairs, poses=7, seed=3, locked=("turn",))
    assert not held["turn"].any()
    assert not held["last"].any()


REFERENCE = read_table(__file__, "reference")


def test_joint_of_one_file_is_at_zero(robot_of):
    fixed = REFERENCE.replace('<joint name="turn" axis="0 0 1" pos="0.1 0 0" ref="0.5"/>', "")
    turned = f'pos="{1.1 - 0.1 * math.cos(0.5)!r} {0.1 * math.sin(0.5)!r} 0" euler="0 0 -0.5"'
    fixed = fixed.replace('pos="1 0 0"', turned)
    assert compare_link_poses(robot_of(fixed), robot_of(REFERENCE)).is_within_tolerance


def test_positions_are_within_both_limits(robot_of):
    narrow = ('lower="-1" upper="2"', 'lower="-0.5" upper="3"')
    ours, _ = sample_positions(pair_robots(robot_of(ARM), robot_of(ARM, narrow)), poses=500, seed=0)
    assert -0.5 <= ours["turn"].min() < -0.4
    assert 1.9 < ours["turn"].max() <= 2.0
    assert 0.0 <= ours["slide"].min() < ours["slide"].max() <= 0.1


@pytest.mark.parametrize("limit", ['lower="-1e9" upper="1e9"', 'lower="50" upper="60"', ""])
def test_invalid_limits_are_replaced(robot_of, limit):
    robot = robot_of(ARM, ('lower="-1" upper="2"', limit))
    ours, _ = sample_positions(pair_robots(robot, robot), poses=50, seed=0)
    assert 3.0 < np.abs(ours["turn"]).max() <= math.pi
    assert compare_link_poses(robot, robot).is_within_tolerance


# Incomplete and invalid files


def test_urdf_with_errors_is_compared(robot_of, caplog, capfd):
    broken = robot_of(
        """
        <robot>
          <link name="a"><visual><geometry><mesh filename="package://x/y.dae"/></geometry></visual>
            <inertial><mass value="heavy"/></inertial></link>
          <link name="b"/><link name="b"/><link name="c"/><link name="alone"/>
          <joint name="j" type="revolute"><parent link="a"/><child link="b"/>
            <origin xyz="0,5 0 0" rpy="x"/><axis xyz="0 0 0"/></joint>
          <joint name="k" type="hinge"><parent link="b"/><child link="c"/>
            <origin xyz="nan 0 0"/><mimic joint="nobody"/></joint>
          <joint name="l" type="revolute"><parent link="b"/><child link="nowhere"/></joint>
          <joint type="revolute"><parent link="a"/><child link="c"/></joint>
        </robot>
        """
    )
    with caplog.at_level(logging.WARNING):
        gap = compare_link_poses(broken, broken)
    assert gap.is_within_tolerance
    assert gap.links == 3
    assert caplog.text == ""
    assert capfd.readouterr() == ("", "")


def test_robots_without_common_links_cannot_be_compared(robot_of):
    other = robot_of(ARM.replace('link name="', 'link name="x').replace('link="', 'link="x'))
    assert compare_link_poses(robot_of(ARM), other).is_within_tolerance
    none = robot_of(ARM.replace('name="', 'name="x').replace('link="', 'link="x'))
    with pytest.raises(CannotCheckError, match="no links"):
        compare_link_poses(robot_of(ARM), none)


def test_extreme_numbers_are_compared(robot_of):
    robot = robot_of(ARM, ('xyz="0.1 0 0"', 'xyz="1e29 0 0"'), ('"0 0.6 0.8"', '"0 1e-200 0"'))
    assert compare_link_poses(robot, robot).links == 3


def test_duplicate_joint_names_cannot_be_compared(robot_of):
    robot = robot_of(ARM.replace('"slide"', '"turn"'))
    with pytest.raises(CannotCheckError, match="2 joints called turn"):
        compare_link_poses(robot, robot)
