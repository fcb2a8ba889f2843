import subprocess
import sys

import numpy as np
import pytest
import torch

from terrainkit_robots.policy.export import export_policy
from terrainkit_robots.rl.config import Env, Runner, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import create_run, open_run
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.spec.robot import Robot

TASK = Task(
    env=Env(num_envs=16, num_threads=1), runner=Runner(num_steps_per_env=12, save_interval=100)
)


@pytest.mark.parametrize(
    ("name", "joints", "width"), [("go2/urdf/go2.urdf", 12, 47), ("h1/urdf/h1.urdf", 10, 44)]
)
def test_real_robot_is_onboarded_trained_exported(
    robot_file, onboarded, tmp_path, name, joints, width
):
    folder = onboarded(robot_file(name)).folder
    robot = Robot.load(folder)
    assert len(robot.spec.joint_order) == joints
    run = create_run(tmp_path / "run", TASK, folder, "plane")
    torch.manual_seed(1)
    env = LeggedEnv(TASK, robot, Plane())
    runner = LeggedRunner(env, run.folder)
    before = [weight.detach().clone() for weight in runner.alg.actor.mlp.parameters()]
    runner.learn(20)  # too few iterations to walk: weights change and stay finite
    after = list(runner.alg.actor.mlp.parameters())
    assert all(not torch.equal(a, b) for a, b in zip(before, after, strict=True))
    assert all(torch.isfinite(weight).all() for weight in after)
    assert np.isfinite(env.sim.qpos).all()
    result = export_policy(open_run(run.folder), tmp_path / "policy", example=True)
    assert result.num_observations == width
    assert max(result.errors) <= 1e-5
    # The program for plain MuJoCo runs the robot of onboard, which has a keyframe and actuators.
    program = [sys.executable, tmp_path / "policy" / "run_policy.py", "--seconds", "0.1"]
    ended = subprocess.run(program, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    assert "m in 0.10 s" in ended.stdout
