import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from terrainkit_robots.analysis.bodies.contact import contact_points
from terrainkit_robots.analysis.bodies.kinematics import body_poses, joint_axis
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.standing_pose import (
    _initial_position,
    _limit_cost,
    _local_minima,
    _penalty_axis,
    clip_to_limits,
    joint_range,
    round_position,
    solve_standing_pose,
)
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.model import Joint, Limit, Source
from tests import small_robots
from tests.small_robots import URDF, ball, link

SOURCE = Source(file=URDF, line=1)
every_urdf = pytest.mark.parametrize("name", ["quadruped", "biped"])


@cache
def read(name):
    return Facts(load_robot(bundled.urdf_path(name)))


def joint(lower, upper, kind="revolute", reference=0.0):
    limit = Limit(source=SOURCE, lower=lower, upper=upper)
    made = Joint(name="j", source=SOURCE, kind=kind, parent="a", child="b", limit=limit)
    return replace(made, reference=reference)


def test_joint_range_of_invalid_limits_is_infinite():
    assert joint_range(joint(-1, 2)) == (-1, 2)
    assert joint_range(joint(2, -1)) == joint_range(joint(None, 1)) == (-math.inf, math.inf)


@pytest.mark.parametrize(
    ("lower", "upper", "position", "expected"),
    [(-1.0, 2.0, 0.0, 0.0), (0.5, 2.0, 0.0, 0.5), (-2.0, -0.5, 0.0, -0.5), (2.0, 1.0, 0.3, 0.3)],
)
def test_clip_to_limits_returns_closest_position(lower, upper, position, expected):
    assert clip_to_limits(joint(lower, upper), position) == expected


@pytest.mark.parametrize(
    ("given", "position", "expected"),
    [
        (joint(-1, 1), 0.1234, 0.12),
        (joint(-1, 1, "prismatic"), 0.1234, 0.123),
        (joint(0.1234, 1), 0.1234, 0.13),
        (joint(-1, 0.1267), 0.1267, 0.12),
        (joint(0.1234, 0.1235), 0.1234, 0.1234),
        (joint(-1, 1), -0.001, 0.0),
        (joint(None, None), 999_999.123, 999_999.12),
        (joint(None, None), 1e6 + 0.125, 1e6 + 0.12),
        (joint(0, 1e30), 1e30, 1e30),
    ],
)
def test_position_is_rounded_within_the_limits(given, position, expected):
    found = round_position(given, position)
    assert (found, math.copysign(1, found)) == (expected, math.copysign(1, expected))


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (joint(-1, 1), 0.0),
        (joint(-1, 1, reference=0.5), 0.5),
        (joint(0, 1), 0.0),
        (joint(1, 3), 1.5),  # a quarter of the range from the limit
        (joint(-3, -1), -1.5),
        (joint(None, None), 0.0),
    ],
)
def test_search_starts_inside_the_limits(given, expected):
    assert _initial_position(given) == expected


def test_cost_of_a_position_near_a_limit():
    # The margin is 8 % of 10 rad.
    positions = np.array([0.0, 0.4, 0.8, 5.0, 9.2, 9.6, 10.0])
    assert _limit_cost(positions, joint(0, 10)) == pytest.approx([1, 0.25, 0, 0, 0, 0.25, 1])
    assert _limit_cost(positions, joint(None, None)).tolist() == [0] * 7


def test_local_minima_are_sorted():
    cost = np.array([[3.0, 5, 1], [5, 6, 5], [2, 5, 9]])
    assert _local_minima(cost) == [(0, 2), (2, 0), (0, 0)]


@pytest.mark.parametrize(("name", "ratio"), [("quadruped", 0.75), ("biped", 0.965)])
def test_standing_pose_bends_legs_below_the_mass(name, ratio):
    robot = read(name)
    stance = robot.stance
    poses = body_poses(robot.bodies, stance.positions)
    offset = (stance.center - stance.contacts.mean(axis=0))[:2]
    assert np.linalg.norm(offset) < 0.06 * robot.legs[0].length
    for leg, contact in zip(robot.legs, stance.contacts, strict=True):
        bodies = [robot.bodies[i] for i in leg.limb.chain if robot.bodies[i].joint.moves]
        hip, knee = (bodies[leg.roles.index(role)] for role in ("hip", "knee"))
        above = (joint_axis(hip, poses[hip.index])[0] - contact)[2]
        assert above / leg.length == pytest.approx(ratio, abs=0.05)
        # The knee stays above the ground.
        height = joint_axis(knee, poses[knee.index])[0][2] + stance.height
        assert height > 0.15 * leg.length


@every_urdf
def test_standing_pose_is_symmetric_and_within_limits(name):
    robot = read(name)
    assert list(robot.stance.positions) == [each.name for each in robot.joints]
    for each in robot.joints:
        assert each.limit.lower <= robot.stance.positions[each.name] <= each.limit.upper
    poses = body_poses(robot.bodies, robot.stance.positions)
    for pair in robot.mirror.pairs:
        image = robot.mirror.image(poses[pair.left][:3, 3])
        np.testing.assert_allclose(image, poses[pair.right][:3, 3], atol=5e-3)


def test_standing_pose_of_a_biped_has_flat_soles_and_knees_ahead():
    robot = read("biped")
    positions = robot.stance.positions
    assert positions["left_knee_joint"] > 0.1
    assert positions["left_hip_pitch_joint"] < 0
    poses = body_poses(robot.bodies, positions)
    for leg in robot.legs:
        foot = leg.limb.chain[-1]
        points = contact_points(robot.bodies[foot], poses[foot], robot.meshes)
        assert np.ptp(points[:, 0]) > 0.1  # heel and toes


def leg(name, root, thigh=0.3, shank=0.3, limits=(-3, 3, -3, 3), axis="0 1 0"):
    hip, knee = f"{name}_hip", f"{name}_knee"
    return (
        link(hip, mass=0.1)
        + small_robots.joint("trunk", hip, root, axis, limits=limits[:2])
        + link(knee, ball(0.02, f"0 0 {-shank}"), mass=0.1)
        + small_robots.joint(hip, knee, f"0 0 {-thigh}", axis, limits=limits[2:])
    )


ROOTS = {"fl": "0.3 0.2 0", "fr": "0.3 -0.2 0", "hl": "-0.3 0.2 0", "hr": "-0.3 -0.2 0"}


def table(center="0 0 0", **each):
    legs = [leg(name, root, **each) for name, root in ROOTS.items()]
    return small_robots.facts(link("trunk", mass=20, center=center), *legs)


def feet(robot):
    return robot.stance.contacts - [[float(x) for x in root.split()] for root in ROOTS.values()]


def test_standing_pose_puts_feet_below_hips():
    # The hips and the mass are at the center. Links of 0.3 m, and a foot radius of 0.02 m.
    robot = table()
    assert feet(robot) == pytest.approx(np.tile([0, 0, -0.75 * 0.62], (4, 1)), abs=0.01)
    # They are multiples of 0.05 rad. Only the cost of a knee outside of its hip decides which way
    # the legs bend.
    signs = {"fl": 1, "fr": 1, "hl": -1, "hr": -1}
    expected = {f"{name}_hip_joint": 0.75 * sign for name, sign in signs.items()}
    expected |= {f"{name}_knee_joint": -1.5 * sign for name, sign in signs.items()}
    assert robot.stance.positions == expected


@pytest.mark.parametrize(
    ("roots", "expected"),
    [
        (ROOTS, [1, 1, -1, -1]),
        ({"a": "0.3 0 0", "b": "0.05 0.2 0", "c": "-0.05 0.2 0", "d": "-0.3 0 0"}, [1, 1, -1, -1]),
        ({"a": "0.3 0 0", "b": "0.04 0.2 0", "c": "-0.04 0.2 0", "d": "-0.3 0 0"}, [1, 0, 0, -1]),
        ({"a": "0.3 0.2 0", "b": "0.3 -0.2 0", "c": "-0.3 0.2 0"}, [0, 0, 0]),
    ],
)
def test_knees_of_quadrupeds_avoid_the_outside(roots, expected):
    # A leg in the middle, within a tenth of its length of 0.47 m, has no outside.
    legs = [leg(f"leg_{name}", root, 0.25, 0.2) for name, root in roots.items()]
    robot = small_robots.facts(link("trunk", mass=20), *legs)
    places = [np.array(root.split(), float) for root in roots.values()]
    found = [
        _penalty_axis(each, robot, body_poses(robot.bodies, {}), place)
        for each, place in zip(robot.legs, places, strict=True)
    ]
    np.testing.assert_allclose(found, [[x, 0, 0] for x in expected])


@pytest.mark.parametrize("x", [-0.05, 0.03, 0.1])
def test_standing_pose_shifts_feet_with_mass(x):
    robot = table(center=f"{x} 0 0")
    assert robot.stance.center[0] == pytest.approx(x, abs=0.02)
    assert robot.stance.contacts[:, 0].mean() == pytest.approx(robot.stance.center[0], abs=0.01)


def test_feet_are_shifted_by_30_percent_of_the_leg_at_most():
    assert feet(table(center="0.5 0 0"))[:, 0] == pytest.approx([0.3 * 0.62] * 4, abs=0.02)


@pytest.mark.parametrize(("limits", "sign"), [((-3, 3, -3, -0.1), -1), ((-3, 3, 0.1, 3), 1)])
def test_standing_pose_bends_knee_within_limits(limits, sign):
    positions = table(limits=limits).stance.positions
    assert positions["fl_knee_joint"] * sign > 0
    assert positions["fl_hip_joint"] * sign < 0
    # The same with all axes and limits negated.
    negated = (-3, 3, -limits[3], -limits[2])
    other = table(limits=negated, axis="0 -1 0").stance.positions
    assert other == pytest.approx({name: -q for name, q in positions.items()}, abs=0.01)


def test_standing_pose_avoids_limits():
    # 0.75 of the length requires a knee angle of 1.45 rad, which is close to the limit.
    robot = table(limits=(-3, 3, -1.5, 0))
    assert -1.44 < robot.stance.positions["fl_knee_joint"] < -1.0


def test_standing_pose_of_unreachable_target():
    robot = table(limits=(-0.1, 0.1, -0.2, 0.2))
    for name, position in robot.stance.positions.items():
        assert abs(position) <= (0.1 if "hip" in name else 0.2)
    assert robot.stance.height == pytest.approx(0.62, abs=0.02)


@pytest.mark.parametrize("limits", [(1, -1, 2, -2), (0, 0, 0, 0), (-1e29, 1e29, -1e29, 1e29)])
def test_standing_pose_with_invalid_limits(limits):
    robot = table(limits=limits)
    assert max(map(abs, robot.stance.positions.values())) < 2.5
    assert robot.stance.height == pytest.approx(0.75 * 0.62, abs=0.02)


def test_standing_pose_keeps_keyframe():
    robot = Facts(load_robot(bundled.urdf_path("quadruped").with_suffix(".xml")))
    expected = {each.name: robot.model.keyframe[each.name] for each in robot.joints}
    assert solve_standing_pose(robot) == robot.default_pose == expected
    assert robot.stance.positions == robot.default_pose


def test_standing_pose_without_legs():
    slide = small_robots.joint("a", "b", limits=(0.5, 1))
    robot = small_robots.facts(link("a"), link("b"), slide)
    assert robot.stance is None
    assert solve_standing_pose(robot) == {"b_joint": 0.5}
