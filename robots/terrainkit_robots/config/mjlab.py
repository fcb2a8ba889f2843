"""mjlab: the entity of a robot, with actuators of its own."""

from collections.abc import Mapping

from terrainkit_robots.config.naming import constant_name, package_name
from terrainkit_robots.config.patterns import mjlab_patterns
from terrainkit_robots.config.robot import ConfiguredRobot
from terrainkit_robots.config.source import (
    HERE,
    assign_sum,
    docstring,
    indented,
    keyed,
    literal,
    module,
    number,
    spread,
    strings,
)

_FIELDS = {
    "stiffness": "stiffness",
    "damping": "damping",
    "effort_limit": "effort",
    "armature": "armature",
}
"""Fields of BuiltinPositionActuatorCfg, and those of the spec that they hold."""


def config_text(robot: ConfiguredRobot) -> str:
    """Return the file `mjlab_config.py` of a robot.

    Raises:
        ConfigError: if two joints have one name in mjlab.
    """
    name = constant_name(robot.spec.name)
    patterns = mjlab_patterns(robot.spec.joint_order)
    return module(
        [
            docstring(_about(robot)),
            ["", "from pathlib import Path", "", "import mujoco"],
            ["from mjlab.actuator import BuiltinPositionActuatorCfg"] if patterns else [],
            ["from mjlab.entity import EntityArticulationInfoCfg, EntityCfg", ""],
            assign_sum("ROBOT_XML", HERE, "/", literal(robot.spec.mjcf)),
            _get_spec(),
            _init_state(robot, name, patterns),
            _articulation(robot, name, patterns),
            _action_scale(robot, name, patterns),
            _robot_cfg(name),
        ]
    )


def _about(robot: ConfiguredRobot) -> list[str]:
    package = package_name(robot.spec.name)
    return [
        f"{robot.title} for mjlab: its entity.",
        "Written by terrainkit from robot.toml; a comment before a value tells its unit and where "
        "it came from. SI units and radians. Patterns have to match the whole name of a joint.",
        f"Put the whole folder into a package of yours, as {package}, and use",
        f"    from {package}.mjlab_config import get_robot_cfg\n\n"
        '    cfg.scene.entities = {"robot": get_robot_cfg()}',
        "mjlab orders actions by the joints of robot.xml. Its position actuators know no limit of "
        "speed; those are in robot.toml.",
    ]


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


def _init_state(robot: ConfiguredRobot, name: str, patterns: Mapping[str, str]) -> list[str]:
    pose = robot.of_every_joint("default_pose")
    entries = keyed({patterns[joint]: number(angle) for joint, angle in pose.items()})
    body = [
        *robot.origin("spawn_height", depth=1, what="x, y, z"),
        f"pos=(0.0, 0.0, {number(robot.spec.spawn_height or 0.0)}),",
        *robot.origin("default_pose", depth=1),
        *spread("joint_pos=", entries, "{}", depth=1, tail=","),
        'joint_vel={".*": 0.0},',
    ]
    return ["", f"{name}_INIT_STATE = EntityCfg.InitialStateCfg(", *indented(body), ")"]


def _articulation(robot: ConfiguredRobot, name: str, patterns: Mapping[str, str]) -> list[str]:
    """Return the actuators: joints that have the same numbers share one."""
    tables = {
        field: robot.by_joint(source)
        if field in ("effort_limit", "armature")
        else robot.of_every_joint(source)
        for field, source in _FIELDS.items()
    }
    groups: dict[tuple[str, ...], list[str]] = {}
    for joint in robot.spec.joint_order:
        values = tuple(
            f"{field}={number(table[joint])}," for field, table in tables.items() if joint in table
        )
        groups.setdefault(values, []).append(joint)
    actuators = []
    for values, joints in groups.items():
        names = strings(patterns[joint] for joint in joints)
        expression = spread("target_names_expr=", names, "()", depth=3, tail=",")
        body = indented([*expression, *values])
        actuators += ["BuiltinPositionActuatorCfg(", *body, "),"]
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


def _action_scale(robot: ConfiguredRobot, name: str, patterns: Mapping[str, str]) -> list[str]:
    scales = robot.of_every_joint("action_scale")
    entries = keyed({patterns[joint]: number(scale) for joint, scale in scales.items()})
    return [
        "",
        "# For JointPositionActionCfg.scale.",
        *robot.origin("action_scale"),
        *spread(f"{name}_ACTION_SCALE = ", entries, "{}"),
    ]


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
