import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terrainkit_robots.analysis.bodies.contact import contact_points
from terrainkit_robots.analysis.bodies.kinematics import body_poses, joint_axis
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.standing_pose import (
    center_of_mass,
    clip_to_limits,
    joint_range,
    solve_standing_pose,
)
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.model import Joint, Limit, Source

FILE = Path("/robots/robot.urdf")
SOURCE = Source(file=FILE, line=1)
URDFS = [
    "a1/urdf/a1.urdf",
    "go2/urdf/go2.urdf",
    "h1/urdf/h1.urdf",
    "g1/g1_29dof.urdf",
    "anymal_c/urdf/anymal_c.urdf",
    "cassie/urdf/cassie.urdf",
    "quadruped.urdf",
    "biped.urdf",
]
every_urdf = pytest.mark.parametrize("name", URDFS)


def load(name, robot_file):
    return read(robot_file(name))


@cache
def read(path):
    return Facts(load_robot(path))


def joint(lower, upper, kind="revolute"):
    limit = Limit(source=SOURCE, lower=lower, upper=upper)
    return Joint(name="j", source=SOURCE, kind=kind, parent="a", child="b", limit=limit)


# Limits


@pytest.mark.parametrize(
    ("lower", "upper", "expected"),
    [
        (-1.0, 2.0, (-1, 2)),
        (2.0, -1.0, (-math.inf, math.inf)),
        (0.0, 0.0, (-math.inf, math.inf)),
        (None, 1.0, (-math.inf, math.inf)),
        (1.0, None, (-math.inf, math.inf)),
    ],
)
def test_joint_range_of_invalid_limits_is_infinite(lower, upper, expected):
    assert joint_range(joint(lower, upper)) == expected


def test_joint_range_of_continuous_joint_is_infinite():
    assert joint_range(joint(-1.0, 1.0, "continuous")) == (-math.inf, math.inf)


@pytest.mark.parametrize(
    ("lower", "upper", "position", "expected"),
    [(-1.0, 2.0, 0.0, 0.0), (0.5, 2.0, 0.0, 0.5), (-2.0, -0.5, 0.0, -0.5), (2.0, 1.0, 0.3, 0.3)],
)
def test_clip_to_limits_returns_closest_position(lower, upper, position, expected):
    assert clip_to_limits(joint(lower, upper), position) == expected


# Published robots


@every_urdf
def test_standing_pose_is_within_limits(name, robot_file):
    robot = load(name, robot_file)
    positions = solve_standing_pose(robot.leg_model)
    assert set(positions) == {each.name for each in robot.joints}
    for each in robot.joints:
        lower, upper = joint_range(each)
        assert lower - 1e-9 <= positions[each.name] <= upper + 1e-9


@every_urdf
def test_standing_pose_centers_mass_above_feet(name, robot_file):
    robot = load(name, robot_file)
    stance = robot.stance
    middle = stance.contacts.mean(axis=0)
    length = np.mean([leg.length for leg in robot.legs])
    assert np.linalg.norm((stance.center - middle)[:2]) < 0.06 * length


@every_urdf
def test_standing_pose_bends_legs_as_specified(name, robot_file):
    robot = load(name, robot_file)
    expected = 0.965 if len(robot.legs) == 2 else 0.75
    if robot.model.name == "cassie":
        expected = 0.89  # its thigh joint cannot straighten the leg
    poses = body_poses(robot.bodies, robot.stance.positions)
    for leg, contact in zip(robot.legs, robot.stance.contacts, strict=True):
        hinged = [i for i in leg.limb.chain if robot.bodies[i].joint.moves]
        hip = hinged[leg.roles.index("hip")]
        point, _ = joint_axis(robot.bodies[hip], poses[hip])
        assert (point - contact)[2] / leg.length == pytest.approx(expected, abs=0.05)


@every_urdf
def test_standing_pose_is_symmetric(name, robot_file):
    robot = load(name, robot_file)
    poses = body_poses(robot.bodies, robot.stance.positions)
    for pair in robot.mirror.pairs:
        image = robot.mirror.image(poses[pair.left][:3, 3])
        np.testing.assert_allclose(image, poses[pair.right][:3, 3], atol=5e-3)


@every_urdf
def test_standing_pose_keeps_knees_above_ground(name, robot_file):
    robot = load(name, robot_file)
    poses = body_poses(robot.bodies, robot.stance.positions)
    for leg in robot.legs:
        hinged = [i for i in leg.limb.chain if robot.bodies[i].joint.moves]
        knee = hinged[leg.roles.index("knee")]
        point, _ = joint_axis(robot.bodies[knee], poses[knee])
        assert point[2] + robot.stance.height > 0.1 * leg.length


@pytest.mark.parametrize("name", ["h1/urdf/h1.urdf", "g1/g1_29dof.urdf", "biped.urdf"])
def test_standing_pose_keeps_soles_flat(name, robot_file):
    robot = load(name, robot_file)
    poses = body_poses(robot.bodies, robot.stance.positions)
    for leg in robot.legs:
        foot = leg.limb.chain[-1]
        points = contact_points(robot.bodies[foot], poses[foot], robot.meshes)
        assert np.ptp(points[:, 0]) > 0.1  # heel and toes


def test_standing_pose_bends_humanoid_knees_forward(robot_file):
    robot = load("g1/g1_29dof.urdf", robot_file)
    assert robot.stance.positions["left_knee_joint"] > 0.1
    assert robot.stance.positions["left_hip_pitch_joint"] < 0
    assert robot.stance.positions["left_shoulder_pitch_joint"] == 0


def test_standing_pose_bends_every_joint_of_cassie(robot_file):
    robot = load("cassie/urdf/cassie.urdf", robot_file)
    for leg in robot.legs:
        for each, role in zip(leg.joints, leg.roles, strict=True):
            lower, upper = joint_range(each)
            fraction = (robot.stance.positions[each.name] - lower) / (upper - lower)
            assert role not in ("hip", "knee", "ankle") or 0.1 < fraction < 0.9


def test_standing_pose_without_limits_bends_knees_inward(robot_file):
    # The joints of ANYmal have no limits. Its default pose has knees inward at front and rear.
    robot = load("anymal_c/urdf/anymal_c.urdf", robot_file)
    poses = body_poses(robot.bodies, robot.stance.positions)
    for leg in robot.legs:
        hip, knee = leg.limb.chain[1], leg.limb.chain[2]
        ahead = poses[knee][0, 3] - poses[hip][0, 3]
        assert ahead * poses[hip][0, 3] < 0


# By hand


def leg(name, root, thigh, shank, limits=(-3, 3, -3, 3), axis="0 1 0"):
    def limit(lower, upper):
        return f'<limit lower="{lower}" upper="{upper}" effort="9" velocity="9"/>'

    inertial = '<inertial><mass value="0.1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    return (
        f'<link name="{name}_thigh">{inertial}</link><link name="{name}_shank">{inertial}'
        f'<collision><origin xyz="0 0 {-shank}"/><geometry><sphere radius="0.02"/></geometry>'
        f'</collision></link><joint name="{name}_hip" type="revolute"><parent link="trunk"/>'
        f'<child link="{name}_thigh"/><origin xyz="{root}"/><axis xyz="{axis}"/>'
        f'{limit(*limits[:2])}</joint><joint name="{name}_knee" type="revolute">'
        f'<parent link="{name}_thigh"/><child link="{name}_shank"/><origin xyz="0 0 {-thigh}"/>'
        f'<axis xyz="{axis}"/>{limit(*limits[2:])}</joint>'
    )


ROOTS = {"fl": "0.3 0.2 0", "fr": "0.3 -0.2 0", "hl": "-0.3 0.2 0", "hr": "-0.3 -0.2 0"}


def table(center="0 0 0", **each):
    legs = "".join(leg(name, root, **each) for name, root in ROOTS.items())
    text = (
        f'<robot name="r"><link name="trunk"><inertial><origin xyz="{center}"/><mass value="20"/>'
        f'<inertia ixx="1" iyy="1" izz="1"/></inertial></link>{legs}</robot>'
    )
    return Facts(load_robot(FILE, contents={FILE: text.encode()}))


def feet(robot):
    return robot.stance.contacts - [[float(x) for x in root.split()] for root in ROOTS.values()]


def test_standing_pose_puts_feet_below_hips():
    # The hips and the mass are at the center. Links of 0.3 m, and a foot radius of 0.02 m.
    robot = table(thigh=0.3, shank=0.3)
    assert feet(robot) == pytest.approx(np.tile([0, 0, -0.75 * 0.62], (4, 1)), abs=0.01)


@pytest.mark.parametrize("x", [-0.05, 0.03, 0.1])
def test_standing_pose_shifts_feet_with_mass(x):
    robot = table(center=f"{x} 0 0", thigh=0.3, shank=0.3)
    assert robot.stance.center[0] == pytest.approx(x, abs=0.02)
    assert robot.stance.contacts[:, 0].mean() == pytest.approx(robot.stance.center[0], abs=0.01)


@pytest.mark.parametrize("limits", [(-3, 3, -3, -0.1), (-3, 3, 0.1, 3)])
def test_standing_pose_bends_knee_within_limits(limits):
    positions = table(thigh=0.3, shank=0.3, limits=limits).stance.positions
    assert np.sign(positions["fl_knee"]) == np.sign(limits[2] + limits[3])
    assert np.sign(positions["fl_hip"]) == -np.sign(positions["fl_knee"])


def test_standing_pose_negates_for_opposite_axis():
    limits = (-3, 3, -3, -0.1)
    ours = table(thigh=0.3, shank=0.3, limits=limits).stance.positions
    other = table(thigh=0.3, shank=0.3, limits=(-3, 3, 0.1, 3), axis="0 -1 0").stance.positions
    for name, position in ours.items():
        assert other[name] == pytest.approx(-position, abs=0.01)


def test_standing_pose_avoids_limits():
    # 0.75 of the length requires a knee angle of 1.45 rad, which is close to the limit.
    robot = table(thigh=0.3, shank=0.3, limits=(-3, 3, -1.5, 0))
    assert -1.44 < robot.stance.positions["fl_knee"] < -1.0


def test_standing_pose_of_unreachable_target():
    robot = table(thigh=0.3, shank=0.3, limits=(-0.1, 0.1, -0.2, 0.2))
    for name, position in robot.stance.positions.items():
        assert abs(position) <= (0.1 if name.endswith("hip") else 0.2)
    assert robot.stance.height == pytest.approx(0.62, abs=0.02)


@pytest.mark.parametrize("limits", [(1, -1, 2, -2), (0, 0, 0, 0), (-1e29, 1e29, -1e29, 1e29)])
def test_standing_pose_with_invalid_limits(limits):
    robot = table(thigh=0.3, shank=0.3, limits=limits)
    assert np.isfinite(list(robot.stance.positions.values())).all()
    assert max(map(abs, robot.stance.positions.values())) < 2.5
    assert robot.stance.height == pytest.approx(0.75 * 0.62, abs=0.02)


@settings(max_examples=12, deadline=None)
@given(
    thigh=st.floats(0.1, 1),
    ratio=st.floats(0.6, 1.6),
    lower=st.floats(-2.5, -0.5),
    upper=st.floats(-0.3, 0.5),
)
def test_standing_pose_of_random_legs(thigh, ratio, lower, upper):
    shank = thigh * ratio
    robot = table(thigh=thigh, shank=shank, limits=(-3, 3, lower, upper))
    places = feet(robot)
    assert np.abs(places[:, :2]).max() < 0.06 * robot.legs[0].length
    assert (places[:, 2] < 0).all()
    # A leg is longer only if the knee cannot bend enough.
    stretch = -places[:, 2].mean() / robot.legs[0].length
    assert 0.7 < stretch < 1.0


def test_standing_pose_keeps_keyframe():
    path = bundled.urdf_path("quadruped").with_suffix(".xml")
    robot = Facts(load_robot(path))
    assert robot.model.keyframe
    assert solve_standing_pose(robot.leg_model) == {
        j.name: robot.model.keyframe[j.name] for j in robot.joints
    }


def test_standing_pose_without_legs():
    text = (
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="revolute">'
        '<parent link="a"/><child link="b"/><limit lower="0.5" upper="1"/></joint></robot>'
    )
    robot = Facts(load_robot(FILE, contents={FILE: text.encode()}))
    assert robot.stance is None
    assert solve_standing_pose(robot.leg_model) == {"j": 0.5}


def test_center_of_mass_by_hand():
    robot = table(thigh=0.3, shank=0.3)
    # 20 kg at the trunk's origin; four thighs of 0.1 kg there too, four shanks 0.3 m below.
    poses = body_poses(robot.bodies, {})
    np.testing.assert_allclose(
        center_of_mass(robot.bodies, poses), [0, 0, -4 * 0.1 * 0.3 / 20.8], atol=1e-12
    )


def test_center_of_mass_without_mass_is_origin():
    text = '<robot name="r"><link name="a"/></robot>'
    robot = Facts(load_robot(FILE, contents={FILE: text.encode()}))
    assert center_of_mass(robot.bodies, body_poses(robot.bodies, {})).tolist() == [0, 0, 0]
