"""Export a policy as ONNX and TorchScript, with a JSON description and the model of the robot."""

import io
import json
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import onnx
import onnxruntime
import torch
from tensordict import TensorDict

from terrainkit.errors import ExportError
from terrainkit.files.atomic_write import atomic_folder, atomic_write, check_target
from terrainkit_robots.checkpoint import read_checkpoint
from terrainkit_robots.export.model_copy import EXAMPLE, ROBOT_FILE, copy_model
from terrainkit_robots.policy.evaluate import EvaluationConfig, build_eval_env
from terrainkit_robots.policy.load import load_actor, single_torch_thread
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.observations import HEIGHT_SCAN_OFFSET
from terrainkit_robots.rl.rewards import MIN_YAW_RATE
from terrainkit_robots.rl.run import Run, last_checkpoint
from terrainkit_robots.rl.state import CONTACT_FORCE
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.transforms import FloatArray

ONNX_FILE, TORCHSCRIPT_FILE, JSON_FILE = "policy.onnx", "policy.pt", "policy.json"

FORMAT_VERSION, METADATA_KEY, ONNX_OPSET = 1, "terrainkit", 17
"""Version of the JSON, its key in the ONNX metadata, and an opset that runtimes on robots have."""

TOLERANCE = 1e-5
"""Largest difference between exported and live actions; relative for actions beyond 1."""

_FORMULAS = {
    "observation": "obs = clip((raw - offset) * scale, -clip, clip), part by part; a part with a "
    "clip of its own is (clip(raw - offset, *clip)) * scale",
    "gait": "gait_phase = (sin, cos)(2 pi time / period); 0 while commanded to stand: no linear "
    "velocity, and a yaw rate below min_yaw_rate",
    "history": "first numbers of the previous obs; in the first step, copies of the numbers before",
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
    num_observations: int
    num_actions: int


@single_torch_thread()
def export_policy(
    run: Run, folder: Path, *, example: bool = False, overwrite: bool = False
) -> ExportResult:
    """Export the policy of a run to a folder, which is created if it does not exist.

    The exported policies are verified against the live policy before anything is written.

    Args:
        run: The run.
        folder: The folder.
        example: Whether to write a program that runs the policy in MuJoCo.
        overwrite: Whether existing files may be replaced.

    Raises:
        ConfigError: If the run has no checkpoint.
        ExportError: If a file exists and `overwrite` is not set, if a file cannot be written, or if
            an exported policy does not match the live one.
    """
    names = [ONNX_FILE, TORCHSCRIPT_FILE, JSON_FILE, ROBOT_FILE] + [EXAMPLE.name] * example
    files = tuple(folder / name for name in names)
    for file in files if folder.is_dir() else [folder]:
        check_target(file, overwrite=overwrite and file != folder)
    env = build_eval_env(run, Plane(), 8, EvaluationConfig())
    actor = load_actor(run, env)
    other_files = copy_model(run.robot.mjcf)
    if example:
        other_files[EXAMPLE.name] = EXAMPLE.read_bytes()
    training = {"iteration": read_checkpoint(last_checkpoint(run))["iteration"]}
    scan = env.cfg.terrain.measure_heights  # also if the terrain of the training decided
    terrain = replace(run.task.terrain, measure_heights=scan)
    training["task"] = asdict(replace(run.task, terrain=terrain))
    text = json.dumps(describe_policy(env) | training, indent=2) + "\n"
    normalization = run.task.normalization
    limits = normalization.clip_observations, normalization.clip_actions
    clip_obs, clip_actions = (torch.nn.Hardtanh(-limit, limit) for limit in limits)
    policy = torch.nn.Sequential(clip_obs, actor.as_jit(), clip_actions).eval()
    random = torch.randn(100, actor.obs_dim, generator=torch.Generator().manual_seed(0))
    obs = torch.cat([env.get_observations()["policy"], random])
    with warnings.catch_warnings(), torch.no_grad():
        # torch deprecates TorchScript, which C++ controllers load, and its older ONNX exporter.
        warnings.simplefilter("ignore", DeprecationWarning)
        warnings.filterwarnings("ignore", message=r"`torch\.jit\.\w+` is (deprecated|not supp)")
        onnx_data, script_file = export_onnx(policy, obs, text), io.BytesIO()
        torch.jit.save(torch.jit.script(policy), script_file)
        actions = clip_actions(actor(TensorDict({"policy": clip_obs(obs)}, [len(obs)]))).numpy()
        script_actions = torch.jit.load(io.BytesIO(script_file.getvalue()))(obs).numpy()
    session = onnxruntime.InferenceSession(onnx_data, providers=["CPUExecutionProvider"])
    onnx_actions = np.asarray(session.run(["actions"], {"obs": obs.numpy()})[0])
    onnx_error = verify_actions(onnx_actions, actions, ONNX_FILE)
    errors = onnx_error, verify_actions(script_actions, actions, TORCHSCRIPT_FILE)
    contents = {JSON_FILE: text.encode(), ONNX_FILE: onnx_data, **other_files}
    contents[TORCHSCRIPT_FILE] = script_file.getvalue()
    if folder.is_dir():  # it may have other files
        with atomic_write(folder / JSON_FILE, overwrite=overwrite) as path:
            _write_files(path.parent, contents)
    else:
        with atomic_folder(folder) as new:
            _write_files(new, contents)
    sizes = {"num_observations": actor.obs_dim, "num_actions": env.num_actions}
    return ExportResult(files=files, errors=errors, **sizes)


def _write_files(folder: Path, contents: Mapping[str, bytes]) -> None:
    for name, data in contents.items():
        (folder / name).write_bytes(data)


def export_onnx(policy: torch.nn.Module, obs: torch.Tensor, metadata: str) -> bytes:
    """Return a policy as an ONNX file.

    Args:
        policy: The network.
        obs: Observations to trace it with, shape (n, k).
        metadata: Text of the metadata `METADATA_KEY`.
    """
    file, axes = io.BytesIO(), {"obs": {0: "batch"}, "actions": {0: "batch"}}
    names: dict[str, Any] = {"input_names": ["obs"], "output_names": ["actions"]}
    # With `dynamo`, the export takes 5 s instead of 0.1 s.
    torch.onnx.export(
        policy, (obs,), file, **names, dynamic_axes=axes, opset_version=ONNX_OPSET, dynamo=False
    )
    model = onnx.load_model_from_string(file.getvalue())
    model.metadata_props.add(key=METADATA_KEY, value=metadata)
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())


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


def describe_policy(env: LeggedEnv) -> dict[str, Any]:
    """Return what a controller needs to run a policy: timing, observations, actions and gains.

    Units are SI and radians. The gains are not randomized.
    """
    from terrainkit import __version__

    task, robot, model = env.cfg, env.robot, env.scene.model
    slide = mujoco.mjtJoint.mjJNT_SLIDE
    types = [model.joint(name).type[0] for name in robot.spec.joint_order]
    units = ["m" if each == slide else "rad" for each in types]
    stiffness, damping = -model.actuator_biasprm[:, 1], -model.actuator_biasprm[:, 2]
    drive = np.where(stiffness > 0, "position", "velocity")
    if task.control.control_type == "T":
        drive[:] = "torque"
    dofs = env.scene.joint_qvel
    joints = {
        "default_position": robot.default_pose,
        "action_offset": env.action_offset,
        "action_scale": env.action_scale,
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
    scan_x, scan_y = task.terrain.measured_points_x, task.terrain.measured_points_y
    scan = {
        "frame": "at the base's position, turned by its yaw alone; x forward, y left",
        "value": "height of the base above the ground at the point",
        "unit": "m",
        "points": [[x, y] for x in scan_x for y in scan_y],
    }
    gait = {"period": float(f"{env.gait.period:.7g}"), "min_yaw_rate": MIN_YAW_RATE}
    names = "name", "base", "spawn_height", "base_height_target"
    dt, decimation = task.sim.dt, task.control.decimation
    return {
        "format_version": FORMAT_VERSION,
        "terrainkit": __version__,
        "robot": {name: getattr(robot.spec, name) for name in names},
        "files": {"onnx": ONNX_FILE, "torchscript": TORCHSCRIPT_FILE, "mjcf": ROBOT_FILE},
        "formulas": _FORMULAS,
        "timing": {"physics_dt": dt, "decimation": decimation, "policy_dt": task.dt},
        "observation": {
            "parts": _observation_parts(env, units),
            "size": env.get_observations()["policy"].shape[1],
            "clip": task.normalization.clip_observations,
            "history_length": task.observations.history_length,
        },
        "action": {
            "size": env.num_actions,
            "clip": task.normalization.clip_actions,
            "joints": [robot.spec.joint_order[k] for k in env.action_joints],
        },
        "control_type": task.control.control_type,
        "joints": {
            "name": list(robot.spec.joint_order),
            "position_unit": units,
            "drive": drive.tolist(),
            **{name: _to_list(values) for name, values in joints.items()},
        },
        "contact": {"friction": float(f"{friction:.7g}")},
        "feet": {"name": list(robot.spec.feet), "contact_force": CONTACT_FORCE},
        "gait": gait if env.gait.period else None,
        "height_scan": scan if env.state.height_scan.shape[1] else None,
    }


def _observation_parts(env: LeggedEnv, joint_units: list[str]) -> list[dict[str, Any]]:
    """Return slice, unit, offset, scale and clip of each observation term."""
    offsets: dict[str, Any] = {"dof_pos": env.robot.default_pose, "height_scan": HEIGHT_SCAN_OFFSET}
    units: dict[str, Any] = {
        "dof_pos": joint_units,
        "dof_vel": [f"{unit}/s" for unit in joint_units],
    }
    units |= {"commands": ["m/s", "m/s", "rad/s"], "base_ang_vel": "rad/s", "height_scan": "m"}
    units["base_lin_vel"] = "m/s"
    parts, start = [], 0
    for term in env.obs_terms["policy"]:
        size = term.function(env.state).shape[1]
        part: dict[str, Any] = {"name": term.name, "start": start, "stop": start + size}
        part["unit"] = units.get(term.name, "1")
        part["offset"] = _to_list(np.broadcast_to(offsets.get(term.name, 0.0), size))
        part["scale"] = _to_list(np.broadcast_to(term.scale, size))
        if term.name == "height_scan":
            part["clip"] = [-1.0, 1.0]
        parts.append(part)
        start += size
    return parts


def _to_list(values: Any) -> list[float]:
    """Return numbers with the digits of single precision: float32(0.1) becomes 0.1."""
    return [float(f"{value + 0.0:.7g}") for value in np.asarray(values, float)]
