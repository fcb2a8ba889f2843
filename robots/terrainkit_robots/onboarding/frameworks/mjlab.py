"""Write the configuration of a robot for mjlab: entity, actuators and velocity task."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from shlex import quote

from terrainkit_robots.onboarding.frameworks import mjlab_task, source
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.initial_state import initial_state
from terrainkit_robots.onboarding.frameworks.naming import package_name
from terrainkit_robots.onboarding.frameworks.patterns import (
    merge_names,
    merge_patterns,
    mjlab_patterns,
)
from terrainkit_robots.spec.robot_spec import RobotSpec

LEGGED_ONLY = False
"""Whether the framework supports only robots with legs."""

READS_MJCF = True
"""Whether the framework reads robot.xml, which has the closed loops, instead of robot.urdf."""

_FIELDS = {
    "stiffness": "stiffness",
    "damping": "damping",
    "effort_limit": "effort",
    "armature": "armature",
}
"""Fields of BuiltinPositionActuatorCfg, and the corresponding fields of the spec.
BuiltinVelocityActuatorCfg has the same fields except for the stiffness."""

_POSITION, _VELOCITY = "BuiltinPositionActuatorCfg", "BuiltinVelocityActuatorCfg"


_STANDARD_IMPORTS = ["import argparse", "import sys", "from dataclasses import replace"]


def train_arguments(spec: RobotSpec) -> str:
    """Return the arguments with which Python trains a robot in its folder; empty without a task."""
    if not (spec.feet and spec.joint_order and spec.floating):
        return ""
    return f"mjlab_config.py {mjlab_task.task_id(spec, 'Flat')}"


def train_commands(spec: RobotSpec, folder: Path) -> tuple[str, list[str]]:
    """Return where to train a robot, and the command."""
    file, _, task = train_arguments(spec).partition(" ")
    return "mjlab", [f"python {quote(str(folder / file))} {task}"] if task else []


def config_text(robot: ConfigRobot) -> str:
    """Return the text of `mjlab_config.py`.

    Raises:
        ConfigError: if two joints have the same name in mjlab.
    """
    patterns = mjlab_patterns(robot.all_joints)
    has_task = bool(train_arguments(robot.spec))
    drives = ((_POSITION, robot.position_joints), (_VELOCITY, robot.velocity_joints))
    kinds = [kind for kind, joints in drives if joints]
    entity = source.fill(
        "mjlab_entity",
        about=source.docstring(_about(robot, has_task=has_task)),
        standard=_STANDARD_IMPORTS if has_task else [],
        actuators=[f"from mjlab.actuator import {', '.join(kinds)}"] if kinds else [],
        task_imports=source.fill("mjlab_imports") if has_task else [],
        robot_xml=source.path_assignment("ROBOT_XML", robot.spec.mjcf),
        init_state=initial_state(robot, patterns, depth=1),
        articulation=_articulation(robot, patterns),
        scales=_scales(robot, patterns),
    )
    return source.join_lines([entity, mjlab_task.task(robot) if has_task else []])


def _about(robot: ConfigRobot, *, has_task: bool) -> list[str]:
    package = package_name(robot.spec.name)
    content = "entity, actuators and velocity task" if has_task else "entity and actuators"
    paragraphs = [
        f"{robot.title} for mjlab: {content}.",
        f"{source.GENERATED_NOTE} A pattern matches the whole name of a joint.",
        *(_training(robot) if has_task else []),
        f"Copy the folder into your Python package as {package}, and use",
        f"    from {package}.mjlab_config import get_robot_cfg\n\n"
        '    cfg.scene.entities = {"robot": get_robot_cfg()}',
        "mjlab orders actions as the joints in robot.xml. Its position actuators have no velocity "
        "limits; these are in robot.toml.",
    ]
    if robot.velocity_joints and not has_task:
        paragraphs.append(
            "Joints without stiffness have velocity targets: use a JointVelocityActionCfg with "
            "actuator_names=tuple(SPEED_SCALE), and a JointPositionActionCfg with the names of "
            "ACTION_SCALE."
        )
    return paragraphs


def _training(robot: ConfigRobot) -> list[str]:
    """Return how to train the task, and how to register it."""
    return [
        "Train it with mjlab 1.6, on flat ground or with Rough for Flat:",
        f"    python {train_arguments(robot.spec)} \\\n        --env.scene.num-envs 4096",
        "With `--map map.npz` and terrainkit installed, a map is the ground of the Rough task.",
        "mjlab's other commands, such as `play`, find the tasks if a package with an entry point "
        "in the group `mjlab.tasks` calls `register_tasks`.",
    ]


def _articulation(robot: ConfigRobot, patterns: Mapping[str, str]) -> list[str]:
    """Return the source of the actuators; joints with the same values share an actuator."""
    tables = {field: robot.joint_values(key) for field, key in _FIELDS.items()}
    groups: dict[tuple[str, ...], list[str]] = {}
    for joint in robot.spec.joint_order:
        is_wheel = joint in robot.velocity_joints
        arguments = [
            f"{field}={source.float_literal(values[joint])},"
            for field, values in tables.items()
            if joint in values and not (is_wheel and field == "stiffness")
        ]
        groups.setdefault((_VELOCITY if is_wheel else _POSITION, *arguments), []).append(joint)
    actuators = []
    # mjlab warns where the pattern of a joint also matches a site.
    sites = [site.rsplit("/", maxsplit=1)[-1] for site in robot.sites]
    patterns = {**dict(zip(sites, sites, strict=True)), **patterns}
    for (kind, *arguments), joints in groups.items():
        names = source.format_strings(merge_names(joints, patterns))
        expression = source.format_collection(
            "target_names_expr=", names, "()", depth=3, suffix=","
        )
        actuators += [f"{kind}(", *source.indent([*expression, *arguments]), "),"]
    origins = [
        line
        for field, key in _FIELDS.items()
        for line in robot.provenance_comment(key, prefix=field.replace("_", " ").capitalize())
    ]
    block = ["    actuators=(", *source.indent(actuators, 2), "    ),"]
    return [
        *origins,
        "ARTICULATION = EntityArticulationInfoCfg(",
        *(block if actuators else ["    actuators=(),"]),
        *source.indent(robot.soft_limit_comment(depth=1)),
        f"    soft_joint_pos_limit_factor={source.float_literal(robot.soft_limit_factor)},",
        ")",
    ]


def _scales(robot: ConfigRobot, patterns: Mapping[str, str]) -> list[str]:
    """Return the action scales of joints with position targets and with velocity targets."""

    def entries(joints: Sequence[str]) -> list[str]:
        return source.dict_entries(merge_patterns(robot.action_scales(joints), patterns))

    lines = []
    if robot.position_joints or not robot.velocity_joints:
        origin = robot.provenance_comment("action_scale")
        lines += ["", "# For JointPositionActionCfg.scale.", *origin]
        lines += source.format_collection("ACTION_SCALE = ", entries(robot.position_joints), "{}")
    if robot.velocity_joints:
        lines += ["", "# For JointVelocityActionCfg.scale.", *robot.velocity_scale_comment()]
        lines += source.format_collection("SPEED_SCALE = ", entries(robot.velocity_joints), "{}")
    return lines
