"""The robot of a policy: its joint order, default pose and gains replace the robot's."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from terrainkit.errors import ConfigError, listing
from terrainkit_robots.policy.contracts.contract import Contract, ContractError
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.geoms import lowest_point
from terrainkit_robots.spec.robot_arrays import Robot
from terrainkit_robots.transforms import FloatArray

TABLES = {
    "P": ("effort", "velocity", "armature", "stiffness", "damping", "action_scale"),
    "V": ("effort", "velocity", "armature", "damping"),
    "T": ("effort", "velocity", "armature"),
}
"""Tables of a robot's spec that a policy replaces, by control type."""


def replace_joints(robot: Robot, joints: Mapping[str, Sequence[Any]], control_type: str) -> Robot:
    """Return a robot with the joint order, pose, gains and limits of a policy.

    Args:
        robot: The robot.
        joints: `name`, and lists with a value for each name.
        control_type: Quantity that an action controls, `P`, `V` or `T`.

    Raises:
        ConfigError: If the names are not the robot's joints, or a list has another length.
    """
    names, spec = joints.get("name", []), robot.spec
    if sorted(map(str, names)) != sorted(spec.joint_order):
        got = listing(str(name) for name in names if name not in spec.joint_order)
        missing = listing(name for name in spec.joint_order if name not in names)
        what = f"got {got}, which {spec.name} lacks, and not its {missing}"
        if set(names) == set(spec.joint_order):
            what = f"got {len(names)} names; expected each of the {len(spec.joint_order)} once"
        raise ConfigError(f"joints.name, the policy belongs to another robot: {what}")
    keys = {name: name for name in TABLES[control_type]} | {"default_pose": "default_position"}
    tables = {name: joints[key] for name, key in keys.items() if key in joints}
    for name, values in tables.items():
        if len(values) != len(names):
            got = f"got {len(values)} values"
            raise ConfigError(f"joints.{keys[name]}: {got}; expected one for each joint")
    pairs = {name: dict(zip(names, values, strict=True)) for name, values in tables.items()}
    spec = replace(spec, joint_order=tuple(names), **pairs)  # type: ignore[arg-type]
    return Robot.from_spec(spec, robot.folder)


def contract_robot(contract: Contract, robot: Robot) -> Robot:
    """Return a robot with the joints, gains and standing height of a contract.

    Joints that the policy does not have follow its joints, without an action.

    Raises:
        ContractError: If the robot lacks a joint of the policy.
    """
    order, spec = contract.joints, robot.spec
    if unknown := [name for name in order if name not in spec.joint_order]:
        got = f"joint names: got {listing(unknown)}, which {spec.name} lacks"
        raise ContractError(got, f"joints among {listing(spec.joint_order)}")
    others = [name for name in spec.joint_order if name not in order]
    joints: dict[str, list[Any]] = {"name": [*order, *others]}
    keys = {"stiffness": "stiffness", "damping": "damping", "default_pose": "default_position"}
    for table, key in keys.items():
        own = spec.per_joint(table)
        joints[key] = [*getattr(contract, table), *(own[name] for name in others)]
    joints["action_scale"] = [*contract.action_scale, *(0.0 for _ in others)]
    new = replace_joints(robot, joints, "P")
    change = _lowest_foot(robot) - _lowest_foot(new)
    spec = replace(
        new.spec,
        spawn_height=robot.spawn_height + change,
        base_height_target=robot.base_height_target + change,
    )
    return Robot.from_spec(spec, robot.folder)


def load_model(robot: Robot) -> Any:
    """Return the robot's own MuJoCo model."""
    with quiet_mujoco():
        return mujoco.MjModel.from_xml_path(str(robot.mjcf))


def imu_position(robot: Robot) -> FloatArray:
    """Return the position of the velocimeter on the base, in its frame [m]; 0 without just one."""
    model, base = load_model(robot), robot.spec.base
    sites = model.sensor_objid[model.sensor_type == mujoco.mjtSensor.mjSENS_VELOCIMETER]
    on_base = [k for k in sites if model.body(model.site_bodyid[k]).name == base]
    position = model.site_pos[on_base[0]] if len(on_base) == 1 else np.zeros(3)
    return position.astype(np.float32)


def qpos_order(robot: Robot) -> list[str]:
    """Return the robot's actuated joints in the order of its model."""
    model = load_model(robot)
    return sorted(robot.spec.joint_order, key=lambda name: int(model.joint(name).qposadr[0]))


def _lowest_foot(robot: Robot) -> float:
    """Return the height of the lowest foot in the default pose, with the base at 0 [m]."""
    model = load_model(robot)
    data = mujoco.MjData(model)
    with quiet_mujoco():
        for name, position in zip(robot.spec.joint_order, robot.default_pose, strict=True):
            data.joint(name).qpos = position
        mujoco.mj_kinematics(model, data)
    feet = [model.body(foot).id for foot in robot.spec.feet]
    geoms = [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] in feet]
    base = data.body(robot.spec.base).xpos[2]
    return float(min((lowest_point(model, data, geom) for geom in geoms), default=base) - base)
