"""Write the configuration of a robot for legged_gym: rough terrain in Isaac Gym."""

from terrainkit_robots.onboarding.frameworks import legged_robot, source
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.naming import class_name, package_name

_NUM_HEIGHTS = 17 * 11
"""Number of height samples in the observations of legged_gym on rough terrain."""

_DEFAULT_NUM_JOINTS = 12
"""Number of joints that legged_gym's observation noise supports."""

_IMPORTS = ["import torch", "from legged_gym.envs.base.legged_robot import LeggedRobot"]

_WHEELS = '''

class $name(LeggedRobot):
    """LeggedRobot with velocity targets for the joints of SPEED_SCALE, such as wheels."""

    def _compute_torques(self, actions):
        torques = super()._compute_torques(actions)
        wheels = [self.dof_names.index(name) for name in SPEED_SCALE]
        scale = torch.tensor(list(SPEED_SCALE.values()), device=self.device)
        error = scale * actions[:, wheels] - self.dof_vel[:, wheels]
        limits = self.torque_limits[wheels]
        torques[:, wheels] = torch.clip(self.d_gains[wheels] * error, -limits, limits)
        return torques

    def compute_observations(self):
        # The angle of a wheel grows without bound, and carries no information.
        wheels = [self.dof_names.index(name) for name in SPEED_SCALE]
        self.dof_pos[:, wheels] = self.default_dof_pos[:, wheels]
        super().compute_observations()
'''
"""The environment of robots on wheels."""

LEGGED_ONLY = True
"""Whether the framework supports only robots with legs."""


def config_text(robot: ConfigRobot) -> str:
    """Return the text of `legged_gym_config.py`.

    Raises:
        ConfigError: if legged_gym does not support the names of the bodies.
    """
    name, has_wheels = class_name(robot.spec.name), bool(robot.velocity_joints)
    return source.join_lines(
        [
            source.docstring(_about(robot, name)),
            ["", *legged_robot.BEFORE_IMPORTS],
            _IMPORTS * has_wheels,
            [
                "from legged_gym.envs.base.legged_robot_config import (",
                "    LeggedRobotCfg,",
                "    LeggedRobotCfgPPO,",
                ")",
                "",
            ],
            legged_robot.HERE,
            legged_robot.speed_scale(robot),
            (["", *source.fill(_WHEELS, name=name)] if has_wheels else []),
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
    task_class = name if robot.velocity_joints else "LeggedRobot"
    own = [f"        {name},"] * bool(robot.velocity_joints)
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


def _env(robot: ConfigRobot) -> list[str]:
    count = len(robot.spec.joint_order)
    return [
        "# 3 linear velocity, 3 angular velocity, 3 gravity, 3 commands; position, velocity",
        f"# and last action of each joint; {_NUM_HEIGHTS} terrain heights.",
        f"num_observations = {12 + 3 * count + _NUM_HEIGHTS}",
        f"num_actions = {count}",
    ]


def _control(robot: ConfigRobot) -> list[str]:
    return legged_robot.gains(robot, "the last matching key is used, so the order matters.")


def _asset(robot: ConfigRobot) -> list[str]:
    # Too little armature makes light joints unstable; too much slows the others only slightly.
    armatures = robot.joint_values("armature").values()
    armature, difference = robot.shared_value(armatures, "largest", depth=2)
    return [
        *legged_robot.path_in_folder("file", robot.spec.urdf),
        legged_robot.asset_name(robot),
        *legged_robot.contacts(robot),
        *legged_robot.shapes(),
        *robot.provenance_comment("armature", depth=2),
        *difference,
        f"armature = {source.float_literal(armature)}",
    ]


def _runner(robot: ConfigRobot) -> list[str]:
    return [
        'run_name = ""',
        f"experiment_name = {source.string_literal(f'rough_{package_name(robot.spec.name)}')}",
    ]
