"""Write the configuration of a robot for mjlab: entity and actuators."""

from collections.abc import Mapping, Sequence

from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.initial_state import initial_state
from terrainkit_robots.onboarding.frameworks.naming import constant_name, package_name
from terrainkit_robots.onboarding.frameworks.patterns import mjlab_patterns
from terrainkit_robots.onboarding.frameworks.source import (
    GENERATED_NOTE,
    PARENT_FOLDER,
    dict_entries,
    docstring,
    float_literal,
    format_collection,
    format_strings,
    indent,
    join_lines,
    string_literal,
    sum_assignment,
)

LEGGED_ONLY = False
"""Whether the framework supports only robots with legs."""

_FIELDS = {
    "stiffness": "stiffness",
    "damping": "damping",
    "effort_limit": "effort",
    "armature": "armature",
}
"""Fields of BuiltinPositionActuatorCfg, and the corresponding fields of the spec.
BuiltinVelocityActuatorCfg has the same fields except for the stiffness."""

_POSITION, _VELOCITY = "BuiltinPositionActuatorCfg", "BuiltinVelocityActuatorCfg"


def config_text(robot: ConfigRobot) -> str:
    """Return the text of `mjlab_config.py`.

    Raises:
        ConfigError: if two joints have the same name in mjlab.
    """
    name = constant_name(robot.spec.name)
    patterns = mjlab_patterns(robot.spec.joint_order)
    kinds = [_POSITION] * bool(robot.position_joints) + [_VELOCITY] * bool(robot.velocity_joints)
    return join_lines(
        [
            docstring(_about(robot, name)),
            ["", "from pathlib import Path", "", "import mujoco"],
            [f"from mjlab.actuator import {', '.join(kinds)}"] if kinds else [],
            ["from mjlab.entity import EntityArticulationInfoCfg, EntityCfg", ""],
            sum_assignment("ROBOT_XML", PARENT_FOLDER, "/", string_literal(robot.spec.mjcf)),
            _get_spec(),
            ["", f"{name}_INIT_STATE = EntityCfg.InitialStateCfg("],
            [*indent(initial_state(robot, patterns, depth=1)), ")"],
            _articulation(robot, name, patterns),
            _scales(robot, name, patterns),
            _robot_cfg(name),
        ]
    )


def _about(robot: ConfigRobot, name: str) -> list[str]:
    package = package_name(robot.spec.name)
    paragraphs = [
        f"{robot.title} for mjlab: entity and actuators.",
        f"{GENERATED_NOTE} A pattern matches the whole name of a joint.",
        f"Copy the folder into your Python package as {package}, and use",
        f"    from {package}.mjlab_config import get_robot_cfg\n\n"
        '    cfg.scene.entities = {"robot": get_robot_cfg()}',
        "mjlab orders actions as the joints in robot.xml. Its position actuators have no velocity "
        "limits; these are in robot.toml.",
    ]
    if robot.velocity_joints:
        paragraphs.append(
            "Joints without stiffness have velocity targets: use a JointVelocityActionCfg with "
            f"actuator_names=tuple({name}_SPEED_SCALE), and a JointPositionActionCfg with the "
            f"names of {name}_ACTION_SCALE."
        )
    return paragraphs


def _get_spec() -> list[str]:
    return [
        "",
        "",
        "def get_spec() -> mujoco.MjSpec:",
        '    """Return the robot without actuators and keyframes, which mjlab adds."""',
        "    spec = mujoco.MjSpec.from_file(str(ROBOT_XML))",
        "    actuator = mujoco.mjtObj.mjOBJ_ACTUATOR",
        "    sensors = [sensor for sensor in spec.sensors if sensor.objtype == actuator]",
        "    for element in [*sensors, *spec.keys, *spec.actuators]:",
        "        spec.delete(element)",
        "    return spec",
        "",
    ]


def _articulation(robot: ConfigRobot, name: str, patterns: Mapping[str, str]) -> list[str]:
    """Return the source of the actuators; joints with the same values share an actuator."""
    tables = {
        field: robot.joint_values(source)
        if field in ("effort_limit", "armature")
        else robot.all_joint_values(source)
        for field, source in _FIELDS.items()
    }
    groups: dict[tuple[str, ...], list[str]] = {}
    for joint in robot.spec.joint_order:
        is_wheel = joint in robot.velocity_joints
        arguments = [
            f"{field}={float_literal(values[joint])},"
            for field, values in tables.items()
            if joint in values and not (is_wheel and field == "stiffness")
        ]
        groups.setdefault((_VELOCITY if is_wheel else _POSITION, *arguments), []).append(joint)
    actuators = []
    for (kind, *arguments), joints in groups.items():
        names = format_strings(patterns[joint] for joint in joints)
        expression = format_collection("target_names_expr=", names, "()", depth=3, suffix=",")
        actuators += [f"{kind}(", *indent([*expression, *arguments]), "),"]
    origins = [
        line
        for field, source in _FIELDS.items()
        for line in robot.provenance_comment(source, prefix=field.replace("_", " ").capitalize())
    ]
    block = ["    actuators=(", *indent(actuators, 2), "    ),"]
    return [
        "",
        *origins,
        f"{name}_ARTICULATION = EntityArticulationInfoCfg(",
        *(block if actuators else ["    actuators=(),"]),
        *indent(robot.soft_limit_comment(depth=1)),
        f"    soft_joint_pos_limit_factor={float_literal(robot.soft_limit_factor)},",
        ")",
    ]


def _scales(robot: ConfigRobot, name: str, patterns: Mapping[str, str]) -> list[str]:
    """Return the action scales of joints with position targets and with velocity targets."""

    def entries(joints: Sequence[str]) -> list[str]:
        scales = robot.action_scales(joints)
        return dict_entries({patterns[joint]: scale for joint, scale in scales.items()})

    lines = []
    if robot.position_joints or not robot.velocity_joints:
        origin = robot.provenance_comment("action_scale")
        lines += ["", "# For JointPositionActionCfg.scale.", *origin]
        lines += format_collection(f"{name}_ACTION_SCALE = ", entries(robot.position_joints), "{}")
    if robot.velocity_joints:
        lines += ["", "# For JointVelocityActionCfg.scale.", *robot.velocity_scale_comment()]
        lines += format_collection(f"{name}_SPEED_SCALE = ", entries(robot.velocity_joints), "{}")
    return lines


def _robot_cfg(name: str) -> list[str]:
    return [
        "",
        "",
        "def get_robot_cfg() -> EntityCfg:",
        '    """Return a new configuration of the robot."""',
        "    return EntityCfg(",
        "        spec_fn=get_spec,",
        f"        init_state={name}_INIT_STATE,",
        f"        articulation={name}_ARTICULATION,",
        "        # Actuators in the order of the joints.",
        "        sort_actuators=True,",
        "    )",
    ]
