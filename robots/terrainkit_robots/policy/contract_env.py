"""The environment of a contract: terrainkit's terms, which a policy receives in its own form."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import torch

from terrainkit.errors import listing
from terrainkit.perception.orientation import projected_gravity
from terrainkit.settings.type_hint import MAX_VALUE
from terrainkit_robots.policy.contracts.contract import (
    COMMAND_NAMES,
    DEFAULT_STEP_DT,
    Contract,
    ContractError,
    own_name,
)
from terrainkit_robots.policy.contracts.contract_robot import contract_robot, imu_position
from terrainkit_robots.policy.evaluate import EvaluationConfig, build_eval_env
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.observations import ObservationTerm, ObsTerms, PolicyInterface
from terrainkit_robots.rl.run import PolicySpec
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.spec.robot_arrays import Robot
from terrainkit_robots.transforms import FloatArray

_SOURCES = {"absolute_dof_pos": "dof_pos", "grid_height_scan": "height_scan"}
"""Terms that are another order or offset of a term of the environment."""


def _running_phase(env: LeggedEnv) -> FloatArray:
    return env.gait.phases(env.steps_since_reset * env.cfg.dt, np.ones(env.num_envs, bool))[0]


def _xyzw_gravity(env: LeggedEnv) -> FloatArray:
    return projected_gravity(np.roll(env.state.base_quat, 1, axis=1))


_OTHER_TERMS = {
    "running_gait_phase": ObservationTerm(_running_phase),
    "xyzw_projected_gravity": ObservationTerm(_xyzw_gravity),
}
"""Terms of other projects that differ from terrainkit's."""


class ContractInterface(PolicyInterface):
    """What policies observe and do by their contracts: raw terms, without scales.

    `ContractPolicy` scales and orders them. The history is terrainkit's: whole observations,
    the newest first. Several contracts with the same simulation share the robots in equal parts.
    """

    def __init__(self, contracts: Sequence[Contract]) -> None:
        self._contracts = contracts

    def observation_terms(self, env: LeggedEnv, groups: ObsTerms) -> dict[str, ObservationTerm]:
        """Return the raw terms of the first contract by terrainkit's names."""
        known = {**groups["privileged"], **groups["policy"], **_OTHER_TERMS}
        history = known.pop("history", None)
        contract = self._contracts[0]
        known["base_lin_vel"] = _velocity_term(contract, known["base_lin_vel"], env.robot)
        own = [own_name(contract.style, term.name, [*known]) for term in contract.terms]
        names = [_SOURCES.get(name, name) for name in own]
        if any(name.endswith("projected_gravity") for name in names):  # repairs exchange them
            names += ["projected_gravity", "xyzw_projected_gravity"]
        raw = {
            name: replace(known[name], offset=0.0, scale=1.0, clip=None, noise=0.0)
            for name in names
        }
        return raw | ({"history": history} if history else {})

    def to_ctrl(self, env: LeggedEnv, actions: FloatArray) -> FloatArray:
        """Return the targets of all joints for the actions of the contracts."""
        target = np.tile(env.actions.offset, (len(actions), 1))
        joints = list(env.robot.spec.joint_order)
        parts = np.split(np.arange(len(actions)), len(self._contracts))
        for contract, part in zip(self._contracts, parts, strict=True):
            offset, scale = np.array([contract.action_offset, contract.action_scale], np.float32)
            values = offset + scale * actions[part]
            if contract.target_limits:
                low, high = np.array(contract.target_limits, np.float32).T
                values = np.clip(values, low, high)
            ids = np.array([joints.index(joint) for joint in contract.joints])
            target[part[:, None], ids] = values
        return target


def _velocity_term(contract: Contract, own: ObservationTerm, robot: Robot) -> ObservationTerm:
    """Return the velocity of the point that a contract means: the IMU, or the base's frame."""
    has_imu = any(term.params.get("imu") for term in contract.terms)
    point = imu_position(robot) if has_imu else np.zeros(3, np.float32)

    def velocity(env: LeggedEnv) -> FloatArray:
        lever = point - env.scene.center
        return own.function(env) + np.cross(env.state.base_ang_vel, lever)

    return replace(own, function=velocity)


class MappedPolicy:
    """A policy that receives its observations in another form than the environment's.

    Args:
        policy: The policy, from observations in that form to actions.
        tables: Tables of the parts that share the robots equally, each of shape (5, k): index,
            offset, scale and limits of each number that the policy receives.
    """

    def __init__(self, policy: Callable[[Any], Any], tables: Sequence[FloatArray]) -> None:
        self.policy, self.__name__ = policy, getattr(policy, "__name__", type(policy).__name__)
        self._tables = tables

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


def _contract_tables(contracts: Sequence[Contract], env: LeggedEnv) -> list[FloatArray]:
    """Return the table of each contract, for an environment of these contracts."""
    terms = {name: term for name, term in env.obs_terms["policy"].items() if name != "history"}
    widths = {name: term.function(env).shape[1] for name, term in terms.items()}
    terrain = env.cfg.terrain
    joints = list(env.robot.spec.joint_order)
    grid = len(terrain.measured_points_x), len(terrain.measured_points_y)
    return [_table(contract, widths, joints, grid) for contract in contracts]


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
    starts = dict(zip(widths, np.cumsum([0, *widths.values()]), strict=False))
    blocks = []
    ids = [joints.index(joint) for joint in contract.joints]
    for term in contract.terms:
        own = own_name(contract.style, term.name, [*widths])
        source = _SOURCES.get(own, own)
        index = starts[source] + np.arange(widths[source])
        if source in ("dof_pos", "dof_vel"):
            index = index[ids]
        elif own == "grid_height_scan":  # x varies fastest
            index = index.reshape(grid).T.ravel()
        if len(term.scale) not in (1, len(index)):
            got = f"scale of {term.name}: got {len(term.scale)} numbers"
            raise ContractError(got, f"1 or {len(index)}")
        index = index[list(term.columns)] if len(term.columns) == len(index) else index
        offset = contract.default_pose if own == "dof_pos" else term.params.get("offset", 0.0)
        rows = offset, term.scale, *(term.clip or (-np.inf, np.inf))
        table = np.stack([index, *(np.broadcast_to(row, len(index)) for row in rows)])
        past = np.array([[sum(widths.values())], [0], [0], [0], [0]])
        steps = [table + lag * past for lag in range(term.history)]
        blocks.append(steps if contract.newest_first else steps[::-1])
    if contract.is_interleaved:
        blocks = [list(step) for step in zip(*blocks, strict=True)]
    return np.concatenate([table for block in blocks for table in block], axis=1).astype(np.float32)


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
    spec = PolicySpec(
        task=contract_task(contract, task),
        robot=contract_robot(contract, robot),
        interface=ContractInterface(contracts),
    )
    env = build_eval_env(spec, Plane(), len(contracts), EvaluationConfig())
    tables = _contract_tables(contracts, env)
    inputs, outputs = tables[0].shape[1], env.num_actions
    terms = listing(f"{term.name} x {term.history}" for term in contract.terms)
    for name, got, expected, what in (
        ("observations", getattr(policy, "num_obs", inputs), inputs, terms),
        ("actions", getattr(policy, "num_actions", outputs), outputs, listing(contract.joints)),
    ):
        if got != expected:
            raise ContractError(f"got a network for {got} {name}", f"{expected}: {what}")
    return replace(spec, policy=MappedPolicy(policy, tables))


def contract_task(contract: Contract, task: Task) -> Task:
    """Return a task whose environment has the observations and the timing of a contract."""
    own = [own_name(contract.style, term.name, [term.name]) for term in contract.terms]
    history = max(term.history for term in contract.terms)
    if contract.is_interleaved and {term.history for term in contract.terms} != {history}:
        raise ContractError("history_length: got several", "one, with use_gym_history")
    step_dt, dt = contract.step_dt or DEFAULT_STEP_DT, contract.physics_dt or task.sim.dt
    decimation = max(1, round(step_dt / dt))
    commands: dict[str, Any] = {
        COMMAND_NAMES[name]: limits
        for name, limits in contract.commands.items()
        if name in COMMAND_NAMES
    }
    for term in contract.terms:
        if "period" in term.params:
            commands["gait_period"] = term.params["period"]
    return replace(
        task,
        control=replace(
            task.control,
            control_type="P",
            decimation=decimation,
            stiffness=None,
            damping=None,
            action_scale=None,
        ),
        sim=replace(task.sim, dt=step_dt / decimation),
        observations=replace(
            task.observations,
            base_lin_vel="base_lin_vel" in own,
            foot_contact="foot_contact" in own,
            history_length=history,
        ),
        terrain=replace(
            task.terrain, measure_heights=any(name.endswith("height_scan") for name in own)
        ),
        commands=replace(task.commands, **commands),
        normalization=replace(
            task.normalization, clip_observations=MAX_VALUE, clip_actions=MAX_VALUE
        ),
    )
