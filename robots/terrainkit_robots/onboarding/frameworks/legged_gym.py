"""Write the configuration of a robot for legged_gym: rough terrain in Isaac Gym."""

from terrainkit_robots.onboarding.frameworks import legged_robot, source
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.naming import class_name, package_name

_NUM_HEIGHTS = 17 * 11
"""Number of height samples in the observations of legged_gym on rough terrain."""

_DEFAULT_NUM_JOINTS = 12
"""Number of joints that legged_gym's observation noise supports."""

_IMPORTS = ["import torch", "from legged_gym.envs.base.legged_robot import LeggedRobot"]

LEGGED_ONLY = True
"""Whether the framework supports only robots with legs."""


def config_text(robot: ConfigRobot) -> str:
    """Return the text of `legged_gym_config.py`.

    Raises:
        ConfigError: if legged_gym does not support the names of the bodies.
    """
    name = class_name(robot.spec.name)
    has_wheels = bool(robot.velocity_joints)
    count = len(robot.spec.joint_order)
    wheels = source.fill("legged_gym_wheels", name=name)
    config = source.fill(
        "legged_gym_config",
        about=source.docstring(_about(robot, name)),
        wheel_imports=_IMPORTS if has_wheels else [],
        speed_scale=legged_robot.speed_scale(robot),
        wheels=["", "", *wheels] if has_wheels else [],
        name=name,
        init_state=legged_robot.init_state(robot),
        num_heights=str(_NUM_HEIGHTS),
        num_observations=str(12 + 3 * count + _NUM_HEIGHTS),
        num_actions=str(count),
        control=legged_robot.gains(robot, "the last matching key is used, so the order matters."),
        asset=_asset(robot),
        rewards=legged_robot.rewards(robot),
        experiment=source.string_literal(f"rough_{package_name(robot.spec.name)}"),
    )
    return source.join_lines([config])


def _about(robot: ConfigRobot, name: str) -> list[str]:
    package = package_name(robot.spec.name)
    task_class = name if robot.velocity_joints else "LeggedRobot"
    own = [f"        {name},"] if robot.velocity_joints else []
    paragraphs = [
        f"{robot.title} for legged_gym: rough terrain.",
        source.GENERATED_NOTE,
        f"Copy the folder to legged_gym/envs/{package} and register the robot in "
        "legged_gym/envs/__init__.py:",
        "\n".join(
            [
                f"    from .{package}.legged_gym_config import (",
                *own,
                f"        {name}RoughCfg,",
                f"        {name}RoughCfgPPO,",
                "    )",
                "    task_registry.register(",
                f'        "{package}", {task_class}, {name}RoughCfg(), {name}RoughCfgPPO()',
                "    )",
            ]
        ),
        "legged_gym uses all movable joints of the URDF in the order of Isaac Gym, which may "
        "differ from the order of robot.toml. Effort and velocity limits are read from robot.urdf.",
    ]
    count = len(robot.spec.joint_order)
    if count != _DEFAULT_NUM_JOINTS:
        paragraphs.append(
            f"LeggedRobot._get_noise_scale_vec supports {_DEFAULT_NUM_JOINTS} joints, but this "
            f"robot has {count}: override it."
        )
    return paragraphs


def _asset(robot: ConfigRobot) -> list[str]:
    # Too little armature makes light joints unstable; too much slows the others only slightly.
    armatures = robot.joint_values("armature").values()
    armature, difference = robot.shared_value(armatures, "largest", depth=2)
    return [
        *legged_robot.path_in_folder("file", robot.spec.urdf),
        legged_robot.asset_name(robot),
        *legged_robot.contacts(robot),
        *source.fill("legged_robot_shapes"),
        *robot.provenance_comment("armature", depth=2),
        *difference,
        f"armature = {source.float_literal(armature)}",
    ]
