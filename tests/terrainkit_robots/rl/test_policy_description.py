import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import torch

from terrainkit_robots.policy.description import description
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.rl.config import Control, Env, Noise, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.terrain import Plane

SMALL = Task(env=Env(num_envs=4, num_threads=1))


def raw(env, told):
    """Return what is measured, from the state of the physics alone; one robot a row."""
    qpos, qvel = np.array(env.sim.qpos), np.array(env.sim.qvel)
    turns = np.zeros((len(qpos), 9))
    for turn, pose in zip(turns, qpos, strict=True):
        mujoco.mju_quat2Mat(turn, pose[3:7])
    turns = turns.reshape(-1, 3, 3)
    found = {
        "commands": env.commands,
        "projected_gravity": -turns[:, 2],
        "base_ang_vel": qvel[:, 3:6],
        "dof_pos": qpos[:, env.scene.joint_qpos],
        "dof_vel": qvel[:, env.scene.joint_qvel],
        "actions": env.actions[0],
    }
    if told["height_scan"]:
        yaw = np.arctan2(turns[:, 1, 0], turns[:, 0, 0])[:, None]
        x, y = np.array(told["height_scan"]["points"]).T
        at_x = qpos[:, :1] + np.cos(yaw) * x - np.sin(yaw) * y
        at_y = qpos[:, 1:2] + np.sin(yaw) * x + np.cos(yaw) * y
        ground = env.terrain.height(at_x.astype(np.float32), at_y.astype(np.float32))
        found["height_scan"] = qpos[:, 2:3] - ground
    return found


@pytest.mark.parametrize("kind", ["plane", "map"])
def test_observations_made_from_the_json_are_those_of_the_environment(quadruped, map_ground, kind):
    task = replace(SMALL, noise=Noise(noise_level=0.0))
    task = replace(task, domain_rand=replace(task.domain_rand, joint_offset=0.0))
    env = LeggedEnv(task, quadruped, Plane() if kind == "plane" else map_ground)
    told = json.loads(json.dumps(description(env)))
    assert told["observation"]["size"] == {"plane": 45, "map": 45 + 187}[kind]
    generator = torch.Generator().manual_seed(0)
    for _ in range(30):
        env.step(torch.randn(4, 12, generator=generator))
        seen = []
        for part in told["observation"]["parts"]:
            value = raw(env, told)[part["name"]] - part["offset"]
            seen.append(np.clip(value, *part.get("clip", (-np.inf, np.inf))) * part["scale"])
            assert seen[-1].shape[1] == part["stop"] - part["start"]
        clip = told["observation"]["clip"]
        obs = np.clip(np.concatenate(seen, axis=1), -clip, clip)
        np.testing.assert_allclose(obs, env.get_observations()["policy"], atol=1e-4)


@pytest.mark.parametrize("name", ["quadruped", "cart"])
@pytest.mark.parametrize("kind", ["P", "V", "T"])
def test_torques_from_the_json_are_those_of_the_motors(request, name, kind):
    robot = request.getfixturevalue(name)
    task = replace(SMALL, control=Control(control_type=kind, damping=1.5))
    env = LeggedEnv(task, robot, Plane())
    told = description(env)
    joints = {name: np.array(value) for name, value in told["joints"].items()}
    assert told["control_type"] == kind
    drives = {"P": "position", "V": "velocity", "T": "torque"}
    assert list(joints["drive"]) == [
        "velocity" if kind == "P" and joint == "wheel_axle" else drives[kind]
        for joint in robot.spec.joint_order
    ]
    scene, model, data = env.scene, env.scene.model, mujoco.MjData(env.scene.model)
    assert [model.actuator(k).name for k in range(model.nu)] == list(joints["name"])
    rng = np.random.default_rng(1)
    count, clipped = env.num_actions, 0
    for _ in range(10):
        action = rng.normal(0, 2, count).astype(np.float32)
        data.qpos[scene.joint_qpos] = rng.normal(0, 0.5, count)
        data.qvel[scene.joint_qvel] = rng.normal(0, 5, count)
        data.ctrl[:] = env.control.told(action[None], np.zeros((1, count), np.float32))[0]
        with quiet_mujoco():
            mujoco.mj_forward(model, data)
        target = joints["action_offset"] + joints["action_scale"] * action
        torque = joints["gain"] * target
        torque -= joints["stiffness"] * data.qpos[scene.joint_qpos]
        torque -= joints["damping"] * data.qvel[scene.joint_qvel]
        wanted = np.clip(torque, -joints["effort"], joints["effort"])
        np.testing.assert_allclose(data.actuator_force, wanted, rtol=1e-5, atol=1e-4)
        clipped += (wanted != torque).sum()
    assert clipped > 0
