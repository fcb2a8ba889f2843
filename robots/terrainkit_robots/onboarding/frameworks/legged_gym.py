"""legged_gym: the configuration class of a robot on rough terrain in Isaac Gym."""

from terrainkit_robots.onboarding.frameworks import legged_robot
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.naming import class_name, package_name
from terrainkit_robots.onboarding.frameworks.source import (
    WRITTEN,
    docstring,
    literal,
    module,
    number,
)

_HEIGHTS = 17 * 11
"""Heights around the robot that legged_gym adds to the observations on rough terrain."""

_USUAL_JOINTS = 12
"""Joints that legged_gym's noise on observations is laid out for."""

LEGGED_ONLY = True
"""Whether it takes robots with legs only."""


def config_text(robot: ConfigRobot) -> str:
    """Return the file `legged_gym_config.py` of a robot.

    Raises:
        ConfigError: if legged_gym cannot name the robot's parts.
    """
    name = class_name(robot.spec.name)
    return module(
        [
            docstring(_about(robot, name)),
            ["", *legged_robot.BEFORE_IMPORTS],
            [
                "from legged_gym.envs.base.legged_robot_config import (",
                "    LeggedRobotCfg,",
                "    LeggedRobotCfgPPO,",
                ")",
                "",
            ],
            legged_robot.HERE,
            ["", "", f"class {name}RoughCfg(LeggedRobotCfg):"],
            legged_robot.class_of("init_state", "LeggedRobotCfg", legged_robot.init_state(robot))[
                1:
            ],
            legged_robot.class_of("env", "LeggedRobotCfg", _env(robot)),
            legged_robot.class_of("control", "LeggedRobotCfg", _control(robot)),
            legged_robot.class_of("asset", "LeggedRobotCfg", _asset(robot)),
            legged_robot.class_of("rewards", "LeggedRobotCfg", legged_robot.rewards(robot)),
            ["", "", f"class {name}RoughCfgPPO(LeggedRobotCfgPPO):"],
            legged_robot.class_of("runner", "LeggedRobotCfgPPO", _runner(robot))[1:],
        ]
    )


def _about(robot: ConfigRobot, name: str) -> list[str]:
    package = package_name(robot.spec.name)
    paragraphs = [
        f"{robot.title} for legged_gym: its configuration on rough terrain.",
        WRITTEN,
        f"Copy the whole folder to legged_gym/envs/{package} and register the robot in "
        "legged_gym/envs/__init__.py:",
        "\n".join(
            [
                f"    from .{package}.legged_gym_config import (",
                f"        {name}RoughCfg,",
                f"        {name}RoughCfgPPO,",
                "    )",
                "    task_registry.register(",
                f'        "{package}", LeggedRobot, {name}RoughCfg(), {name}RoughCfgPPO()',
                "    )",
            ]
        ),
        "legged_gym moves every joint of the URDF, in the order of Isaac Gym, which need not be "
        "that of robot.toml. Limits of torque and speed are those in robot.urdf.",
    ]
    count = len(robot.spec.joint_order)
    if count != _USUAL_JOINTS:
        paragraphs.append(
            f"LeggedRobot._get_noise_scale_vec is laid out for {_USUAL_JOINTS} joints; this robot "
            f"has {count}: override it."
        )
    return paragraphs


def _env(robot: ConfigRobot) -> list[str]:
    count = len(robot.spec.joint_order)
    return [
        "# 3 linear velocity, 3 angular velocity, 3 gravity, 3 commands; position, velocity",
        f"# and last action of each joint; {_HEIGHTS} heights of the ground.",
        f"num_observations = {12 + 3 * count + _HEIGHTS}",
        f"num_actions = {count}",
    ]


def _control(robot: ConfigRobot) -> list[str]:
    return legged_robot.gains(robot, "the last key that fits counts, so the order matters.")


def _asset(robot: ConfigRobot) -> list[str]:
    # Too little shakes light joints; more than they need makes the others but a bit slower.
    known = robot.by_joint("armature").values()
    armature, differ = robot.one_for_all(known, "largest", depth=2)
    return [
        *legged_robot.path_in_folder("file", robot.spec.urdf),
        legged_robot.asset_name(robot),
        *legged_robot.contacts(robot),
        *legged_robot.shapes(),
        *robot.origin("armature", depth=2),
        *differ,
        f"armature = {number(armature)}",
    ]


def _runner(robot: ConfigRobot) -> list[str]:
    return [
        'run_name = ""',
        f"experiment_name = {literal(f'rough_{package_name(robot.spec.name)}')}",
    ]
