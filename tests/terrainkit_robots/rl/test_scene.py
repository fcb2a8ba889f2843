from dataclasses import replace

import mujoco
import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit_robots.rl.config import Asset, Sim
from terrainkit_robots.rl.scene import Scene
from terrainkit_robots.rl.simulation import Simulation
from terrainkit_robots.rl.terrain import MapGround, Plane
from terrainkit_robots.spec.robot_arrays import Robot
from terrainkit_robots.spec.robot_spec import JOINT_TABLES


@pytest.fixture(scope="module")
def scene_of(cart, nominal_task):
    """Return a function that builds the scene of a cart on a plane."""
    return lambda robot=cart, **sections: Scene(robot, Plane(), nominal_task(**sections))


@pytest.fixture(scope="module")
def scene(scene_of):
    return scene_of()


def weight_of(scene):
    """Return the weight of the robot, without the ground."""
    return scene.model.body_subtreemass[scene.base] * 9.81


def contacts(model, qpos):
    """Return the names of the pairs of geoms in contact."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    return {frozenset(model.geom(g).name for g in contact.geom) for contact in data.contact}


@pytest.mark.parametrize(
    ("name", "hips"),
    [
        ("quadruped", ["FL_hip", "FR_hip", "RL_hip", "RR_hip"]),
        ("biped", ["left_hip_roll", "left_hip_yaw", "right_hip_roll", "right_hip_yaw"]),
        ("cart", []),  # its spec has no thighs
    ],
)
def test_hip_joints_move_legs_sideways(request, nominal_task, name, hips):
    robot = request.getfixturevalue(name)
    found = Scene(robot, Plane(), nominal_task()).hip_joints
    assert [robot.spec.joint_order[k] for k in found] == [f"{hip}_joint" for hip in hips]


def test_bodies_without_collision_shapes_touch_the_ground_alone(quadruped_of_feet, nominal_task):
    """The base is below the ground."""
    robot, touching, masses, counts = quadruped_of_feet, [], [], []
    for visual_collisions in (False, True):
        asset = Asset(visual_collisions=visual_collisions, self_collisions=True)
        scene = Scene(robot, Plane(), nominal_task(asset=asset))
        data = mujoco.MjData(scene.model)
        data.qpos[:] = scene.default_qpos
        mujoco.mj_forward(scene.model, data)
        bodies = scene.model.geom_bodyid[data.contact.geom]
        names = {frozenset(scene.model.body(body).name for body in pair) for pair in bodies}
        assert all("world" in pair for pair in names)
        touching.append(set().union(*names) - {"world"})
        masses.append(scene.model.body_mass.sum())
        counts.append(np.bincount(scene.model.geom_bodyid[scene.geoms]).tolist())
    assert touching[0] == set(robot.spec.feet)
    assert touching[1] > {robot.spec.base, *robot.spec.feet}
    assert masses[0] == masses[1]
    visual = np.bincount(scene.model.geom_bodyid[scene.model.geom_conaffinity == 0])
    expected = [before or shown for before, shown in zip(counts[0], visual.tolist(), strict=True)]
    assert counts[1] == expected  # a box for each visual geom of the other bodies


def test_sites_of_feet_are_at_the_geoms_that_touch_the_ground(scene_of, cart, tmp_path):
    """The foot is a leg with a cube below it, whose mesh has its origin elsewhere."""
    corners = [(x, y, z) for x in (1.0, 1.1) for y in (1.95, 2.05) for z in (3.0, 3.1)]
    mesh = " ".join(f"{value:g}" for corner in corners for value in corner)
    asset = f'<asset><mesh name="cube" vertex="{mesh}"/></asset><worldbody>'
    text = cart.mjcf.read_text().replace("<worldbody>", asset, 1)
    cube = 'type="mesh" mesh="cube" pos="-1 -2 -3.3"'
    text = text.replace('type="sphere" pos="0 0 -0.2" size="0.03"', cube)
    (tmp_path / "cart.xml").write_text(text)
    scene = scene_of(Robot.from_spec(cart.spec, tmp_path))
    np.testing.assert_allclose(scene.model.site("sole of front").pos, [0.05, 0, -0.25], atol=1e-6)
    data = mujoco.MjData(scene.model)
    data.qpos[:] = scene.default_qpos
    mujoco.mj_forward(scene.model, data)
    found = data.sensordata[scene.sensors["foot_position"]].reshape(-1, 3)
    np.testing.assert_allclose(found - scene.center, scene.foot_pos, atol=1e-6)


class TestActuators:
    def test_are_in_the_order_of_the_spec(self, scene, cart):
        model = scene.model
        driven = [model.joint(model.actuator(k).trnid[0]).name for k in range(model.nu)]
        assert driven == list(cart.spec.joint_order)
        # The order in the MJCF is different.
        assert list(scene.joint_qpos) != sorted(scene.joint_qpos)

    def test_defaults_of_the_file_are_ignored(self, scene):
        # The file's default for motors has a gear of 7 and a limited control range.
        np.testing.assert_allclose(scene.model.actuator_gear[:, 0], 1)
        assert not scene.model.actuator_ctrllimited.any()
        # A joint of the file is limited to 1 N m; its effort in the spec is 6 N m.
        assert not scene.model.jnt_actfrclimited.any()
        assert scene.model.nkey == 0
        assert all(scene.model.sensor(k).name != "old" for k in range(scene.model.nsensor))

    def test_armature_is_the_specs_and_friction_optional(self, scene_of, scene):
        np.testing.assert_allclose(scene.model.dof_armature[scene.joint_qvel], [0.001, 0.01, 0.02])
        assert (scene.model.dof_frictionloss == 0).all()
        assert (scene.model.dof_armature[:6] == 0).all()
        rough = scene_of(asset=Asset(joint_friction=True)).model
        np.testing.assert_allclose(rough.dof_frictionloss[scene.joint_qvel], 0.3)


class TestIndices:
    def test_home_is_the_default_pose(self, scene, cart):
        for k, name in enumerate(cart.spec.joint_order):
            joint = scene.model.joint(name)
            assert scene.joint_qvel[k] == joint.dofadr[0]
            assert scene.default_qpos[joint.qposadr[0]] == pytest.approx(cart.default_pose[k])
        np.testing.assert_array_equal(scene.default_qpos[:7], [0, 0, 0, 1, 0, 0, 0])

    def test_base_and_colliding_geoms(self, scene):
        model, geoms = scene.model, scene.geoms
        assert model.body(scene.base).name == "trunk"
        names = [model.geom(g).name for g in geoms]
        assert names == ["hull", "front_leg", "front_ball", "rear_leg", "tire"]
        # The friction of contacts is the robot's.
        assert (model.geom_priority[geoms] == 1).all()
        assert (model.geom_condim[geoms] == 3).all()

    def test_options_are_the_tasks(self, scene_of):
        option = scene_of(sim=Sim(dt=0.002, iterations=7, ls_iterations=9)).model.opt
        assert (option.timestep, option.iterations, option.ls_iterations) == (0.002, 7, 9)
        assert option.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL


class TestCollisions:
    def folded(self, scene, height=3.0):
        qpos = scene.default_qpos.copy()
        qpos[2] = height
        for name, turn in (("front_hinge", 1.9), ("rear_hinge", -1.9)):
            qpos[scene.model.joint(name).qposadr[0]] = turn
        return qpos

    def test_self_collisions_can_be_enabled(self, scene_of, scene):
        assert contacts(scene.model, self.folded(scene)) == set()
        scene = scene_of(asset=Asset(self_collisions=True))
        touching = contacts(scene.model, self.folded(scene))
        assert any("ground" not in "".join(pair) for pair in touching)

    @pytest.mark.parametrize("self_collisions", [False, True])
    def test_all_solid_geoms_touch_the_ground(self, scene_of, self_collisions):
        scene = scene_of(asset=Asset(self_collisions=self_collisions))
        qpos = scene.default_qpos.copy()
        qpos[2] = -0.5
        pairs = [pair for pair in contacts(scene.model, qpos) if any("ground" in n for n in pair)]
        touching = set().union(*pairs)
        assert {"hull", "front_leg", "front_ball", "rear_leg", "tire"} <= touching
        assert "paint" not in touching


class TestForces:
    @pytest.mark.parametrize("collision", ["hfield", "boxes"])
    def test_feet_carry_the_robot_on_a_map(self, nominal_env, mixed_map, collision):
        # The order of the two geoms depends on their types; the force must not.
        env = nominal_env(6, MapGround(mixed_map, collision))
        env.curriculum.levels[:] = 0
        env.reset()
        for _ in range(60):
            env.step(torch.zeros(6, 12))
        carried = env.state.foot_force.sum(axis=1)[:, 2]
        np.testing.assert_allclose(carried, weight_of(env.scene), rtol=0.02)

    def test_trunk_carries_a_robot_on_its_back(self, scene_of):
        scene = scene_of()
        sim = Simulation(scene, 1, 1)
        sim.qpos[0] = scene.default_qpos
        sim.qpos[0, 2:7] = (0.06, 0, 1, 0, 0)
        for _ in range(100):
            sim.step(4)
        up = -sim.sensor("termination_force")[0, 0]
        np.testing.assert_allclose(up, [0, 0, weight_of(scene)], atol=0.5)
        assert (sim.sensor("foot_force") == 0).all()


class TestBuildSceneErrors:
    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"base": "torso"}, "has no body 'torso', the base of its spec"),
            ({"base": "front"}, "front has no freejoint of its own"),
            ({"feet": ("hoof",)}, "feet of cart: got 'hoof'; cart.xml has: "),
            ({"termination_contacts": ("x",)}, "termination_contacts of cart: got 'x'"),
            ({"penalized_contacts": ("x",)}, "penalized_contacts of cart: got 'x'"),
            ({"mjcf": "gone.xml"}, "MuJoCo cannot read .*gone.xml"),
            (
                {table: {".*": 0.5} for table in JOINT_TABLES}
                | {"joint_order": ("wheel_axle", "fore_hinge"), "soft_limits": {}},
                r"joint_order of .*'fore_hinge'; cart\.xml has: ",
            ),
        ],
    )
    def test_scene_rejects_mismatched_spec(self, scene_of, cart, changes, message):
        other = Robot.from_spec(replace(cart.spec, **changes), cart.mjcf.parent)
        with pytest.raises(ConfigError, match=message) as caught:
            scene_of(other)
        assert "\n" not in str(caught.value)

    @pytest.mark.parametrize(
        ("first", "last", "message"),
        [
            ('<body name="ball" pos="2 0 1"><freejoint/><geom size="0.1"/></body>', "", "trunk"),
            ("", "<worldbody>", "MuJoCo cannot read"),
        ],
        ids=["other moving body", "malformed"],  # qpos must start with the base
    )
    def test_scene_rejects_mjcf(self, scene_of, cart, tmp_path, first, last, message):
        text = cart.mjcf.read_text().partition("<keyframe>")[0]
        text = text.replace('<body name="trunk"', f'{first}<body name="trunk"') + last
        (tmp_path / "cart.xml").write_text(text + "</mujoco>")
        with pytest.raises(ConfigError, match=message) as caught:
            scene_of(Robot.from_spec(cart.spec, tmp_path))
        assert "\n" not in str(caught.value)
        assert not (tmp_path / "MUJOCO_LOG.TXT").exists()
