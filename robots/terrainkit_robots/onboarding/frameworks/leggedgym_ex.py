"""LeggedGym-Ex: the configuration class of a robot, for Isaac Gym, Genesis and Isaac Lab."""

from terrainkit_robots.onboarding.frameworks import legged_robot
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.naming import class_name, package_name
from terrainkit_robots.onboarding.frameworks.source import (
    WRITTEN,
    assign,
    comment,
    docstring,
    indented,
    literal,
    module,
    number,
    spread,
    strings,
)

LEGGED_ONLY = True
"""Whether it takes robots with legs only."""

_SCALES = {
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
"""Weights of rewards: those of legged_gym, and one that keeps joints off their limits. In
LeggedGym-Ex all are zero, and a robot that is told nothing learns nothing."""


def config_text(robot: ConfigRobot) -> str:
    """Return the file `leggedgym_ex_config.py` of a robot.

    Raises:
        ConfigError: if LeggedGym-Ex cannot name the robot's parts.
    """
    name = class_name(robot.spec.name)
    return module(
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
        f"{robot.title} for LeggedGym-Ex: its configuration on flat ground.",
        WRITTEN,
        f"Copy the whole folder to legged_gym/envs/{package} and register the robot in "
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
        "Isaac Gym reads robot.urdf, Genesis robot.xml (in versions without xml_file: robot.urdf). "
        "On Isaac Lab, legged_gym/simulator/isaaclab_simulator.py picks actuators by asset.name "
        f"and knows its own robots only: add a branch for {literal(package)}.",
        "On Isaac Gym, LeggedGym-Ex takes the way from its order of joints to dof_names for the "
        "way back as well. That holds if the two are the same or exchange joints in pairs; "
        "elsewhere give dof_names, and what goes with it, the order that it prints.",
    ]


def _env(robot: ConfigRobot) -> list[str]:
    count = len(robot.spec.joint_order)
    return [
        "# What LeggedRobot observes: 3 linear velocity, 3 gravity, 3 angular velocity,",
        "# 3 commands; position, velocity and last action of each joint.",
        f"num_observations = {12 + 3 * count}",
        f"num_actions = {count}",
    ]


def _control(robot: ConfigRobot) -> list[str]:
    return [
        *legged_robot.gains(
            robot,
            "on Isaac Gym and Isaac Lab the last key that fits counts, so the order matters; "
            "Genesis takes a gain for each, which fails: rename the joint there.",
        ),
        "# s between two actions.",
        "dt = 0.02",
    ]


def _asset(robot: ConfigRobot) -> list[str]:
    spec = robot.spec
    armature, speeds = robot.by_joint("armature"), robot.by_joint("velocity")
    armatures = [number(armature.get(joint, 0.0)) for joint in spec.joint_order]
    limits = [
        number(speeds[joint]) if joint in speeds else 'float("inf")' for joint in spec.joint_order
    ]
    base = robot.known([spec.base], "base")[0]
    return [
        legged_robot.asset_name(robot),
        *legged_robot.path_in_folder("file", spec.urdf),
        *legged_robot.path_in_folder("xml_file", spec.mjcf),
        *legged_robot.contacts(robot),
        *assign("base_link_name", literal(base), depth=2),
        "# The order of actions and observations.",
        *spread("dof_names = ", strings(spec.joint_order), depth=2),
        *robot.origin("armature", depth=2, what="In the order of dof_names"),
        *spread("dof_armature = ", armatures, depth=2),
        *robot.origin("velocity", depth=2, what="In the order of dof_names"),
        *spread("dof_vel_limits = ", limits, depth=2),
        *comment("Bodies on fixed joints that Genesis is not to merge.", depth=2),
        *spread("links_to_keep = ", strings(spec.feet), depth=2),
        *legged_robot.shapes(),
    ]


def _rewards(robot: ConfigRobot) -> list[str]:
    return [
        *legged_robot.rewards(robot),
        "",
        "class scales(LeggedRobotCfg.rewards.scales):",
        *indented(["# The weights that legged_gym starts from; in LeggedGym-Ex all are zero."]),
        *indented(f"{name} = {weight}" for name, weight in _SCALES.items()),
    ]


def _runner(robot: ConfigRobot) -> list[str]:
    return [
        "run_name = SIMULATOR",
        f"experiment_name = {literal(package_name(robot.spec.name))}",
    ]
