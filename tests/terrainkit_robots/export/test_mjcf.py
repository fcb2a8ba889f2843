from dataclasses import replace

import mujoco
import numpy as np
import pytest
import trimesh

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.model import Dynamics, Mimic
from terrainkit_robots.export.actuator import ActuatorConfig
from terrainkit_robots.export.canonical import to_canonical
from terrainkit_robots.export.mjcf import Extras, Site, mjcf_text, scene_text
from terrainkit_robots.export.sites import foot_sites, imu_site
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.transforms import quat_to_matrix
from tests.terrainkit_robots.export.made_models import (
    MJCF_MASS,
    SOURCE,
    at,
    joint,
    limits,
    link,
    mesh,
    model,
    shape,
    stl_of,
)


def written(robot, **extras):
    with quiet_mujoco():
        return mujoco.MjModel.from_xml_string(mjcf_text(robot, Extras(**extras)))


def kinematics(compiled, qpos, name):
    """Return the position and orientation of a body."""
    data = mujoco.MjData(compiled)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(compiled, data)
    return np.r_[data.body(name).xpos, data.body(name).xmat]


@pytest.fixture
def quadruped():
    facts = Facts(load_robot(bundled.urdf_path("quadruped")))
    return Facts(to_canonical(facts).model)


TURNED = at(0.1, 0.2, 0.3, [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
TURNING = {"origin": TURNED, "axis": np.array([0.0, 2, 0]), "limit": limits(-0.5, 1.5)}
LOSSES = Dynamics(source=SOURCE, damping=0.3, friction=0.4)
FOLLOWS = Mimic(source=SOURCE, joint="hip", multiplier=-2.0, offset=0.1)
LEG = model(
    link(
        "base",
        visuals=(shape("box", 0.1, 0.2, 0.3, color=(1, 0, 0.5, 1)), shape("sphere", 0.1)),
        collisions=(shape("cylinder", 0.1, 0.2, origin=TURNED, contype=2, conaffinity=4),),
    ),
    link("leg", collisions=(shape("sphere", 0.1), shape("sphere", 0.2))),
    link("foot"),
    link("toe", None, collisions=(shape("sphere", 0.1, origin=at(1, 0, 0)), shape("sphere", 0.1))),
    joint("hip", "revolute", "base", "leg", **TURNING, armature=0.5, dynamics=LOSSES),
    joint("slide", "prismatic", "leg", "foot", limit=None, mimic=FOLLOWS),
    joint("tip", "fixed", "foot", "toe"),
    floating=True,
)


def test_joints_are_written():
    made = written(LEG)
    root, hip, slide = (made.joint(name) for name in ("root", "hip", "slide"))
    assert [each.type[0] for each in (root, hip, slide)] == [0, 3, 2]
    assert (hip.axis.tolist(), hip.range.tolist()) == ([0, 1, 0], [-0.5, 1.5])
    assert [hip.damping[0], hip.frictionloss[0], hip.armature[0]] == [0.3, 0.4, 0.5]
    assert [slide.limited[0], slide.damping[0], slide.armature[0]] == [0, 0, 0]
    leg = made.body("leg")
    assert leg.pos.tolist() == [0.1, 0.2, 0.3]
    np.testing.assert_allclose(quat_to_matrix(leg.quat), TURNED[:3, :3], atol=1e-12)
    assert made.eq_data[0, :5].tolist() == [0.1, -2, 0, 0, 0]
    assert (made.eq_obj1id[0], made.eq_obj2id[0]) == (slide.id, hip.id)


def test_geoms_are_written():
    """Shapes have no mass, and only those that collide have a name."""
    made = written(LEG)
    names = ["", "", "base_collision", "leg_collision1", "leg_collision2"]
    names += ["toe_collision1", "toe_collision2"]
    assert [made.geom(k).name for k in range(made.ngeom)] == names
    assert made.geom_group.tolist() == [2, 2, 3, 3, 3, 3, 3]
    assert made.geom_contype.tolist() == [0, 0, 2, 1, 1, 1, 1]
    assert made.geom_conaffinity.tolist() == [0, 0, 4, 1, 1, 1, 1]
    assert made.geom_rgba[:2].tolist() == [[1, 0, 0.5, 1], pytest.approx([0.75, 0.77, 0.8, 1])]
    assert made.geom("base_collision").pos.tolist() == [0.1, 0.2, 0.3]
    assert made.body_mass.tolist() == [0, 1, 1, 1, 0]
    assert made.body("toe").ipos.tolist() == [0.5, 0, 0]  # the middle of its shapes


def test_inertias_are_written(quadruped):
    made = written(quadruped.model)
    for each in quadruped.links:
        body, rotation = made.body(each.name), each.inertial.origin[:3, :3]
        assert body.mass[0] == pytest.approx(each.inertial.mass, rel=1e-9)
        axes = quat_to_matrix(body.iquat)
        np.testing.assert_allclose(
            axes @ np.diag(body.inertia) @ axes.T,
            rotation @ each.inertial.inertia @ rotation.T,
            rtol=1e-6,
            atol=1e-7,  # MuJoCo before 3.14 diagonalizes with an error of 5e-8
        )


def test_meshes_have_a_name_for_each_file_and_scale(tmp_path):
    box = stl_of(trimesh.creation.box([1, 1, 1]))
    scales = [(1, 1, 1), (2, 1, 1)]
    shapes = [mesh("a.stl", scale, origin=at(0, 0, 0)) for scale in scales]
    shapes = [replace(each, mesh=replace(each.mesh, filename="a.stl")) for each in shapes]
    base = link("base", visuals=(*shapes, shapes[0]), collisions=(shapes[1],))
    (tmp_path / "a.stl").write_bytes(box)
    (tmp_path / "robot.xml").write_text(mjcf_text(model(base), Extras()))
    made = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    assert [made.mesh(k).name for k in range(made.nmesh)] == ["a", "a_2"]
    assert made.geom_dataid.tolist() == [0, 1, 0, 1]
    assert made.geom_size.max(axis=1).tolist() == pytest.approx([0.5, 1, 0.5, 1])


def test_several_joints_of_one_body(robot, tmp_path):
    """Two hinges and a slide on one body, off its origin and with references."""
    facts = robot(
        f"""<mujoco><compiler angle="radian"/><worldbody><body name="base">{MJCF_MASS}
        <body name="hip" pos="0.1 0.2 -0.3" quat="0.9 0.1 0.2 0.3">{MJCF_MASS}
          <joint name="a" axis="1 0 0" pos="0.01 0.02 0.03" ref="0.1"/>
          <joint name="b" axis="0 1 1" pos="-0.02 0 0.1" ref="-0.2"/>
          <joint name="c" type="slide" axis="0 0 1" ref="0.05"/>
          <body name="knee" pos="0 0 -0.2">{MJCF_MASS}
            <joint name="d" axis="0 1 0" pos="0 0 0.02"/></body>
        </body></body></worldbody></mujoco>"""
    )
    source = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    made = written(to_canonical(facts, floating=False).model)
    assert [made.joint(k).name for k in range(made.njnt)] == ["a", "b", "c", "d"]
    for qpos in np.random.default_rng(0).uniform(-1, 1, (3, 4)):
        for name in ("hip", "knee"):
            there, here = (kinematics(each, qpos, name) for each in (source, made))
            np.testing.assert_allclose(here, there, atol=1e-9)


def test_actuators_and_keyframe():
    """The order is the one of the actuators; a wheel is commanded its speed."""
    drives = {
        "slide": ActuatorConfig(stiffness=0, damping=0.5, velocity=7.0),
        "hip": ActuatorConfig(stiffness=20, damping=2, effort=5.0, armature=0.01),
    }
    pose = {"hip": 0.25, "slide": 0.5}
    made = written(LEG, actuators=drives, keyframe=pose, height=0.3, height_at_zero=0.4)
    speed, position = made.actuator(0), made.actuator(1)
    assert [made.joint(each.trnid[0]).name for each in (speed, position)] == ["slide", "hip"]
    assert (position.gainprm[0], position.biasprm[:3].tolist()) == (20, [0, -20, -2])
    assert (position.forcerange.tolist(), position.ctrlrange.tolist()) == ([-5, 5], [-0.5, 1.5])
    assert (speed.gainprm[0], speed.biasprm[:3].tolist()) == (0.5, [0, 0, -0.5])
    assert (bool(speed.forcelimited[0]), speed.ctrlrange.tolist()) == (False, [-7, 7])
    assert (made.joint("hip").armature[0], made.joint("slide").armature[0]) == (0.01, 0)
    key = made.key("home")
    assert key.qpos.tolist() == [0, 0, 0.3, 1, 0, 0, 0, 0.25, 0.5]
    assert key.ctrl.tolist() == [0, 0.25]
    assert made.body("base").pos.tolist() == [0, 0, 0.4]
    fixed = written(replace(LEG, floating=False), keyframe=pose, height=0.3, time_step=0.002)
    assert (fixed.key("home").qpos.tolist(), fixed.nu) == ([0.25, 0.5], 0)
    assert (fixed.body("base").pos.tolist(), fixed.opt.timestep) == ([0, 0, 0.3], 0.002)
    assert written(model(link("base"))).nkey == 0


def test_sites_and_sensors():
    """A frame with the name of another site is not written."""
    foot = Site(name="foot", body="foot", pose=TURNED, half_size=(0.1, 0.2, 0.3))
    frames = tuple(Site(name=name, body="base", pose=at(0, 0, 1)) for name in ("foot", "camera"))
    imu = Site(name="imu", body="leg", pose=np.eye(4))
    made = written(LEG, feet=(foot,), imu=imu, frames=frames)
    found = {made.site(k).name: made.site(k).bodyid[0] for k in range(made.nsite)}
    assert found == {"camera": 1, "imu": 2, "foot": 3}
    assert made.site("foot").size.tolist() == [0.1, 0.2, 0.3]
    assert made.site("foot").pos.tolist() == [0.1, 0.2, 0.3]
    names = ["orientation", "angular_velocity", "acceleration", "linear_velocity", "foot_contact"]
    assert [made.sensor(k).name for k in range(made.nsensor)] == names
    assert set(made.sensor_objtype.tolist()) == {mujoco.mjtObj.mjOBJ_SITE}
    assert written(LEG, imu=imu).nsensor == 4


def test_touch_sensors_carry_the_weight(quadruped):
    weight = quadruped.total_mass * 9.81
    drive = ActuatorConfig(stiffness=100, damping=2, effort=50.0, armature=0.01)
    extras = Extras(
        actuators={each.name: drive for each in quadruped.actuated},
        feet=foot_sites(quadruped),
        imu=imu_site(quadruped),
        keyframe=quadruped.default_pose,
        height=quadruped.stance.height,
    )
    floor = '<worldbody><geom type="plane" size="0 0 1"/>'
    text = mjcf_text(quadruped.model, extras).replace("<worldbody>", floor, 1)
    made = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(made)
    mujoco.mj_resetDataKeyframe(made, data, 0)
    for _ in range(400):
        mujoco.mj_step(made, data)
    felt = [data.sensor(f"{leg.foot}_contact").data[0] for leg in quadruped.legs]
    assert min(felt) > 0.1 * weight
    assert sum(felt) == pytest.approx(weight, rel=0.01)
    assert data.sensor("acceleration").data[2] == pytest.approx(9.81, abs=0.1)
    assert data.sensor("orientation").data[0] == pytest.approx(1, abs=1e-3)


def test_names_cannot_end_the_text():
    hostile = '"/><body name="x">&amp; é'
    robot = replace(LEG, name=hostile, links=(*LEG.links, link(hostile)))
    robot = replace(robot, joints=(*LEG.joints, joint("floor", "fixed", "leg", hostile)))
    made = written(robot)
    assert [made.body(k).name for k in range(4, made.nbody)] == ["toe", hostile]


def test_excluded_pairs():
    assert written(LEG).nexclude == 0
    robot = replace(LEG, excluded=frozenset({frozenset(("base", "foot"))}))
    assert written(robot).exclude_signature == [(1 << 16) + 3]


def test_scene(tmp_path):
    (tmp_path / "robot.xml").write_text(mjcf_text(LEG, Extras(height=0.3)))
    (tmp_path / "scene.xml").write_text(scene_text("leg", "robot.xml", height=0.3))
    made = mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml"))
    floor = made.geom("floor")
    assert (floor.type[0], floor.contype[0]) == (mujoco.mjtGeom.mjGEOM_PLANE, 2**31 - 1)
    assert made.body("base").pos[2] == 0.3
    assert (made.stat.center.tolist(), made.stat.extent) == ([0, 0, 0.15], 0.6)
    assert made.light_pos.tolist() == [[0, 0, 1.2]]
