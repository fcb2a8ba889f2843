import dataclasses

import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.model import Dynamics
from terrainkit_robots.export.actuator import ActuatorConfig
from terrainkit_robots.export.canonical import to_canonical
from terrainkit_robots.export.mjcf import Extras, mjcf_text, scene_text
from terrainkit_robots.export.sites import foot_sites, imu_site
from terrainkit_robots.quiet_mujoco import quiet_mujoco

MASS = '<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>'


def written(model, **extras):
    with quiet_mujoco():
        return mujoco.MjModel.from_xml_string(mjcf_text(model, Extras(**extras)))


@pytest.fixture
def quadruped():
    facts = Facts(load_robot(bundled.urdf_path("quadruped")))
    return Facts(to_canonical(facts).model)


def test_masses_and_inertias(quadruped):
    model = written(quadruped.model)
    for link in quadruped.links:
        body = model.body(link.name)
        declared = link.inertial
        assert body.mass[0] == pytest.approx(declared.mass, rel=1e-9)
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, body.iquat)
        turn = turn.reshape(3, 3)
        origin = declared.origin[:3, :3]
        np.testing.assert_allclose(
            turn @ np.diag(body.inertia) @ turn.T,
            origin @ declared.inertia @ origin.T,
            rtol=1e-6,
            atol=1e-7,  # MuJoCo before 3.14 diagonalizes with an error of 5e-8
        )


def test_visual_geoms_have_their_colors(quadruped):
    model = written(quadruped.model)
    shown = model.geom_rgba[model.geom_contype == 0]
    colors = {tuple(color.astype(float).round(3).tolist()) for color in shown}
    assert colors == {(0.75, 0.77, 0.8, 1.0), (0.2, 0.21, 0.23, 1.0)}


def test_several_joints_of_one_body(tmp_path):
    """Two hinges and a slide on one body, off its origin and with references."""
    text = f"""<mujoco><compiler angle="radian"/><worldbody><body name="base">{MASS}
      <body name="hip" pos="0.1 0.2 -0.3" quat="0.9 0.1 0.2 0.3">{MASS}
        <joint name="a" axis="1 0 0" pos="0.01 0.02 0.03" ref="0.1"/>
        <joint name="b" axis="0 1 1" pos="-0.02 0 0.1" ref="-0.2"/>
        <joint name="c" type="slide" axis="0 0 1" ref="0.05"/>
        <body name="knee" pos="0 0 -0.2">{MASS}
          <joint name="d" axis="0 1 0" pos="0 0 0.02"/></body>
      </body></body></worldbody></mujoco>"""
    path = tmp_path / "robot.xml"
    path.write_text(text)
    source = mujoco.MjModel.from_xml_path(str(path))
    model = written(to_canonical(Facts(load_robot(path)), floating=False).model)
    assert [model.joint(k).name for k in range(model.njnt)] == ["a", "b", "c", "d"]
    rng = np.random.default_rng(0)
    for qpos in rng.uniform(-1, 1, (20, 4)):
        for name in ("hip", "knee"):
            there, here = (pose_of(m, qpos, name) for m in (source, model))
            np.testing.assert_allclose(here, there, atol=1e-9)


def pose_of(model, qpos, name):
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    return np.r_[data.body(name).xpos, data.body(name).xmat]


def test_actuator_order(quadruped):
    names = [joint.name for joint in quadruped.actuated][::-1]
    drives = {
        name: ActuatorConfig(stiffness=20 + k, damping=0.5, effort=5.0 + k, armature=0.01)
        for k, name in enumerate(names)
    }
    model = written(quadruped.model, actuators=drives, keyframe=quadruped.default_pose, height=0.3)
    assert [model.actuator(k).name for k in range(model.nu)] == names
    for k, name in enumerate(names):
        motor, joint = model.actuator(k), model.joint(name)
        assert motor.trnid[0] == joint.id
        assert motor.gainprm[0] == 20 + k
        assert list(motor.biasprm[:3]) == [0, -20 - k, -0.5]
        assert list(motor.forcerange) == [-5 - k, 5 + k]
        np.testing.assert_allclose(motor.ctrlrange, joint.range)
        assert model.dof_armature[joint.dofadr[0]] == 0.01
    key = model.key("home")
    assert key.qpos[2] == 0.3
    assert list(key.ctrl) == pytest.approx([quadruped.default_pose[name] for name in names])


def test_actuator_without_effort_is_unlimited(quadruped):
    model = written(
        quadruped.model, actuators={"FL_hip_joint": ActuatorConfig(stiffness=1, damping=0)}
    )
    assert not model.actuator(0).forcelimited


def test_touch_sensors_of_feet(quadruped):
    weight = quadruped.total_mass * 9.81
    drives = {
        joint.name: ActuatorConfig(stiffness=100, damping=2, effort=50.0, armature=0.01)
        for joint in quadruped.actuated
    }
    extras = Extras(
        actuators=drives,
        feet=foot_sites(quadruped),
        imu=imu_site(quadruped),
        keyframe=quadruped.default_pose,
        height=quadruped.stance.height,
    )
    text = mjcf_text(quadruped.model, extras)
    floor = '<worldbody><geom type="plane" size="0 0 1"/>'
    model = mujoco.MjModel.from_xml_string(text.replace("<worldbody>", floor, 1))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(400):
        mujoco.mj_step(model, data)
    felt = [data.sensor(f"{leg.foot}_contact").data[0] for leg in quadruped.legs]
    assert min(felt) > 0.1 * weight
    assert sum(felt) == pytest.approx(weight, rel=0.01)
    assert data.sensor("acceleration").data[2] == pytest.approx(9.81, abs=0.1)
    assert data.sensor("orientation").data[0] == pytest.approx(1, abs=1e-3)


def test_mimic_joint(tmp_path):
    link = (
        '<link name="{}"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" '
        'ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )
    joint = (
        '<joint name="{0}" type="revolute"><parent link="a"/><child link="{1}"/><axis xyz="0 1 0"/>'
        '<limit lower="-1" upper="1" effort="5" velocity="5"/>{2}</joint>'
    )
    text = f"""<robot name="r">{link.format("a")}{link.format("b")}{link.format("c")}
      {joint.format("j", "b", "")}
      {joint.format("k", "c", '<mimic joint="j" multiplier="-2" offset="0.1"/>')}</robot>"""
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    facts = Facts(to_canonical(Facts(load_robot(path))).model)
    assert [joint.name for joint in facts.actuated] == ["j"]
    model = written(facts.model)
    assert model.neq == 1
    np.testing.assert_allclose(model.eq_data[0, :5], [0.1, -2, 0, 0, 0])


def test_special_characters_in_names(quadruped):
    hostile = '"/><body name="x">&amp; é'
    links = [
        dataclasses.replace(link, name=hostile) if link.name == "imu" else link
        for link in quadruped.model.links
    ]
    base = dataclasses.replace(quadruped.model, name=hostile, links=tuple(links))
    assert written(base).nbody == written(quadruped.model).nbody


def test_excluded_pairs(quadruped):
    pair = frozenset(("base", "FL_calf"))
    assert written(quadruped.model).nexclude == 0
    assert written(quadruped.model, excluded=[pair]).nexclude == 1


def test_arm_keeps_its_pose(tmp_path):
    text = f"""<mujoco><worldbody><body name="base">{MASS}<body name="arm">{MASS}
      <joint name="j" range="-1 1"/></body></body></worldbody></mujoco>"""
    path = tmp_path / "robot.xml"
    path.write_text(text)
    model = written(to_canonical(Facts(load_robot(path))).model)
    assert (model.nq, model.nkey) == (1, 1)


def test_scene(quadruped, tmp_path):
    (tmp_path / "robot.xml").write_text(mjcf_text(quadruped.model, Extras(height=0.3)))
    (tmp_path / "scene.xml").write_text(scene_text("quadruped", "robot.xml", height=0.3))
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml"))
    assert model.geom("floor").type[0] == mujoco.mjtGeom.mjGEOM_PLANE
    assert model.body("base").pos[2] == 0.3


def test_contacts_of_massless_foot(quadruped):
    def weighs(mass):
        def foot(link):
            if link.name != "FL_foot":
                return link
            light = dataclasses.replace(link.inertial, mass=mass, inertia=1e-3 * mass * np.eye(3))
            return dataclasses.replace(link, inertial=light if mass else None)

        links = tuple(map(foot, quadruped.model.links))
        model = written(dataclasses.replace(quadruped.model, links=links))
        return model.body("FL_foot")

    none, next_to_none = weighs(0.0), weighs(1e-9)
    assert none.mass[0] == 0
    np.testing.assert_allclose(none.invweight0, next_to_none.invweight0, rtol=1e-4)


def test_joint_friction(quadruped):
    joints = [
        dataclasses.replace(joint, dynamics=Dynamics(source=joint.source, friction=0.25))
        if joint.name == "FL_hip_joint"
        else joint
        for joint in quadruped.model.joints
    ]
    model = written(dataclasses.replace(quadruped.model, joints=tuple(joints)))
    for joint in quadruped.joints:
        wanted = 0.25 if joint.name == "FL_hip_joint" else joint.friction
        assert model.joint(joint.name).frictionloss[0] == wanted
