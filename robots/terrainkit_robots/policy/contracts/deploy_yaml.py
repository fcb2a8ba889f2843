"""The YAML files of Unitree's controllers: `deploy.yaml`, and the form of unitree_rl_gym."""

from collections.abc import Sequence
from typing import Any

import msgspec
import yaml

from terrainkit.errors import ConfigError, listing
from terrainkit_robots.policy.contracts.contract import (
    UNITREE,
    Contract,
    ContractError,
    ContractTerm,
    check_length,
)

YAML_FILE = "deploy.yaml"

MAX_FILE_SIZE = 1 << 18
"""Largest YAML file that is read [bytes]."""

GYM_GAIT_PERIOD = 0.8
"""Period of the gait phase in unitree_rl_gym [s], which its files do not state."""

DEFAULT_SCAN_OFFSET = 0.5
"""Offset of the height scan in Isaac Lab [m], where a file does not state it."""


def _both_sides(joints: str) -> list[str]:
    return [f"{side}_{joint}" for side in ("left", "right") for joint in joints.split()]


_ARM = "shoulder_pitch shoulder_roll shoulder_yaw elbow wrist_roll wrist_pitch wrist_yaw"
_G1_LEG = "hip_pitch hip_roll hip_yaw knee ankle_pitch ankle_roll"
_H1_2_LEG = "hip_yaw hip_pitch hip_roll knee ankle_pitch ankle_roll"
_H1 = (
    "right_hip_roll right_hip_pitch right_knee left_hip_roll left_hip_pitch left_knee torso "
    "left_hip_yaw right_hip_yaw - left_ankle right_ankle right_shoulder_pitch right_shoulder_roll "
    "right_shoulder_yaw right_elbow left_shoulder_pitch left_shoulder_roll left_shoulder_yaw "
    "left_elbow"
)
_MOTORS = {
    "a quadruped": [
        f"{leg}_{j}" for leg in ("FR", "FL", "RR", "RL") for j in ("hip", "thigh", "calf")
    ],
    "a g1": [
        *(*_both_sides(_G1_LEG), "waist_yaw", "waist_roll", "waist_pitch", *_both_sides(_ARM))
    ],
    "an h1_2": [*_both_sides(_H1_2_LEG), "torso", *_both_sides(_ARM)],
    "an h1": _H1.split(),
}
"""Joints of Unitree's robots in the order of their motors, without the suffix `_joint`."""


class _Term(msgspec.Struct):
    scale: list[float] | float | None = None
    clip: tuple[float, float] | None = None
    history_length: int = 1
    params: dict[str, Any] | None = None


class _Action(msgspec.Struct):
    scale: list[float] | float | None = None
    offset: list[float] | float | None = None
    clip: list[tuple[float, float]] | None = None
    joint_ids: list[int] | None = None
    joint_names: list[str] | None = None


class _Actions(msgspec.Struct, forbid_unknown_fields=True):
    action: _Action = msgspec.field(name="JointPositionAction")


class _Deploy(msgspec.Struct):
    joint_ids_map: list[int]
    step_dt: float
    stiffness: list[float]
    damping: list[float]
    default_joint_pos: list[float]
    actions: _Actions
    observations: dict[str, Any]
    commands: dict[str, Any] | None = None
    physics_dt: float | None = None


class _Loader(yaml.SafeLoader):
    """A loader that makes no objects, and merges no mappings, which can grow without bound."""

    def flatten_mapping(self, node: Any) -> None:
        if any(key.tag == "tag:yaml.org,2002:merge" for key, _ in node.value):
            raise yaml.YAMLError("got a merge key <<; expected the keys themselves")


# Isaac Lab's `slice(None)`: all joints. Other tags of Python are errors.
_Loader.add_constructor("tag:yaml.org,2002:python/object/apply:builtins.slice", lambda *_: None)


def read_yaml(data: bytes, robot_joints: Sequence[str], qpos_order: Sequence[str]) -> Contract:
    """Return the contract in a YAML file.

    Args:
        data: The file: `deploy.yaml`, or a configuration of unitree_rl_gym's `deploy_mujoco`.
        robot_joints: Names of the robot's joints.
        qpos_order: These joints in the order of the robot's model.

    Raises:
        ConfigError: If it is neither, or a value is missing or of the wrong kind.
    """
    if len(data) > MAX_FILE_SIZE:
        raise ConfigError(f"got {len(data)} bytes; expected at most {MAX_FILE_SIZE}")
    try:
        document = yaml.load(data, _Loader)
        if isinstance(document, dict) and "kps" in document:
            document = _from_gym(document, qpos_order)
        file = msgspec.convert(document, _Deploy, strict=False)
        return _read(file, _joint_names(file, robot_joints))
    except KeyError as error:
        raise ConfigError(f"{error.args[0]}: missing; expected the key of deploy_mujoco") from None
    except (yaml.YAMLError, ValueError, TypeError, OverflowError, RecursionError) as error:
        raise ConfigError(" ".join(str(error).split())[:300]) from error


def _read(file: _Deploy, joints: tuple[str, ...]) -> Contract:
    action, motors, count = file.actions.action, file.joint_ids_map, len(joints)
    if action.joint_ids not in (None, list(range(count))):
        got = f"got {str(action.joint_ids)[:60]}"
        raise ConfigError(f"joint_ids of the action: {got}; expected null: all joints in order")
    gains, doubts = [], []
    for name, values in (("stiffness", file.stiffness), ("damping", file.damping)):
        if len(values) > max(motors):
            gains.append(tuple(values[motor] for motor in motors))
            continue
        check_length(name, values, count)
        gains.append(tuple(values))
        doubts.append(
            ContractError(
                f"{name}: got {count} values for motors up to {max(motors)}; Unitree's controller "
                "gives value k to motor k",
                f"{max(motors) + 1} values, 0 without a joint",
            )
        )
    terms = dict(file.observations)
    if terms.pop("scale_first", False):
        raise ConfigError("scale_first: got true; expected false: clip before the scale")
    is_interleaved = bool(terms.pop("use_gym_history", False))
    ranges = ((file.commands or {}).get("base_velocity") or {}).get("ranges") or {}
    given = {name: limits for name, limits in ranges.items() if limits is not None}
    scale, offset = (
        tuple(value) if isinstance(value, list) else (default if value is None else value,) * count
        for value, default in ((action.scale, 1.0), (action.offset, 0.0))
    )
    return Contract(
        style=UNITREE,
        joints=joints,
        default_pose=tuple(file.default_joint_pos),
        stiffness=gains[0],
        damping=gains[1],
        action_scale=scale,
        action_offset=offset,
        target_limits=tuple(action.clip or ()),
        terms=tuple(_read_term(name, term) for name, term in terms.items()),
        is_interleaved=is_interleaved,
        step_dt=file.step_dt,
        physics_dt=file.physics_dt,
        commands=msgspec.convert(given, dict[str, tuple[float, float]], strict=False),
        doubts=tuple(doubts),
    )


def _read_term(name: str, table: Any) -> ContractTerm:
    try:
        term = msgspec.convert(table, _Term, strict=False)
    except msgspec.ValidationError as error:
        raise ConfigError(f"observations.{name}: {error}") from None
    scale = [1.0] if term.scale is None else term.scale
    params = {k: v for k, v in (term.params or {}).items() if isinstance(v, int | float)}
    return ContractTerm(
        name=name,
        scale=tuple(scale) if isinstance(scale, list) else (scale,),
        clip=term.clip,
        history=term.history_length or 1,  # 0 is the current step alone, as in Isaac Lab
        params={"offset": DEFAULT_SCAN_OFFSET} | params if "height_scan" in name else params,
    )


def _joint_names(file: _Deploy, robot_joints: Sequence[str]) -> tuple[str, ...]:
    """Return the joints of the policy in order: named in the file, or those of a Unitree robot."""
    motors, names = file.joint_ids_map, file.actions.action.joint_names or []
    if not motors or min(motors) < 0 or max(motors) > 255:
        raise ConfigError(f"joint_ids_map: got {str(motors)[:60]}; expected numbers of motors")
    if len(names) == len(motors) and set(names) <= set(robot_joints):
        return tuple(names)
    found = {}
    for robot, order in _MOTORS.items():
        known = dict(enumerate(order))
        joints = tuple(f"{known.get(motor)}_joint" for motor in motors)
        if set(joints) <= set(robot_joints):
            found[robot] = joints
    if len(found) == 1:
        return next(iter(found.values()))
    which = f"got motors of {listing(found)}" if found else "got motors of an unknown robot"
    example = f"joint_names: [{listing(robot_joints[:2])}, ...]"
    expected = "expected the names of its joints in order, in actions.JointPositionAction"
    raise ConfigError(f"joint_ids_map: {which}; {expected}: {example}")


def _from_gym(gym: dict[str, Any], joints: Sequence[str]) -> dict[str, Any]:
    """Return a configuration of unitree_rl_gym in the form of `deploy.yaml`."""
    pose = gym["default_angles"]
    count = len(joints)
    observations = {
        "base_ang_vel": gym["ang_vel_scale"],
        "projected_gravity": 1.0,
        "velocity_commands": gym["cmd_scale"],
        "joint_pos_rel": gym["dof_pos_scale"],
        "joint_vel_rel": gym["dof_vel_scale"],
        "last_action": 1.0,
    }
    terms: dict[str, Any] = {name: {"scale": scale} for name, scale in observations.items()}
    if gym["num_obs"] == 11 + 3 * count:
        terms["gait_phase"] = {"params": {"period": GYM_GAIT_PERIOD}}
    action = {"scale": gym["action_scale"], "offset": pose, "joint_names": list(joints)}
    return {
        "joint_ids_map": list(range(count)),
        "physics_dt": gym["simulation_dt"],
        "step_dt": gym["simulation_dt"] * gym["control_decimation"],
        "stiffness": gym["kps"],
        "damping": gym["kds"],
        "default_joint_pos": pose,
        "actions": {"JointPositionAction": action},
        "observations": terms,
    }


def write_deploy_yaml(contract: Contract) -> str:
    """Return a contract of this style as `deploy.yaml`, whose motors are the joints in order."""
    document: dict[str, Any] = {
        "joint_ids_map": list(range(len(contract.joints))),
        "step_dt": contract.step_dt,
        "stiffness": list(contract.stiffness),
        "damping": list(contract.damping),
        "default_joint_pos": list(contract.default_pose),
        "commands": {
            "base_velocity": {"ranges": {k: list(v) for k, v in contract.commands.items()}}
        },
        "actions": {
            "JointPositionAction": {
                "clip": None,
                "joint_names": list(contract.joints),
                "scale": list(contract.action_scale),
                "offset": list(contract.action_offset),
                "joint_ids": None,
            }
        },
        "observations": {
            term.name: {
                "params": dict(term.params),
                "clip": list(term.clip) if term.clip else None,
                "scale": list(term.scale),
                "history_length": term.history,
            }
            for term in contract.terms
        },
    }
    return yaml.safe_dump(document, default_flow_style=None, sort_keys=False, width=100)
