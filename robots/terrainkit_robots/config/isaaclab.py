"""Isaac Lab: the articulation of a robot, and its velocity task if it walks."""

from collections.abc import Mapping, Sequence

from terrainkit.errors import ConfigError
from terrainkit_robots.config.naming import class_name, constant_name, package_name
from terrainkit_robots.config.patterns import usd_patterns
from terrainkit_robots.config.robot import ConfiguredRobot
from terrainkit_robots.config.source import (
    HERE,
    assign,
    assign_sum,
    docstring,
    indented,
    keyed,
    literal,
    module,
    number,
    numbers,
    spread,
    strings,
)

_LIMITS = {
    "effort_limit_sim": "effort",
    "velocity_limit_sim": "velocity",
    "stiffness": "stiffness",
    "damping": "damping",
    "armature": "armature",
}
"""Fields of ImplicitActuatorCfg, and those of the spec that they hold."""


def config_text(robot: ConfiguredRobot) -> str:
    """Return the file `isaaclab_config.py` of a robot.

    Raises:
        ConfigError: if it has no joints, or two of them have one name in USD.
    """
    if not robot.spec.joint_order:
        raise ConfigError(f"{robot.title} has no joints; Isaac Lab configures articulations")
    name = f"{constant_name(robot.spec.name)}_CFG"
    walks = bool(robot.spec.feet) and robot.spec.floating
    return module(
        [
            docstring(_about(robot, name, walks)),
            ["", "from pathlib import Path", "", "import isaaclab.sim as sim_utils"],
            ["from isaaclab.actuators import ImplicitActuatorCfg"],
            ["from isaaclab.assets import ArticulationCfg", ""],
            [*assign_sum("ROBOT_URDF", HERE, "/", literal(robot.spec.urdf)), ""],
            _articulation(robot, name),
            ["", *_by_pattern(robot, "ACTION_SCALE", "action_scale")],
            _task(robot, name) if walks else [],
        ]
    )


def _about(robot: ConfiguredRobot, name: str, walks: bool) -> list[str]:
    package = package_name(robot.spec.name)
    paragraphs = [
        f"{robot.title} for Isaac Lab 2: its articulation"
        + (", and its velocity task." if walks else "."),
        "Written by terrainkit from robot.toml; a comment before a value tells its unit and where "
        "it came from. SI units and radians. Patterns have to match the whole name of a joint or "
        "body, and each name just one of them.",
        f"Put the whole folder into a package of yours, as {package}, and use",
        f"    from {package}.isaaclab_config import {name}\n\n"
        f'    robot = {name}.replace(prim_path="{{ENV_REGEX_NS}}/Robot")',
    ]
    if walks:
        paragraphs += [
            "or register the task:",
            "\n".join(
                [
                    "    gymnasium.register(",
                    f'        id="Isaac-Velocity-Rough-{class_name(robot.spec.name)}-v0",',
                    '        entry_point="isaaclab.envs:ManagerBasedRLEnv",',
                    "        disable_env_checker=True,",
                    "        kwargs={",
                    f'            "env_cfg_entry_point": "{package}.isaaclab_config:rough_env_cfg"',
                    "        },",
                    "    )",
                ]
            ),
        ]
    return [
        *paragraphs,
        "Isaac Lab orders joints breadth first, which need not be the order of robot.toml.",
    ]


def _articulation(robot: ConfiguredRobot, name: str) -> list[str]:
    lines = [
        "spawn=sim_utils.UrdfFileCfg(",
        *indented(_spawn(robot)),
        "),",
        "init_state=ArticulationCfg.InitialStateCfg(",
        *indented(_init_state(robot)),
        "),",
        *robot.soft_limits(depth=1),
        f"soft_joint_pos_limit_factor={number(robot.soft_factor)},",
        "actuators={",
        '    "joints": ImplicitActuatorCfg(',
        *indented(_actuator(robot), 2),
        "    ),",
        "},",
    ]
    return [f"{name} = ArticulationCfg(", *indented(lines), ")"]


def _spawn(robot: ConfiguredRobot) -> list[str]:
    spec = robot.spec
    return [
        "asset_path=str(ROBOT_URDF),",
        f"fix_base={not spec.floating},",
        "# Feet on fixed joints stay bodies where the URDF says dont_collapse.",
        "merge_fixed_joints=True,",
        "replace_cylinders_with_capsules=False,",
        "activate_contact_sensors=True,",
        "# The actuators below drive the joints, not what the importer would set.",
        "joint_drive=sim_utils.UrdfConverterCfg.JointDriveCfg(",
        "    gains=sim_utils.UrdfConverterCfg.JointDriveCfg.PDGainsCfg(",
        "        stiffness=0.0,",
        "        damping=0.0,",
        "    ),",
        "),",
        "rigid_props=sim_utils.RigidBodyPropertiesCfg(",
        "    disable_gravity=False,",
        "    max_depenetration_velocity=1.0,",
        "),",
        "articulation_props=sim_utils.ArticulationRootPropertiesCfg(",
        "    # A URDF cannot exclude pairs of bodies that overlap at rest.",
        "    enabled_self_collisions=False,",
        "    solver_position_iteration_count=4,",
        "    solver_velocity_iteration_count=0,",
        "),",
    ]


def _init_state(robot: ConfiguredRobot) -> list[str]:
    patterns = usd_patterns(robot.spec.joint_order)
    pose = robot.of_every_joint("default_pose")
    entries = keyed({patterns[joint]: number(angle) for joint, angle in pose.items()})
    return [
        *robot.origin("spawn_height", depth=2, what="x, y, z"),
        f"pos=(0.0, 0.0, {number(robot.spec.spawn_height or 0.0)}),",
        *robot.origin("default_pose", depth=2),
        *spread("joint_pos=", entries, "{}", depth=2, tail=","),
        'joint_vel={".*": 0.0},',
    ]


def _actuator(robot: ConfiguredRobot) -> list[str]:
    patterns = usd_patterns(robot.spec.joint_order)
    names = strings(patterns.values())
    lines = spread("joint_names_expr=", names, depth=3, tail=",")
    for field, source in _LIMITS.items():
        required = field in ("stiffness", "damping")
        values = robot.of_every_joint(source) if required else robot.by_joint(source)
        if values:
            lines += robot.origin(source, depth=3)
            lines += _value(robot, f"{field}=", values, patterns, depth=3, tail=",")
    return lines


def _by_pattern(robot: ConfiguredRobot, name: str, field: str) -> list[str]:
    patterns = usd_patterns(robot.spec.joint_order)
    values = robot.of_every_joint(field)
    return [*robot.origin(field), *_value(robot, f"{name} = ", values, patterns)]


def _value(
    robot: ConfiguredRobot,
    head: str,
    values: Mapping[str, float],
    patterns: Mapping[str, str],
    *,
    depth: int = 0,
    tail: str = "",
) -> list[str]:
    """Return a statement with one number, if all joints have it, else with one by pattern."""
    numbers = {joint: number(value) for joint, value in values.items()}
    if len(numbers) == len(robot.spec.joint_order) and len(set(numbers.values())) == 1:
        return [f"{head}{next(iter(numbers.values()))}{tail}"]
    entries = keyed({patterns[joint]: value for joint, value in numbers.items()})
    return spread(head, entries, "{}", depth=depth, tail=tail)


def _task(robot: ConfiguredRobot, name: str) -> list[str]:
    """Return the bodies by name, and a function that puts the robot into the velocity task."""
    low, high = numbers(robot.spec.reset_range)
    return [
        "",
        "# Bodies, once fixed joints are merged.",
        *_bodies(robot),
        "",
        "",
        "def rough_env_cfg():",
        '    """Return Isaac Lab\'s velocity task on rough ground, with this robot in it."""',
        "    from isaaclab_tasks.manager_based.locomotion.velocity.velocity_env_cfg import (",
        "        LocomotionVelocityRoughEnvCfg,",
        "    )",
        "",
        "    cfg = LocomotionVelocityRoughEnvCfg()",
        f"    cfg.scene.robot = {name}.replace(",
        '        prim_path="{ENV_REGEX_NS}/Robot",',
        "    )",
        '    cfg.scene.height_scanner.prim_path = "{ENV_REGEX_NS}/Robot/" + BASE',
        "    cfg.actions.joint_pos.scale = ACTION_SCALE",
        "    # Factors on the default pose between which a joint starts an episode.",
        "    reset = cfg.events.reset_robot_joints.params",
        f'    reset["position_range"] = ({low}, {high})',
        "    # Which of these there are depends on the version of Isaac Lab.",
        '    for event in ("add_base_mass", "base_com", "base_external_force_torque"):',
        "        term = getattr(cfg.events, event, None)",
        "        if term is not None:",
        '            term.params["asset_cfg"].body_names = BASE',
        '    cfg.rewards.feet_air_time.params["sensor_cfg"].body_names = FEET',
        *_contact_term("rewards.undesired_contacts", "PENALIZED", robot.spec.penalized_contacts),
        *_contact_term("terminations.base_contact", "TERMINATION", robot.spec.termination_contacts),
        "    return cfg",
    ]


def _contact_term(term: str, name: str, bodies: Sequence[str]) -> list[str]:
    if not bodies:
        return [f"    cfg.{term} = None"]
    return [f'    cfg.{term}.params["sensor_cfg"].body_names = {name}']


def _bodies(robot: ConfiguredRobot) -> list[str]:
    spec = robot.spec
    patterns = usd_patterns(robot.all_bodies)
    lines = assign("BASE", literal(patterns[robot.known([spec.base], "base")[0]]))
    for name, field in (
        ("FEET", "feet"),
        ("PENALIZED", "penalized_contacts"),
        ("TERMINATION", "termination_contacts"),
    ):
        names = robot.known(getattr(spec, field), field)
        lines += spread(f"{name} = ", strings(patterns[body] for body in names))
    return lines
