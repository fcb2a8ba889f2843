"""Open a policy from outside: an ONNX or TorchScript file, and the contract that describes it."""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import isclose
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import torch
from numpy.typing import NDArray

from terrainkit.errors import (
    ConfigError,
    ExportError,
    TerrainkitWarning,
    one_line,
    prefixed_errors,
)
from terrainkit_robots.policy.contracts.contract import UNITREE, Contract, from_description
from terrainkit_robots.policy.contracts.deploy_yaml import YAML_FILE, read_yaml
from terrainkit_robots.policy.contracts.environment import make_spec
from terrainkit_robots.policy.contracts.mjlab import JOINTS_KEY, read_metadata
from terrainkit_robots.policy.contracts.robot import qpos_order, replace_joints
from terrainkit_robots.policy.evaluate import EvaluationConfig, build_eval_env
from terrainkit_robots.policy.export import (
    JSON_FILE,
    METADATA_KEY,
    describe_policy,
    observation_order,
)
from terrainkit_robots.policy.policy_file import PolicyFile, read_file
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.run import PolicySpec
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.spec.robot_arrays import Robot

_COMPARED = "format_version timing observation action control_type joints feet gait height_scan"
"""Keys that state what the policy receives and what its actions do."""

_OF_THE_ROBOT = ("joints.frictionloss", "joints.passive_damping")
"""Keys that may differ between the robot and the robot of the training."""


class _Description(msgspec.Struct):
    joints: dict[str, list[str | float | bool | None]]
    task: dict[str, Any] = {}


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
        for note in parsed.notes:
            warnings.warn(f"{found.source}: {note}", TerrainkitWarning, stacklevel=2)
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
            return from_description(msgspec.json.decode(found.text, type=dict[str, Any]), UNITREE)
        except (msgspec.DecodeError, UnicodeError, LookupError, TypeError, ExportError) as error:
            raise ConfigError(one_line(str(error))[:300]) from error
    if found.kind == "mjlab":
        return read_metadata(found.policy.metadata)
    return read_yaml(found.text, robot.spec.joint_order, qpos_order(robot))


def _open_description(found: ForeignPolicy, path: Path, robot: Robot, default: Task) -> PolicySpec:
    """Return a policy with terrainkit's own description."""
    policy = found.policy
    try:
        document = msgspec.json.decode(found.text, type=dict[str, Any])
        described = msgspec.convert(document, _Description)
        task = default.from_table(described.task, default.with_defaults(), "task.")
        kind = task.control.control_type
        model = replace_joints(robot, described.joints, kind)
        spec = PolicySpec(task=task, robot=model, policy=policy)
        env = build_eval_env(spec, Plane(), 1, EvaluationConfig())
        built = describe_policy(env)
        for key in _COMPARED.split():
            expected = dict(_leaves(built[key], key))
            for at, got in _leaves(document.get(key, {}), key):
                if not at.startswith(_OF_THE_ROBOT) and not _is_close(got, expected.get(at, ...)):
                    other = "the environment of task and joints has no such value"
                    if at in expected:
                        other = f"expected {expected[at]}, as in task and joints"
                    raise ConfigError(f"{at}: got {str(got)[:80]}; {other}")
    except (msgspec.DecodeError, UnicodeError, RecursionError, ConfigError) as error:
        raise ConfigError(f"{found.source}: {one_line(str(error))[:300]}") from error
    sizes = built["observation"]["size"], env.num_actions
    if (policy.num_obs, policy.num_actions) != sizes:
        got = f"got {policy.num_obs} observations and {policy.num_actions} actions"
        raise ConfigError(
            f"{path}: {got}; expected {sizes[0]} and {sizes[1]}, as in {found.source}"
        )
    return replace(spec, policy=_OrderedPolicy(policy, observation_order(env)))


class _OrderedPolicy:
    """A policy that receives its observations in the order of exported ones."""

    def __init__(self, policy: PolicyFile, order: NDArray[np.int64]) -> None:
        self.policy, self.__name__ = policy, policy.__name__
        self.num_obs, self.num_actions = policy.num_obs, policy.num_actions
        self._order = torch.from_numpy(order)

    def __call__(self, obs: torch.Tensor) -> Any:
        """Return actions (n, a) for observations of the environment."""
        return self.policy(obs[:, self._order])

    def reset(self, dones: torch.Tensor) -> None:
        """Clear the state of robots, a mask of shape (n,)."""
        self.policy.reset(dones)


def _leaves(value: Any, path: str) -> Iterator[tuple[str, Any]]:
    """Yield the path and the value of each number, text and null in a value of JSON."""
    if not isinstance(value, dict | list):
        yield path, value
        return
    for key, item in value.items() if isinstance(value, dict) else enumerate(value):
        yield from _leaves(item, f"{path}.{key}")


def _is_close(got: Any, built: Any) -> bool:
    numbers = isinstance(got, int | float) and isinstance(built, int | float)
    try:
        return isclose(got, built, rel_tol=1e-5, abs_tol=1e-6) if numbers else bool(got == built)
    except OverflowError:  # an integer beyond the range of float
        return False
