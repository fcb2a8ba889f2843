"""Exports are read back exactly; histories, orders and joints of other projects."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit_robots.policy.contract_env import make_spec
from terrainkit_robots.policy.contracts.contract import ContractTerm
from terrainkit_robots.policy.evaluate import EvaluationConfig, build_eval_env
from terrainkit_robots.policy.load_policy import load_policy
from terrainkit_robots.policy.open_policy import find_contract, open_policy, read_contract
from terrainkit_robots.policy.policy_rollout import rollout
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.spec.robot_arrays import Robot

COMMANDS = np.array([[0.5, 0, 0.3], [0, 0, 0]], np.float32)


def roll(spec, steps, policy=None):
    """Return the actions of each step."""
    env, actions = build_eval_env(spec, Plane(), 2, EvaluationConfig()), []
    policy = policy or load_policy(spec, env)

    def act(obs):
        actions.append(torch.as_tensor(policy(obs)).clone())
        return actions[-1]

    for _ in rollout(env, act, [COMMANDS] * steps):
        pass
    return torch.stack(actions).numpy()


@pytest.mark.parametrize(("form", "file"), [("mjlab", "onnx"), ("yaml", "onnx"), ("script", "pt")])
def test_exports_are_read_back(all_forms, form, file):
    expected = roll(open_policy(all_forms / "export" / f"policy.{file}", "quadruped"), 60)
    spec = open_policy(all_forms / form / f"policy.{file}", "quadruped")
    np.testing.assert_allclose(roll(spec, 60), expected, atol=1e-4)  # rounding of TorchScript


@pytest.fixture
def contract(all_forms):
    robot = Robot.load(get_task("quadruped").folder)
    return read_contract(find_contract(all_forms / "yaml" / "policy.onnx"), robot)


def observed(contract, steps=4, robot=None):
    """Return what a policy of zeros observes in each step, shape (steps, k), of one robot."""
    seen = []

    def zero(obs):
        seen.append(obs[0].numpy())
        return torch.zeros(len(obs), len(contract.joints))

    robot = robot or Robot.load(get_task("quadruped").folder)
    roll(make_spec(contract, zero, robot, Task()), steps)
    return np.array(seen[-steps:])


def test_history_of_each_term_begins_with_the_oldest_step(contract):
    terms = ContractTerm(name="projected_gravity"), ContractTerm(name="joint_vel_rel")
    single = observed(replace(contract, terms=terms))
    gravity, speed = single[:, :3], single[:, 3:]
    deep = replace(terms[0], history=3), terms[1]
    result = observed(replace(contract, terms=deep))
    np.testing.assert_allclose(result[3], [*gravity[1], *gravity[2], *gravity[3], *speed[3]])
    np.testing.assert_allclose(result[0, :9], np.tile(gravity[0], 3))  # the first one fills it
    both = replace(terms[0], history=2), replace(terms[1], history=2)
    mixed = observed(replace(contract, terms=both, is_interleaved=True))
    np.testing.assert_allclose(mixed[3], [*single[2], *single[3]])
    newest = observed(replace(contract, terms=both, newest_first=True))
    np.testing.assert_allclose(newest[3], [*gravity[3], *gravity[2], *speed[3], *speed[2]])


def test_numbers_are_clipped_and_then_scaled(contract):
    plain = ContractTerm(name="joint_pos")
    pose = np.array(contract.default_pose)
    position = observed(replace(contract, terms=(plain,)))  # absolute in deploy.yaml
    limited = replace(plain, clip=(-1.0, 0.5), scale=tuple(range(1, 13)))
    expected = np.clip(position, -1, 0.5) * range(1, 13)
    np.testing.assert_allclose(observed(replace(contract, terms=(limited,))), expected, rtol=1e-5)
    relative = observed(replace(contract, terms=(ContractTerm(name="joint_pos_rel"),)))
    np.testing.assert_allclose(position - pose, relative, atol=1e-6)


@pytest.mark.parametrize("imu", [0.0, 1.0])
def test_margins_find_the_velocity_that_a_policy_observes(contract, imu):
    """They disturb the term `base_lin_vel`."""
    term = ContractTerm(name="base_lin_vel", params={"imu": imu})
    robot = Robot.load(get_task("quadruped").folder)
    spec = make_spec(replace(contract, terms=(term,)), lambda obs: obs, robot, Task())
    env = build_eval_env(spec, Plane(), 2, EvaluationConfig())
    assert list(env.obs_terms["policy"]) == ["base_lin_vel"]


def test_policies_may_move_some_joints_in_another_order(contract):
    names = "joints default_pose stiffness damping action_scale action_offset"
    order = [4, 1, 2, 5]
    some = {name: tuple(getattr(contract, name)[k] for k in order) for name in names.split()}
    one = replace(contract, terms=(ContractTerm(name="joint_pos"),))
    result = observed(replace(one, **some))
    assert result.shape == (4, 4)
    # The other joints are held by the robot's own gains, which are the same.
    np.testing.assert_allclose(result, observed(one)[:, order], atol=1e-6)


def test_targets_are_limited_and_have_an_offset(contract):
    offset = tuple(value + 0.1 for value in contract.default_pose)
    limits = tuple((value - 0.02, value + 0.05) for value in contract.default_pose)
    spec = make_spec(
        replace(contract, action_offset=offset, target_limits=limits),
        lambda obs: torch.zeros(len(obs), 12),
        Robot.load(get_task("quadruped").folder),
        Task(),
    )
    env = build_eval_env(spec, Plane(), 2, EvaluationConfig())
    actions = np.array([np.zeros(12), np.full(12, -9.0)], np.float32)
    expected = np.array(contract.default_pose) + np.array([[0.05], [-0.02]])
    np.testing.assert_allclose(env.to_ctrl(actions), expected, atol=1e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"terms": (ContractTerm(name="foo"),)}, "observation term 'foo': unknown; expected one"),
        ({"terms": (ContractTerm(name="last_action", scale=(1.0,) * 5),)}, "got 5 numbers; .* 12"),
        (
            {"terms": (ContractTerm(name="last_action"),)},
            "network for 141 observations; expected 12",
        ),
        ({"joints": tuple("abcdefghijkl")}, "joint names: got a, b, .*, which quadruped lacks"),
    ],
)
def test_contracts_that_do_not_fit_are_rejected(all_forms, contract, changes, message):
    policy = find_contract(all_forms / "yaml" / "policy.onnx").policy
    robot = Robot.load(get_task("quadruped").folder)
    with pytest.raises(ConfigError, match=message):
        make_spec(replace(contract, **changes), policy, robot, Task())
