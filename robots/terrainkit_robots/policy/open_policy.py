"""Open a policy from outside: an ONNX or TorchScript file, and the contract that describes it."""

import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from terrainkit.errors import (
    ConfigError,
    ExportError,
    TerrainkitWarning,
    one_line,
    prefixed_errors,
)
from terrainkit_robots.policy.contract_env import MappedPolicy, make_spec
from terrainkit_robots.policy.contracts.contract import UNITREE, Contract
from terrainkit_robots.policy.contracts.contract_robot import qpos_order, replace_joints
from terrainkit_robots.policy.contracts.deploy_yaml import YAML_FILE, read_yaml
from terrainkit_robots.policy.contracts.mjlab_metadata import JOINTS_KEY, read_metadata
from terrainkit_robots.policy.contracts.policy_json import (
    JSON_FILE,
    METADATA_KEY,
    check_policy_json,
    read_policy_json,
    to_contract,
)
from terrainkit_robots.policy.evaluate import EvaluationConfig, build_eval_env
from terrainkit_robots.policy.export import describe_policy, observation_order
from terrainkit_robots.policy.policy_file import PolicyFile, read_file
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.run import PolicySpec
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.spec.robot_arrays import Robot


@dataclass(frozen=True, kw_only=True)
class ForeignPolicy:
    """A policy in a file, with the text of its contract and where that text is."""

    policy: Any
    source: str
    text: bytes
    kind: str
    """Format of the contract: json, yaml or mjlab."""


def open_policy(
    path: Path, robot: str | Path, contract: Path | None = None, task: Task | None = None
) -> PolicySpec:
    """Open a policy from outside, which is evaluated like a run.

    Args:
        path: An ONNX or TorchScript file.
        robot: Name of a registered task, or folder of an onboarded robot. The contract replaces the
            order, pose, gains and limits of its joints, and the settings of its task.
        contract: The contract of the policy: `policy.json`, or a YAML file of Unitree's form. None
            for one beside the file, or else in its metadata.
        task: Task of your own, whose environment has further observation terms; None for the
            task of the robot.

    Raises:
        ConfigError: If a file cannot be read, the policy is for another robot, or the contract does
            not describe an environment that terrainkit can build.
    """
    registered, found = get_task(robot), find_contract(path, contract)
    model, task = Robot.load(registered.folder), task or registered.task
    if found.kind == "json":
        return _open_description(found, path, model, task)
    with prefixed_errors(f"{found.source}: "):
        parsed = read_contract(found, model)
        for doubt in parsed.doubts:
            message = f"{found.source}: {doubt.got}, so expected {doubt.expected}"
            warnings.warn(message, TerrainkitWarning, stacklevel=2)
        return make_spec(parsed, found.policy, model, task)


def find_contract(path: Path, contract: Path | None = None) -> ForeignPolicy:
    """Load a policy, and find its contract; see `open_policy`.

    Raises:
        ConfigError: If a file cannot be read, or there is no contract.
    """
    policy = PolicyFile(path)
    beside = path.with_name(JSON_FILE), path.with_name(YAML_FILE)
    for file in (contract,) if contract else (*beside, path.parent.parent / "params" / YAML_FILE):
        if contract or file.is_file():
            kind = "json" if file.suffix == ".json" else "yaml"
            return ForeignPolicy(policy=policy, source=str(file), text=read_file(file), kind=kind)
    for key, source, kind in (
        (METADATA_KEY, f"{JSON_FILE} in {path}", "json"),
        (JOINTS_KEY, f"metadata of {path}", "mjlab"),
    ):
        if key in policy.metadata:
            text = policy.metadata[key].encode()
            return ForeignPolicy(policy=policy, source=source, text=text, kind=kind)
    got = f"got no {JSON_FILE} or {YAML_FILE} beside it, and no metadata of terrainkit or mjlab"
    hint = f"expected one of them, or --contract FILE, such as --contract {YAML_FILE}"
    raise ConfigError(f"{path}: {got}; {hint}")


def read_contract(found: ForeignPolicy, robot: Robot) -> Contract:
    """Return the contract of a policy in the form of mjlab or Unitree.

    Raises:
        ConfigError: If it is damaged, or for another robot.
    """
    if found.kind == "json":
        try:
            return to_contract(read_policy_json(found.text), UNITREE)
        except (ConfigError, LookupError, TypeError, ExportError) as error:
            raise ConfigError(one_line(str(error))[:300]) from error
    if found.kind == "mjlab":
        return read_metadata(found.policy.metadata)
    return read_yaml(found.text, robot.spec.joint_order, qpos_order(robot))


def _open_description(found: ForeignPolicy, path: Path, robot: Robot, default: Task) -> PolicySpec:
    """Return a policy with terrainkit's own description."""
    policy = found.policy
    try:
        described = read_policy_json(found.text)
        task = default.from_table(described["task"], default.with_defaults(), "task.")
        model = replace_joints(robot, described["joints"], task.control.control_type)
        spec = PolicySpec(task=task, robot=model, policy=policy)
        env = build_eval_env(spec, Plane(), 1, EvaluationConfig())
        built = describe_policy(env)
        check_policy_json(described, built)
    except ConfigError as error:
        raise ConfigError(f"{found.source}: {one_line(str(error))[:300]}") from error
    sizes = built["observation"]["size"], env.num_actions
    if (policy.num_obs, policy.num_actions) != sizes:
        got = f"got {policy.num_obs} observations and {policy.num_actions} actions"
        raise ConfigError(
            f"{path}: {got}; expected {sizes[0]} and {sizes[1]}, as in {found.source}"
        )
    order = observation_order(env)
    table = np.repeat([[0.0], [0.0], [1.0], [-np.inf], [np.inf]], len(order), axis=1)
    table[0] = order
    return replace(spec, policy=MappedPolicy(policy, [table.astype(np.float32)]))
