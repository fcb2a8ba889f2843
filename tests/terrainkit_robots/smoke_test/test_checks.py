import shutil
from dataclasses import replace

import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit_robots.description import bundled
from terrainkit_robots.policy.evaluate import eval_task
from terrainkit_robots.rl.config import Control, Env, Rewards, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.rewards import REWARDS
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.smoke_test import checks as module
from terrainkit_robots.smoke_test.checks import (
    SmokeTestResult,
    check_action_scale,
    check_observations,
    check_rewards,
    check_spawn_height,
    check_stand,
    check_standing,
    check_training,
    check_trends,
    random_state,
    run_checks,
    smoke_test,
)
from terrainkit_robots.smoke_test.short_training import TrainingRecord
from terrainkit_robots.spec.robot import Robot

RECORD = TrainingRecord(
    losses=[{"value": 0.1}],
    noise_std=0.7,
    first_rewards={},
    last_rewards={},
    falls=(0.0, 0.0),
    robot_seconds=100.0,
    error="",
)
TASK = Task(env=Env(num_envs=16, num_threads=1))


def failed(result):
    return {check.name for check in result.checks if not check.passed}


def replace_spec(robot, **values):
    return Robot.from_spec(replace(robot.spec, **values), robot.mjcf.parent)


def still_env(robot, **parts):
    return LeggedEnv(eval_task(replace(TASK, **parts), 4), robot, Plane())


@pytest.fixture
def env(quadruped):
    return LeggedEnv(TASK, quadruped, Plane())


def test_bundled_robot_can_be_trained(biped):
    fractions = []
    result = run_checks(biped, Task(), 1, fractions.append)
    assert fractions == [1.0]
    assert result.passed, failed(result)
    assert result.robot == "biped"
    names = [check.name for check in result.checks]
    assert names[:5] == [
        "environment initializes",
        "spawn height",
        "observation policy",
        "observation privileged",
        "stands for 1 s with zero action",
    ]
    assert names[5:7] == ["standing is not tracking", "action scale"]
    assert names[-1] == "trains for 1 iteration"
    assert {f"reward {name}" for name in ("torques", "collision", "stand_still")} < set(names)
    assert len(set(names)) == len(names)


def test_invalid_spec_fails_the_first_check(quadruped):
    result = run_checks(replace_spec(quadruped, penalized_contacts=("tail",)), Task(), 1)
    (check,) = result.checks
    assert not result.passed
    assert check.name == "environment initializes"
    assert "'tail'" in check.measured


@pytest.mark.parametrize(
    ("offset", "passed", "height"),
    [
        (0.0, True, "1.0 cm"),
        (0.009, True, "1.9 cm"),
        (0.3, False, "31.0 cm"),
        (-0.0105, True, "0.0 cm"),
        (-0.05, False, "-4.0 cm"),
    ],
)
def test_spawn_height_is_that_of_the_feet(quadruped, offset, passed, height):
    robot = replace_spec(quadruped, spawn_height=quadruped.spec.spawn_height + offset)
    check = check_spawn_height(still_env(robot))
    assert check.passed is passed
    assert height in check.measured
    assert f"spawn_height {robot.spec.spawn_height:.4g} m" in check.measured


def test_spawn_height_is_measured_at_the_lowest_corner(biped):
    assert check_spawn_height(still_env(biped)).passed
    pose = biped.spec.per_joint("default_pose")
    pose["left_ankle_pitch_joint"] += 0.2
    check = check_spawn_height(still_env(replace_spec(biped, default_pose=pose)))
    assert not check.passed
    assert "left_ankle_roll_link -" in check.measured


def test_spawn_height_names_the_raised_foot(quadruped):
    pose = quadruped.spec.per_joint("default_pose")
    pose["FL_calf_joint"] -= 0.4
    check = check_spawn_height(still_env(replace_spec(quadruped, default_pose=pose)))
    assert not check.passed
    assert "FL_foot 1.0 cm" not in check.measured
    assert "FR_foot 1.0 cm" in check.measured


def test_spawn_height_names_feet_without_shapes(quadruped):
    env = still_env(quadruped)
    foot = env.scene.model.body("FL_foot").id
    geoms = env.scene.geoms[env.scene.model.geom_bodyid[env.scene.geoms] != foot]
    env.scene = replace(env.scene, geoms=geoms)
    check = check_spawn_height(env)
    assert not check.passed
    assert "FL_foot has no shape" in check.measured


def test_observations_must_be_finite(env):
    assert all(check.passed for check in check_observations(env))
    env.get_observations()["policy"][3, 4] = torch.nan
    policy, privileged = check_observations(env)
    assert privileged.passed
    assert not policy.passed
    assert policy.measured == "47 numbers, some not finite"


@pytest.mark.parametrize(
    ("stiffness", "measured"), [(60.0, "% of its height"), (0.1, "fell after 0.")]
)
def test_weak_gains_do_not_stand(quadruped, stiffness, measured):
    control = Control(stiffness=stiffness, damping=min(stiffness, 2.0))
    check = check_stand(still_env(quadruped, control=control))
    assert check.passed is (stiffness > 10)
    assert measured in check.measured


def test_sunken_robot_does_not_stand(quadruped):
    robot = replace_spec(quadruped, termination_contacts=())
    check = check_stand(still_env(robot, control=Control(stiffness=1.0)))
    assert not check.passed
    assert "% of its height" in check.measured


def test_each_reward_is_checked(env):
    checks = list(check_rewards(env, {}))
    assert [check.name for check in checks] == [f"reward {name}" for name in env.reward_terms]
    assert all(check.passed for check in checks)


@pytest.mark.parametrize(
    ("reward", "passed", "measured"),
    [
        (lambda state: 0 * state.base_pos[:, 0], False, "0 in every state"),
        (lambda state: np.nan * state.base_pos[:, 0], False, "not finite"),
        (lambda state: np.full(len(state.base_pos), np.inf), False, "not finite"),
        (lambda state: state.base_pos[:, 0] > 10, True, "0: the rewarded event did not happen"),
    ],
)
def test_constant_rewards_fail(env, reward, passed, measured):
    env.reward_terms["torques"] = (lambda state, *_: reward(state), -0.1)
    (check,) = (check for check in check_rewards(env, {}) if check.name == "reward torques")
    assert (check.passed, check.measured) == (passed, measured)


def test_every_fourth_robot_stands_for_the_rewards(env):
    env.set_commands(np.full((env.num_envs, 3), 0.5, np.float32))
    stands = lambda state, *_: (state.commands == 0).all(axis=1).astype(float)  # noqa: E731
    env.reward_terms["torques"] = (stands, -0.1)
    (check,) = (check for check in check_rewards(env, {}) if check.name == "reward torques")
    assert check.measured == "0 to 1"


def test_unreachable_reward_fails(quadruped):
    env = still_env(replace_spec(quadruped, penalized_contacts=()))
    (check,) = (check for check in check_rewards(env, {}) if check.name == "reward collision")
    assert not check.passed
    assert check.measured == "0 in every state"
    assert "rewards.collision 0" in check.expected


def test_random_state_triggers_every_reward(quadruped):
    env = still_env(quadruped, rewards=Rewards(**dict.fromkeys(REWARDS, 1.0)))
    state = random_state(env.state, seed=1)
    for name, reward in REWARDS.items():
        assert reward(state, quadruped, env.cfg.rewards).any(), name


def test_standing_earns_a_quarter_of_the_tracking(quadruped):
    env = still_env(quadruped)
    assert check_standing(env).measured == "25%"
    wide = Rewards(tracking_ang_vel=0.0)
    robust = lambda state, *_: np.exp(-np.square(state.commands[:, 0]))  # noqa: E731
    env.reward_terms = {"tracking_lin_vel": (robust, wide.tracking_lin_vel)}
    assert not check_standing(env).passed


def test_large_action_scale_fails(quadruped):
    assert check_action_scale(still_env(quadruped)).passed
    check = check_action_scale(still_env(quadruped, control=Control(action_scale=0.5)))
    assert not check.passed
    assert check.measured.startswith("1.3 of the effort of FL_hip_joint")  # 60 * 0.5 / 23.7


def test_training_can_be_skipped(quadruped):
    names = [check.name for check in run_checks(quadruped, Task(), 0).checks]
    assert names[-1] == "reward stand_still"


def test_excessive_penalties_fail_with_their_names(quadruped, monkeypatch):
    monkeypatch.setattr(module, "MIN_TREND_SAMPLES", 1)
    rewards = Rewards(termination=0.0, ang_vel_xy=-100.0, dof_acc=-0.15)
    result = run_checks(quadruped, Task(rewards=rewards), 1)
    assert {"reward ang_vel_xy", "reward dof_acc"} <= failed(result)
    (check,) = (check for check in result.checks if check.name == "reward ang_vel_xy")
    assert "% of the positive rewards" in check.measured
    assert "a penalty of at most 200%" in check.expected
    assert "reward lin_vel_z" not in failed(result)
    assert [check.name for check in result.checks][-3:] == [
        "trains for 1 iteration",
        "reward does not drop",
        "falls do not increase",
    ]


def test_falls_may_outweigh_the_rewards(env):
    trained = dict.fromkeys(env.reward_terms, 0.1) | {"termination": -50.0, "torques": -50.0}
    checks = {check.name: check for check in check_rewards(env, trained)}
    assert checks["reward termination"].passed
    assert not checks["reward torques"].passed
    assert "trained -50.000 /s" in checks["reward torques"].measured


def test_training_fails_with_the_reason(quadruped, monkeypatch):
    torques = lambda state, *_: np.nan * state.base_pos[:, 0]  # noqa: E731
    monkeypatch.setitem(REWARDS, "torques", torques)
    result = run_checks(quadruped, Task(), 100_000)
    check = result.checks[-1]
    assert (check.name, check.passed) == ("trains for 0 iterations", False)
    assert "torques" in check.measured


@pytest.mark.parametrize(
    ("rewards", "falls", "names"),
    [
        (({"a": 1.0, "b": -2.0}, {"a": 1.0, "b": -1.5}), (0.1, 0.1), set()),
        (({"a": 1.0, "b": -2.0}, {"a": 1.0, "b": -2.1}), (0.1, 0.1), set()),  # 0.1 of 1.0
        (({"a": 1.0, "b": -2.0}, {"a": 0.9, "b": -2.1}), (0.1, 0.1), {"reward does not drop"}),
        # 100 and 142 falls: sqrt(242) is 15.6, and three times that 46.7
        (({"a": 1.0}, {"a": 1.0}), (1.0, 1.42), set()),
        (({"a": 1.0}, {"a": 1.0}), (1.0, 1.6), {"falls do not increase"}),
        (({"a": 1.0}, {"a": 1.0}), (0.0, 0.09), set()),
        (({"a": 1.0}, {"a": 1.0}), (0.0, 0.1), {"falls do not increase"}),
    ],
)
def test_trends_compare_quarters(rewards, falls, names):
    first, last = rewards
    record = replace(RECORD, first_rewards=first, last_rewards=last, falls=falls)
    assert {check.name for check in check_trends(record) if not check.passed} == names


@pytest.mark.parametrize(
    "changed", [{"losses": [{"value": np.nan}]}, {"noise_std": np.inf}, {"error": "diverged"}]
)
def test_training_must_be_finite(changed):
    assert check_training(RECORD).passed
    assert check_training(RECORD).measured == "value 0.1, noise std 0.7"
    check = check_training(replace(RECORD, **changed))
    assert not check.passed
    assert check.measured in ("diverged", "value nan, noise std 0.7", "value 0.1, noise std inf")


@pytest.fixture
def quick(monkeypatch):
    """Run one check instead of all."""

    def check(robot, *_):
        return SmokeTestResult(robot.spec.name, (check_spawn_height(still_env(robot)),))

    monkeypatch.setattr(module, "run_checks", check)


@pytest.mark.usefixtures("quick")
def test_smoke_test_onboards_a_file(tmp_path):
    urdf = tmp_path / "quadruped.urdf"
    shutil.copy(bundled.urdf_path("quadruped"), urdf)
    before = urdf.read_bytes()
    result = smoke_test(str(urdf))
    assert result.passed, failed(result)
    assert [check.name for check in result.checks] == ["can be onboarded", "spawn height"]
    assert [path.name for path in tmp_path.iterdir()] == ["quadruped.urdf"]
    assert urdf.read_bytes() == before


@pytest.mark.usefixtures("quick")
def test_smoke_test_rejects_a_file_with_errors(tmp_path):
    urdf = tmp_path / "bad.urdf"
    text = bundled.urdf_path("quadruped").read_text()
    urdf.write_text(text.replace('<mass value="', '<mass value="-', 1))
    (check,) = smoke_test(str(urdf)).checks
    assert (check.name, check.passed) == ("can be onboarded", False)
    assert "INR" in check.measured


@pytest.mark.usefixtures("quick")
def test_smoke_test_of_a_folder_uses_its_spec(tmp_path):
    folder = tmp_path / "robot"
    shutil.copytree(get_task("quadruped").folder, folder)
    text = (folder / "robot.toml").read_text()
    edited = text.replace("spawn_height = 0.344", "spawn_height = 0.644")
    assert edited != text
    (folder / "robot.toml").write_text(edited)
    (check,) = smoke_test(str(folder)).checks
    assert not check.passed
    assert check.measured.startswith("FL_foot 31.0 cm")


def test_smoke_test_rejects_unknown_names():
    with pytest.raises(ConfigError, match="biped, quadruped"):
        smoke_test("unicorn")
