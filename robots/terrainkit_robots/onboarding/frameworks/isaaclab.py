"""Isaac Lab: the articulation of a robot, and its velocity task if it walks."""

from collections.abc import Mapping, Sequence

from terrainkit.errors import ConfigError
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.initial_state import initial_state
from terrainkit_robots.onboarding.frameworks.naming import class_name, constant_name, package_name
from terrainkit_robots.onboarding.frameworks.patterns import usd_patterns
from terrainkit_robots.onboarding.frameworks.source import (
    HERE,
    WRITTEN,
    assign,
    assign_sum,
    docstring,
    indented,
    literal,
    module,
    number,
    numbers,
    spread,
    strings,
    table,
)

LEGGED_ONLY = False
"""Whether it takes robots with legs only."""

_LIMITS = {
    "effort_limit_sim": "effort",
    "velocity_limit_sim": "velocity",
    "stiffness": "stiffness",
    "damping": "damping",
    "armature": "armature",
}
"""Fields of ImplicitActuatorCfg, and those of the spec that they hold."""


def config_text(robot: ConfigRobot) -> str:
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
            _scales(robot),
            _task(robot, name) if walks else [],
        ]
    )


def _about(robot: ConfigRobot, name: str, walks: bool) -> list[str]:
    package = package_name(robot.spec.name)
    paragraphs = [
        f"{robot.title} for Isaac Lab 2: its articulation"
        + (", and its velocity task." if walks else "."),
        f"{WRITTEN} Patterns have to match the whole name of a joint or body, and each name just "
        "one of them.",
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
    if robot.velocity_joints:
        paragraphs.append(
            "What has no stiffness is told a speed: it wants a JointVelocityActionCfg of WHEELS "
            "and SPEED_SCALE."
        )
    return [
        *paragraphs,
        "Isaac Lab orders joints breadth first, which need not be the order of robot.toml.",
    ]


def _articulation(robot: ConfigRobot, name: str) -> list[str]:
    lines = [
        "spawn=sim_utils.UrdfFileCfg(",
        *indented(_spawn(robot)),
        "),",
        "init_state=ArticulationCfg.InitialStateCfg(",
        *indented(initial_state(robot, usd_patterns(robot.spec.joint_order), depth=2)),
        "),",
        *robot.soft_limits(depth=1),
        f"soft_joint_pos_limit_factor={number(robot.soft_factor)},",
        "actuators={",
        *indented(_actuator(robot, "joints", robot.position_joints)),
        *indented(_actuator(robot, "wheels", robot.velocity_joints)),
        "},",
    ]
    return [f"{name} = ArticulationCfg(", *indented(lines), ")"]


def _spawn(robot: ConfigRobot) -> list[str]:
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


def _actuator(robot: ConfigRobot, name: str, joints: Sequence[str]) -> list[str]:
    """Return the entry of an actuator of these joints; nothing without joints."""
    if not joints:
        return []
    patterns = usd_patterns(robot.spec.joint_order)
    names = strings(patterns[joint] for joint in joints)
    lines = spread("joint_names_expr=", names, depth=3, tail=",")
    for field, source in _LIMITS.items():
        required = field in ("stiffness", "damping")
        known = robot.of_every_joint(source) if required else robot.by_joint(source)
        values = {joint: known[joint] for joint in joints if joint in known}
        if values:
            lines += robot.origin(source, depth=3)
            complete = len(values) == len(joints)
            lines += _value(f"{field}=", values, patterns, complete=complete, depth=3, tail=",")
    return [f'"{name}": ImplicitActuatorCfg(', *indented(lines), "),"]


def _scales(robot: ConfigRobot) -> list[str]:
    """Return what an action of 1 changes: a position, or a wheel's speed."""
    patterns = usd_patterns(robot.spec.joint_order)
    lines = []
    if robot.position_joints:
        lines += ["", *robot.origin("action_scale")]
        lines += _value("ACTION_SCALE = ", robot.scales(robot.position_joints), patterns)
    if robot.velocity_joints:
        lines += ["", *robot.speed_origin()]
        lines += _value("SPEED_SCALE = ", robot.scales(robot.velocity_joints), patterns)
        lines += spread("WHEELS = ", strings(patterns[joint] for joint in robot.velocity_joints))
    if robot.position_joints and (robot.velocity_joints or robot.unactuated):
        lines += spread("JOINTS = ", strings(patterns[joint] for joint in robot.position_joints))
    return lines


def _value(
    head: str,
    values: Mapping[str, float],
    patterns: Mapping[str, str],
    *,
    complete: bool = True,
    depth: int = 0,
    tail: str = "",
) -> list[str]:
    """Return a statement with one number, if all joints have it, else with one by pattern."""
    different = set(numbers(values.values()))
    if complete and len(different) == 1:
        return [f"{head}{different.pop()}{tail}"]
    entries = table({patterns[joint]: value for joint, value in values.items()})
    return spread(head, entries, "{}", depth=depth, tail=tail)


def _task(robot: ConfigRobot, name: str) -> list[str]:
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
        *["    from isaaclab.envs.mdp import JointVelocityActionCfg"] * bool(robot.velocity_joints),
        "    from isaaclab_tasks.manager_based.locomotion.velocity.velocity_env_cfg import (",
        "        LocomotionVelocityRoughEnvCfg,",
        "    )",
        "",
        "    cfg = LocomotionVelocityRoughEnvCfg()",
        f"    cfg.scene.robot = {name}.replace(",
        '        prim_path="{ENV_REGEX_NS}/Robot",',
        "    )",
        '    cfg.scene.height_scanner.prim_path = "{ENV_REGEX_NS}/Robot/" + BASE',
        *_actions(robot),
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


def _actions(robot: ConfigRobot) -> list[str]:
    """Return what tells each joint a position, or a speed."""
    lines = ["cfg.actions.joint_pos.scale = ACTION_SCALE"] if robot.position_joints else []
    if robot.velocity_joints or robot.unactuated:
        lines += [
            "cfg.actions.joint_pos.joint_names = JOINTS"
            if robot.position_joints
            else "cfg.actions.joint_pos = None"
        ]
    if robot.velocity_joints:
        lines += [
            "cfg.actions.joint_vel = JointVelocityActionCfg(",
            '    asset_name="robot",',
            "    joint_names=WHEELS,",
            "    scale=SPEED_SCALE,",
            ")",
        ]
    return indented(lines)


def _contact_term(term: str, name: str, bodies: Sequence[str]) -> list[str]:
    if not bodies:
        return [f"    cfg.{term} = None"]
    return [f'    cfg.{term}.params["sensor_cfg"].body_names = {name}']


def _bodies(robot: ConfigRobot) -> list[str]:
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
