"""Open a policy from outside: an ONNX file, and the JSON that describes it as in an export."""

from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import replace
from math import isclose
from pathlib import Path
from threading import Thread
from typing import Any

import msgspec
import onnxruntime
import torch

from terrainkit.errors import ConfigError, listing
from terrainkit.files.child_process import ProcessError, run_in_process
from terrainkit_robots.files import open_regular
from terrainkit_robots.policy.evaluate import EvaluationConfig, build_eval_env
from terrainkit_robots.policy.export import JSON_FILE, METADATA_KEY, describe_policy
from terrainkit_robots.policy.onnx_model import (
    LIMITS,
    call_model,
    load_model,
    make_session,
    make_state,
)
from terrainkit_robots.rl.run import PolicySpec
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.spec.robot import Robot
from terrainkit_robots.transforms import FloatArray

MAX_FILE_SIZE = 1 << 28
"""Largest ONNX or JSON file that is read [bytes]."""

_TABLES = {
    "P": ("effort", "velocity", "armature", "stiffness", "damping", "action_scale"),
    "V": ("effort", "velocity", "armature", "damping"),
    "T": ("effort", "velocity", "armature"),
}
"""Tables of a robot's spec that `joints` replaces, by control type."""

_COMPARED = "format_version timing observation action control_type joints feet gait height_scan"
"""Keys that state what the policy receives and what its actions do."""

_OF_THE_ROBOT = ("joints.frictionloss", "joints.passive_damping")
"""Keys that may differ between the robot and the robot of the training."""


class _Description(msgspec.Struct):
    joints: dict[str, list[str | float | bool | None]]
    task: dict[str, Any] = {}


class OnnxPolicy:
    """A policy in an ONNX file, from observations (n, k) to actions (n, a).

    It keeps the state of a recurrent network; `reset` clears it for robots whose episodes ended.
    """

    def __init__(self, path: Path) -> None:
        """Load a file, and call it once.

        Args:
            path: The ONNX file.

        Raises:
            ConfigError: If the file is not a policy.
        """
        self.__name__ = path.name
        try:
            loaded = run_in_process(
                load_model, _read(path), path.parent, METADATA_KEY, limits=LIMITS
            )
        except ProcessError as error:
            raise ConfigError(f"{path} is not a policy: {error}") from error
        self.num_obs, self.num_actions = loaded["sizes"].tolist()
        self.description = loaded["text"].tobytes()
        self._session = make_session(loaded["model"].tobytes())
        self._sizes, self._state = loaded["state"].tolist(), make_state((), 0)

    def __call__(self, obs: torch.Tensor) -> FloatArray:
        """Return actions (n, a) for observations (n, k).

        Raises:
            ConfigError: If the model fails, or exceeds the limits of :mod:`.onnx_model`.
        """
        if self._sizes and (not self._state or self._state[0].shape[1] != len(obs)):
            self._state = make_state(self._sizes, len(obs))
        result: Future[list[FloatArray]] = Future()
        options = onnxruntime.RunOptions()
        options.log_severity_level = 4
        # A signal interrupts waiting for a thread, but not a call of native code. The process does
        # not wait for a daemon thread when it ends.
        arguments = result, self._session, obs.numpy(force=True), self._state, options
        Thread(target=_set_result, args=arguments, daemon=True).start()
        try:
            actions, *self._state = result.result(LIMITS.seconds)
            return actions
        except TimeoutError:
            raise ConfigError(f"{self.__name__} takes more than {LIMITS.seconds:g} s") from None
        except ConfigError as error:
            raise ConfigError(f"{self.__name__} {_one_line(error)}") from error
        finally:
            options.terminate = True  # ends the call if it is still running

    def reset(self, dones: torch.Tensor) -> None:
        """Clear the state of robots, a mask of shape (n,)."""
        for part in self._state:
            part[:, dones.numpy(force=True)] = 0


def _set_result(result: Future[list[FloatArray]], *arguments: Any) -> None:
    try:
        result.set_result(call_model(*arguments))
    except Exception as error:
        result.set_exception(error)


def open_onnx(path: Path, robot: str | Path) -> PolicySpec:
    """Open an exported policy, which is evaluated like a run.

    Args:
        path: The ONNX file, with `policy.json` beside it, or else in its metadata.
        robot: Name of a registered task, or folder of an onboarded robot. The JSON replaces the
            order, pose, gains and limits of its joints, and the settings of its task.

    Raises:
        ConfigError: If a file cannot be read, the policy is for another robot, or the JSON does not
            describe the environment that terrainkit builds from it.
    """
    policy, found, beside = OnnxPolicy(path), get_task(robot), path.with_name(JSON_FILE)
    if not beside.is_file() and not policy.description:
        got = f"got no {JSON_FILE} beside it, nor in its metadata (key {METADATA_KEY})"
        raise ConfigError(f"{path}: {got}; terrainkit export writes both")
    text = _read(beside) if beside.is_file() else policy.description
    source = str(beside) if beside.is_file() else f"{JSON_FILE} in {path}"
    try:
        document = msgspec.json.decode(text, type=dict[str, Any])
        described = msgspec.convert(document, _Description)
        task = found.task.from_table(described.task, found.task.with_defaults(), "task.")
        kind = task.control.control_type
        model = _replace_joints(Robot.load(found.folder), described.joints, kind)
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
        raise ConfigError(f"{source}: {_one_line(error)}") from error
    sizes = built["observation"]["size"], env.num_actions
    if (policy.num_obs, policy.num_actions) != sizes:
        got = f"got {policy.num_obs} observations and {policy.num_actions} actions"
        raise ConfigError(f"{path}: {got}; expected {sizes[0]} and {sizes[1]}, as in {source}")
    return spec


def _replace_joints(robot: Robot, joints: dict[str, list[Any]], control_type: str) -> Robot:
    """Return a robot with the joint order, pose, gains and limits of a policy."""
    names, spec = joints.get("name", []), robot.spec
    if sorted(map(str, names)) != sorted(spec.joint_order):
        got = listing(str(name) for name in names if name not in spec.joint_order)
        missing = listing(name for name in spec.joint_order if name not in names)
        what = f"got {got}, which {spec.name} lacks, and not its {missing}"
        if set(names) == set(spec.joint_order):
            what = f"got {len(names)} names; expected each of the {len(spec.joint_order)} once"
        raise ConfigError(f"joints.name, the policy belongs to another robot: {what}")
    keys = {name: name for name in _TABLES[control_type]} | {"default_pose": "default_position"}
    tables = {name: joints[key] for name, key in keys.items() if key in joints}
    for name, values in tables.items():
        if len(values) != len(names):
            got = f"got {len(values)} values"
            raise ConfigError(f"joints.{keys[name]}: {got}; expected one for each joint")
    pairs = {name: dict(zip(names, values, strict=True)) for name, values in tables.items()}
    spec = replace(spec, joint_order=tuple(names), **pairs)  # type: ignore[arg-type]
    return Robot.from_spec(spec, robot.folder)


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


def _read(path: Path) -> bytes:
    try:
        with open_regular(path) as file:
            data = file.read(MAX_FILE_SIZE + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else None
        raise ConfigError(f"cannot read {path}: {reason or error}") from error
    if len(data) > MAX_FILE_SIZE:
        raise ConfigError(f"{path}: more than {MAX_FILE_SIZE} bytes; expected a smaller file")
    return data


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:300]
