"""Run the policy of this folder in MuJoCo, on a plane: python run_policy.py --vx 0.5 --viewer."""

import argparse
import json
import runpy
import sys
import time
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import onnxruntime

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--vx", type=float, default=0.5, help="forward velocity [m/s]")
parser.add_argument("--vy", type=float, default=0.0, help="velocity to the left [m/s]")
parser.add_argument("--yaw", type=float, default=0.0, help="yaw rate [rad/s]")
parser.add_argument("--seconds", type=float, default=10.0, help="duration [s]")
parser.add_argument("--viewer", action="store_true", help="show the robot in a window")
parser.add_argument("--observations", help="Python file with functions of your own observations")
args = parser.parse_args()

# A function of the name of the observation takes the data and the rotation of the base.
own: dict[str, Any] = runpy.run_path(args.observations) if args.observations else {}
folder = Path(__file__).parent
config = json.loads((folder / "policy.json").read_text())
policy = onnxruntime.InferenceSession(folder / config["files"]["onnx"])
timing = config["timing"]
joints = {k: np.array(v) for k, v in config["joints"].items()}

# The robot on a plane, with the joints and the friction of the training.
spec = mujoco.MjSpec.from_file(str(folder / config["files"]["mjcf"]))
for element in (*spec.actuators, *spec.keys):  # policy.json has the gains and the default pose
    spec.delete(element)
for k, joint in enumerate(map(spec.joint, joints["name"])):
    joint.armature, joint.frictionloss = joints["armature"][k], joints["frictionloss"][k]
plane = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], priority=2)
plane.friction[0] = config["contact"]["friction"]
spec.option.timestep = timing["physics_dt"]
model = spec.compile()
data = mujoco.MjData(model)
qpos_index = [model.joint(name).qposadr[0] for name in joints["name"]]
qvel_index = [model.joint(name).dofadr[0] for name in joints["name"]]
data.qpos[:7] = 0, 0, config["robot"]["spawn_height"], 1, 0, 0, 0
data.qpos[qpos_index] = joints["default_position"]
controlled = [config["joints"]["name"].index(name) for name in config["action"]["joints"]]


def linear_velocity(rotation: Any) -> Any:
    """Return the velocity of the center of the robot in the frame of the base."""
    return rotation.T @ data.qvel[:3] + np.cross(data.qvel[3:6], config["robot"]["center"])


def observe(command: Any, action: Any, rotation: Any, past: Any = None) -> Any:
    """Return the observation; the columns of `rotation` are the axes of the base.

    `past` has the history of each part, and is updated.
    """
    terms = {"commands": command, "actions": action, "projected_gravity": -rotation[2]}
    terms |= {"dof_pos": data.qpos[qpos_index], "dof_vel": data.qvel[qvel_index]}
    terms |= {"base_ang_vel": data.qvel[3:6], "base_lin_vel": linear_velocity(rotation)}
    if gait := config["gait"]:
        angle = 2 * np.pi * data.time / gait["period"]
        is_moving = command[:2].any() or abs(command[2]) >= gait["min_yaw_rate"]
        terms["gait_phase"] = is_moving * np.array([np.sin(angle), np.cos(angle)])
    mujoco.mj_rnePostConstraint(model, data)  # contact forces on the bodies, in `cfrc_ext`
    feet = [model.body(name).id for name in config["feet"]["name"]]
    terms["foot_contact"] = data.cfrc_ext[feet, 5] > config["feet"]["contact_force"]
    if scan := config["height_scan"]:
        terms["height_scan"] = np.full(len(scan["points"]), data.qpos[2])  # above a plane
    values: list[Any] = []
    past = {} if past is None else past
    for part in config["observation"]["parts"]:
        if part["name"] in own:
            terms[part["name"]] = np.atleast_1d(own[part["name"]](data, rotation))
        size = part["history"] * np.size(terms.get(part["name"], ()))
        if size != part["stop"] - part["start"]:
            sys.exit(f"observation {part['name']}: unknown; define it in a file for --observations")
        value = np.clip(terms[part["name"]] - part["offset"], *part.get("clip", (-np.inf, np.inf)))
        value = value * part["scale"]
        steps = past.get(part["name"], part["history"] * [value])  # at first, copies
        past[part["name"]] = [*steps[1:], value]  # the oldest first
        values += past[part["name"]]
    return np.concatenate(values, dtype=np.float32)


if args.viewer:
    import mujoco.viewer

    viewer = mujoco.viewer.launch_passive(model, data)
command, action = np.array([args.vx, args.vy, args.yaw]), np.zeros(len(controlled))
rotation, velocity = np.eye(3), np.zeros(3)
history: dict[str, Any] = {}
steps = max(1, round(args.seconds / timing["policy_dt"]))
memory = config["recurrent"] or {"inputs": []}  # the state of a recurrent network
state = {name: np.zeros(memory["shape"], np.float32) for name in memory["inputs"]}
for _ in range(steps):
    obs = observe(command, action, rotation, history)
    (action, *_), *values = policy.run(None, {"obs": obs[None], **state})
    state = dict(zip(memory["inputs"], values, strict=True))
    target = joints["action_offset"].copy()
    target[controlled] += joints["action_scale"][controlled] * action
    for _ in range(timing["decimation"]):
        torque = joints["gain"] * target - joints["stiffness"] * data.qpos[qpos_index]
        torque -= joints["damping"] * data.qvel[qvel_index]
        data.qfrc_applied[qvel_index] = np.clip(torque, -joints["effort"], joints["effort"])
        mujoco.mj_step(model, data)
    mujoco.mju_quat2Mat(rotation.reshape(9), data.qpos[3:7])  # in place
    velocity += [*linear_velocity(rotation)[:2], data.qvel[5]]
    if rotation[2, 2] < 0.5:
        sys.exit(f"fell after {data.time:.2f} s")
    if args.viewer:
        viewer.sync()
        time.sleep(timing["policy_dt"])
print(f"distance: {np.hypot(*data.qpos[:2]):.2f} m in {data.time:.2f} s")
print("mean velocity: {:.2f} m/s forward, {:.2f} m/s left, {:.2f} rad/s".format(*velocity / steps))
