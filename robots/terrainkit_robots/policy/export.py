"""Export a policy as ONNX and TorchScript, with a JSON description and the model of the robot."""

import io
import json
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from rsl_rl.models import MLPModel
from tensordict import TensorDict

from terrainkit.errors import ExportError, listing
from terrainkit.files.atomic_write import atomic_folder, atomic_write, check_target
from terrainkit_robots.checkpoint import read_checkpoint
from terrainkit_robots.export.model_copy import EXAMPLE, ROBOT_FILE, copy_model
from terrainkit_robots.policy.contracts.contract import (
    FORMATS,
    KNOWN_TERMS,
    MJLAB,
    UNITREE,
    Contract,
)
from terrainkit_robots.policy.contracts.deploy_yaml import YAML_FILE, write_deploy_yaml
from terrainkit_robots.policy.contracts.mjlab_metadata import write_metadata
from terrainkit_robots.policy.contracts.policy_json import JSON_FILE, METADATA_KEY, to_contract
from terrainkit_robots.policy.evaluate import EvaluationConfig, build_eval_env
from terrainkit_robots.policy.load_policy import load_actor, single_torch_thread
from terrainkit_robots.policy.onnx_model import call_model, make_session, make_state
from terrainkit_robots.rl.config import Normalization
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.estimator import ESTIMATE, EstimatorModel
from terrainkit_robots.rl.observations import ObservationTerm
from terrainkit_robots.rl.rewards import MIN_YAW_RATE
from terrainkit_robots.rl.run import Run, last_checkpoint
from terrainkit_robots.rl.state import CONTACT_FORCE
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.transforms import FloatArray

ONNX_FILE, TORCHSCRIPT_FILE, ESTIMATOR_FILE = "policy.onnx", "policy.pt", "estimator.onnx"

FORMAT_VERSION, ONNX_OPSET = 2, 17
"""Version of the JSON, and an opset that runtimes on robots have."""

RECURRENT_STEPS = 10
"""Steps for which an exported recurrent network is compared with the live one."""

TOLERANCE = 1e-5
"""Largest difference between exported and live actions; relative for actions beyond 1."""

_FORMULAS = {
    "observation": "obs = clip((raw - offset) * scale, -clip, clip), part by part; a part with a "
    "clip of its own is (clip(raw - offset, *clip)) * scale",
    "gait": "gait_phase = (sin, cos)(2 pi time / period); 0 while commanded to stand: no linear "
    "velocity, and a yaw rate below min_yaw_rate",
    "history": "a part has its values of the last `history` steps, the oldest first; in the first "
    "step, copies of the current ones",
    "foot_contact": "1 if the vertical contact force on the foot is above contact_force, else 0",
    "action": "target = action_offset + action_scale * action for the joints of action.joints, "
    "action_offset for the others",
    "torque": "clip(gain * target - stiffness * position - damping * velocity, -effort, effort), "
    "every physics_dt; a new action every policy_dt",
}


@dataclass(frozen=True, kw_only=True)
class ExportResult:
    """The ONNX, TorchScript, JSON, MJCF and example files; action errors of the first two."""

    files: tuple[Path, ...]
    errors: tuple[float, float]
    notes: tuple[str, ...]
    """What readers of other formats lack or cannot read."""
    num_observations: int
    num_actions: int


@single_torch_thread()
def export_policy(
    run: Run,
    folder: Path,
    *,
    example: bool = False,
    deploy_yaml: bool = False,
    overwrite: bool = False,
) -> ExportResult:
    """Export the policy of a run to a folder, which is created if it does not exist.

    The exported policies are verified against the live policy before anything is written.

    Args:
        run: The run.
        folder: The folder.
        example: Whether to write a program that runs the policy in MuJoCo.
        deploy_yaml: Whether to write `deploy.yaml`, the contract that Unitree's controllers read.
        overwrite: Whether existing files may be replaced.

    Raises:
        ConfigError: If the run has no checkpoint.
        ExportError: If a file exists and `overwrite` is not set, if a file cannot be written, if an
            exported policy does not match the live one, or if `deploy.yaml` cannot describe it.
    """
    names = [ONNX_FILE, TORCHSCRIPT_FILE, JSON_FILE, ROBOT_FILE]
    names += [ESTIMATOR_FILE] if run.task.has_estimator else []
    names += [YAML_FILE] if deploy_yaml else []
    names += [EXAMPLE.name] if example else []
    files = tuple(folder / name for name in names)
    for file in files if folder.is_dir() else [folder]:
        check_target(file, overwrite=overwrite and file != folder)
    env = build_eval_env(run, Plane(), 8, EvaluationConfig())
    actor = load_actor(run, env)
    random = torch.randn(100, actor.obs_dim, generator=torch.Generator().manual_seed(0))
    order = observation_order(env)
    obs = torch.cat([env.get_observations()["policy"], random])[:, order]
    network = OnnxNetwork(actor, run.task.normalization, order)
    contents = copy_model(run.robot.mjcf)
    if example:
        contents[EXAMPLE.name] = EXAMPLE.read_bytes()
    description = describe_policy(env) | {"recurrent": network.describe_state()}
    description |= _describe_training(run, env) | {"estimator": None}
    if isinstance(actor, EstimatorModel):
        description["estimator"], contents[ESTIMATOR_FILE] = export_estimator(env, network, obs)
    text = json.dumps(description, indent=2) + "\n"
    yaml, metadata, notes = _other_formats(description, deploy_yaml=deploy_yaml)
    networks, errors = _export_networks(network, actor, obs, {METADATA_KEY: text} | metadata)
    contents |= networks | yaml | {JSON_FILE: text.encode()}
    if folder.is_dir():  # it may have other files
        with atomic_write(folder / JSON_FILE, overwrite=overwrite) as path:
            _write_files(path.parent, contents)
    else:
        with atomic_folder(folder) as new:
            _write_files(new, contents)
    return ExportResult(
        files=files,
        errors=errors,
        notes=tuple(notes),
        num_observations=actor.obs_dim,
        num_actions=env.num_actions,
    )


def _describe_training(run: Run, env: LeggedEnv) -> dict[str, Any]:
    """Return the iteration of a run, and the task that has the observations of `env`."""
    scan = env.cfg.terrain.measure_heights  # also if the terrain of the training decided
    terrain = replace(run.task.terrain, measure_heights=scan)
    iteration = read_checkpoint(last_checkpoint(run))["iteration"]
    return {"iteration": iteration, "task": asdict(replace(run.task, terrain=terrain))}


def _other_formats(
    description: Mapping[str, Any], *, deploy_yaml: bool
) -> tuple[dict[str, bytes], dict[str, str], list[str]]:
    """Return `deploy.yaml` if it is asked for, mjlab's metadata, and notes about both."""
    files: dict[str, bytes] = {}
    metadata: dict[str, str] = {}
    notes = []
    if deploy_yaml:
        contract = to_contract(description, UNITREE)
        files[YAML_FILE] = write_deploy_yaml(contract).encode()
        notes += _unknown_terms(contract)
    try:
        contract = to_contract(description, MJLAB)
        metadata = write_metadata(contract)
        notes += _unknown_terms(contract)
    except ExportError as error:
        notes.append(f"{ONNX_FILE} has no {error}")
    return files, metadata, notes


def _unknown_terms(contract: Contract) -> list[str]:
    """Return a note about the terms that the readers of a format lack."""
    known_terms = KNOWN_TERMS[contract.style].split()
    unknown = [term.name for term in contract.terms if term.name not in known_terms]
    if not unknown:
        return []
    what = f"controllers that read it stop at unknown observations: {listing(unknown)}"
    add = "add them as policy.json describes"
    if "foot_contact" in unknown:
        add += f": {_FORMULAS['foot_contact']}"
    return [f"{FORMATS[contract.style]}: {what}; {add}"]


def _write_files(folder: Path, contents: Mapping[str, bytes]) -> None:
    for name, data in contents.items():
        (folder / name).write_bytes(data)


class OnnxNetwork(torch.nn.Module):
    """An actor with clipped observations and actions, whose state is an input and an output.

    Args:
        actor: The network.
        normalization: Limits of observations and actions.
        order: Order of the exported observations; see `observation_order`.
    """

    indices: torch.Tensor

    def __init__(
        self, actor: MLPModel, normalization: Normalization, order: NDArray[np.int64]
    ) -> None:
        super().__init__()
        self.register_buffer("indices", torch.from_numpy(np.argsort(order)))
        limits = normalization.clip_observations, normalization.clip_actions
        self.clip_obs, self.clip_actions = (torch.nn.Hardtanh(-limit, limit) for limit in limits)
        self.model: Any = actor.as_onnx(verbose=False).eval()

    def forward(self, obs: torch.Tensor, *state: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Return the actions, and the state of the next step."""
        result = self.model(self.clip_obs(obs[:, self.indices]), *state)
        actions, *new = result if state else (result,)
        return self.clip_actions(actions), *new[: len(state)]

    def clipped(self, actor: MLPModel, obs: torch.Tensor) -> torch.Tensor:
        """Return the actions of the live actor, which keeps its own state."""
        return self.clip_actions(actor(TensorDict({"policy": self.clip_obs(obs)}, [len(obs)])))

    def describe_state(self) -> dict[str, Any] | None:
        """Return names and shape of the state, which is zero at first; None without a state."""
        _, *states = self.model.get_dummy_inputs()
        if not states:
            return None
        names = {"inputs": self.model.input_names[1:], "outputs": self.model.output_names[1:]}
        return names | {"shape": list(states[0].shape)}


class EstimatorNetwork(torch.nn.Module):
    """The estimator of a policy, in the units of `policy.json`; see `OnnxNetwork`."""

    scale: torch.Tensor
    offset: torch.Tensor

    def __init__(self, network: OnnxNetwork, scale: FloatArray, offset: FloatArray) -> None:
        super().__init__()
        self.register_buffer("scale", torch.from_numpy(scale))
        self.register_buffer("offset", torch.from_numpy(offset))
        self.network, self.model = network, network.model

    def forward(self, obs: torch.Tensor) -> torch.Tensor:
        """Return the estimates for observations of the policy, shape (n, k)."""
        clipped = self.network.clip_obs(obs[:, self.network.indices])
        estimates = self.model.mlp.estimator(self.model.obs_normalizer(clipped))
        result: torch.Tensor = estimates / self.scale + self.offset
        return result


class ScriptNetwork(torch.nn.Module):
    """An actor with clipped observations and actions, which keeps its state; see `OnnxNetwork`."""

    indices: torch.Tensor

    def __init__(self, actor: MLPModel, network: OnnxNetwork) -> None:
        super().__init__()
        self.register_buffer("indices", network.indices)
        self.clip_obs, self.clip_actions = network.clip_obs, network.clip_actions
        self.model = actor.as_jit().eval()

    def forward(self, obs: torch.Tensor) -> torch.Tensor:
        """Return the actions."""
        return self.clip_actions(self.model(self.clip_obs(obs[:, self.indices])))

    @torch.jit.export  # type: ignore[untyped-decorator]
    def reset(self) -> None:
        """Forget the state."""
        self.model.reset()


def run_onnx(data: bytes, steps: Sequence[FloatArray]) -> list[FloatArray]:
    """Return the actions of an ONNX file for the observations (n, k) of each step."""
    session = make_session(data)
    results = []
    state = make_state(session, len(steps[0]))
    for obs in steps:
        actions, *state = call_model(session, obs, state)
        results.append(actions)
    return results


@contextmanager
def _quiet_torch() -> Iterator[None]:
    """Export without gradients and without torch's warnings of what is as it should be."""
    with warnings.catch_warnings(), torch.no_grad():
        # torch deprecates TorchScript, which C++ controllers load, and its older ONNX exporter.
        warnings.simplefilter("ignore", DeprecationWarning)
        warnings.filterwarnings("ignore", message=r"`torch\.jit\.\w+` is (deprecated|not supp)")
        # Recurrent networks check the shapes of their inputs.
        warnings.simplefilter("ignore", torch.jit.TracerWarning)
        warnings.filterwarnings("ignore", message="Exporting a model to ONNX with a batch_size")
        yield


@_quiet_torch()
def export_onnx(
    network: torch.nn.Module,
    obs: torch.Tensor,
    metadata: Mapping[str, str],
    output: str = "actions",
) -> bytes:
    """Return a network as an ONNX file.

    Args:
        network: An `OnnxNetwork` or `EstimatorNetwork`.
        obs: Observations to trace it with, shape (n, k).
        metadata: Its metadata by key.
        output: Name of the first output.
    """
    file = io.BytesIO()
    model: Any = network.model
    inputs, outputs = model.input_names, [output, *model.output_names[1:]]
    _, *states = model.get_dummy_inputs()
    axes = {name: {1: "batch"} for name in (*inputs, *outputs)}
    axes |= {"obs": {0: "batch"}, output: {0: "batch"}}
    # With `dynamo`, the export takes 5 s instead of 0.1 s.
    torch.onnx.export(
        network,
        (obs, *(state.repeat(1, len(obs), 1) for state in states)),
        file,
        input_names=inputs,
        output_names=outputs,
        dynamic_axes=axes,
        opset_version=ONNX_OPSET,
        dynamo=False,
    )
    model = onnx.load_model_from_string(file.getvalue())
    onnx.helper.set_model_props(model, dict(metadata))
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())


def export_estimator(
    env: LeggedEnv, network: OnnxNetwork, obs: torch.Tensor
) -> tuple[dict[str, Any], bytes]:
    """Return the description of a policy's estimator, and its ONNX file.

    Args:
        env: The environment, whose group `estimate` has the values.
        network: The policy, whose actor is an `EstimatorModel`.
        obs: Exported observations to trace it with, shape (n, k).
    """
    parts = _observation_parts(env, ESTIMATE)
    scale, offset = (
        np.concatenate([np.array(part[key], np.float32) for part in parts])
        for key in ("scale", "offset")
    )
    estimator = EstimatorNetwork(network, scale, offset)
    keys = "name", "start", "stop", "unit"
    described = [{key: part[key] for key in keys} for part in parts]
    data = export_onnx(estimator, obs, {}, "estimates")
    return {"file": ESTIMATOR_FILE, "parts": described}, data


def verify_actions(exported: FloatArray, live: FloatArray, name: str) -> float:
    """Compare exported with live actions.

    Args:
        exported: Actions of the exported policy, shape (n, a).
        live: Actions of the live policy, shape (n, a).
        name: Name of the exported file, for the error.

    Returns:
        Largest difference, relative for actions beyond 1.

    Raises:
        ExportError: if the difference is above `TOLERANCE`.
    """
    error = float(np.max(np.abs(exported - live) / np.maximum(1, np.abs(live))))
    if not error <= TOLERANCE:
        expected = f"expected at most {TOLERANCE:g}"
        raise ExportError(f"{name}: got actions off the live policy by {error:.2g}; {expected}")
    return error


@_quiet_torch()
def _export_networks(
    network: OnnxNetwork, actor: MLPModel, obs: torch.Tensor, metadata: Mapping[str, str]
) -> tuple[dict[str, bytes], tuple[float, float]]:
    """Return the ONNX and TorchScript files, and their errors on exported observations (n, k)."""
    # A recurrent network depends on the observations before.
    steps = [obs.roll(k, 0) for k in range(RECURRENT_STEPS if actor.is_recurrent else 1)]
    onnx_data, script_file = export_onnx(network, obs, metadata), io.BytesIO()
    torch.jit.save(torch.jit.script(ScriptNetwork(actor, network)), script_file)
    script = torch.jit.load(io.BytesIO(script_file.getvalue()))
    live = [network.clipped(actor, step[:, network.indices]).numpy() for step in steps]
    # TorchScript of rsl-rl keeps the state of one robot.
    rows = slice(1) if actor.is_recurrent else slice(None)
    script_actions = [script(step[rows]).numpy() for step in steps]
    onnx_actions = run_onnx(onnx_data, [step.numpy() for step in steps])
    errors = (
        verify_actions(np.stack(onnx_actions), np.stack(live), ONNX_FILE),
        verify_actions(np.stack(script_actions), np.stack(live)[:, rows], TORCHSCRIPT_FILE),
    )
    return {ONNX_FILE: onnx_data, TORCHSCRIPT_FILE: script_file.getvalue()}, errors


def describe_policy(env: LeggedEnv) -> dict[str, Any]:
    """Return what a controller needs to run a policy: timing, observations, actions and gains.

    Units are SI and radians. The gains are not randomized.
    """
    from terrainkit import __version__

    task, robot, model = env.cfg, env.robot, env.scene.model
    stiffness, damping = -model.actuator_biasprm[:, 1], -model.actuator_biasprm[:, 2]
    drive = np.where(stiffness > 0, "position", "velocity")
    if task.control.control_type == "T":
        drive[:] = "torque"
    dofs = env.scene.joint_qvel
    joints = {
        "default_position": robot.default_pose,
        "action_offset": env.actions.offset,
        "action_scale": env.actions.scale,
        "gain": model.actuator_gainprm[:, 0],
        "stiffness": stiffness,
        "damping": damping,
        "effort": model.actuator_forcerange[:, 1],
        "velocity": robot.velocity,
        "armature": model.dof_armature[dofs],
        "frictionloss": model.dof_frictionloss[dofs],
        "passive_damping": model.dof_damping[dofs],
    }
    feet = [model.body(foot).id for foot in robot.spec.feet]
    soles = env.scene.geoms[np.isin(model.geom_bodyid[env.scene.geoms], feet)]
    friction = np.max(model.geom_friction[soles, 0], initial=0)
    scan = {
        "frame": "at the base's position, turned by its yaw alone; x forward, y left",
        "value": "height of the base above the ground at the point",
        "unit": "m",
        "points": np.round(env.scan_points, 6).tolist(),
    }
    gait = {"period": float(env.gait.period), "min_yaw_rate": MIN_YAW_RATE}
    names = "name", "base", "spawn_height", "base_height_target"
    dt, decimation = task.sim.dt, task.control.decimation
    return {
        "format_version": FORMAT_VERSION,
        "terrainkit": __version__,
        "robot": {name: getattr(robot.spec, name) for name in names}
        | {"center": env.scene.center.tolist()},
        "files": {"onnx": ONNX_FILE, "torchscript": TORCHSCRIPT_FILE, "mjcf": ROBOT_FILE},
        "formulas": _FORMULAS,
        "timing": {"physics_dt": dt, "decimation": decimation, "policy_dt": task.dt},
        "observation": {
            "parts": _observation_parts(env),
            "size": env.get_observations()["policy"].shape[1],
            "clip": task.normalization.clip_observations,
        },
        "action": {
            "size": env.num_actions,
            "clip": task.normalization.clip_actions,
            "joints": [robot.spec.joint_order[k] for k in env.actions.joints],
        },
        "control_type": task.control.control_type,
        "joints": {
            "name": list(robot.spec.joint_order),
            "position_unit": list(env.scene.joint_units),
            "drive": drive.tolist(),
            **{name: _to_list(values) for name, values in joints.items()},
        },
        "contact": {"friction": float(f"{friction:.7g}")},
        "feet": {"name": list(robot.spec.feet), "contact_force": CONTACT_FORCE},
        "gait": gait if env.gait.period else None,
        "height_scan": scan if env.has_height_scan else None,
    }


def observation_order(env: LeggedEnv) -> NDArray[np.int64]:
    """Return where each number of an exported observation is in an observation of `env`.

    The history of `env` consists of whole observations, the newest first. An exported observation
    has the history of each term, the oldest step first, as in mjlab and Isaac Lab.
    """
    terms = list(_terms(env))
    width = sum(size for *_, size, history in terms if history > 1)
    return np.concatenate(
        [
            (start + np.arange(history)[::-1, None] * width + np.arange(size)).ravel()
            for _, _, start, size, history in terms
        ]
    )


def _terms(
    env: LeggedEnv, group: str = "policy"
) -> Iterator[tuple[str, ObservationTerm, int, int, int]]:
    """Yield name, term, first number in an observation of `env`, size and steps of each term."""
    start = 0
    steps = env.history_length if "history" in env.obs_terms[group] else 1
    for name, term in env.obs_terms[group].items():
        size = term.function(env).shape[1]
        if name == "history":  # of the terms before it
            steps = 1
        else:
            yield name, term, start, size, steps
        start += size


def _observation_parts(env: LeggedEnv, group: str = "policy") -> list[dict[str, Any]]:
    """Return slice, steps of the history, unit, offset, scale and clip of each term."""
    parts = []
    first = 0
    for name, term, _, size, history in _terms(env, group):
        part: dict[str, Any] = {"name": name, "start": first, "stop": first + size * history}
        part["history"] = history
        part["unit"] = term.unit if isinstance(term.unit, str) else list(term.unit)
        part["offset"] = _to_list(np.broadcast_to(term.offset, size))
        part["scale"] = _to_list(np.broadcast_to(term.scale, size))
        if term.clip is not None:
            part["clip"] = list(term.clip)
        parts.append(part)
        first = part["stop"]
    return parts


def _to_list(values: Any) -> list[float]:
    """Return numbers with the digits of single precision: float32(0.1) becomes 0.1."""
    return [float(f"{value + 0.0:.7g}") for value in np.asarray(values, float)]
