"""Check a policy with its contract and a robot: values that do not fit, and a test in simulation.

If the robot does not follow its commands, the contract is tested with one value changed at a time,
such as another joint order or scale. A change with which the robot follows all of them names the
fault, if it also halves the errors: of so many changes, some make any policy a little better.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from terrainkit.errors import ConfigError, prefixed_errors
from terrainkit_robots.policy.contract_env import make_spec
from terrainkit_robots.policy.contracts.contract import (
    DEFAULT_STEP_DT,
    PER_JOINT,
    Contract,
    ContractError,
)
from terrainkit_robots.policy.contracts.contract_repairs import Repair, other_simulations, repairs
from terrainkit_robots.policy.contracts.contract_robot import load_model
from terrainkit_robots.policy.evaluate import EvaluationConfig, build_eval_env
from terrainkit_robots.policy.load_policy import load_policy, single_torch_thread
from terrainkit_robots.policy.open_policy import find_contract, read_contract
from terrainkit_robots.policy.policy_rollout import rollout
from terrainkit_robots.rl.config import Commands, Task
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.spec.robot_arrays import Robot
from terrainkit_robots.transforms import BoolArray, FloatArray

SECONDS = 4.0
"""Duration of the test [s]."""

SETTLING_SECONDS = 2.0
"""Part of the test without measurement [s]."""

SHORT_SECONDS = 2.0
"""Duration of the first test of a change [s]."""

COMMAND_SHARE = 0.75
"""Commands relative to their limits."""

NUM_REPAIRS = 12
"""Number of changes that are tested fully."""

FOLLOWED, MAX_DRIFT = (0.5, 1.6), 0.25
"""Range of each commanded velocity, relative to its command, and largest velocity while a robot is
commanded to stand [m/s, rad/s]."""

# The bundled policies have 0.94 and 0.86. Policies that bear latency and pushes also bear many
# faults: the quadruped had 0.849 with its history reversed, and followed all commands.
GOOD_SCORE = 0.85
"""Score, 0 to 1, below which changes are tested although the robot follows its commands."""

MAX_ERROR, SIMILAR, MAX_NAMED = 0.5, 0.05, 3
"""Largest error, 1 - score, of a change that names a fault, relative to the error without it; by
how much the scores of such changes may differ, and how many are named."""

_Result = tuple[float, list[str]]


@dataclass(frozen=True)
class Finding:
    """A finding: its code, what was found and what was expected, and how to fix it."""

    code: str
    got: str
    expected: str
    help: str


def check_policy(
    path: Path, robot: str | Path, contract: Path | None = None, task: Task | None = None
) -> list[Finding]:
    """Return what is wrong with a policy, its contract or its robot.

    Args:
        path: An ONNX or TorchScript file.
        robot: Name of a registered task, or folder of an onboarded robot.
        contract: The contract; None for one beside the file or in its metadata.
        task: Task of your own; None for the task of the robot.

    Raises:
        ConfigError: If a file cannot be read.
    """
    registered = get_task(robot)
    found = find_contract(path, contract)
    model = Robot.load(registered.folder)
    with prefixed_errors(f"{found.source}: "):
        parsed = read_contract(found, model)
    return check_contract(parsed, found.policy, model, task or registered.task)


@single_torch_thread()
def check_contract(
    contract: Contract, policy: Callable[[Any], Any], robot: Robot, task: Task
) -> list[Finding]:
    """Return what is wrong with a contract, or with the policy under it.

    Args:
        contract: The contract.
        policy: The policy, from observations in the order of the contract to actions.
        robot: The robot.
        task: The task, whose environment may have more observation terms.
    """
    findings = list(check_values(contract, robot))
    if not findings:
        try:
            make_spec(contract, policy, robot, task)
        except ConfigError as error:
            fault = error if isinstance(error, ContractError) else ContractError(str(error))
            hint = "correct the contract, or choose the robot"
            return [Finding("POL001", fault.got, fault.expected, hint)]
        findings = list(check_motion(contract, policy, robot, task))
    return findings


def check_values(contract: Contract, robot: Robot) -> Iterator[Finding]:
    """Yield the values of a contract that do not fit the robot or each other."""
    for doubt in contract.doubts:
        yield Finding("POL002", doubt.got, doubt.expected, "write one value for each motor")
    step = contract.step_dt or DEFAULT_STEP_DT
    if not 0.008 <= step <= 0.05:
        hint = "step_dt is the time between two actions [s]"
        yield Finding("POL003", f"step_dt {step:g} s", "0.008 to 0.05 s", hint)
    for term in contract.terms:
        if min(term.scale) <= 0:
            hint = "the sign of an axis belongs to the robot"
            yield Finding("POL006", f"scale of {term.name} {min(term.scale):g}", "above 0", hint)
    model = load_model(robot)
    for k, joint in enumerate(contract.joints):
        if joint in robot.spec.joint_order:
            yield from _joint_findings(contract, k, model.joint(joint), robot)
    own = robot.spec.per_joint("stiffness")
    ratios = [
        k / own[j] for k, j in zip(contract.stiffness, contract.joints, strict=True) if own.get(j)
    ]
    if ratios and not 0.25 <= (ratio := float(np.median(ratios))) <= 4:
        hint = "check that the gains are those of this robot, per radian"
        yield Finding("POL008", f"stiffness {ratio:.3g} times as in robot.toml", "0.25 to 4", hint)
    tables = {name: getattr(contract, name) for name in PER_JOINT}
    tables |= {
        f"scale of {term.name}": term.scale
        for term in contract.terms
        if len(term.scale) == len(contract.joints)
    }
    for name, values in tables.items():
        yield from _asymmetries(name, values, contract, robot)


def _joint_findings(contract: Contract, k: int, model: Any, robot: Robot) -> Iterator[Finding]:
    joint = contract.joints[k]
    pose, stiffness, damping, scale, offset = (getattr(contract, name)[k] for name in PER_JOINT)
    low, high = model.range if model.range[0] < model.range[1] else (-np.inf, np.inf)
    effort = robot.spec.per_joint("effort")[joint]
    for name, value in (("default position", pose), ("action offset", offset)):
        if not low - 0.02 <= value <= high + 0.02:
            hint = "positions are in radians, in the order of the joint names"
            got = f"{name} of {joint} {value:g}"
            yield Finding("POL004", got, f"{low:.3g} to {high:.3g}, its limits", hint)
    if abs(offset - pose) > 0.05:
        hint = "set the offset of the action to the default pose"
        got = f"action offset of {joint} {offset:g}"
        yield Finding("POL005", got, f"{pose:g}, its default position", hint)
    if scale <= 0:
        hint = "the sign belongs to the axis of the joint"
        yield Finding("POL006", f"action scale of {joint} {scale:g}", "above 0", hint)
    if stiffness * scale > 3 * effort:
        hint = "scales and gains are in radians"
        got = f"an action of 1 moves {joint} with {stiffness * scale:.3g} N m"
        yield Finding("POL007", got, f"at most 3 times its effort, {3 * effort:.3g} N m", hint)
    if stiffness and not 0.002 <= damping / stiffness <= 0.3:
        hint = "check that stiffness and damping are not exchanged"
        got = f"damping of {joint} {damping:g} at the stiffness {stiffness:g}"
        yield Finding("POL008", got, "0.002 to 0.3 of the stiffness", hint)


def _asymmetries(
    name: str, values: Sequence[float], contract: Contract, robot: Robot
) -> Iterator[Finding]:
    """Yield joints whose value differs from the value of their mirror image."""
    by_joint = dict(zip(contract.joints, values, strict=True))
    is_signed = name in ("default_pose", "action_offset")
    for joint, mirror in robot.spec.mirror.items():
        if mirror.joint in by_joint and joint in by_joint and joint <= mirror.joint:
            got = by_joint[joint]
            expected = by_joint[mirror.joint] * (mirror.sign if is_signed else 1)
            if abs(got - expected) > 0.05 * max(abs(got), abs(expected), 0.2):
                text = f"{name} of {joint} {got:g}, of its mirror image {by_joint[mirror.joint]:g}"
                hint = "check the order of the joints, and their signs"
                yield Finding("POL009", text, f"{expected:g}", hint)


def check_motion(
    contract: Contract, policy: Callable[[Any], Any], robot: Robot, task: Task
) -> Iterator[Finding]:
    """Yield what the robot does not do that it is commanded to do, and why."""

    def test(simulated: Contract, candidates: Sequence[Contract], seconds: float) -> list[_Result]:
        return score_contracts(simulated, candidates, policy, robot, task, seconds)

    ((score, motion),) = test(contract, [contract], SECONDS)
    if not motion and score >= GOOD_SCORE:
        return
    tried = list(repairs(contract, robot))
    short = test(contract, [repair.contract for repair in tried], SHORT_SECONDS)
    best = sorted(range(len(short)), key=lambda k: -short[k][0])[:NUM_REPAIRS]
    candidates = [tried[k] for k in best]
    scores = test(contract, [repair.contract for repair in candidates], SECONDS)
    for repair in other_simulations(contract, robot):
        tried.append(repair)
        candidates.append(repair)
        scores += test(repair.contract, [repair.contract], SECONDS)
    causes = find_causes(score, candidates, scores)
    if motion:
        none = f"tried {len(tried)} changes: with none, it follows all commands with half the error"
        hint = "see the other findings" if causes else none
        yield Finding("POL010", "; ".join(motion), "to follow the command", hint)
    yield from causes


def find_causes(
    score: float, candidates: Sequence[Repair], results: Sequence[_Result]
) -> list[Finding]:
    """Return the changes of a contract that name its fault: robots follow all commands, and well.

    Args:
        score: Score of the contract.
        candidates: The changes.
        results: Score of each change, and what its robots did not do.
    """
    pairs = zip(candidates, results, strict=True)
    follow = [(new, repair) for repair, (new, faults) in pairs if not faults]
    follow.sort(key=lambda pair: -pair[0])
    least = max([1 - MAX_ERROR * (1 - score), *(new - SIMILAR for new, _ in follow[:1])])
    findings = []
    for new, repair in follow[:MAX_NAMED]:
        if new > least:
            got = f"score {score:.2f} of 1 in simulation, and {new:.2f} if {repair.text}"
            hint = "correct the contract, or its reader"
            findings.append(Finding(repair.code, got, repair.text, hint))
    return findings


def score_contracts(
    simulated: Contract,
    contracts: Sequence[Contract],
    policy: Callable[[Any], Any],
    robot: Robot,
    task: Task,
    seconds: float,
) -> list[_Result]:
    """Return the score of each contract, 0 to 1, and what its robots did not do.

    All of them are simulated at once, with gains and timing of the contract `simulated`.
    """
    spec = make_spec(simulated, policy, robot, task, contracts)
    commands = motion_commands(spec.task.commands)[: None if seconds == SECONDS else 2]
    count, width = len(contracts), len(commands)
    env = build_eval_env(spec, Plane(), count * width, EvaluationConfig(seconds=seconds))
    actor = load_policy(spec, env)
    fallen = np.zeros(env.num_envs, bool)
    velocity = []
    start = min(SETTLING_SECONDS, seconds / 2)

    def act(obs: Any) -> torch.Tensor:
        actions = torch.as_tensor(actor(obs)).nan_to_num().clip(-1e3, 1e3)
        actor.reset(torch.from_numpy(fallen))  # type: ignore[attr-defined]
        return actions

    schedule = [np.tile(commands, (count, 1))] * round(seconds / env.cfg.dt)
    for k, (_, falls) in enumerate(rollout(env, act, schedule)):
        fallen |= falls
        if k * env.cfg.dt >= start:
            lin, ang = env.state.base_lin_vel[:, :2], env.state.base_ang_vel[:, 2]
            velocity.append(np.column_stack([lin, ang]))
    means = np.mean(velocity, axis=0).reshape(count, width, 3)
    falls = fallen.reshape(count, width)
    return [judge_motion(commands, mean, fell) for mean, fell in zip(means, falls, strict=True)]


def motion_commands(limits: Commands) -> FloatArray:
    """Return the commands of the test: to walk ahead, turn and sidestep while walking, and stand.

    Returns:
        Forward and left velocity [m/s] and yaw velocity [rad/s], shape (5, 3).
    """
    x, y, yaw = (
        COMMAND_SHARE * limit[1]
        for limit in (limits.lin_vel_x, limits.lin_vel_y, limits.ang_vel_yaw)
    )
    rows = [[x, 0, 0], [x / 2, 0, yaw], [x / 2, 0, -yaw], [x / 2, y, 0], [0, 0, 0]]
    return np.array(rows, np.float32)


def judge_motion(commands: FloatArray, means: FloatArray, fallen: BoolArray) -> _Result:
    """Return the score of a contract, and what its robots did not do.

    A command is followed if each velocity in it is.

    Args:
        commands: Forward and left velocity [m/s] and yaw velocity [rad/s], shape (c, 3).
        means: Mean velocities of the robots, shape (c, 3).
        fallen: Robots that fell, shape (c,).
    """
    scores, faults = [], []
    for command, mean, fell in zip(commands, means, fallen, strict=True):
        error = float(np.linalg.norm(mean - command)) / max(float(np.linalg.norm(command)), 0.5)
        scores.append(0.0 if fell else max(0.0, 1 - error))
        moves = f"it moves with {', '.join(f'{value:.2f}' for value in mean)}"
        if fell:
            moves = "it falls"
        elif command.any():
            ratio = mean[command != 0] / command[command != 0]
            if (ratio >= FOLLOWED[0]).all() and (ratio <= FOLLOWED[1]).all():
                continue
        elif np.abs(mean).max() <= MAX_DRIFT:
            continue
        faults.append(f"commanded {', '.join(f'{v:.2f}' for v in command)}, {moves}")
    return float(np.mean(scores)), faults
