import shutil
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit_robots.rl import config as sections
from terrainkit_robots.rl.config import Commands, DomainRand, Observations, Sim
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.symmetry import augment
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.spec.robot_arrays import Robot
from terrainkit_robots.spec.robot_spec import MirrorJoint

LEFT = np.array([0.05, 0.1, 0.02])
"""Position of the frame of the base of `left_frame` in the one of the biped [m]."""

_PAIRS = 4
"""Robots k and k + 4 of each environment are mirror images."""


class Valley(Plane):
    """A plane whose height scan sees a valley along x, symmetric about y = 0."""

    is_plane = False

    def height(self, x, y, *_, **__):
        return (0.3 * np.abs(y) + 0.1 * np.sin(3 * x)).astype(np.float32)


@pytest.fixture
def make_env(request, nominal_env):
    """Return a function that makes environments of a named or given robot."""

    def make(robot="quadruped", ground=None, **options):
        if robot in ("held_calves", "left_frame"):
            robot = Robot.load(request.getfixturevalue(robot))
        elif isinstance(robot, str):
            robot = request.getfixturevalue(robot)
        return nominal_env(
            2 * _PAIRS,
            ground,
            robot,
            observations=Observations(**options),
            commands=Commands(gait_period=0.4),
            domain_rand=DomainRand(push_interval_s=0.0, action_delay=None),
            sim=Sim(iterations=100, ls_iterations=50),  # so that both sides converge to the same
            terrain=sections.Terrain(foot_points_x=(-0.1, 0.2), foot_points_y=(-0.05, 0.05)),
        )

    return make


@pytest.fixture
def env(make_env):
    return make_env()


@pytest.fixture(scope="module")
def left_frame(biped, tmp_path_factory):
    """Return the folder of the biped with the frame of its base at the left hip."""
    folder = tmp_path_factory.mktemp("left") / "left_frame"
    shutil.copytree(biped.folder, folder, ignore=shutil.ignore_patterns("trained", "tasks"))
    path = folder / biped.spec.mjcf
    spec = mujoco.MjSpec.from_file(str(path))
    base = spec.body(biped.spec.base)
    base.ipos -= LEFT
    for child in (*base.bodies, *base.geoms, *base.sites):
        child.pos -= LEFT
    path.write_text(spec.to_xml())
    return folder


def center_of(env, rows):
    """Return positions and velocities of the center of the base, and the lever arms."""
    qpos, qvel = env.sim.qpos[rows], env.sim.qvel[rows]
    arms = np.array([rotate(quat, env.scene.center) for quat in qpos[:, 3:7]])
    turns = [rotate(quat, vel) for quat, vel in zip(qpos[:, 3:7], qvel[:, 3:6], strict=True)]
    return qpos[:, :3] + arms, qvel[:, :3] + np.cross(turns, arms), arms


def rotate(quat, vector):
    result = np.zeros(3)
    mujoco.mju_rotVecQuat(result, np.float64(vector), quat)
    return result


def mirror_physics(env, mirror):
    """Set random states in half of the environments, and mirror images in the others."""
    rng, p, scene = np.random.default_rng(3), env.sim, env.scene
    a, b = slice(0, _PAIRS), slice(_PAIRS, 2 * _PAIRS)
    # MuJoCo integrates the path of the frame. If it is beside the center, it is not mirrored
    # exactly, and contacts amplify the difference: these robots fly.
    height = env.robot.spawn_height + scene.center.any()
    p.qpos[a, :2] = rng.uniform(-1, 1, (_PAIRS, 2))
    p.qpos[a, 2] = height + rng.uniform(0, 0.02, _PAIRS)
    quat = np.array([1.0, 0, 0, 0]) + rng.uniform(-0.1, 0.1, (_PAIRS, 4))
    quat[:, 3] += rng.uniform(-2, 2, _PAIRS)
    p.qpos[a, 3:7] = quat / np.linalg.norm(quat, axis=1, keepdims=True)
    bent = env.robot.default_pose + rng.uniform(-0.1, 0.1, (_PAIRS, len(env.robot.default_pose)))
    p.qpos[a, scene.joint_qpos] = bent
    p.qvel[a] = rng.uniform(-0.5, 0.5, (_PAIRS, scene.model.nv))
    # The mirror image: y is negated, and so are rotations about x and z.
    p.qpos[b], p.qvel[b] = p.qpos[a], p.qvel[a]
    for k in (1, 4, 6):
        p.qpos[b, k] *= -1
    for k in (1, 3, 5):
        p.qvel[b, k] *= -1
    p.qpos[b, scene.joint_qpos] = mirror.joints(p.qpos[a, scene.joint_qpos])
    p.qvel[b, scene.joint_qvel] = mirror.joints(p.qvel[a, scene.joint_qvel])
    # The frame of the base may be beside its center, which is what is mirrored.
    for values, given, found in zip(
        (p.qpos, p.qvel), center_of(env, a)[:2], center_of(env, b)[:2], strict=True
    ):
        values[b, :3] += given * [1, -1, 1] - found


def mirror_memory(env, mirror):
    """Mirror the commands, actions and parameters of one half to the other."""
    from terrainkit_robots.rl.events import apply_params

    rng = np.random.default_rng(4)
    a, b = slice(0, _PAIRS), slice(_PAIRS, 2 * _PAIRS)
    env.set_commands(rng.uniform(-1, 1, (2 * _PAIRS, 3)).astype(np.float32))
    env.velocity_command.fixed[b] = env.velocity_command.fixed[a] * np.array([1, -1, -1])
    env.action_history[:, a] = rng.uniform(-0.2, 0.2, env.action_history[:, a].shape)
    env.action_history[:, b] = [mirror.actions(each) for each in env.action_history[:, a]]
    env.push_vel[a] = rng.uniform(-1, 1, (_PAIRS, 3)) * [1, 1, 0]
    env.push_vel[b] = env.push_vel[a] * np.array([1, -1, 1])
    env.joint_offset[b] = mirror.joints(env.joint_offset[a])
    env.lin_vel_bias[b] = env.lin_vel_bias[a] * np.array([1, -1, 1])
    env.state.mean_vel[b] = env.state.mean_vel[a] * np.array([1, -1, -1])
    env.steps_since_reset[a], env.steps_since_reset[b] = 3, 13  # half a period later
    d = env.params
    for same in (d.friction, d.geom_friction, d.added_mass, d.strength):
        same[b] = same[a]
    d.com_shift[b] = d.com_shift[a] * np.array([1, -1, 1])
    for each in (d.stiffness, d.damping):
        each[b] = each[a][:, mirror.joints.index]  # a factor has no direction
    apply_params(env.sim, env.params)


def assert_images(env, mirror, tolerance):
    for name, image in mirror.groups.items():
        values = env.get_observations()[name].numpy()
        one, other = values[:_PAIRS], values[_PAIRS:]
        width = 0
        for term, each in env.obs_terms[name].items():
            here = slice(width, width + each.function(env).shape[1])
            width = here.stop
            np.testing.assert_allclose(
                image(one)[:, here], other[:, here], atol=tolerance, err_msg=term
            )
        assert width == values.shape[1]


@pytest.mark.parametrize("name", ["quadruped", "biped", "held_calves", "left_frame"])
class TestRobot:
    @pytest.mark.parametrize("more", [False, True])
    def test_mirrored_actions_lead_to_mirrored_states(self, make_env, name, more):
        options = {"base_lin_vel": True, "foot_contact": True, "history_length": 3} if more else {}
        env = make_env(name, Valley() if more else None, **options)
        mirror = env.mirror_maps
        mirror_physics(env, mirror)
        mirror_memory(env, mirror)
        rng = np.random.default_rng(6)
        touched = False
        for _ in range(6):
            one = rng.uniform(-0.5, 0.5, (_PAIRS, env.num_actions)).astype(np.float32)
            actions = np.concatenate([one, mirror.actions(one)])
            env.step(torch.from_numpy(actions))
            touched |= bool((env.state.foot_force[..., 2] > 5).any())
            assert not env.state.fallen.any()
        assert touched != env.scene.center.any()
        scan = env.state.height_scan
        assert scan.shape[1] == (187 + 4 * len(env.robot.spec.feet)) * more
        assert not more or not np.allclose(scan[0], scan[_PAIRS])
        assert_images(env, mirror, 2e-3)
        a, b = slice(0, _PAIRS), slice(_PAIRS, 2 * _PAIRS)
        for given, found in zip(center_of(env, a)[:2], center_of(env, b)[:2], strict=True):
            np.testing.assert_allclose(given * [1, -1, 1], found, atol=1e-3)
        image = env.sim.qpos[a, 3:7] * [1, -1, 1, -1]
        np.testing.assert_allclose(image, env.sim.qpos[b, 3:7], atol=1e-4)
        rewards = env._compute_rewards(np.zeros(env.num_envs, bool))
        np.testing.assert_allclose(rewards[:_PAIRS], rewards[_PAIRS:], atol=1e-4)


class TestAugment:
    def test_originals_precede_images(self, env):
        mirror, obs = env.mirror_maps, env.get_observations()
        actions = torch.randn(8, 12)
        both, acted = augment(env, obs, actions)
        assert (both.batch_size, set(both.keys())) == (torch.Size([16]), {"policy", "privileged"})
        for name, image in mirror.groups.items():
            np.testing.assert_array_equal(both[name][:8], obs[name])
            np.testing.assert_array_equal(both[name][8:], image(obs[name].numpy()))
        np.testing.assert_array_equal(acted[:8], actions)
        np.testing.assert_array_equal(acted[8:], mirror.actions(actions.numpy()))

    def test_obs_or_actions_may_be_none(self, env):
        both, acted = augment(env, None, torch.zeros(2, 12))
        assert both is None
        assert acted.shape == (4, 12)
        both, acted = augment(env, env.get_observations()[:3], None)
        assert acted is None
        assert both["policy"].shape == (6, 141)

    def test_gradients_flow(self, env):
        actions = torch.zeros(1, 12, requires_grad=True)
        _, acted = augment(env, None, actions)
        acted.sum().backward()
        # Only the hip joints of a quadruped change their sign: 1 - 1, otherwise 1 + 1.
        assert sorted(actions.grad[0].tolist()) == [0] * 4 + [2] * 8


class TestErrors:
    @pytest.mark.parametrize(
        ("twin", "message"),
        [
            ({}, "FL_hip_joint is paired with nothing"),
            ({"FL_hip_joint": MirrorJoint(joint="RR_hip_joint", sign=-1)}, "paired with RR_hip"),
        ],
    )
    def test_joint_without_pair_is_rejected(self, make_env, quadruped, twin, message):
        mirror = {k: v for k, v in quadruped.spec.mirror.items() if k != "FL_hip_joint"} | twin
        env = make_env(replace(quadruped, spec=replace(quadruped.spec, mirror=mirror)))
        with pytest.raises(ConfigError, match=message):
            _ = env.mirror_maps

    def test_asymmetric_default_pose_is_rejected(self, make_env, quadruped):
        pose = quadruped.default_pose.copy()
        pose[1] += 0.1
        with pytest.raises(ConfigError, match="default_pose differs between left and right"):
            _ = make_env(replace(quadruped, default_pose=pose)).mirror_maps

    @pytest.mark.parametrize("table", ["stiffness", "damping", "effort"])
    def test_asymmetric_control_is_rejected(self, make_env, quadruped, table):
        values = quadruped.spec.per_joint(table)
        other = {**values, "RR_hip_joint": 1.1 * values["RR_hip_joint"]}
        env = make_env(replace(quadruped, spec=replace(quadruped.spec, **{table: other})))
        with pytest.raises(ConfigError, match=f"{table} differs between left and right: RL_hip"):
            _ = env.mirror_maps

    def test_feet_without_pairs_are_rejected(self, env):
        position = env.scene.foot_pos.copy()
        position[0] = position[2]  # two feet have the same mirror image
        env.scene.foot_pos = position
        with pytest.raises(ConfigError, match=f"symmetry: the foot {env.robot.spec.feet[2]} is"):
            _ = env.mirror_maps

    def test_asymmetric_scan_is_rejected(self, env):
        terrain = sections.Terrain(measured_points_y=(-0.5, 0.0, 0.4))
        leaning = LeggedEnv(replace(env.cfg, terrain=terrain), env.robot, Valley())
        with pytest.raises(ConfigError, match=r"y = -0\.5 m; expected another at y = 0\.5 m"):
            _ = leaning.mirror_maps

    def test_wrong_term_width_is_rejected(self, env):
        terms = env.obs_terms["policy"]
        terms["commands"] = replace(terms["commands"], symmetry="joints")
        with pytest.raises(ConfigError, match="commands: got 3 numbers; expected 12, as in its"):
            _ = env.mirror_maps
