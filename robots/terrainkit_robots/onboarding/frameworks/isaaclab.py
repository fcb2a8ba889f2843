"""Write the configuration of a robot for Isaac Lab: articulation and velocity task."""

import re
from collections.abc import Mapping, Sequence

from terrainkit.errors import ConfigError
from terrainkit_robots.onboarding.frameworks import source
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.initial_state import initial_state
from terrainkit_robots.onboarding.frameworks.naming import class_name, constant_name, package_name
from terrainkit_robots.onboarding.frameworks.patterns import (
    merge_names,
    merge_patterns,
    usd_patterns,
)

LEGGED_ONLY = False
"""Whether the framework supports only robots with legs."""

_IMPLICIT, _DC_MOTOR = "ImplicitActuatorCfg", "DCMotorCfg"

_GAINS = {"stiffness": "stiffness", "damping": "damping", "armature": "armature"}

_FIELDS = {
    _IMPLICIT: {"effort_limit_sim": "effort", "velocity_limit_sim": "velocity", **_GAINS},
    _DC_MOTOR: {"effort_limit": "effort", "velocity_limit": "velocity", **_GAINS},
}
"""Fields of each type of actuator, and the corresponding fields of the spec."""

_MIN_MOTOR_FEET = 4
"""From this number of feet on, legs have DC motors, as Isaac Lab's own quadrupeds."""

_MAX_PART_LENGTH = 20
"""Longest name of an actuator that is made of the names of its joints."""


def config_text(robot: ConfigRobot) -> str:
    """Return the text of `isaaclab_config.py`.

    Raises:
        ConfigError: if the robot has no joints, or two joints have the same name in USD.
    """
    if not robot.spec.joint_order:
        raise ConfigError(f"{robot.title} has no joints, which Isaac Lab requires")
    spec = robot.spec
    actuators = _actuators(robot)
    name = f"{constant_name(spec.name)}_CFG"
    is_legged = bool(spec.feet) and spec.floating
    config = source.fill(
        "isaaclab_config",
        about=source.docstring(_about(robot, name, is_legged)),
        kinds=", ".join(sorted(set(actuators.values()))),
        task_imports=source.fill("isaaclab_imports") if is_legged else [],
        urdf=source.path_assignment("ROBOT_URDF", spec.urdf),
        name=name,
        fix_base=str(not spec.floating),
        merge="not IS_ISAACLAB_3" if is_legged and robot.has_fixed_feet else "True",
        init_state=initial_state(robot, usd_patterns(robot.all_joints), depth=2),
        soft_limit=robot.soft_limit_comment(depth=1),
        factor=source.float_literal(robot.soft_limit_factor),
        actuators=[
            line
            for (part, joints), kind in actuators.items()
            for line in _actuator(robot, part, kind, joints)
        ],
        scales=_scales(robot),
    )
    return source.join_lines([config, _task(robot, name) if is_legged else []])


def _about(robot: ConfigRobot, name: str, is_legged: bool) -> list[str]:
    package = package_name(robot.spec.name)
    paragraphs = [
        f"{robot.title} for Isaac Lab 2 and 3: articulation"
        + (" and velocity task." if is_legged else "."),
        f"{source.GENERATED_NOTE} A pattern matches the whole name of a joint or body, and each "
        "name is matched by one pattern.",
        f"Copy the folder into your Python package as {package}, and use",
        f"    from {package}.isaaclab_config import {name}\n\n"
        f'    robot = {name}.replace(prim_path="{{ENV_REGEX_NS}}/Robot")',
    ]
    if is_legged:
        register = source.fill(
            "isaaclab_register", robot=class_name(robot.spec.name), package=package
        )
        paragraphs += ["or register the task, with Isaac Lab's PPO of the Go2:"]
        paragraphs += ["\n".join(register)]
    if robot.velocity_joints:
        paragraphs.append(
            "Joints without stiffness have velocity targets: use a JointVelocityActionCfg with "
            "WHEELS and SPEED_SCALE."
        )
    return [
        *paragraphs,
        "Isaac Lab orders joints breadth-first, on Newton depth-first, which may differ from the "
        "order of robot.toml.",
    ]


def _actuators(robot: ConfigRobot) -> dict[tuple[str, tuple[str, ...]], str]:
    """Return the type of each actuator by its name and joints.

    A DC motor has one saturation effort, so joints with other effort limits have their own motor.
    """
    effort, velocity = robot.joint_values("effort"), robot.joint_values("velocity")
    has_motors = len(robot.spec.feet) >= _MIN_MOTOR_FEET
    motors: dict[float, list[str]] = {}
    groups: dict[str, list[str]] = {}
    for joint in robot.spec.joint_order:
        role = robot.roles.get(joint, "")
        is_leg = role not in ("", "waist")
        if joint in robot.velocity_joints:
            groups.setdefault("wheels", []).append(joint)
        elif has_motors and (is_leg or not robot.roles) and joint in effort and joint in velocity:
            motors.setdefault(effort[joint], []).append(joint)
        else:
            body_part = "feet" if role == "ankle" else "legs" if is_leg else "upper_body"
            groups.setdefault(body_part if robot.roles else "joints", []).append(joint)
    patterns = usd_patterns(robot.all_joints)
    found = {}
    for index, joints in enumerate(motors.values(), 1):
        words = re.findall(r"[A-Za-z]+", " ".join(merge_names(joints, patterns)))
        part = "_".join(word for word in dict.fromkeys(words) if word.lower() != "joint")
        name = part if 0 < len(part) <= _MAX_PART_LENGTH else f"legs_{index}"
        found[name if len(motors) > 1 else "legs", tuple(joints)] = _DC_MOTOR
    return found | {(name, tuple(joints)): _IMPLICIT for name, joints in groups.items()}


def _actuator(robot: ConfigRobot, name: str, kind: str, joints: Sequence[str]) -> list[str]:
    """Return the source of an actuator of some joints."""
    patterns = usd_patterns(robot.all_joints)
    names = source.format_strings(merge_names(joints, patterns))
    lines = source.format_collection("joint_names_expr=", names, depth=3, suffix=",")
    for field, key in _FIELDS[kind].items():
        known = robot.joint_values(key)
        values = {joint: known[joint] for joint in joints if joint in known}
        if values:
            lines += robot.provenance_comment(key, depth=3)
            complete = len(values) == len(joints)
            lines += _value(f"{field}=", values, patterns, complete=complete, depth=3, suffix=",")
        if kind == _DC_MOTOR and field == "effort_limit":
            lines.append(f"saturation_effort={source.float_literal(values[joints[0]])},")
    friction = ["friction=0.0,"] if kind == _DC_MOTOR else []
    return [f'"{name}": {kind}(', *source.indent([*lines, *friction]), "),"]


def _scales(robot: ConfigRobot) -> list[str]:
    """Return the action scales of joints with position targets and with velocity targets."""
    patterns = usd_patterns(robot.all_joints)
    lines = []
    if robot.position_joints:
        lines += ["", *robot.provenance_comment("action_scale")]
        lines += _value("ACTION_SCALE = ", robot.action_scales(robot.position_joints), patterns)
    if robot.velocity_joints:
        lines += ["", *robot.velocity_scale_comment()]
        lines += _value("SPEED_SCALE = ", robot.action_scales(robot.velocity_joints), patterns)
        wheels = source.format_strings(merge_names(robot.velocity_joints, patterns))
        lines += source.format_collection("WHEELS = ", wheels)
    if robot.position_joints and (robot.velocity_joints or robot.passive_joints):
        joints = source.format_strings(merge_names(robot.position_joints, patterns))
        lines += source.format_collection("JOINTS = ", joints)
    return lines


def _value(
    prefix: str,
    values: Mapping[str, float],
    patterns: Mapping[str, str],
    *,
    complete: bool = True,
    depth: int = 0,
    suffix: str = "",
) -> list[str]:
    """Return a statement with one number if all joints have the same value, else with a dict."""
    different = set(source.format_floats(values.values()))
    if complete and len(different) == 1:
        return [f"{prefix}{different.pop()}{suffix}"]
    entries = source.dict_entries(merge_patterns(values, patterns))
    return source.format_collection(prefix, entries, "{}", depth=depth, suffix=suffix)


def _task(robot: ConfigRobot, name: str) -> list[str]:
    """Return the names of bodies, and the class of the velocity task."""
    low, high = source.format_floats(robot.spec.reset_range)
    return source.fill(
        "isaaclab_task",
        bodies=_bodies(robot),
        name=name,
        actions=_actions(robot),
        low=low,
        high=high,
        contacts=[
            _contact_term("rewards.undesired_contacts", "PENALIZED", robot.spec.penalized_contacts),
            _contact_term(
                "terminations.base_contact", "TERMINATION", robot.spec.termination_contacts
            ),
        ],
    )


def _actions(robot: ConfigRobot) -> list[str]:
    """Return the source of the actions with position targets and velocity targets."""
    lines = ["self.actions.joint_pos.scale = ACTION_SCALE"] if robot.position_joints else []
    if robot.velocity_joints or robot.passive_joints:
        lines += [
            "self.actions.joint_pos.joint_names = JOINTS"
            if robot.position_joints
            else "self.actions.joint_pos = None"
        ]
    if robot.velocity_joints:
        lines += source.fill("isaaclab_wheels")
    return lines


def _contact_term(term: str, name: str, bodies: Sequence[str]) -> str:
    if not bodies:
        return f"self.{term} = None"
    return f'self.{term}.params["sensor_cfg"].body_names = {name}'


def _bodies(robot: ConfigRobot) -> list[str]:
    spec = robot.spec
    patterns = usd_patterns(robot.all_bodies)
    lines = source.assignment(
        "BASE", source.string_literal(patterns[robot.check_bodies([spec.base], "base")[0]])
    )
    for name, field in (
        ("FEET", "feet"),
        ("PENALIZED", "penalized_contacts"),
        ("TERMINATION", "termination_contacts"),
    ):
        names = robot.check_bodies(getattr(spec, field), field)
        merged = source.format_strings(merge_names(names, patterns))
        lines += source.format_collection(f"{name} = ", merged)
    return lines
