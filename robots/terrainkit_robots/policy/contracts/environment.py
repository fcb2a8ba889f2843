"""The environment of a contract: terrainkit's terms, which a policy receives in its own form."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, cast

import numpy as np
import torch

from terrainkit.errors import ConfigError, listing
from terrainkit.settings.type_hint import MAX_VALUE
from terrainkit_robots.policy.contracts.contract import (
    DEFAULT_STEP_DT,
    Contract,
    ContractTerm,
    own_name,
)
from terrainkit_robots.policy.contracts.robot import contract_robot, imu_position
from terrainkit_robots.policy.evaluate import EvaluationConfig, build_eval_env
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.observations import ObservationTerm
from terrainkit_robots.rl.run import PolicySpec
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.spec.robot_arrays import Robot
from terrainkit_robots.transforms import FloatArray, projected_gravity

_SOURCES = {"absolute_dof_pos": "dof_pos", "grid_height_scan": "height_scan"}
"""Terms that are another order or offset of a term of the environment."""


class ContractEnv:
    """Part of an environment before a `LeggedEnv`: its policy gets raw terms, without scales.

    `ContractPolicy` scales and orders them. The history is terrainkit's: whole observations,
    the newest first. Several contracts with the same simulation share the robots in equal parts.
    """

    contracts: ClassVar[tuple[Contract, ...]]

    def observation_terms(self: Any) -> dict[str, dict[str, ObservationTerm]]:
        """Return the raw terms of the first contract by terrainkit's names."""
        groups = super().observation_terms()  # type: ignore[misc]
        known = groups["privileged"] | groups["policy"] | _other_terms(self.robot)
        history = known.pop("history", None)
        names = [_source(self.contracts[0], term, [*known]) for term in self.contracts[0].terms]
        if any(name.endswith("projected_gravity") for name in names):  # repairs exchange them
            names += ["projected_gravity", "xyzw_projected_gravity"]
        raw = {
            name: replace(known[name], offset=0.0, scale=1.0, clip=None, noise=0.0)
            for name in names
        }
        return groups | {"policy": raw | ({"history": history} if history else {})}

    def to_ctrl(self: Any, actions: FloatArray) -> FloatArray:
        """Return the targets of all joints for the actions of the contracts."""
        target = np.tile(self.action_offset, (len(actions), 1))
        joints, rows = list(self.robot.spec.joint_order), np.arange(len(actions))
        for contract, part in zip(self.contracts, np.split(rows, len(self.contracts)), strict=True):
            offset, scale = np.array([contract.action_offset, contract.action_scale], np.float32)
            values = offset + scale * actions[part]
            if contract.target_limits:
                low, high = np.array(contract.target_limits, np.float32).T
                values = np.clip(values, low, high)
            ids = np.array([joints.index(joint) for joint in contract.joints])
            target[part[:, None], ids] = values
        return target


def _other_terms(robot: Robot) -> dict[str, ObservationTerm]:
    """Return the terms of other projects that differ from terrainkit's."""
    lever = imu_position(robot)

    def running_phase(env: LeggedEnv) -> FloatArray:
        time = env.steps_since_reset * env.cfg.dt
        return env.gait.phases(time, np.ones(env.num_envs, bool))[0]

    return {
        "running_gait_phase": ObservationTerm(running_phase),
        "imu_lin_vel": ObservationTerm(
            lambda env: env.state.base_lin_vel + np.cross(env.state.base_ang_vel, lever)
        ),
        "xyzw_projected_gravity": ObservationTerm(
            lambda env: projected_gravity(np.roll(env.state.base_quat, 1, axis=1))
        ),
    }


def _source(contract: Contract, term: ContractTerm, known: Sequence[str]) -> str:
    """Return the term of the environment that has the numbers of a contract's term."""
    name = own_name(contract.style, term.name, known)
    is_imu = name == "base_lin_vel" and term.params.get("imu")
    return "imu_lin_vel" if is_imu else _SOURCES.get(name, name)


class ContractPolicy:
    """A policy that receives its observations in the form of its contract.

    Args:
        policy: The policy, from observations in that form to actions.
        contracts: Contracts that share the robots in equal parts.
        env: An environment of these contracts.
    """

    def __init__(
        self, policy: Callable[[Any], Any], contracts: Sequence[Contract], env: LeggedEnv
    ) -> None:
        self.policy, self.__name__ = policy, getattr(policy, "__name__", type(policy).__name__)
        terms = {k: v for k, v in env.obs_terms["policy"].items() if k != "history"}
        widths = {name: term.function(env).shape[1] for name, term in terms.items()}
        terrain = env.cfg.terrain
        grid = len(terrain.measured_points_x), len(terrain.measured_points_y)
        joints = list(env.robot.spec.joint_order)
        self._tables = [_table(contract, widths, joints, grid) for contract in contracts]

    @property
    def num_obs(self) -> int:
        """Number of observations in the form of the contract."""
        return int(self._tables[0].shape[1])

    def __call__(self, obs: torch.Tensor) -> Any:
        """Return actions (n, a) for raw observations of the environment."""
        inputs = []
        parts = np.split(obs.numpy(force=True), len(self._tables))
        for (index, offset, scale, low, high), part in zip(self._tables, parts, strict=True):
            values = np.clip(part[:, index.astype(int)] - offset, low, high) * scale
            inputs.append(values.astype(np.float32))
        return self.policy(torch.from_numpy(np.concatenate(inputs)))

    def reset(self, dones: torch.Tensor) -> None:
        """Clear the state of robots, a mask of shape (n,)."""
        if reset := getattr(self.policy, "reset", None):
            reset(dones)


def _table(
    contract: Contract, widths: dict[str, int], joints: list[str], grid: tuple[int, int]
) -> FloatArray:
    """Return index, offset, scale and limits of each number that a policy receives, shape (5, k).

    Args:
        contract: The contract.
        widths: Width of each raw term, in order.
        joints: Joints of the environment in order.
        grid: Numbers of points of the height scan along x and y.
    """
    starts, blocks = dict(zip(widths, np.cumsum([0, *widths.values()]), strict=False)), []
    ids = [joints.index(joint) for joint in contract.joints]
    for term in contract.terms:
        own, source = (
            own_name(contract.style, term.name, [*widths]),
            _source(contract, term, [*widths]),
        )
        index = starts[source] + np.arange(widths[source])
        if source in ("dof_pos", "dof_vel"):
            index = index[ids]
        elif own == "grid_height_scan":  # x varies fastest
            index = index.reshape(grid).T.ravel()
        if len(term.scale) not in (1, len(index)):
            got = f"got {len(term.scale)} numbers"
            raise ConfigError(f"scale of {term.name}: {got}; expected 1 or {len(index)}")
        index = index[list(term.columns)] if len(term.columns) == len(index) else index
        offset = contract.default_pose if own == "dof_pos" else term.params.get("offset", 0.0)
        rows = offset, term.scale, *(term.clip or (-np.inf, np.inf))
        table = np.stack([index, *(np.broadcast_to(row, len(index)) for row in rows)])
        past = np.array([[sum(widths.values())], [0], [0], [0], [0]])
        steps = [table + lag * past for lag in range(term.history)]
        blocks.append(steps if contract.newest_first else steps[::-1])
    if contract.is_interleaved:
        blocks = [list(step) for step in zip(*blocks, strict=True)]
    return np.concatenate([each for block in blocks for each in block], axis=1).astype(np.float32)


def make_spec(
    contract: Contract,
    policy: Callable[[Any], Any],
    robot: Robot,
    task: Task,
    contracts: Sequence[Contract] = (),
) -> PolicySpec:
    """Return a policy with the task and the robot of its contract.

    Args:
        contract: The contract.
        policy: The policy, which receives observations in the form of the contract.
        robot: The robot, whose joints and gains the contract replaces.
        task: The task, whose environment may have more observation terms.
        contracts: Contracts that differ in observations and actions and share the robots.

    Raises:
        ConfigError: If the contract does not fit the robot or the policy, or a term is unknown.
    """
    contracts = contracts or (contract,)
    own = contract_task(contract, task, (contract, *contracts)[-len(contracts) :])
    spec = PolicySpec(task=own, robot=contract_robot(contract, robot))
    env = build_eval_env(spec, Plane(), len(contracts), EvaluationConfig())
    mapped = ContractPolicy(policy, contracts, env)
    for name, got, expected in (
        ("observations", getattr(policy, "num_obs", mapped.num_obs), mapped.num_obs),
        ("actions", getattr(policy, "num_actions", env.num_actions), env.num_actions),
    ):
        if got != expected:
            terms = (f"{term.name} x {term.history}" for term in contract.terms)
            what = listing(terms) if name == "observations" else listing(contract.joints)
            raise ConfigError(f"got a network for {got} {name}; expected {expected}: {what}")
    return replace(spec, policy=mapped)


def contract_task(contract: Contract, task: Task, contracts: Sequence[Contract]) -> Task:
    """Return a task whose environment has the observations and the timing of a contract."""
    own = [own_name(contract.style, term.name, [term.name]) for term in contract.terms]
    history = max(term.history for term in contract.terms)
    if contract.is_interleaved and {term.history for term in contract.terms} != {history}:
        raise ConfigError("history_length: got several; expected one, with use_gym_history")
    step_dt, dt = contract.step_dt or DEFAULT_STEP_DT, contract.physics_dt or task.sim.dt
    decimation = max(1, round(step_dt / dt))
    commands: dict[str, Any] = {
        name.replace("ang_vel_z", "ang_vel_yaw"): limits
        for name, limits in contract.commands.items()
        if name in ("lin_vel_x", "lin_vel_y", "ang_vel_z")
    }
    for term in contract.terms:
        if "period" in term.params:
            commands["gait_period"] = term.params["period"]
    base: type = task.env_class or LeggedEnv
    space: dict[str, Any] = {"contracts": tuple(contracts), "__module__": base.__module__}
    env_class = type(base.__name__, (ContractEnv, base), space)
    space = {"env_class": env_class, "__module__": type(task).__module__}
    kind: Any = dataclass(frozen=True, kw_only=True)(type("Task", (type(task),), space))
    scan = any(name.endswith("height_scan") for name in own)
    changes: dict[str, dict[str, Any]] = {
        "control": {"control_type": "P", "decimation": decimation}
        | dict.fromkeys(("stiffness", "damping", "action_scale")),
        "sim": {"dt": step_dt / decimation},
        "observations": {
            "base_lin_vel": "base_lin_vel" in own,
            "foot_contact": "foot_contact" in own,
            "history_length": history,
        },
        "terrain": {"measure_heights": scan},
        "commands": commands,
        "normalization": {"clip_observations": MAX_VALUE, "clip_actions": MAX_VALUE},
    }
    values = {field.name: getattr(task, field.name) for field in fields(task)}
    changed = {name: replace(values[name], **keys) for name, keys in changes.items()}
    return cast("Task", kind(**values | changed))
