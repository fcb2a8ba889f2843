"""The robot as legged_gym and its successors see it: found by substrings, standing on feet."""

from collections.abc import Sequence

from terrainkit.errors import ConfigError, listing
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.naming import package_name
from terrainkit_robots.onboarding.frameworks.source import (
    assign,
    assign_sum,
    comment,
    indented,
    literal,
    number,
    spread,
    strings,
    table,
)
from terrainkit_robots.onboarding.frameworks.substrings import common_key, gain_keys, keys_for
from terrainkit_robots.text import names

BEFORE_IMPORTS = ["# ruff: noqa: RUF012", "", "from pathlib import Path", ""]
"""The first lines. Lists that belong to a class are how these frameworks are configured."""

HERE = [
    "# The framework passes the name through str.format, which doubled braces survive.",
    'HERE = str(Path(__file__).resolve().parent).replace("{", "{{").replace("}", "}}")',
]
"""How a configuration finds the robot that lies beside it."""


def check_legs(robot: ConfigRobot, framework: str, others: Sequence[str]) -> None:
    """Refuse a robot that cannot walk.

    Raises:
        ConfigError: if it has no legs or no joints, or some without a motor, is bolted down, or
            nobody knows how high it is.
    """
    spec = robot.spec
    if not spec.feet or not spec.joint_order:
        raise ConfigError(
            f"{robot.title} has no legs; {framework} trains legged robots; "
            f"for others there are: {listing(others)}"
        )
    if robot.unactuated:
        raise ConfigError(
            f"no motor drives {names(robot.unactuated)} of {robot.title}; {framework} drives "
            f"every joint; for others there are: {listing(others)}"
        )
    if not spec.floating:
        raise ConfigError(
            f"the base of {robot.title} is fixed; {framework} trains robots that walk"
        )
    if spec.spawn_height is None or spec.base_height_target is None:
        raise ConfigError(f"{robot.title} lacks a spawn_height or a base_height_target")


def class_of(name: str, base: str, body: list[str]) -> list[str]:
    """Return a nested class, indented, with a blank line in front."""
    return indented(["", f"class {name}({base}.{name}):", *indented(body)])


def init_state(robot: ConfigRobot) -> list[str]:
    """Return where the robot starts, and the pose that actions are added to."""
    height = number(robot.spec.spawn_height or 0.0)
    angles = robot.of_every_joint("default_pose")
    entries = table(angles)
    return [
        *robot.origin("spawn_height", depth=2, what="x, y, z"),
        f"pos = [0.0, 0.0, {height}]",
        *robot.origin("default_pose", depth=2),
        *spread("default_joint_angles = ", entries, "{}", depth=2),
    ]


def gains(robot: ConfigRobot, if_clashing: str) -> list[str]:
    """Return stiffness and damping by names of joints, and the scale of actions."""
    stiffness, damping = robot.of_every_joint("stiffness"), robot.of_every_joint("damping")
    pairs = {joint: (stiffness[joint], damping[joint]) for joint in robot.spec.joint_order}
    found = gain_keys(robot.spec.joint_order, pairs)
    scale, differ = robot.one_for_all(
        robot.scales(robot.position_joints).values(), "median", depth=2
    )
    undriven = ""
    if robot.velocity_joints:
        wants = "wants a speed, which P does not tell it"
        undriven = f"What has no stiffness {wants}: {listing(robot.velocity_joints)}."
    warning = ""
    if found.clashes:
        key, joint = found.clashes[0]
        warning = f"{joint} contains {key}: {if_clashing}"
    return [
        "# P: actions are targets of joint positions.",
        'control_type = "P"',
        *comment(undriven, depth=2),
        "# A key stands for every joint whose name contains it.",
        *comment(warning, depth=2),
        *robot.origin("stiffness", depth=2),
        *_table("stiffness", stiffness, found.keys),
        *robot.origin("damping", depth=2),
        *_table("damping", damping, found.keys),
        *robot.origin("action_scale", depth=2),
        *differ,
        f"action_scale = {number(scale)}",
        "# Steps of the simulation for one of the policy: 4 of 0.005 s, 50 Hz.",
        "decimation = 4",
    ]


def contacts(robot: ConfigRobot) -> list[str]:
    """Return what the feet are called, and whose contacts cost reward or end an episode.

    Raises:
        ConfigError: if no one substring means the feet.
    """
    spec = robot.spec
    feet = robot.known(spec.feet, "feet")
    foot_name = common_key(feet, robot.all_bodies)
    if foot_name is None:
        raise ConfigError(
            f"legged_gym finds feet by one substring, and none is in all of "
            f"{listing(map(repr, feet))} and in no other body; rename them, to end in _foot say"
        )
    return [
        "# Every body whose name contains it is a foot.",
        *assign("foot_name", literal(foot_name), depth=2),
        *_listed(robot, "penalized_contacts", "penalize_contacts_on"),
        *_listed(robot, "termination_contacts", "terminate_after_contacts_on"),
    ]


def shapes() -> list[str]:
    """Return how Isaac Gym is to read the URDF that terrainkit writes."""
    return [
        "# 1 switches them off: a URDF cannot exclude pairs of bodies that overlap at rest.",
        "self_collisions = 1",
        "# Feet on fixed joints stay bodies where the URDF says dont_collapse.",
        "collapse_fixed_joints = True",
        "# Heights were measured with the shapes as they are, and meshes have z up.",
        "replace_cylinder_with_capsule = False",
        "flip_visual_attachments = False",
    ]


def rewards(robot: ConfigRobot) -> list[str]:
    """Return what rewards compare with."""
    return [
        *robot.soft_limits(depth=2),
        f"soft_dof_pos_limit = {number(robot.soft_factor)}",
        *robot.origin("base_height_target", depth=2),
        f"base_height_target = {number(robot.spec.base_height_target or 0.0)}",
    ]


def asset_name(robot: ConfigRobot) -> str:
    """Return the statement that names the actor."""
    return f"name = {literal(package_name(robot.spec.name))}"


def path_in_folder(attribute: str, name: str) -> list[str]:
    """Return the statement that gives a file beside the configuration."""
    escaped = name.replace("{", "{{").replace("}", "}}")
    return assign_sum(attribute, "HERE", "+", literal("/" + escaped), depth=2)


def _table(name: str, values: dict[str, float], keys: tuple[str, ...]) -> list[str]:
    entries = table({key: values[key] for key in keys})
    return spread(f"{name} = ", entries, "{}", depth=2)


def _listed(robot: ConfigRobot, field: str, attribute: str) -> list[str]:
    names = robot.known(getattr(robot.spec, field), field)
    found = keys_for(names, robot.all_bodies)
    lines = []
    for key, name in found.clashes:
        lines += comment(f"{key} is also in {name}, which cannot be told apart.", depth=2)
    return [*lines, *spread(f"{attribute} = ", strings(found.keys), depth=2)]
