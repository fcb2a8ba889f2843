import logging
import math
import time

import numpy as np
import pytest

from terrainkit_robots.analysis.bodies.link_poses import link_poses
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.compare.link_poses import compare_link_poses, sample_positions
from terrainkit_robots.lint.compare.robot_pairs import pair_robots
from terrainkit_robots.lint.compare.urdf_poses import urdf_poses
from tests.robots import REAL_ROBOTS

URDFS = [name for name in REAL_ROBOTS if not name.endswith(".xml")]

ARM = """
<robot name="r">
  <link name="a"/><link name="b"/><link name="c"/>
  <joint name="turn" type="revolute"><parent link="a"/><child link="b"/>
    <origin xyz="0.1 0 0" rpy="0.2 -0.3 0.4"/><axis xyz="0 0.6 0.8"/>
    <limit lower="-1" upper="2" effort="1" velocity="1"/></joint>
  <joint name="slide" type="prismatic"><parent link="b"/><child link="c"/>
    <origin xyz="0 0.2 0"/><axis xyz="0 0 3"/>
    <limit lower="0" upper="0.1" effort="1" velocity="1"/></joint>
</robot>
"""


def worst(robot, count=5):
    """Return the largest difference between our link poses and yourdfpy's."""
    pairs = pair_robots(robot, robot)
    positions, _ = sample_positions(pairs, poses=count, seed=1)
    ours = link_poses(robot.bodies, positions, count=count)
    theirs = urdf_poses(robot, positions)
    top = theirs[robot.bodies[0].top.name]
    return max(np.abs(top @ poses - theirs[name]).max() for name, poses in ours.items())


def test_quaternion_origins_agree(tmp_path):
    path = tmp_path / "robot.urdf"
    text = ARM.replace('rpy="0.2 -0.3 0.4"', 'quat_xyzw="0.1 0.2 0.3 0.9"')
    assert text != ARM
    path.write_text(text)
    assert worst(Facts(load_robot(path))) < 1e-9


@pytest.mark.parametrize("name", URDFS)
def test_body_poses_agree_on_real_robots(robot_file, name):
    assert worst(Facts(load_robot(robot_file(name)))) < 1e-9


@pytest.mark.parametrize("name", ["quadruped.urdf", "biped.urdf"])
def test_body_poses_agree_on_bundled_robots(robot_of, name):
    assert worst(robot_of(name)) < 1e-9


@pytest.mark.parametrize("off", [0.0, 1e-10, 9e-10, 1e-8])
def test_vertical_joint_is_exact(tmp_path, off):
    path = tmp_path / "arm.xacro"  # whose angles are written again
    path.write_text(ARM.replace("0.2 -0.3 0.4", f"0.2 {math.pi / 2 - off!r} 0.4"))
    robot = Facts(load_robot(path))
    assert robot.model.kind == "xacro"
    assert worst(robot) < 1e-11


@pytest.mark.parametrize("kind", ["urdf", "xacro"])
def test_prismatic_axis_is_normalized(tmp_path, kind):
    path = tmp_path / f"arm.{kind}"
    path.write_text(ARM)
    robot = Facts(load_robot(path))
    assert robot.model.kind == kind
    assert worst(robot) < 1e-12


# Differences


@pytest.mark.parametrize("name", ["quadruped", "biped"])
def test_bundled_urdf_and_mjcf_agree(robot_of, name):
    one, other = robot_of(f"{name}.urdf"), robot_of(f"{name}.xml")
    gap = compare_link_poses(one, other, poses=100)
    assert gap.is_within_tolerance
    assert gap.distance < 1e-5
    assert gap.angle < 1e-5
    assert (gap.poses, gap.links, gap.first) == (100, len(one.links), "")
    assert not gap.is_base_offset
    assert not gap.is_rotation_only


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


def test_base_offset_is_detected(robot_of):
    other = robot_of(ARM, ('xyz="0.1 0 0" rpy="0.2', 'xyz="0.1 0 0.05" rpy="0.2'))
    gap = compare_link_poses(robot_of(ARM), other)
    assert gap.is_base_offset
    assert gap.base == ("a", "a")
    assert gap.distance == pytest.approx(0.05)


def test_constant_rotation_is_detected(robot_of):
    turned = ('<origin xyz="0 0.2 0"/>', '<origin xyz="0 0.2 0" rpy="0 0 0.5"/>')
    gap = compare_link_poses(robot_of(ARM), robot_of(ARM, turned))
    assert gap.is_rotation_only
    assert gap.angle == pytest.approx(0.5)
    assert gap.link == gap.first == "c"


def test_mimic_joints_follow(robot_of):
    follows = ("<limit lower", '<mimic joint="slide" multiplier="2" offset="0.3"/><limit lower')
    robot = robot_of(ARM, follows)
    ours, theirs = sample_positions(pair_robots(robot, robot), poses=7, seed=3)
    np.testing.assert_allclose(ours["turn"], 2 * ours["slide"] + 0.3)
    np.testing.assert_array_equal(ours["turn"], theirs["turn"])
    assert compare_link_poses(robot, robot).distance == 0.0


def test_chained_mimic_joints_follow(robot_of):
    more = """<link name="d"/><joint name="last" type="continuous"><parent link="c"/>
      <child link="d"/><mimic joint="turn" multiplier="-2"/></joint></robot>"""
    follows = ("<limit lower", '<mimic joint="slide" offset="0.5"/><limit lower')
    robot = robot_of(ARM, follows, ("</robot>", more))
    pairs = pair_robots(robot, robot)
    ours, _ = sample_positions(pairs, poses=7, seed=3)
    np.testing.assert_allclose(ours["turn"], ours["slide"] + 0.5)
    np.testing.assert_allclose(ours["last"], -2 * ours["turn"])
    held, _ = sample_positions(pairs, poses=7, seed=3, locked=("turn",))
    assert not held["turn"].any()
    assert not held["last"].any()


REFERENCE = """<mujoco><compiler angle="radian"/><worldbody><body name="a"><freejoint/>
  <geom size="0.1"/><body name="b" pos="1 0 0"><geom size="0.1"/>
    <joint name="turn" axis="0 0 1" pos="0.1 0 0" ref="0.5"/>
    <body name="c" pos="0 1 0"><geom size="0.1"/>
      <joint name="slide" type="slide" axis="1 0 0" ref="0.2"/>
      <body name="d" pos="0 0 1"><geom size="0.1"/><joint name="spin" type="ball"/></body>
    </body></body></body></worldbody></mujoco>"""


def test_joint_of_one_file_is_at_zero(robot_of):
    fixed = REFERENCE.replace('<joint name="turn" axis="0 0 1" pos="0.1 0 0" ref="0.5"/>', "")
    turned = f'pos="{1.1 - 0.1 * math.cos(0.5)!r} {0.1 * math.sin(0.5)!r} 0" euler="0 0 -0.5"'
    fixed = fixed.replace('pos="1 0 0"', turned)
    assert compare_link_poses(robot_of(fixed), robot_of(REFERENCE)).is_within_tolerance


def test_positions_are_within_both_limits(robot_of):
    narrow = ('lower="-1" upper="2"', 'lower="-0.5" upper="3"')
    pairs = pair_robots(robot_of(ARM), robot_of(ARM, narrow))
    ours, _ = sample_positions(pairs, poses=500, seed=0)
    assert ours["turn"].min() >= -0.5
    assert ours["turn"].max() <= 2.0
    assert np.ptp(ours["turn"]) > 2.3
    assert ours["slide"].min() >= 0.0
    assert ours["slide"].max() <= 0.1


@pytest.mark.parametrize("limit", ['lower="-1e9" upper="1e9"', 'lower="50" upper="60"', ""])
def test_invalid_limits_are_replaced(robot_of, limit):
    robot = robot_of(ARM, ('lower="-1" upper="2"', limit))
    ours, _ = sample_positions(pair_robots(robot, robot), poses=50, seed=0)
    assert np.abs(ours["turn"]).max() <= math.pi
    assert compare_link_poses(robot, robot).is_within_tolerance


# Incomplete and invalid files


def test_mjcf_without_meshes_is_compared(robot_file):
    one = Facts(load_robot(robot_file("go2/urdf/go2.urdf")))
    gap = compare_link_poses(one, Facts(load_robot(robot_file("go2_mjcf/go2.xml"))), poses=100)
    assert gap.distance < 1e-4
    assert gap.base == ("base", "base_link")


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


def test_mjcf_in_degrees_with_reference_is_compared(robot_of):
    mjcf = """
    <mujoco><worldbody><body name="a"><geom size="0.1"/>
      <body name="b" pos="0.1 0 0" euler="0 0 90"><joint name="turn" ref="30" axis="0 0 1"/>
      <geom size="0.1"/></body></body></worldbody></mujoco>
    """
    urdf = """
    <robot name="r"><link name="a"/><link name="b"/>
      <joint name="turn" type="continuous"><parent link="a"/><child link="b"/>
        <origin xyz="0.1 0 0" rpy="0 0 1.04719755119659774"/><axis xyz="0 0 1"/></joint></robot>
    """
    assert compare_link_poses(robot_of(urdf), robot_of(mjcf)).distance < 1e-12
    assert compare_link_poses(robot_of(urdf), robot_of(mjcf)).angle < 1e-7


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda text: text.replace("turn", "bend"), "has changed"),
        (lambda text: text[:0], "has changed"),
        (None, "there is no file"),
    ],
)
def test_changed_urdf_cannot_be_compared(robot_of, change, reason):
    robot = robot_of("quadruped.urdf", ("FL_calf_joint", "turn"))
    file = robot.model.file
    if change is None:
        file.unlink()
    else:
        file.write_text(change(file.read_text()))
    with pytest.raises(CannotCheckError, match=reason):
        compare_link_poses(robot, robot)


def test_robots_without_common_links_cannot_be_compared(robot_of):
    other = robot_of(ARM.replace('link name="', 'link name="x').replace('link="', 'link="x'))
    none = robot_of(ARM.replace('name="', 'name="x').replace('link="', 'link="x'))
    assert compare_link_poses(robot_of(ARM), other).is_within_tolerance
    with pytest.raises(CannotCheckError, match="no links"):
        compare_link_poses(robot_of(ARM), none)


def chain(count):
    links = "".join(f'<link name="l{k}"/>' for k in range(count + 1))
    joints = "".join(
        f'<joint name="j{k}" type="continuous"><parent link="l{k}"/><child link="l{k + 1}"/>'
        '<origin xyz="0 0 0.1"/></joint>'
        for k in range(count)
    )
    return f'<robot name="r">{links}{joints}</robot>'


def test_large_robot_cannot_be_compared(robot_of):
    robot = robot_of(chain(2000))
    began = time.process_time()
    with pytest.raises(CannotCheckError, match="2000 joints"):
        compare_link_poses(robot, robot)
    assert time.process_time() - began < 2.0
    assert compare_link_poses(*[robot_of(chain(60))] * 2).is_within_tolerance


def test_duplicate_joint_names_cannot_be_compared(robot_of):
    robot = robot_of(ARM.replace('"slide"', '"turn"'))
    with pytest.raises(CannotCheckError, match="two joints called turn"):
        compare_link_poses(robot, robot)


def test_extreme_numbers_are_compared(robot_of):
    robot = robot_of(ARM, ('xyz="0.1 0 0"', 'xyz="1e29 0 0"'), ('"0 0.6 0.8"', '"0 1e-200 0"'))
    assert compare_link_poses(robot, robot).links == 3
