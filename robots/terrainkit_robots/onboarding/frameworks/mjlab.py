"""mjlab: the entity of a robot, with actuators of its own."""

from collections.abc import Mapping, Sequence

from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.initial_state import initial_state
from terrainkit_robots.onboarding.frameworks.naming import constant_name, package_name
from terrainkit_robots.onboarding.frameworks.patterns import mjlab_patterns
from terrainkit_robots.onboarding.frameworks.source import (
    HERE,
    WRITTEN,
    assign_sum,
    docstring,
    indented,
    literal,
    module,
    number,
    spread,
    strings,
    table,
)

LEGGED_ONLY = False
"""Whether it takes robots with legs only."""

_FIELDS = {
    "stiffness": "stiffness",
    "damping": "damping",
    "effort_limit": "effort",
    "armature": "armature",
}
"""Fields of BuiltinPositionActuatorCfg, and those of the spec that they hold. Those of
BuiltinVelocityActuatorCfg are the same, but for the stiffness."""

_POSITION, _VELOCITY = "BuiltinPositionActuatorCfg", "BuiltinVelocityActuatorCfg"


def config_text(robot: ConfigRobot) -> str:
    """Return the file `mjlab_config.py` of a robot.

    Raises:
        ConfigError: if two joints have one name in mjlab.
    """
    name = constant_name(robot.spec.name)
    patterns = mjlab_patterns(robot.spec.joint_order)
    kinds = [_POSITION] * bool(robot.position_joints) + [_VELOCITY] * bool(robot.velocity_joints)
    return module(
        [
            docstring(_about(robot, name)),
            ["", "from pathlib import Path", "", "import mujoco"],
            [f"from mjlab.actuator import {', '.join(kinds)}"] if kinds else [],
            ["from mjlab.entity import EntityArticulationInfoCfg, EntityCfg", ""],
            assign_sum("ROBOT_XML", HERE, "/", literal(robot.spec.mjcf)),
            _get_spec(),
            ["", f"{name}_INIT_STATE = EntityCfg.InitialStateCfg("],
            [*indented(initial_state(robot, patterns, depth=1)), ")"],
            _articulation(robot, name, patterns),
            _scales(robot, name, patterns),
            _robot_cfg(name),
        ]
    )


def _about(robot: ConfigRobot, name: str) -> list[str]:
    package = package_name(robot.spec.name)
    paragraphs = [
        f"{robot.title} for mjlab: its entity.",
        f"{WRITTEN} Patterns have to match the whole name of a joint.",
        f"Put the whole folder into a package of yours, as {package}, and use",
        f"    from {package}.mjlab_config import get_robot_cfg\n\n"
        '    cfg.scene.entities = {"robot": get_robot_cfg()}',
        "mjlab orders actions by the joints of robot.xml. Its position actuators know no limit of "
        "speed; those are in robot.toml.",
    ]
    if robot.velocity_joints:
        paragraphs.append(
            "What has no stiffness is told a speed: it wants a JointVelocityActionCfg with "
            f"actuator_names=tuple({name}_SPEED_SCALE), and the JointPositionActionCfg those of "
            f"{name}_ACTION_SCALE."
        )
    return paragraphs


def _get_spec() -> list[str]:
    return [
        "",
        "",
        "def get_spec() -> mujoco.MjSpec:",
        '    """Return the robot without the actuators and keyframes that mjlab adds itself."""',
        "    spec = mujoco.MjSpec.from_file(str(ROBOT_XML))",
        "    actuator = mujoco.mjtObj.mjOBJ_ACTUATOR",
        "    theirs = [sensor for sensor in spec.sensors if sensor.objtype == actuator]",
        "    for element in [*theirs, *spec.keys, *spec.actuators]:",
        "        spec.delete(element)",
        "    return spec",
        "",
    ]


def _articulation(robot: ConfigRobot, name: str, patterns: Mapping[str, str]) -> list[str]:
    """Return the actuators: joints that have the same numbers share one."""
    tables = {
        field: robot.by_joint(source)
        if field in ("effort_limit", "armature")
        else robot.of_every_joint(source)
        for field, source in _FIELDS.items()
    }
    groups: dict[tuple[str, ...], list[str]] = {}
    for joint in robot.spec.joint_order:
        rolls = joint in robot.velocity_joints
        arguments = [
            f"{field}={number(values[joint])},"
            for field, values in tables.items()
            if joint in values and not (rolls and field == "stiffness")
        ]
        groups.setdefault((_VELOCITY if rolls else _POSITION, *arguments), []).append(joint)
    actuators = []
    for (kind, *arguments), joints in groups.items():
        names = strings(patterns[joint] for joint in joints)
        expression = spread("target_names_expr=", names, "()", depth=3, tail=",")
        actuators += [f"{kind}(", *indented([*expression, *arguments]), "),"]
    origins = [
        line
        for field, source in _FIELDS.items()
        for line in robot.origin(source, what=field.replace("_", " ").capitalize())
    ]
    opened = ["    actuators=(", *indented(actuators, 2), "    ),"]
    return [
        "",
        *origins,
        f"{name}_ARTICULATION = EntityArticulationInfoCfg(",
        *(opened if actuators else ["    actuators=(),"]),
        *indented(robot.soft_limits(depth=1)),
        f"    soft_joint_pos_limit_factor={number(robot.soft_factor)},",
        ")",
    ]


def _scales(robot: ConfigRobot, name: str, patterns: Mapping[str, str]) -> list[str]:
    """Return what an action of 1 changes: a position, or a wheel's speed."""

    def entries(joints: Sequence[str]) -> list[str]:
        return table({patterns[joint]: scale for joint, scale in robot.scales(joints).items()})

    lines = []
    if robot.position_joints or not robot.velocity_joints:
        lines += ["", "# For JointPositionActionCfg.scale.", *robot.origin("action_scale")]
        lines += spread(f"{name}_ACTION_SCALE = ", entries(robot.position_joints), "{}")
    if robot.velocity_joints:
        lines += ["", "# For JointVelocityActionCfg.scale.", *robot.speed_origin()]
        lines += spread(f"{name}_SPEED_SCALE = ", entries(robot.velocity_joints), "{}")
    return lines


def _robot_cfg(name: str) -> list[str]:
    return [
        "",
        "",
        "def get_robot_cfg() -> EntityCfg:",
        '    """Return a new configuration of the robot, which may be changed."""',
        "    return EntityCfg(",
        "        spec_fn=get_spec,",
        f"        init_state={name}_INIT_STATE,",
        f"        articulation={name}_ARTICULATION,",
        "        # Actuators in the order of the joints.",
        "        sort_actuators=True,",
        "    )",
    ]
