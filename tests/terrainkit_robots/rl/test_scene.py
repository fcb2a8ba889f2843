from dataclasses import replace

import mujoco
import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit_robots.rl.config import Asset, Control, Sim
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.scene import build_scene
from terrainkit_robots.rl.simulation import Simulation
from terrainkit_robots.rl.terrain import MapTerrain, Plane
from terrainkit_robots.spec.robot import Robot


@pytest.fixture(scope="module")
def scene(cart, nominal_task):
    return build_scene(cart, Plane(), nominal_task())


def weight_of(scene):
    """Return the weight of the robot, without that of the ground."""
    return scene.model.body_subtreemass[scene.base] * 9.81


def contacts(model, qpos):
    """Return the names of the pairs of geoms in contact."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    return {frozenset(model.geom(g).name for g in contact.geom) for contact in data.contact}


class TestActuators:
    def test_are_in_the_order_of_the_spec(self, scene, cart):
        model = scene.model
        assert model.nu == 3
        driven = [model.joint(model.actuator(k).trnid[0]).name for k in range(3)]
        assert driven == list(cart.spec.joint_order)
        # The order in the MJCF is different.
        assert list(scene.joint_qpos) != sorted(scene.joint_qpos)

    def test_gains_and_limits_are_the_specs(self, scene):
        model = scene.model
        np.testing.assert_allclose(model.actuator_gainprm[:, 0], [0.4, 20, 20])
        np.testing.assert_allclose(
            model.actuator_biasprm[:, :3], [[0, 0, -0.4], [0, -20, -1.5], [0, -20, -1.5]]
        )
        np.testing.assert_allclose(model.actuator_forcerange, [[-3, 3], [-5, 5], [-6, 6]])
        assert model.actuator_forcelimited.all()

    def test_defaults_of_the_file_are_ignored(self, scene):
        # The file's default for motors has a gear of 7 and a limited control range.
        np.testing.assert_allclose(scene.model.actuator_gear[:, 0], 1)
        assert not scene.model.actuator_ctrllimited.any()

    def test_torque_limits_of_the_file_are_ignored(self, scene):
        # A joint of the file is limited to 1 N m; its effort in the spec is 6 N m.
        assert not scene.model.jnt_actfrclimited.any()

    def test_armature_is_the_specs_without_friction(self, scene):
        np.testing.assert_allclose(scene.model.dof_armature[scene.joint_qvel], [0.001, 0.01, 0.02])
        assert (scene.model.dof_frictionloss == 0).all()
        assert (scene.model.dof_armature[:6] == 0).all()

    def test_joint_friction_can_be_kept(self, cart, nominal_task):
        scene = build_scene(cart, Plane(), nominal_task(asset=Asset(joint_friction=True)))
        np.testing.assert_allclose(scene.model.dof_frictionloss[scene.joint_qvel], 0.3)

    def test_torque_control_adds_plain_motors(self, cart, nominal_task):
        model = build_scene(cart, Plane(), nominal_task(control=Control(control_type="T"))).model
        np.testing.assert_allclose(model.actuator_gainprm[:, 0], 1)
        assert (model.actuator_biasprm == 0).all()


class TestIndices:
    def test_home_is_the_default_pose(self, scene, cart):
        for name, position in zip(cart.spec.joint_order, cart.default_pose, strict=True):
            address = scene.model.joint(name).qposadr[0]
            assert scene.default_qpos[address] == pytest.approx(position)
        np.testing.assert_array_equal(scene.default_qpos[:7], [0, 0, 0, 1, 0, 0, 0])

    def test_joint_qvel_matches_joint_order(self, scene, cart):
        for k, name in enumerate(cart.spec.joint_order):
            assert scene.joint_qvel[k] == scene.model.joint(name).dofadr[0]

    def test_base_and_colliding_geoms(self, scene):
        assert scene.model.body(scene.base).name == "trunk"
        names = {scene.model.geom(g).name for g in scene.geoms}
        assert names == {"hull", "front_leg", "front_ball", "rear_leg", "tire"}

    def test_sensors_and_keyframes_of_file_are_removed(self, scene):
        assert scene.model.nkey == 0
        assert all(scene.model.sensor(k).name != "old" for k in range(scene.model.nsensor))

    def test_sensor_ranges_cover_all_sensors(self, scene):
        last = 0
        for block in scene.sensors.values():
            assert block.start == last
            last = block.stop
        assert last == scene.model.nsensordata

    def test_options_are_the_tasks(self, cart, nominal_task):
        task = nominal_task(sim=Sim(dt=0.002, iterations=7, ls_iterations=9))
        option = build_scene(cart, Plane(), task).model.opt
        assert option.timestep == 0.002
        assert option.iterations == 7
        assert option.ls_iterations == 9
        assert option.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL


class TestCollisions:
    def folded(self, scene, height=3.0):
        qpos = scene.default_qpos.copy()
        qpos[2] = height
        for name in ("front_hinge", "rear_hinge"):
            turn = 1.9 if name == "front_hinge" else -1.9
            qpos[scene.model.joint(name).qposadr[0]] = turn
        return qpos

    def test_no_self_collisions_by_default(self, scene):
        assert contacts(scene.model, self.folded(scene)) == set()

    def test_self_collisions_can_be_enabled(self, cart, nominal_task):
        scene = build_scene(cart, Plane(), nominal_task(asset=Asset(self_collisions=True)))
        touching = contacts(scene.model, self.folded(scene))
        assert any("ground" not in "".join(pair) for pair in touching)

    @pytest.mark.parametrize("self_collisions", [False, True])
    def test_all_solid_geoms_touch_the_ground(self, cart, nominal_task, self_collisions):
        scene = build_scene(
            cart, Plane(), nominal_task(asset=Asset(self_collisions=self_collisions))
        )
        qpos = scene.default_qpos.copy()
        qpos[2] = -0.5
        touching = {
            name
            for pair in contacts(scene.model, qpos)
            for name in pair
            if any("ground" in n for n in pair)
        }
        assert {"hull", "front_leg", "front_ball", "rear_leg", "tire"} <= touching
        assert "paint" not in touching

    def test_all_bodies_with_collision_geometry_collide(self, scene):
        bodies = scene.model.geom_bodyid[scene.geoms]
        assert {scene.model.body(k).name for k in bodies} == {"trunk", "front", "rear", "wheel"}

    def test_contact_friction_is_the_robots(self, scene):
        assert (scene.model.geom_priority[scene.geoms] == 1).all()
        assert (scene.model.geom_condim[scene.geoms] == 3).all()


class TestForces:
    def test_feet_carry_a_standing_robot(self, nominal_env):
        standing = nominal_env()
        for _ in range(50):
            standing.step(torch.zeros(4, 12))
        weight = weight_of(standing.scene)
        total = standing.state.foot_force.sum(axis=1)
        np.testing.assert_allclose(total[:, 2], weight, rtol=0.01)
        np.testing.assert_allclose(total[:, :2], 0, atol=0.02 * weight)
        assert (standing.state.foot_force[:, :, 2] > 0.1 * weight).all()
        assert (standing.state.penalized_force == 0).all()

    @pytest.mark.parametrize("collision", ["hfield", "boxes"])
    def test_feet_carry_the_robot_on_a_map(self, quadruped, nominal_task, mixed_map, collision):
        # The order of the two geoms depends on their types; the force must not.
        env = LeggedEnv(nominal_task(6), quadruped, MapTerrain(mixed_map, collision))
        env.curriculum.levels[:] = 0
        env.reset()
        for _ in range(60):
            env.step(torch.zeros(6, 12))
        np.testing.assert_allclose(
            env.state.foot_force.sum(axis=1)[:, 2], weight_of(env.scene), rtol=0.02
        )

    def test_trunk_carries_a_robot_on_its_back(self, cart, nominal_task):
        scene = build_scene(cart, Plane(), nominal_task(1))
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
        ],
    )
    def test_build_scene_rejects_mismatched_spec(self, cart, nominal_task, changes, message):
        other = Robot.from_spec(replace(cart.spec, **changes), cart.mjcf.parent)
        with pytest.raises(ConfigError, match=message) as caught:
            build_scene(other, Plane(), nominal_task())
        assert "\n" not in str(caught.value)

    def test_build_scene_rejects_unknown_joint(self, cart, nominal_task):
        tables = {
            name: {".*": 0.5}
            for name in (
                "default_pose", "stiffness", "damping", "effort", "velocity", "armature",
                "action_scale", "soft_limits",
            )
        }  # fmt: skip
        tables["soft_limits"] = {".*": (-1.0, 1.0)}
        spec = replace(cart.spec, joint_order=("wheel_axle", "fore_hinge"), **tables)
        with pytest.raises(ConfigError, match=r"joint_order of .*'fore_hinge'; cart\.xml has: "):
            build_scene(Robot.from_spec(spec, cart.mjcf.parent), Plane(), nominal_task())

    def test_build_scene_rejects_other_moving_bodies(self, cart, nominal_task, tmp_path):
        # qpos must start with the base.
        text = cart.mjcf.read_text().replace(
            '<body name="trunk"',
            '<body name="ball" pos="2 0 1"><freejoint/><geom size="0.1"/></body><body name="trunk"',
        )
        (tmp_path / "cart.xml").write_text(text.partition("<keyframe>")[0] + "</mujoco>")
        with pytest.raises(ConfigError, match="trunk") as caught:
            build_scene(Robot.from_spec(cart.spec, tmp_path), Plane(), nominal_task())
        assert "\n" not in str(caught.value)

    def test_build_scene_rejects_malformed_mjcf(self, cart, nominal_task, tmp_path):
        (tmp_path / "cart.xml").write_text("<mujoco><worldbody>")
        with pytest.raises(ConfigError, match="MuJoCo cannot read"):
            build_scene(Robot.from_spec(cart.spec, tmp_path), Plane(), nominal_task())
        assert not (tmp_path / "MUJOCO_LOG.TXT").exists()


class TestRobot:
    def test_are_in_the_order_of_the_spec(self, cart):
        np.testing.assert_allclose(cart.default_pose, [0.0, -0.2, 0.3], rtol=1e-6)
        np.testing.assert_allclose(cart.effort, [3.0, 5.0, 6.0])
        np.testing.assert_allclose(cart.velocity, [30.0, 10.0, 10.0])
        assert cart.default_pose.dtype == np.float32

    def test_joint_without_limits_is_unbounded(self, cart):
        np.testing.assert_allclose(cart.lower, [-np.inf, -0.9, -0.9], rtol=1e-6)
        np.testing.assert_allclose(cart.upper, [np.inf, 0.9, 0.9], rtol=1e-6)

    @pytest.mark.parametrize(
        ("stiffness", "damping", "wheel"), [(0.0, 1.0, True), (0.0, 0.0, False), (5.0, 1.0, False)]
    )
    def test_wheels_have_damping_and_no_stiffness(
        self, cart_spec, tmp_path, stiffness, damping, wheel
    ):
        spec = replace(cart_spec, stiffness={".*": stiffness}, damping={".*": damping})
        assert Robot.from_spec(spec, tmp_path).wheels.tolist() == [wheel] * len(spec.joint_order)

    def test_mjcf_is_beside_the_spec(self, cart):
        assert cart.mjcf.name == "cart.xml"
        assert cart.mjcf.is_file()

    @pytest.mark.parametrize("name", ["quadruped", "biped"])
    def test_bundled_robots_have_valid_arrays(self, name, request):
        robot = request.getfixturevalue(name)
        assert len(robot.default_pose) == len(robot.spec.joint_order)
        assert (robot.lower < robot.default_pose).all()
        assert (robot.default_pose < robot.upper).all()
        assert (robot.effort > 0).all()


class TestRobotErrors:
    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"floating": False}, "base of cart: got a fixed base"),
            ({"feet": ()}, "feet of cart: got none"),
            ({"spawn_height": None}, "lacks spawn_height or base_height_target"),
            ({"base_height_target": None}, "lacks spawn_height or base_height_target"),
            ({"effort": {"wheel_axle": 3.0}}, "effort"),
            ({"default_pose": {".*": 0.0, "ghost": 1.0}}, "ghost"),
        ],
    )
    def test_from_spec_rejects_incomplete_spec(self, cart_spec, tmp_path, changes, message):
        with pytest.raises(ConfigError, match=message) as caught:
            Robot.from_spec(replace(cart_spec, **changes), tmp_path)
        assert "\n" not in str(caught.value)

    def test_load_rejects_folder_without_spec(self, tmp_path):
        with pytest.raises(ConfigError, match=r"cannot read .*robot\.toml"):
            Robot.load(tmp_path)

    def test_load_rejects_missing_folder(self, tmp_path):
        with pytest.raises(ConfigError, match=r"cannot read .*robot\.toml"):
            Robot.load(tmp_path / "nowhere")
