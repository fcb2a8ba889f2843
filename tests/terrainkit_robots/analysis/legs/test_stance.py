import math
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from terrainkit_robots.analysis.bodies.contact import contact_points
from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.stance import GRAVITY, compute_stance, ground_forces
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from tests.robots import BUNDLED

FILE = Path("/robots/robot.urdf")
ROBOTS = [
    "a1/urdf/a1.urdf",
    "go2/urdf/go2.urdf",
    "h1/urdf/h1.urdf",
    "g1/g1_29dof.urdf",
    "go2_mjcf/go2.xml",
    "h1/h1.xml",
    "g1/g1_29dof.xml",
    *BUNDLED,
]
every_robot = pytest.mark.parametrize("name", ROBOTS)


@cache
def read(path):
    return Facts(load_robot(path))


def floating_base(path):
    """Return the text of a URDF with a floating base and without visuals."""
    root = etree.parse(str(path)).getroot()
    for element in [*root.iter("visual"), *root.findall("mujoco")]:
        element.getparent().remove(element)
    folder = path.parent
    compiler = (
        f'<compiler meshdir="{folder}" strippath="false" discardvisual="false" '
        'inertiafromgeom="false"/>'
    )
    root.append(etree.fromstring(f"<mujoco>{compiler}</mujoco>"))
    children = {child.get("link") for child in root.iter("child")}
    trunk = next(e.get("name") for e in root.findall("link") if e.get("name") not in children)
    root.append(etree.fromstring('<link name="world"/>'))
    root.append(
        etree.fromstring(
            '<joint name="afloat" type="floating"><parent link="world"/>'
            f'<child link="{trunk}"/></joint>'
        )
    )
    return etree.tostring(root).decode()


@cache
def compiled(path):
    """Compile a robot above a plane, without its visuals."""
    text = path.suffix == ".urdf"
    spec = (
        mujoco.MjSpec.from_string(floating_base(path))
        if text
        else mujoco.MjSpec.from_file(str(path))
    )
    drawn = [g for g in spec.geoms if not (g.contype or g.conaffinity)]
    for geom in drawn if not text else []:
        spec.delete(geom)
    used = {geom.meshname for geom in spec.geoms} - {""}
    for mesh in [m for m in spec.meshes if m.name not in used]:
        spec.delete(mesh)
    floors = [g for g in spec.geoms if g.type == mujoco.mjtGeom.mjGEOM_PLANE]
    for geom in floors:
        spec.delete(geom)
    plane = mujoco.mjtGeom.mjGEOM_PLANE
    spec.worldbody.add_geom(name="ground", type=plane, size=[0, 0, 1], margin=0)
    return spec.compile()


def placed(model, stance, height):
    data = mujoco.MjData(model)
    data.qpos[:7] = [0, 0, height, 1, 0, 0, 0]
    for joint, position in stance.positions.items():
        data.joint(joint).qpos = position
    mujoco.mj_forward(model, data)
    return data


def on_the_ground(model, data):
    ground = model.geom("ground").id
    near = [contact.dist for contact in data.contact if ground in contact.geom]
    return [distance for distance in near if distance < 0]


# Compared with MuJoCo


@every_robot
def test_stance_height_touches_ground_in_mujoco(name, robot_file):
    path = robot_file(name)
    stance, model = read(path).stance, compiled(path)
    assert on_the_ground(model, placed(model, stance, stance.height + 1e-4)) == []
    touching = on_the_ground(model, placed(model, stance, stance.height - 1e-4))
    assert min(touching) == pytest.approx(-1e-4, abs=1e-5)
    assert on_the_ground(model, placed(model, stance, stance.spawn_height)) == []


def same_torques(facts, model):
    """Compare with the forces that hold the robot still in MuJoCo, given the ground forces."""
    stance = facts.stance
    data = placed(model, stance, 0.0)
    weight = facts.total_mass * GRAVITY
    pushes = ground_forces(stance.contacts[:, :2], stance.center[:2], weight)
    needed = data.qfrc_bias.copy()
    for leg, place, push in zip(facts.legs, stance.force_points, pushes, strict=True):
        foot = data.body(facts.bodies[leg.limb.chain[-1]].top.name).id
        jacobian = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, jacobian, None, place, foot)
        needed -= jacobian.T @ [0, 0, push]
    # No residual force acts on the trunk.
    np.testing.assert_allclose(needed[:6], 0, atol=1e-6)
    assert set(stance.torques) == {joint.name for leg in facts.legs for joint in leg.joints}
    for joint, torque in stance.torques.items():
        assert torque == pytest.approx(needed[model.joint(joint).dofadr[0]], abs=1e-6), joint


@every_robot
def test_stance_torques_match_mujoco(name, robot_file):
    path = robot_file(name)
    same_torques(read(path), compiled(path))


def test_stance_torque_of_waist_matches_mujoco(tmp_path):
    # The legs of the bundled biped below an inclined waist with a torso above it.
    text = bundled.urdf_path("biped").read_text()
    model = load_robot(bundled.urdf_path("biped"))
    trunk = Facts(model).bodies[0].top.name
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    text = text.replace(
        "</robot>",
        f'<link name="torso"><inertial><mass value="20"/>{inertia}</inertial></link>'
        '<joint name="waist" type="revolute">'
        f'<parent link="torso"/><child link="{trunk}"/><origin xyz="0.02 0 -0.1"/>'
        '<axis xyz="0 1 0"/><limit lower="0.05" upper="0.1" effort="90" velocity="9"/>'
        "</joint></robot>",
    )
    path = tmp_path / "waist.urdf"
    path.write_text(text)
    facts = Facts(load_robot(path))
    assert [leg.roles[0] for leg in facts.legs] == ["waist", "waist"]
    assert facts.stance.positions["waist"] == 0.05
    assert abs(facts.stance.torques["waist"]) > 1
    same_torques(facts, compiled(path))


@every_robot
def test_stance_center_matches_mujoco(name, robot_file):
    path = robot_file(name)
    facts = read(path)
    data = placed(compiled(path), facts.stance, 0.0)
    trunk = data.body(facts.bodies[0].top.name).id
    np.testing.assert_allclose(facts.stance.center, data.subtree_com[trunk], atol=1e-9)


@every_robot
def test_stance_of_published_robots_is_valid(name, robot_file):
    facts = read(robot_file(name))
    stance = facts.stance
    assert stance.margin > 0.02
    assert len(stance.contacts) == len(facts.legs)
    # All feet are on the ground, within the thickness of a sole.
    np.testing.assert_allclose(stance.contacts[:, 2], -stance.height, atol=0.01)
    for joint in facts.joints:
        limit, position = joint.limit, stance.positions[joint.name]
        assert limit.lower - 1e-9 <= position <= limit.upper + 1e-9


# By hand


def table(leg_mass=0.0, trunk_mass=12.0, foot=0.02):
    """Return a quadruped with hips at x = +-0.3, y = +-0.2 and legs of 0.3 m and 0.3 m."""

    def link(name, mass, center, collision=""):
        if not mass:
            return f'<link name="{name}">{collision}</link>'
        return (
            f'<link name="{name}"><inertial><origin xyz="{center}"/><mass value="{mass}"/>'
            f'<inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial>{collision}</link>'
        )

    def joint(name, parent, child, xyz, lower, upper):
        return (
            f'<joint name="{name}" type="revolute"><parent link="{parent}"/>'
            f'<child link="{child}"/><origin xyz="{xyz}"/><axis xyz="0 1 0"/>'
            f'<limit lower="{lower}" upper="{upper}" effort="50" velocity="20"/></joint>'
        )

    box = '<collision><geometry><box size="0.6 0.3 0.1"/></geometry></collision>'
    ball = (
        '<collision><origin xyz="0 0 -0.3"/><geometry>'
        f'<sphere radius="{foot}"/></geometry></collision>'
    )
    parts = [link("trunk", trunk_mass, "0 0 0", box)]
    for side, x, y in (("fl", 1, 1), ("fr", 1, -1), ("hl", -1, 1), ("hr", -1, -1)):
        parts += [
            link(f"{side}_thigh", leg_mass, "0 0 -0.15"),
            link(f"{side}_shank", leg_mass, "0 0 -0.15", ball),
            joint(f"{side}_hip", "trunk", f"{side}_thigh", f"{0.3 * x} {0.2 * y} 0", -1, 1.5),
            joint(f"{side}_knee", f"{side}_thigh", f"{side}_shank", "0 0 -0.3", -2.5, 0),
        ]
    text = f'<robot name="table">{"".join(parts)}</robot>'
    return Facts(load_robot(FILE, contents={FILE: text.encode()}))


def stand(facts, positions):
    return compute_stance(facts.leg_model, positions, total_mass=facts.total_mass)


def at(hip, knee):
    return {
        f"{side}_{joint}": q
        for side in ("fl", "fr", "hl", "hr")
        for joint, q in (("hip", hip), ("knee", knee))
    }


def test_stance_on_straight_legs():
    stance = stand(table(), at(0, 0))
    assert stance.height == pytest.approx(0.62)
    assert stance.spawn_height == pytest.approx(0.63)
    assert all(torque == pytest.approx(0) for torque in stance.torques.values())
    np.testing.assert_allclose(stance.center, [0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(stance.support, [[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]])
    assert stance.margin == pytest.approx(0.2)


def test_stance_on_bent_legs():
    # Thigh 0.5 rad back, shank 0.5 rad ahead: the foot is below the hip, the knee 0.3 sin(0.5) m
    # behind it. Each leg carries a quarter of 12 kg: the knee needs that times the lever.
    stance = stand(table(), at(0.5, -1.0))
    lever = 0.3 * math.sin(0.5)
    assert stance.height == pytest.approx(0.6 * math.cos(0.5) + 0.02)
    assert stance.torques["fl_hip"] == pytest.approx(0, abs=1e-9)
    assert stance.torques["fl_knee"] == pytest.approx(3 * GRAVITY * lever)
    assert stance.torques["hr_knee"] == pytest.approx(3 * GRAVITY * lever)


def test_stance_on_inclined_legs():
    # Straight legs 0.2 rad back: every foot is 0.6 sin(0.2) m behind its hip. The weight is then
    # ahead of the middle, and the front legs carry more: lever is 0.3 m either way.
    stance = stand(table(), at(0.2, 0))
    back = 0.6 * math.sin(0.2)
    fore = 12 * GRAVITY * (0.3 + back) / 0.6 / 2
    assert stance.torques["fl_hip"] == pytest.approx(-fore * back)
    assert stance.torques["hl_hip"] == pytest.approx(-(6 * GRAVITY - fore) * back)
    assert stance.margin == pytest.approx(min(0.2, 0.3 - back))


def test_stance_torque_includes_leg_mass():
    # Each leg has two parts of 1 kg, and stands straight 0.2 rad back.
    stance = stand(table(leg_mass=1.0), at(0.2, 0))
    back = 0.6 * math.sin(0.2)
    center = -8 * back / 2 / 20  # eight parts whose mean is halfway down
    fore = 20 * GRAVITY * (0.3 + back + center) / 0.6 / 2
    hanging = 1 * GRAVITY * (0.15 + 0.45) * math.sin(0.2)
    assert stance.center[0] == pytest.approx(center)
    assert stance.torques["fl_hip"] == pytest.approx(-fore * back + hanging)


def test_stance_with_one_foot_in_the_air():
    # With one leg folded the other three carry; they still have the lowest shapes.
    positions = at(0, 0) | {"fl_hip": 1.0, "fl_knee": -2.0}
    stance = stand(table(), positions)
    assert stance.height == pytest.approx(0.62)


def test_stance_height_includes_trunk():
    # The legs are folded so far that the trunk is lower than the feet.
    facts = table(foot=0.001)
    stance = stand(facts, at(1.5, -2.5))
    lowest = 0.3 * math.cos(1.5) + 0.3 * math.cos(1.0) + 0.001
    assert lowest > 0.05
    assert stance.height == pytest.approx(lowest)
    assert stand(facts, at(1.5, 0)).height == pytest.approx(0.05)


def test_stance_without_mass_has_no_torques():
    stance = stand(table(trunk_mass=0.0), at(0.5, -1.0))
    assert set(stance.torques.values()) == {0.0} or max(map(abs, stance.torques.values())) < 1e-9
    assert np.isfinite(stance.margin)


# Forces

SQUARE = np.array([[0.3, 0.2], [0.3, -0.2], [-0.3, 0.2], [-0.3, -0.2]])


@pytest.mark.parametrize(
    ("places", "center", "expected"),
    [
        (SQUARE, (0, 0), [25, 25, 25, 25]),
        # Halfway to the front feet, these carry three quarters.
        (SQUARE, (0.15, 0), [37.5, 37.5, 12.5, 12.5]),
        (SQUARE, (0.3, 0), [50, 50, 0, 0]),
        (SQUARE[:2], (0.3, 0.1), [75, 25]),
        (SQUARE[:1], (0.3, 0.2), [100]),
        # A triangle: 0.6 m long, the weight a third of the way.
        (np.array([[0, 0.1], [0, -0.1], [0.6, 0]]), (0.2, 0), [100 / 3] * 3),
    ],
)
def test_ground_forces_by_hand(places, center, expected):
    assert ground_forces(places, np.array(center), 100.0) == pytest.approx(expected)


def test_ground_forces_without_balance_sum_to_weight():
    forces = ground_forces(SQUARE, np.array([1.0, 0.0]), 100.0)
    assert forces.sum() == pytest.approx(100)
    assert (forces >= 0).all()


POINT = st.tuples(st.floats(-1, 1), st.floats(-1, 1))


@given(st.lists(POINT, min_size=1, max_size=8), POINT, st.floats(0, 1000))
def test_ground_forces_are_upward_and_sum_to_weight(places, center, weight):
    forces = ground_forces(np.array(places), np.array(center), weight)
    assert (forces >= 0).all()
    assert forces.sum() == pytest.approx(weight, abs=1e-9)


@given(st.lists(st.tuples(POINT, st.floats(0.1, 1)), min_size=3, max_size=8))
def test_ground_forces_are_balanced(feet):
    places = np.array([place for place, _ in feet])
    shares = np.array([share for _, share in feet])
    center = shares @ places / shares.sum()
    forces = ground_forces(places, center, 100.0)
    even = np.full(len(places), 100 / len(places))
    if np.isclose(forces, 0).any():
        return  # a foot lifted off
    np.testing.assert_allclose(forces @ places / 100, center, atol=1e-6)
    assert (
        np.linalg.norm(forces - even) <= np.linalg.norm(shares / shares.sum() * 100 - even) + 1e-6
    )


@every_robot
def test_force_points_are_within_soles(name, robot_file):
    facts = read(robot_file(name))
    stance = facts.stance
    poses = body_poses(facts.bodies, stance.positions)
    for leg, place in zip(facts.legs, stance.force_points, strict=True):
        foot = leg.limb.chain[-1]
        points = contact_points(facts.bodies[foot], poses[foot], facts.meshes)[:, :2]
        assert (points.min(axis=0) - 1e-9 <= place[:2]).all()
        assert (place[:2] <= points.max(axis=0) + 1e-9).all()


def test_contacts_are_at_leg_ends():
    facts = table()
    positions = at(0.5, -1.0)
    stance, poses = stand(facts, positions), body_poses(facts.bodies, positions)
    for leg, contact in zip(facts.legs, stance.contacts, strict=True):
        shank = poses[leg.limb.chain[-1]]
        np.testing.assert_allclose(contact, (shank @ [0, 0, -0.3, 1])[:3] - [0, 0, 0.02], atol=1e-9)
