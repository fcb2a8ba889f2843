"""The description of a policy: all that it takes to run it elsewhere, as plain data.

Everything is in SI units and radians. What an observation is made of, and what an action does, is
read off the environment itself, so that the two cannot differ.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.observations import ObservationTerm

ONNX, TORCHSCRIPT = "policy.onnx", "policy.pt"
"""What the files with the policy are called."""

FORMAT_VERSION = 1
"""Raised when a key of the description changes its meaning or goes; new keys may come without."""

_UNITS = {
    "commands": ("m/s", "m/s", "rad/s"),
    "projected_gravity": "1",
    "base_ang_vel": "rad/s",
    "actions": "1",
    "height_scan": "m",
}
"""Unit of each part of an observation before its scale, but for those by joint."""

_TOLD = {
    "observation": "obs = clip((raw - offset) * scale, -clip, clip), part by part; a part with a "
    "clip of its own is (clip(raw - offset, *clip)) * scale",
    "action": "target = action_offset + action_scale * action",
    "torque": "clip(gain * target - stiffness * position - damping * velocity, -effort, effort), "
    "every physics_dt; a new action every policy_dt",
}
"""How the numbers are used, as formulas."""


def description(env: LeggedEnv) -> dict[str, Any]:
    """Return all that it takes to run a policy of an environment, as plain data.

    Arrays by joint are in the order of the actions. The gains are those of the scene that it was
    trained in, without their randomization.
    """
    from terrainkit import __version__

    task, spec = env.cfg, env.robot.spec
    return {
        "format_version": FORMAT_VERSION,
        "terrainkit": __version__,
        "robot": {
            "name": spec.name,
            "base": spec.base,
            "spawn_height": spec.spawn_height,
            "base_height_target": spec.base_height_target,
        },
        "files": {"onnx": ONNX, "torchscript": TORCHSCRIPT},
        "formulas": _TOLD,
        "timing": {
            "physics_dt": task.sim.dt,
            "decimation": task.control.decimation,
            "policy_dt": task.dt,
        },
        "observation": {
            "size": width_of(env),
            "clip": task.normalization.clip_observations,
            "parts": _parts(env),
        },
        "action": {"size": env.num_actions, "clip": task.normalization.clip_actions},
        "control_type": task.control.control_type,
        "joints": _joints(env),
        "height_scan": _scan(env),
    }


def width_of(env: LeggedEnv) -> int:
    """Return how many numbers the policy observes."""
    return int(env.get_observations()["policy"].shape[1])


def _parts(env: LeggedEnv) -> list[dict[str, Any]]:
    """Return each part of an observation: its place, and how it is made of what is measured."""
    parts: list[dict[str, Any]] = []
    start = 0
    for each in env.obs_groups["policy"]:
        width = each.function(env.state).shape[1]
        offset = np.zeros(width)
        if each.name == "dof_pos":
            offset[:] = env.robot.default_pose
        part = {
            "name": each.name,
            "start": start,
            "stop": start + width,
            "unit": _units(each.name, env),
            "offset": _numbers(offset),
            "scale": _numbers(np.broadcast_to(each.scale, width)),
        }
        if each.name == "height_scan":
            # Asked of the table itself, whose constants these are.
            below, level, above = (_scanned(each, env, z) for z in (-1e3, 0.0, 1e3))
            part |= {"offset": _numbers(np.full(width, -level)), "clip": [below, above]}
        parts.append(part)
        start += width
    return parts


def _scanned(each: ObservationTerm, env: LeggedEnv, height: float) -> float:
    """Return what is observed, before the scale, where the base is so high above the ground [m]."""
    scan = np.full_like(env.state.height_scan, height)
    return float(each.function(replace(env.state, height_scan=scan))[0, 0])


def _units(name: str, env: LeggedEnv) -> list[str] | str:
    if name in ("dof_pos", "dof_vel"):
        return [unit + "/s" * (name == "dof_vel") for unit in _position_units(env)]
    unit = _UNITS.get(name, "")
    return unit if isinstance(unit, str) else list(unit)


def _position_units(env: LeggedEnv) -> list[str]:
    import mujoco

    kinds = (env.scene.model.joint(name).type[0] for name in env.robot.spec.joint_order)
    return ["m" if kind == mujoco.mjtJoint.mjJNT_SLIDE else "rad" for kind in kinds]


def _joints(env: LeggedEnv) -> dict[str, Any]:
    """Return names, poses and gains by joint; the gains are those of the scene's own motors."""
    model = env.scene.model
    gain = model.actuator_gainprm[:, 0]
    stiffness, damping = -model.actuator_biasprm[:, 1], -model.actuator_biasprm[:, 2]
    held = np.where(stiffness > 0, "position", "velocity")
    drives = held if env.cfg.control.control_type != "T" else np.full(len(held), "torque")
    return {
        "name": list(env.robot.spec.joint_order),
        "position_unit": _position_units(env),
        "drive": drives.tolist(),
        "default_position": _numbers(env.robot.default_pose),
        "action_offset": _numbers(env.action_offset),
        "action_scale": _numbers(env.action_scale),
        "gain": _numbers(gain),
        "stiffness": _numbers(stiffness),
        "damping": _numbers(damping),
        "effort": _numbers(model.actuator_forcerange[:, 1]),
        "velocity": _numbers(env.robot.velocity),
    }


def _scan(env: LeggedEnv) -> dict[str, Any] | None:
    """Return where the height scan looks; None without one."""
    if not env.state.height_scan.shape[1]:
        return None
    terrain = env.cfg.terrain
    return {
        "frame": "at the base's position, turned by its yaw alone; x forward, y left",
        "value": "height of the base above the ground at the point",
        "unit": "m",
        "points": [[x, y] for x in terrain.measured_points_x for y in terrain.measured_points_y],
    }


def _numbers(values: Any) -> list[float]:
    """Return numbers as they were written: a float32 of 0.1 is 0.1."""
    return [float(f"{value + 0.0:.7g}") for value in np.asarray(values, float)]
