import math
from functools import cache

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.stance import (
    GRAVITY,
    _force_points,
    compute_stance,
    ground_forces,
    is_statically_stable,
)
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from tests import small_robots
from tests.robots import ROBOTS
from tests.small_robots import ball, box, floating, joint, link

every_robot = pytest.mark.parametrize("name", ROBOTS)


@cache
def read(path):
    return Facts(load_robot(path))


def compiled(facts):
    """Compile a robot above a plane."""
    path = facts.model.file
    if path.suffix == ".urdf":
        text = floating(path.read_text(), facts.bodies[0].top.name)
        spec = mujoco.MjSpec.from_string(text)
    else:
        spec = mujoco.MjSpec.from_file(str(path))
    for floor in [g for g in spec.geoms if g.type == mujoco.mjtGeom.mjGEOM_PLANE]:
        spec.delete(floor)
    plane = mujoco.mjtGeom.mjGEOM_PLANE
    spec.worldbody.add_geom(name="ground", type=plane, size=[0, 0, 1], margin=0)
    return spec.compile()


def placed(model, stance, height):
    data = mujoco.MjData(model)
    data.qpos[:7] = [0, 0, height, 1, 0, 0, 0]
    for name, position in stance.positions.items():
        data.joint(name).qpos = position
    mujoco.mj_forward(model, data)
    return data


def depths(model, stance, height):
    ground = model.geom("ground").id
    contacts = [c for c in placed(model, stance, height).contact if ground in c.geom]
    return [c.dist for c in contacts if c.dist < 0]


@every_robot
def test_stance_height_touches_ground_in_mujoco(name, robot_file):
    robot = read(robot_file(name))
    stance, model = robot.stance, compiled(robot)
    assert depths(model, stance, stance.height + 1e-4) == []
    assert min(depths(model, stance, stance.height - 1e-4)) == pytest.approx(-1e-4, abs=1e-5)
    assert stance.spawn_height == pytest.approx(stance.height + 0.01)


def assert_same_in_mujoco(robot, model):
    """Compare with the forces that hold the robot still in MuJoCo, given the ground forces."""
    stance = robot.stance
    data = placed(model, stance, 0.0)
    trunk = data.body(robot.bodies[0].top.name).id
    np.testing.assert_allclose(stance.center, data.subtree_com[trunk], atol=1e-9)
    weight = robot.total_mass * GRAVITY
    pushes = ground_forces(stance.contacts[:, :2], stance.center[:2], weight)
    needed = data.qfrc_bias.copy()
    for leg, place, push in zip(robot.legs, stance.force_points, pushes, strict=True):
        foot = data.body(robot.bodies[leg.limb.chain[-1]].top.name).id
        jacobian = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, jacobian, None, place, foot)
        needed -= jacobian.T @ [0, 0, push]
    # No residual force acts on the trunk.
    np.testing.assert_allclose(needed[:6], 0, atol=1e-6)
    assert set(stance.torques) == {joint.name for leg in robot.legs for joint in leg.joints}
    for name, torque in stance.torques.items():
        assert torque == pytest.approx(needed[model.joint(name).dofadr[0]], abs=1e-6), name


@every_robot
def test_stance_torques_and_center_match_mujoco(name, robot_file):
    robot = read(robot_file(name))
    assert_same_in_mujoco(robot, compiled(robot))


def test_stance_torque_of_waist_matches_mujoco(tmp_path):
    # The legs of the bundled biped below an inclined waist with a torso above it.
    path = tmp_path / "waist.urdf"
    waist = joint("torso", "pelvis", "0.02 0 -0.1", limits=(0.05, 0.1))
    text = bundled.urdf_path("biped").read_text()
    path.write_text(text.replace("</robot>", f"{link('torso', mass=20)}{waist}</robot>"))
    robot = read(path)
    assert [leg.roles[0] for leg in robot.legs] == ["waist", "waist"]
    assert robot.stance.positions["pelvis_joint"] == 0.05
    assert abs(robot.stance.torques["pelvis_joint"]) > 1
    assert_same_in_mujoco(robot, compiled(robot))


def table(leg_mass=None, trunk_mass=12.0, foot=0.02, sliding=False):
    """Return a quadruped with hips at x = +-0.3, y = +-0.2 and legs of 0.3 m and 0.3 m."""
    parts = [link("trunk", box("0.6 0.3 0.1"), mass=trunk_mass)]
    for side, x, y in (("fl", 1, 1), ("fr", 1, -1), ("hl", -1, 1), ("hr", -1, -1)):
        hip, knee, part = f"{side}_hip", f"{side}_knee", {"mass": leg_mass, "center": "0 0 -0.15"}
        parts += [link(hip, **part), link(knee, ball(foot, "0 0 -0.3"), **part)]
        parts += [joint("trunk", hip, f"{0.3 * x} {0.2 * y} 0", limits=(-1, 1.5))]
        slide = ("0 0 1", "prismatic") if sliding else ("0 1 0",)
        parts += [joint(hip, knee, "0 0 -0.3", *slide, limits=(-2.5, 0))]
    return small_robots.facts(*parts)


def by_joint(hip, knee):
    values = {"hip": hip, "knee": knee}
    return {f"{s}_{part}_joint": x for s in ("fl", "fr", "hl", "hr") for part, x in values.items()}


def stand(robot, hip, knee, **other):
    positions = by_joint(hip, knee) | other
    return compute_stance(robot, positions, total_mass=robot.total_mass)


def test_stance_on_straight_legs():
    stance = stand(table(), 0, 0)
    assert stance.height == pytest.approx(0.62)
    assert stance.torques == pytest.approx(by_joint(0, 0), abs=1e-9)
    np.testing.assert_allclose(stance.center, [0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(stance.support, [[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]])
    assert stance.margin == pytest.approx(0.2)


def test_stance_on_bent_legs():
    # Thigh 0.5 rad back, shank 0.5 rad ahead: the foot is below the hip, the knee 0.3 sin(0.5) m
    # behind it. Each leg carries a quarter of 12 kg: the knee needs that times the lever.
    stance = stand(table(), 0.5, -1.0)
    assert stance.height == pytest.approx(0.6 * math.cos(0.5) + 0.02)
    feet = [[0.3 * x, 0.2 * y, -stance.height] for x in (1, -1) for y in (1, -1)]
    np.testing.assert_allclose(stance.contacts, feet, atol=1e-9)
    expected = by_joint(0, 3 * GRAVITY * 0.3 * math.sin(0.5))
    assert stance.torques == pytest.approx(expected, abs=1e-9)


def test_stance_force_of_sliding_knees():
    # The legs are vertical; each carries a quarter of 12 kg, which pushes the shank up its axis.
    stance = stand(table(sliding=True), 0, -0.1)
    assert stance.height == pytest.approx(0.72)
    assert stance.torques == pytest.approx(by_joint(0, -3 * GRAVITY), abs=1e-9)


def test_stance_on_inclined_legs():
    # Straight legs 0.2 rad back: every foot is 0.6 sin(0.2) m behind its hip. The weight is then
    # ahead of the middle, and the front legs carry more: lever is 0.3 m either way.
    stance = stand(table(), 0.2, 0)
    back = 0.6 * math.sin(0.2)
    fore = 12 * GRAVITY * (0.3 + back) / 0.6 / 2
    assert stance.torques["fl_hip_joint"] == pytest.approx(-fore * back)
    assert stance.torques["hl_hip_joint"] == pytest.approx(-(6 * GRAVITY - fore) * back)
    assert stance.margin == pytest.approx(0.3 - back)


def test_stance_height_is_that_of_the_lowest_shape():
    # With one leg folded, the other three carry; with all of them, the trunk may be lower.
    assert stand(table(), 0, 0, fl_hip_joint=1.0, fl_knee_joint=-2.0).height == pytest.approx(0.62)
    robot = table(foot=0.001)
    lowest = 0.3 * math.cos(1.5) + 0.3 * math.cos(1.0) + 0.001
    assert stand(robot, 1.5, -2.5).height == pytest.approx(lowest)
    assert stand(robot, 1.5, 0).height == pytest.approx(0.05)


def test_stance_without_mass_has_no_torques():
    robot = table(trunk_mass=0.0)
    stance = stand(robot, 0.5, -1.0)
    assert stance.torques == pytest.approx(by_joint(0, 0), abs=1e-9)
    assert np.isfinite(stance.margin)
    unknown = compute_stance(robot, stance.positions, total_mass=math.nan)
    assert (unknown.torques, math.isnan(unknown.margin)) == ({}, True)


def test_three_legs_stand_without_balance():
    assert [is_statically_stable([None] * count) for count in (2, 3, 4)] == [False, True, True]


SQUARE = np.array([[0.3, 0.2], [0.3, -0.2], [-0.3, 0.2], [-0.3, -0.2]])


@pytest.mark.parametrize(
    ("places", "center", "expected"),
    [
        (SQUARE, (0, 0), [25, 25, 25, 25]),
        # Halfway to the front feet, these carry three quarters.
        (SQUARE, (0.15, 0), [37.5, 37.5, 12.5, 12.5]),
        (SQUARE, (0.3, 0), [50, 50, 0, 0]),
        (SQUARE, (1.0, 0), [50, 50, 0, 0]),  # cannot be balanced
        (SQUARE[:2], (0.3, 0.1), [75, 25]),
        (SQUARE[:1], (0.3, 0.2), [100]),
        # A triangle: 0.6 m long, the weight a third of the way.
        (np.array([[0, 0.1], [0, -0.1], [0.6, 0]]), (0.2, 0), [100 / 3] * 3),
    ],
)
def test_ground_forces_by_hand(places, center, expected):
    found = ground_forces(places, np.array(center), 100.0)
    assert found == pytest.approx(expected, abs=1e-9)


def test_pressure_moves_within_the_soles_to_balance():
    # Feet at x = 0 and 0.4 with soles of +-0.05 carry 30 and 10 N. Their common center is at 0.1;
    # the mass is 0.03 ahead of that, and then 0.3 ahead, beyond what the soles reach.
    contacts = np.array([[0, 0, -1], [0.4, 0, -1.0]])
    soles = [np.add(point, [[-0.05, -0.01, 0], [0.05, 0.01, 0]]) for point in contacts]
    for ahead, moved in ((0.03, 0.03), (0.3, 0.05)):
        center = np.array([0.1 + ahead, 0, 0.5])
        found = _force_points(soles, contacts, np.array([30.0, 10.0]), center)
        np.testing.assert_allclose(found, np.add(contacts, [moved, 0, 0]), atol=1e-12)
    assert _force_points(soles, contacts, np.zeros(2), center) is contacts


POINT = st.tuples(st.floats(-1, 1), st.floats(-1, 1))


@given(st.lists(st.tuples(POINT, st.floats(0.1, 1)), min_size=3, max_size=8))
def test_ground_forces_are_the_most_even_balance(feet):
    places = np.array([place for place, _ in feet])
    shares = np.array([share for _, share in feet])
    shares *= 100 / shares.sum()
    center = shares @ places / 100
    forces = ground_forces(places, center, 100.0)
    if np.isclose(forces, 0).any():
        return  # a foot lifted off
    np.testing.assert_allclose(forces @ places / 100, center, atol=1e-6)
    even = 100 / len(places)
    assert np.linalg.norm(forces - even) <= np.linalg.norm(shares - even) + 1e-6


@given(st.lists(POINT, min_size=1, max_size=8), POINT, st.floats(0, 1000))
def test_ground_forces_push_upward_with_the_weight(places, center, weight):
    forces = ground_forces(np.array(places), np.array(center), weight)
    assert (forces >= 0).all()
    assert forces.sum() == pytest.approx(weight, abs=1e-9)
