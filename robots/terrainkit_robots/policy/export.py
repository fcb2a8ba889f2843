"""The export: a policy as ONNX, as TorchScript, and as a JSON of all that it takes to run it.

The files need neither terrainkit nor rsl-rl. This lets a policy walk in plain MuJoCo, in the folder
that was exported, with the robot's `robot.xml` beside it::

    import json, mujoco, numpy as np, onnxruntime, pathlib

    told = json.loads(pathlib.Path("policy.json").read_text())
    policy = onnxruntime.InferenceSession("policy.onnx")
    spec = mujoco.MjSpec.from_file("robot.xml")
    for actuator in list(spec.actuators):
        spec.delete(actuator)  # the gains are in the JSON
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    spec.option.timestep = told["timing"]["physics_dt"]
    model = spec.compile()
    data = mujoco.MjData(model)
    joints = {name: np.array(value) for name, value in told["joints"].items()}
    at = [model.joint(name).qposadr[0] for name in joints["name"]]
    dof = [model.joint(name).dofadr[0] for name in joints["name"]]
    data.qpos[:7] = 0, 0, told["robot"]["spawn_height"], 1, 0, 0, 0
    data.qpos[at] = joints["default_position"]
    command, action = np.array([0.5, 0, 0]), np.zeros(len(at))  # [m/s, m/s, rad/s]
    for _ in range(int(5 / told["timing"]["policy_dt"])):
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, data.qpos[3:7])
        raw = {
            "commands": command,
            "projected_gravity": -turn.reshape(3, 3)[2],  # down, in the base's frame
            "base_ang_vel": data.qvel[3:6],
            "dof_pos": data.qpos[at],
            "dof_vel": data.qvel[dof],
            "actions": action,
        }
        seen = [
            (raw[part["name"]] - part["offset"]) * part["scale"]
            for part in told["observation"]["parts"]
        ]
        obs = np.concatenate(seen, dtype=np.float32)[None]
        action = policy.run(None, {"obs": obs})[0][0]
        target = joints["action_offset"] + joints["action_scale"] * action
        for _ in range(told["timing"]["decimation"]):
            torque = joints["gain"] * target
            torque -= joints["stiffness"] * data.qpos[at] + joints["damping"] * data.qvel[dof]
            data.qfrc_applied[dof] = np.clip(torque, -joints["effort"], joints["effort"])
            mujoco.mj_step(model, data)

A policy with a height scan also wants `raw["height_scan"]`: the height of the base above the ground
at each of the points in the JSON, clipped as its `clip` says once the offset is taken off.
"""

import io
import json
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from rsl_rl.models import MLPModel
from tensordict import TensorDict

from terrainkit.atomic_write import atomic_write, check_target
from terrainkit.errors import ConfigError, ExportError
from terrainkit_robots.policy.actor import actor_of
from terrainkit_robots.policy.description import ONNX, TORCHSCRIPT, description, width_of
from terrainkit_robots.policy.rollout import walk
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import Run, read_checkpoint
from terrainkit_robots.rl.runner import single_torch_thread
from terrainkit_robots.rl.terrain import load_terrain

FloatArray = NDArray[np.float32]
Answer = Callable[[FloatArray], FloatArray]

TEXT = "policy.json"
"""What the file with the description is called."""

METADATA = "terrainkit"
"""Key of the ONNX file's metadata that holds the JSON."""

TOLERANCE = 1e-5
"""Largest difference between an exported action and the live policy's; relative beyond 1."""

_OPSET = 17
"""Version of ONNX's operators: old enough for the runtimes on robots."""


@dataclass(frozen=True, kw_only=True)
class Exported:
    """A policy that was written."""

    files: tuple[Path, ...]
    """What was written."""

    error: float
    """Largest difference between what the TorchScript answers and the live policy; see
    `TOLERANCE`."""

    onnx_error: float | None
    """The same for the ONNX file; None if there is no onnxruntime to ask."""

    observations: int
    """Numbers in an observation."""

    actions: int
    """Numbers in an action."""


class DeployedPolicy(torch.nn.Module):
    """A policy with all that is around it: from observations (n, width) to actions (n, j)."""

    def __init__(self, actor: torch.nn.Module, clip_observations: float, clip_actions: float):
        """Put it together.

        Args:
            actor: From observations to actions, its normalization included.
            clip_observations: Largest observation.
            clip_actions: Largest action.
        """
        super().__init__()
        self.actor = actor
        self.clip_observations = float(clip_observations)
        self.clip_actions = float(clip_actions)

    def forward(self, obs: torch.Tensor) -> torch.Tensor:
        """Return actions."""
        seen = torch.clamp(obs, -self.clip_observations, self.clip_observations)
        actions = self.actor(seen)
        return torch.clamp(actions, -self.clip_actions, self.clip_actions)


@single_torch_thread()
def export_policy(run: Run, folder: Path, *, overwrite: bool = False) -> Exported:
    """Write the policy of a run's checkpoint to `folder`, which is made if it is not there.

    Before anything is moved there, what was written is read again, and asked on observations of a
    rollout and on random ones.

    Raises:
        ConfigError: if the run has no checkpoint, or a package is missing.
        ExportError: if a file is there and `overwrite` is not set, cannot be written, or answers
            otherwise than the checkpoint.
    """
    require_onnx()
    _check_targets(folder, overwrite=overwrite)
    task = replace(
        run.task,
        env=replace(run.task.env, num_envs=_ROBOTS, num_threads=1),
        algorithm=replace(run.task.algorithm, num_mini_batches=1),  # so few may have no more
    )
    env = LeggedEnv(task, run.robot, load_terrain(run.terrain, task.terrain.collision))
    actor = actor_of(run, env)
    document = description(env) | {"iteration": _iteration(run)}
    return write_policy(env, actor, document, folder, overwrite=overwrite)


def _iteration(run: Run) -> int:
    """Return after how many updates the policy was; it is there, since it was loaded."""
    return int(read_checkpoint(run.checkpoint)["iteration"]) if run.checkpoint else 0


def require_onnx() -> None:
    """Raise ConfigError if ONNX files cannot be written."""
    try:
        import onnx  # noqa: F401
    except ImportError:
        raise ConfigError(
            "exporting a policy needs onnx, which is not installed; "
            "pip install 'terrainkit[train]' has it"
        ) from None


def _check_targets(folder: Path, *, overwrite: bool) -> None:
    """Raise ExportError if a file cannot or may not be written, before the work is done."""
    if folder.is_dir():
        for name in (ONNX, TORCHSCRIPT, TEXT):
            check_target(folder / name, overwrite=overwrite)
    else:
        check_target(folder, overwrite=False)


def write_policy(
    env: LeggedEnv,
    actor: MLPModel,
    document: Mapping[str, Any],
    folder: Path,
    *,
    overwrite: bool = False,
) -> Exported:
    """Write a live policy and its description; see :func:`export_policy`.

    Args:
        env: The environment that it acts in.
        actor: The policy as rsl-rl's model, which is not changed.
        document: What is written beside it.
        folder: Where.
        overwrite: Whether files that are there may be replaced.
    """
    live = DeployedPolicy(
        actor.as_jit(), env.cfg.normalization.clip_observations, env.cfg.normalization.clip_actions
    )
    live.to("cpu").eval()
    text = json.dumps(document, indent=2, allow_nan=False) + "\n"
    with _folder(folder), atomic_write(folder / TEXT, overwrite=overwrite) as path:
        path.write_text(text, encoding="utf-8")
        onnx_file, script_file = path.with_name(ONNX), path.with_name(TORCHSCRIPT)
        _write_onnx(live, width_of(env), text, onnx_file)
        _write_script(live, script_file)
        batches = _batches(env, actor)
        wanted = [_clipped(env, _asked_live(actor, batch)) for batch in batches]
        error = _error(_script_answer(script_file), batches, wanted, TORCHSCRIPT)
        answer = _onnx_answer(onnx_file)
        onnx_error = None if answer is None else _error(answer, batches, wanted, ONNX)
    return Exported(
        files=tuple(folder / name for name in (ONNX, TORCHSCRIPT, TEXT)),
        error=error,
        onnx_error=onnx_error,
        observations=width_of(env),
        actions=env.num_actions,
    )


@contextmanager
def _folder(folder: Path) -> Iterator[None]:
    """Make a folder; if the block raises, it is gone again."""
    made = not folder.exists()
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise ExportError(f"cannot write {folder}: {error.strerror or error}") from error
    try:
        yield
    except BaseException:
        if made:
            with suppress(OSError):
                folder.rmdir()
        raise


def _write_onnx(live: DeployedPolicy, width: int, text: str, path: Path) -> None:
    """Write the ONNX file, with `text` in its metadata.

    By torch's older exporter: the newer one takes 5 seconds for what this does in a tenth of one,
    and reports on torchvision meanwhile. That it is the older one is what its warnings say.
    """
    import onnx

    written = io.BytesIO()  # torch, writing to a full disk itself, ends the process
    with warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore", DeprecationWarning)
        warnings.filterwarnings("ignore", message=_DEPRECATED)
        torch.onnx.export(
            live,
            (torch.zeros(2, width),),
            written,
            input_names=["obs"],
            output_names=["actions"],
            dynamic_axes={"obs": {0: "batch"}, "actions": {0: "batch"}},
            opset_version=_OPSET,
            dynamo=False,
        )
    model = onnx.load_model_from_string(written.getvalue())
    model.metadata_props.add(key=METADATA, value=text)
    onnx.checker.check_model(model)
    path.write_bytes(model.SerializeToString())


def _write_script(live: DeployedPolicy, path: Path) -> None:
    written = io.BytesIO()
    with warnings.catch_warnings(), torch.no_grad():
        warnings.filterwarnings("ignore", message=_DEPRECATED)
        torch.jit.save(torch.jit.script(live), written)
    path.write_bytes(written.getvalue())


_DEPRECATED = r"`torch\.jit\.\w+` is (deprecated|not supported)"
"""What torch says of TorchScript, which is still what robots' programs in C++ read."""

_ROBOTS, _STEPS = 8, 25
"""Size of the rollout whose observations the written files are asked on."""


def _batches(env: LeggedEnv, actor: MLPModel) -> list[FloatArray]:
    """Return observations to ask: of a rollout, and random ones; one at a time, and many."""
    steps = walk(env, actor, repeat(None, _STEPS))
    rolled = np.concatenate([step.observed["policy"].numpy() for step in steps])
    clip = env.cfg.normalization.clip_observations
    drawn = np.random.default_rng(0).normal(size=rolled.shape).astype(np.float32)
    random = np.clip(drawn, -clip, clip)
    return [rolled[:1], rolled[-1:], rolled, random[:1], random]


def _asked_live(actor: MLPModel, obs: FloatArray) -> FloatArray:
    """Return what the live policy answers."""
    with torch.no_grad():
        answer: torch.Tensor = actor(TensorDict({"policy": torch.from_numpy(obs)}, [len(obs)]))
    return answer.numpy()


def _clipped(env: LeggedEnv, actions: FloatArray) -> FloatArray:
    """Return actions as the environment takes them."""
    most = env.cfg.normalization.clip_actions
    return np.clip(actions, -most, most)


def _script_answer(path: Path) -> Answer:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=_DEPRECATED)
        loaded = torch.jit.load(str(path))
    return lambda obs: loaded(torch.from_numpy(obs)).detach().numpy()


def _onnx_answer(path: Path) -> Answer | None:
    """Return what asks the ONNX file; None if there is no onnxruntime."""
    try:
        import onnxruntime
    except ImportError:
        return None
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    return lambda obs: np.asarray(session.run(["actions"], {"obs": obs})[0], np.float32)


def _error(
    answer: Answer, batches: Sequence[FloatArray], wanted: Sequence[FloatArray], name: str
) -> float:
    """Return the largest difference between answers and those wanted.

    Raises:
        ExportError: if it is more than the tolerance, or an answer is no number.
    """
    largest = 0.0
    for obs, right in zip(batches, wanted, strict=True):
        off = np.abs(answer(obs) - right) / np.maximum(1, np.abs(right))
        largest = max(largest, float(np.nan_to_num(off, nan=np.inf).max()))
    if largest > TOLERANCE:
        raise ExportError(
            f"{name} answers otherwise than the policy: up to {largest:.2g}; "
            f"wanted {TOLERANCE:g} at most, so nothing was written"
        )
    return largest
