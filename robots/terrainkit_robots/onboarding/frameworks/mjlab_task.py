"""Write mjlab's velocity task for a robot: what depends on the robot, and two registered tasks."""

import re

from terrainkit_robots.export.mjcf import COLLISION_SUFFIX
from terrainkit_robots.onboarding.frameworks import source
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.naming import class_name, package_name
from terrainkit_robots.onboarding.frameworks.patterns import (
    merge_names,
    merge_patterns,
    mjlab_patterns,
)
from terrainkit_robots.spec.robot_spec import RobotSpec

_POSE_STD = {
    "hip": (0.3, 0.5),
    "knee": (0.5, 0.8),
    "ankle": (0.2, 0.3),
    "roll": (0.15, 0.2),
    "yaw": (0.15, 0.2),
}
"""Standard deviation of the pose reward by role, walking and running [rad]."""

_DEFAULT_POSE_STD = (0.15, 0.3)
"""The same of other joints, such as arms."""

_CLEARANCE = 0.25
"""Target height of a swinging foot over the leg length, for legs that are too short for mjlab's."""

_MAX_CLEARANCE = 0.1
"""Target height of a swinging foot in mjlab [m]."""

_POSITION_ACTIONS = 'cfg.actions["joint_pos"].scale = ACTION_SCALE'

_NAMED_POSITION_ACTIONS = 'cfg.actions["joint_pos"].actuator_names = tuple(ACTION_SCALE)'

_NO_POSITION_ACTIONS = 'del cfg.actions["joint_pos"]'


def task_id(spec: RobotSpec, terrain: str) -> str:
    """Return the name of the task on a terrain, `Flat` or `Rough`."""
    return f"Mjlab-Velocity-{terrain}-{class_name(spec.name)}"


def task(robot: ConfigRobot) -> list[str]:
    """Return the names that the task needs, its functions, and the command that trains it."""
    return [
        "",
        "",
        *source.fill("mjlab_task", names=_names(robot), actions=_actions(robot)),
    ]


def _names(robot: ConfigRobot) -> list[str]:
    spec = robot.spec
    base = mjlab_patterns(robot.check_bodies([spec.base], "base"))[spec.base]
    # Feet are listed, since sites, sensors and rewards have to agree on their order.
    feet = [name.rsplit("/", maxsplit=1)[-1] for name in robot.check_bodies(spec.feet, "feet")]
    geoms = [rf"{re.escape(foot)}{COLLISION_SUFFIX}\d*" for foot in feet]
    return [
        *source.assignment("FLAT_TASK", source.string_literal(task_id(spec, "Flat"))),
        *source.assignment("ROUGH_TASK", source.string_literal(task_id(spec, "Rough"))),
        f"EXPERIMENT = {source.string_literal(package_name(spec.name))}",
        "",
        "# Names in robot.xml; a pattern matches a whole name.",
        *source.assignment("BASE", source.string_literal(base)),
        *source.format_collection("FEET = ", source.format_strings(feet), "()"),
        *source.format_collection("FOOT_GEOMS = ", source.format_strings(geoms), "()"),
        "# Bodies whose contacts with the ground are penalized, or end an episode.",
        *_bodies(robot, "PENALIZED", "penalized_contacts"),
        *_bodies(robot, "TERMINATION", "termination_contacts"),
        "# Target height of a swinging foot [m].",
        f"FOOT_CLEARANCE = {_foot_clearance(spec.leg_length)}",
        "# Standard deviation of the pose reward, by joint [rad].",
        *_pose_std(robot, "WALKING_STD", 0),
        *_pose_std(robot, "RUNNING_STD", 1),
    ]


def _bodies(robot: ConfigRobot, name: str, field: str) -> list[str]:
    bodies = robot.check_bodies(getattr(robot.spec, field), field)
    patterns = merge_names(bodies, mjlab_patterns(robot.all_bodies))
    return source.format_collection(f"{name} = ", source.format_strings(patterns), "()")


def _foot_clearance(leg_length: float | None) -> float:
    height = _MAX_CLEARANCE if leg_length is None else _CLEARANCE * leg_length
    return max(0.01, round(min(height, _MAX_CLEARANCE), 2))


def _pose_std(robot: ConfigRobot, name: str, index: int) -> list[str]:
    joints = robot.all_joints
    stds = {
        joint: _POSE_STD.get(robot.roles.get(joint, ""), _DEFAULT_POSE_STD)[index]
        for joint in joints
    }
    entries = source.dict_entries(merge_patterns(stds, mjlab_patterns(joints)))
    return source.format_collection(f"{name} = ", entries, "{}")


def _actions(robot: ConfigRobot) -> list[str]:
    """Return the source of the actions with position targets and velocity targets."""
    velocity = source.fill("mjlab_wheels") if robot.velocity_joints else []
    if not robot.position_joints:
        return [_NO_POSITION_ACTIONS, *velocity]
    return [_POSITION_ACTIONS, *([_NAMED_POSITION_ACTIONS] if velocity else []), *velocity]
