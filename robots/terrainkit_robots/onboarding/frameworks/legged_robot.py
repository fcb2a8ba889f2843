"""Write the parts of configurations that legged_gym and LeggedGym-Ex have in common.

Their templates ignore RUF012, which is about mutable class attributes.
"""

from collections.abc import Sequence

from terrainkit.errors import ConfigError, listing
from terrainkit_robots.onboarding.frameworks import source
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.naming import package_name
from terrainkit_robots.onboarding.frameworks.substrings import (
    Keys,
    common_key,
    gain_keys,
    keys_for,
)
from terrainkit_robots.text import group, names


def check_legs(robot: ConfigRobot, name: str, others: Sequence[str]) -> None:
    """Check that a robot can be trained to walk.

    Args:
        robot: The robot.
        name: Name of the framework.
        others: Frameworks that support other robots.

    Raises:
        ConfigError: if the robot has no legs, has unactuated joints or a fixed base, or its height
            is unknown.
    """
    spec = robot.spec
    if not spec.feet or not spec.joint_order:
        raise ConfigError(
            f"{robot.title} has no legs, but {name} requires a legged robot; "
            f"other frameworks: {listing(others)}"
        )
    if robot.passive_joints:
        raise ConfigError(
            f"{names(robot.passive_joints)} of {robot.title} have no actuator, but {name} "
            f"actuates all joints; other frameworks: {listing(others)}"
        )
    if not spec.floating:
        raise ConfigError(
            f"the base of {robot.title} is fixed, but {name} requires a floating base"
        )
    if spec.spawn_height is None or spec.base_height_target is None:
        raise ConfigError(f"{robot.title} has no spawn_height or base_height_target")


def init_state(robot: ConfigRobot) -> list[str]:
    """Return the spawn position and the default joint angles."""
    height = source.float_literal(robot.spec.spawn_height or 0.0)
    angles = robot.joint_values("default_pose")
    entries = source.dict_entries(angles)
    return [
        *robot.provenance_comment("spawn_height", depth=2, prefix="x, y, z"),
        f"pos = [0.0, 0.0, {height}]",
        *robot.provenance_comment("default_pose", depth=2),
        *source.format_collection("default_joint_angles = ", entries, "{}", depth=2),
    ]


def gains(robot: ConfigRobot, clash_note: str) -> list[str]:
    """Return stiffness and damping by joint, and the action scale.

    Args:
        robot: The robot.
        clash_note: How the framework handles several keys that match a joint.
    """
    stiffness, damping = robot.joint_values("stiffness"), robot.joint_values("damping")
    pairs = {joint: (stiffness[joint], damping[joint]) for joint in robot.spec.joint_order}
    result = gain_keys(robot.spec.joint_order, pairs)
    values = {key: pairs[key] for key in result.keys}
    groups = group((pair, joint) for joint, pair in pairs.items())
    shared = {pair: keys_for(joints, robot.spec.joint_order) for pair, joints in groups.items()}
    if not any(keys.clashes for keys in shared.values()):
        result = Keys(keys=tuple(key for keys in shared.values() for key in keys.keys))
        values = {key: pair for pair, keys in shared.items() for key in keys.keys}
    scales = robot.action_scales(robot.position_joints)
    held = [joint for joint, value in scales.items() if not value]
    moved = (value for value in scales.values() if value)
    scale, difference = robot.shared_value(moved, "median", depth=2)
    if held:
        note = f"Set the actions of these joints to 0, to hold the default pose: {listing(held)}."
        difference += source.comment(note, depth=2)
    velocity_note = ""
    if robot.velocity_joints:
        velocity_note = "The joints of SPEED_SCALE, without stiffness, have velocity targets."
    warning = ""
    if result.clashes:
        key, joint = result.clashes[0]
        warning = f"{joint} contains {key}: {clash_note}"
    return [
        "# P: actions are joint position targets.",
        'control_type = "P"',
        *source.comment(velocity_note, depth=2),
        "# A key applies to every joint whose name contains it.",
        *source.comment(warning, depth=2),
        *robot.provenance_comment("stiffness", depth=2),
        *_table("stiffness", {key: pair[0] for key, pair in values.items()}),
        *robot.provenance_comment("damping", depth=2),
        *_table("damping", {key: pair[1] for key, pair in values.items()}),
        *robot.provenance_comment("action_scale", depth=2),
        *difference,
        f"action_scale = {source.float_literal(scale)}",
        "# Simulation steps per policy step: 4 steps of 0.005 s, 50 Hz.",
        "decimation = 4",
    ]


def speed_scale(robot: ConfigRobot) -> list[str]:
    """Return the table of the velocity of each wheel for an action of 1; empty without wheels."""
    return robot.scale_table("SPEED_SCALE", "velocity") if robot.velocity_joints else []


def contacts(robot: ConfigRobot) -> list[str]:
    """Return the names of feet, and of bodies whose contacts are penalized or terminate.

    Raises:
        ConfigError: if no substring matches all feet and no other body.
    """
    spec = robot.spec
    feet = robot.check_bodies(spec.feet, "feet")
    foot_name = common_key(feet, robot.all_bodies)
    if foot_name is None:
        raise ConfigError(
            f"legged_gym finds feet by one substring, but no substring is in all of "
            f"{listing(map(repr, feet))} and in no other body; rename the feet, such as FL_foot"
        )
    return [
        "# Every body whose name contains it is a foot.",
        *source.assignment("foot_name", source.string_literal(foot_name), depth=2),
        *_body_keys(robot, "penalized_contacts", "penalize_contacts_on"),
        *_body_keys(robot, "termination_contacts", "terminate_after_contacts_on"),
    ]


def rewards(robot: ConfigRobot) -> list[str]:
    """Return the targets and limits of rewards."""
    return [
        *robot.soft_limit_comment(depth=2),
        f"soft_dof_pos_limit = {source.float_literal(robot.soft_limit_factor)}",
        *robot.provenance_comment("base_height_target", depth=2),
        f"base_height_target = {source.float_literal(robot.spec.base_height_target or 0.0)}",
    ]


def asset_name(robot: ConfigRobot) -> str:
    """Return the statement that names the actor."""
    return f"name = {source.string_literal(package_name(robot.spec.name))}"


def path_in_folder(attribute: str, name: str) -> list[str]:
    """Return a statement with the path of a file in the folder of the configuration."""
    escaped = name.replace("{", "{{").replace("}", "}}")
    return source.assignment(
        attribute, "HERE", f"+ {source.string_literal('/' + escaped)}", depth=2
    )


def _table(name: str, values: dict[str, float]) -> list[str]:
    return source.format_collection(f"{name} = ", source.dict_entries(values), "{}", depth=2)


def _body_keys(robot: ConfigRobot, field: str, attribute: str) -> list[str]:
    names = robot.check_bodies(getattr(robot.spec, field), field)
    result = keys_for(names, robot.all_bodies)
    lines = []
    for key, name in result.clashes:
        lines += source.comment(f"{key} also matches {name}.", depth=2)
    return [
        *lines,
        *source.format_collection(f"{attribute} = ", source.format_strings(result.keys), depth=2),
    ]
