"""Write the configuration of a robot for LeggedGym-Ex: Isaac Gym, Genesis and Isaac Lab."""

from terrainkit_robots.onboarding.frameworks import legged_robot
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.naming import class_name, package_name
from terrainkit_robots.onboarding.frameworks.source import (
    GENERATED_NOTE,
    assignment,
    comment,
    docstring,
    float_literal,
    format_collection,
    format_strings,
    indent,
    join_lines,
    string_literal,
)

LEGGED_ONLY = True
"""Whether the framework supports only robots with legs."""

_REWARD_SCALES = {
    "tracking_lin_vel": "1.0",
    "tracking_ang_vel": "0.5",
    "lin_vel_z": "-2.0",
    "ang_vel_xy": "-0.05",
    "torques": "-1e-5",
    "dof_acc": "-2.5e-7",
    "dof_pos_limits": "-1.0",
    "action_rate": "-0.01",
    "feet_air_time": "1.0",
    "collision": "-1.0",
}
"""Reward scales of legged_gym, and one for joint limits. The defaults in LeggedGym-Ex are 0."""


def config_text(robot: ConfigRobot) -> str:
    """Return the text of `leggedgym_ex_config.py`.

    Raises:
        ConfigError: if LeggedGym-Ex does not support the names of the bodies.
    """
    name = class_name(robot.spec.name)
    return join_lines(
        [
            docstring(_about(robot, name)),
            ["", *legged_robot.BEFORE_IMPORTS, "from legged_gym import SIMULATOR"],
            [
                "from legged_gym.envs.base.legged_robot_config import (",
                "    LeggedRobotCfg,",
                "    LeggedRobotCfgPPO,",
                ")",
                "",
            ],
            legged_robot.HERE,
            ["", "", f"class {name}Cfg(LeggedRobotCfg):"],
            legged_robot.class_of("env", "LeggedRobotCfg", _env(robot))[1:],
            legged_robot.class_of("init_state", "LeggedRobotCfg", legged_robot.init_state(robot)),
            legged_robot.class_of("control", "LeggedRobotCfg", _control(robot)),
            legged_robot.class_of("asset", "LeggedRobotCfg", _asset(robot)),
            legged_robot.class_of("rewards", "LeggedRobotCfg", _rewards(robot)),
            ["", "", f"class {name}CfgPPO(LeggedRobotCfgPPO):"],
            legged_robot.class_of("runner", "LeggedRobotCfgPPO", _runner(robot))[1:],
        ]
    )


def _about(robot: ConfigRobot, name: str) -> list[str]:
    package = package_name(robot.spec.name)
    return [
        f"{robot.title} for LeggedGym-Ex: flat ground.",
        GENERATED_NOTE,
        f"Copy the folder to legged_gym/envs/{package} and register the robot in "
        "legged_gym/envs/__init__.py:",
        "\n".join(
            [
                f"    from legged_gym.envs.{package}.leggedgym_ex_config import (",
                f"        {name}Cfg,",
                f"        {name}CfgPPO,",
                "    )",
                "    task_registry.register(",
                f'        "{package}", LeggedRobot, {name}Cfg(), {name}CfgPPO()',
                "    )",
            ]
        ),
        "Isaac Gym reads robot.urdf; Genesis reads robot.xml (robot.urdf in versions without "
        "xml_file). With Isaac Lab, legged_gym/simulator/isaaclab_simulator.py selects actuators "
        f"by asset.name: add a branch for {string_literal(package)}.",
        "With Isaac Gym, LeggedGym-Ex uses the permutation from its joint order to dof_names also "
        "for the inverse. This is correct only if the permutation is its own inverse; otherwise "
        "set dof_names, dof_armature and dof_vel_limits in the order that it prints.",
    ]


def _env(robot: ConfigRobot) -> list[str]:
    count = len(robot.spec.joint_order)
    return [
        "# Observations: 3 linear velocity, 3 gravity, 3 angular velocity,",
        "# 3 commands; position, velocity and last action of each joint.",
        f"num_observations = {12 + 3 * count}",
        f"num_actions = {count}",
    ]


def _control(robot: ConfigRobot) -> list[str]:
    return [
        *legged_robot.gains(
            robot,
            "Isaac Gym and Isaac Lab use the last matching key, so the order matters; "
            "Genesis fails with several matching keys: rename the joint.",
        ),
        "# Control time step [s].",
        "dt = 0.02",
    ]


def _asset(robot: ConfigRobot) -> list[str]:
    spec = robot.spec
    armature, velocities = robot.joint_values("armature"), robot.joint_values("velocity")
    armatures = [float_literal(armature.get(joint, 0.0)) for joint in spec.joint_order]
    limits = [
        float_literal(velocities[joint]) if joint in velocities else 'float("inf")'
        for joint in spec.joint_order
    ]
    base = robot.check_bodies([spec.base], "base")[0]
    return [
        legged_robot.asset_name(robot),
        *legged_robot.path_in_folder("file", spec.urdf),
        *legged_robot.path_in_folder("xml_file", spec.mjcf),
        *legged_robot.contacts(robot),
        *assignment("base_link_name", string_literal(base), depth=2),
        "# The order of actions and observations.",
        *format_collection("dof_names = ", format_strings(spec.joint_order), depth=2),
        *robot.provenance_comment("armature", depth=2, prefix="In the order of dof_names"),
        *format_collection("dof_armature = ", armatures, depth=2),
        *robot.provenance_comment("velocity", depth=2, prefix="In the order of dof_names"),
        *format_collection("dof_vel_limits = ", limits, depth=2),
        *comment("Bodies on fixed joints that Genesis does not merge.", depth=2),
        *format_collection("links_to_keep = ", format_strings(spec.feet), depth=2),
        *legged_robot.shapes(),
    ]


def _rewards(robot: ConfigRobot) -> list[str]:
    return [
        *legged_robot.rewards(robot),
        "",
        "class scales(LeggedRobotCfg.rewards.scales):",
        *indent(["# The default scales of legged_gym; in LeggedGym-Ex the defaults are 0."]),
        *indent(f"{name} = {weight}" for name, weight in _REWARD_SCALES.items()),
    ]


def _runner(robot: ConfigRobot) -> list[str]:
    return [
        "run_name = SIMULATOR",
        f"experiment_name = {string_literal(package_name(robot.spec.name))}",
    ]
