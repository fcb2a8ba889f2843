"""The task: every number of training, with legged_gym's names and nesting.

A task is data: it is read from the command line and TOML, saved beside the policy that it trained,
and compared with `==`. Make your own by subclassing `Task` or a section of it; see
docs/adding_a_robot.md.
"""

import math
from dataclasses import dataclass, field
from typing import Annotated, Literal

from terrainkit.errors import ConfigError
from terrainkit_robots.rl.section import (
    Count,
    Factors,
    Limits,
    NotNegative,
    Points,
    Positive,
    Section,
    Share,
    Span,
    Widths,
)

Activation = Literal[
    "elu", "selu", "relu", "crelu", "lrelu", "tanh", "sigmoid", "softplus", "gelu", "swish", "mish"
]


@dataclass(frozen=True, kw_only=True)
class Env(Section):
    """How many environments there are, and how long an episode lasts."""

    num_envs: Count = 512
    """Environments that are stepped together; on a CPU 512 to 1024 pay best."""

    episode_length_s: Annotated[float, Limits(least=0.0, most=1e6, zero=False)] = 20.0
    """Longest episode [s]; a longer one is cut off, which is no fall."""

    num_threads: Annotated[int, Limits(least=0, most=4096)] = 0
    """Threads that step the physics; 0 for as many as there are processors."""


@dataclass(frozen=True, kw_only=True)
class Terrain(Section):
    """The ground, and the curriculum on it."""

    collision: Literal["auto", "hfield", "boxes", "plane"] = "auto"
    """What the robot touches: the map's heightfield, its boxes, whichever suits the map, or a level
    plane in place of the map."""

    curriculum: bool = True
    """Whether robots that do well move to harder rows of the map."""

    max_init_level: Annotated[int, Limits(least=0)] = 5
    """Hardest row to start on; the map's last one if it has fewer."""

    measure_heights: bool | None = None
    """Whether the policy sees the heights around it; unless given, on any ground but a plane."""

    measured_points_x: Points = tuple(round(-0.8 + 0.1 * k, 1) for k in range(17))
    """Where the height scan looks, along the robot's heading [m]."""

    measured_points_y: Points = tuple(round(-0.5 + 0.1 * k, 1) for k in range(11))
    """Where the height scan looks, to the left [m]."""

    def __post_init__(self) -> None:
        """Check the values, and that the scan is no map.

        Raises:
            ConfigError: if there is something wrong.
        """
        super().__post_init__()
        points = len(self.measured_points_x) * len(self.measured_points_y)
        if points > _MOST_POINTS:
            raise ConfigError(
                f"measured_points_x and _y make {points} points; wanted {_MOST_POINTS} or less"
            )


_MOST_POINTS = 10_000


@dataclass(frozen=True, kw_only=True)
class InitState(Section):
    """How an episode starts. Heights and the default pose are those of the robot's spec."""

    reset_range: Factors | None = None
    """Factors on the default pose between which each joint starts; unless given, the spec's."""

    position: NotNegative = 0.5
    """Distance from the spawn origin along x and along y, at most, where the ground allows [m]."""

    yaw: NotNegative = 3.14159
    """Heading, at most, to either side [rad]."""

    lin_vel: NotNegative = 0.5
    """Speed of the base along each axis, at most [m/s]."""

    ang_vel: NotNegative = 0.5
    """Speed of the base around each axis, at most [rad/s]."""


@dataclass(frozen=True, kw_only=True)
class Control(Section):
    """From actions to torques; the gains are those of the robot's spec unless given."""

    control_type: Literal["P", "V", "T"] = "P"
    """What an action asks for: a position, a velocity or a torque of each joint."""

    stiffness: NotNegative | None = None
    """Proportional gain of every joint with one [N m/rad]."""

    damping: NotNegative | None = None
    """Derivative gain of every joint [N m s/rad]."""

    action_scale: Positive | None = None
    """Change for an action of 1: of the position [rad], the velocity [rad/s] or the torque [N m].
    Unless given, the spec's for P, the largest velocity for V, the largest torque for T."""

    decimation: Annotated[int, Limits(least=1, most=1000)] = 4
    """Steps of the physics for one of the policy."""


@dataclass(frozen=True, kw_only=True)
class Asset(Section):
    """What of the robot takes part."""

    collisions: Literal["all", "feet_and_termination"] = "all"
    """What of the robot touches the ground: all that has a shape for it, or only feet and bodies
    that end an episode. The latter steps half as fast again, but legs pass through the edges of
    stairs, so that the trunk hits them, and `rewards.collision` has nothing to count."""

    self_collisions: bool = False
    """Whether the robot touches itself."""

    joint_friction: bool = False
    """Keep the joints' dry friction; it costs a quarter of the speed."""


@dataclass(frozen=True, kw_only=True)
class Commands(Section):
    """What the robot is asked to do."""

    lin_vel_x: Span = (-1.0, 1.0)
    """Forward speed [m/s]."""

    lin_vel_y: Span = (-0.5, 0.5)
    """Speed to the left [m/s]."""

    ang_vel_yaw: Span = (-1.0, 1.0)
    """Turning speed to the left [rad/s]; with a heading, its limits."""

    heading: Span = (-3.14159, 3.14159)
    """Direction to turn to, in the world [rad]."""

    heading_command: bool | None = None
    """Whether a heading is asked for, in place of a turning speed; unless given, on any ground but
    a plane: who turns all the time comes nowhere."""

    heading_stiffness: NotNegative = 0.5
    """Turning speed for an error of heading [1/s]."""

    resampling_time: Positive = 10.0
    """Time after which there is a new command [s]."""

    min_norm: NotNegative = 0.2
    """Linear commands below it become zero, and so do turning speeds [m/s, rad/s]."""

    standing: Share = 0.1
    """Share of commands that ask to stand still."""

    curriculum: bool = False
    """Whether the range of `lin_vel_x` widens once it is followed well."""

    max_curriculum: NotNegative = 1.0
    """Widest range of `lin_vel_x`, to either side [m/s]."""

    def __post_init__(self) -> None:
        """Check the values, and that the curriculum has somewhere to go.

        Raises:
            ConfigError: if there is something wrong.
        """
        super().__post_init__()
        low, high = self.lin_vel_x
        if self.curriculum and self.max_curriculum <= min(-low, high):
            raise ConfigError(
                f"max_curriculum is {self.max_curriculum:g}, and lin_vel_x from {low:g} to "
                f"{high:g} already; wanted more, or no curriculum"
            )


@dataclass(frozen=True, kw_only=True)
class DomainRand(Section):
    """What differs from robot to robot, and from time to time."""

    friction: Factors | None = (0.5, 1.25)
    """Friction of the robot's contacts; none: as the robot has it."""

    added_mass: Span | None = (-1.0, 1.0)
    """Mass added to the base [kg]."""

    com_shift: NotNegative = 0.03
    """Shift of the base's center of mass along each axis, at most [m]."""

    gains: Factors | None = (0.9, 1.1)
    """Factors on stiffness and on damping, for each joint."""

    motor_strength: Factors | None = (0.9, 1.1)
    """Factor on all torques of a robot."""

    joint_offset: NotNegative = 0.02
    """Error of each joint's zero, at most, drawn at each reset [rad]."""

    push_interval_s: NotNegative = 15.0
    """Time between pushes [s]; 0: no pushes."""

    max_push_vel_xy: NotNegative = 1.0
    """Speed that a push adds along x and along y, at most [m/s]."""


@dataclass(frozen=True, kw_only=True)
class Rewards(Section):
    """What is rewarded, each per second: the scale of every term, and what the terms need.

    A term with the scale 0 is not computed.
    """

    tracking_lin_vel: float = 1.5
    """Moving as asked."""

    tracking_ang_vel: float = 0.75
    """Turning as asked."""

    lin_vel_z: float = -2.0
    """Bouncing."""

    ang_vel_xy: float = -0.05
    """Rolling and pitching."""

    orientation: float = -1.0
    """A tilted base."""

    base_height: float = 0.0
    """A base above or below its target height."""

    torques: float = -0.0002
    """Torque, squared."""

    dof_power: float = 0.0
    """Mechanical power."""

    dof_vel: float = 0.0
    """Speed of the joints, squared."""

    dof_acc: float = -2.5e-7
    """Acceleration of the joints, squared."""

    action_rate: float = -0.01
    """Change of the action, squared."""

    action_smoothness: float = 0.0
    """Change of the change of the action, squared."""

    collision: float = -1.0
    """Contacts of penalized bodies."""

    termination: float = 0.0
    """Falling."""

    dof_pos_limits: float = -10.0
    """Joints beyond their soft limits."""

    dof_vel_limits: float = 0.0
    """Joints beyond their soft speed limits."""

    torque_limits: float = 0.0
    """Torques beyond their soft limits."""

    feet_air_time: float = 1.0
    """Long steps."""

    foot_clearance: float = 0.0
    """Feet that swing lower or higher than they should."""

    stumble: float = 0.0
    """Feet that hit something upright."""

    stand_still: float = -0.2
    """Leaving the default pose where standing is asked for."""

    feet_contact_forces: float = 0.0
    """Feet that hit hard."""

    tracking_sigma: Positive = 0.25
    """Tracking is rewarded by exp(-error squared / sigma) [m2/s2]."""

    only_positive_rewards: bool = False
    """Whether the sum of a step is kept at 0 or above, but for `termination`."""

    soft_dof_vel_limit: NotNegative = 0.9
    """Part of each joint's largest speed that is free of cost."""

    soft_torque_limit: NotNegative = 0.9
    """Part of each joint's largest torque that is free of cost."""

    base_height_target: float | None = None
    """Height of the base above the ground [m]; unless given, the spec's."""

    air_time_target: NotNegative = 0.15
    """Time in the air of a step that neither costs nor pays [s]."""

    foot_clearance_target: NotNegative = 0.08
    """Height of a swinging foot above the ground [m]."""

    max_contact_force: NotNegative = 100.0
    """Force on a foot that is free of cost [N]."""


@dataclass(frozen=True, kw_only=True)
class Termination(Section):
    """What ends an episode as a fall."""

    contact_force: NotNegative = 1.0
    """Force on a termination body [N]."""

    tilt: Annotated[float, Limits(least=0.0, most=math.pi, zero=False)] = 1.3
    """Angle between the base's up and the world's [rad]."""


@dataclass(frozen=True, kw_only=True)
class ObsScales(Section):
    """Factors on observations."""

    lin_vel: NotNegative = 2.0
    """Of linear velocity, and of its commands."""

    ang_vel: NotNegative = 0.25
    """Of angular velocity, and of its command."""

    dof_pos: NotNegative = 1.0
    """Of joint positions."""

    dof_vel: NotNegative = 0.05
    """Of joint speeds."""

    height_measurements: NotNegative = 5.0
    """Of the height scan."""


@dataclass(frozen=True, kw_only=True)
class Normalization(Section):
    """What keeps numbers in a range."""

    obs_scales: ObsScales = field(default_factory=ObsScales)
    """Factors on observations."""

    clip_observations: Positive = 100.0
    """Largest observation."""

    clip_actions: Positive = 100.0
    """Largest action."""


@dataclass(frozen=True, kw_only=True)
class Noise(Section):
    """Uniform noise on what the policy observes, to either side, before the scale."""

    noise_level: NotNegative = 1.0
    """Factor on all of it; 0: none."""

    dof_pos: NotNegative = 0.01
    """Of joint positions [rad]."""

    dof_vel: NotNegative = 1.5
    """Of joint speeds [rad/s]."""

    ang_vel: NotNegative = 0.2
    """Of the base's angular velocity [rad/s]."""

    gravity: NotNegative = 0.05
    """Of the direction of gravity."""

    height_measurements: NotNegative = 0.1
    """Of the height scan [m]."""


@dataclass(frozen=True, kw_only=True)
class Sim(Section):
    """The physics."""

    dt: Annotated[float, Limits(least=0.0, most=0.1, zero=False)] = 0.005
    """Time step [s]."""

    iterations: Count = 10
    """Iterations of the solver, at most."""

    ls_iterations: Count = 10
    """Iterations of its line search, at most."""


@dataclass(frozen=True, kw_only=True)
class Policy(Section):
    """The networks of actor and critic."""

    init_noise_std: Positive = 1.0
    """Standard deviation of actions at the start."""

    actor_hidden_dims: Widths = (128, 128, 128)
    """Widths of the actor's hidden layers."""

    critic_hidden_dims: Widths = (128, 128, 128)
    """Widths of the critic's hidden layers."""

    activation: Activation = "elu"
    """Activation of the hidden layers, by rsl-rl's name."""

    obs_normalization: bool = True
    """Whether observations are normalized by their running mean and deviation."""


@dataclass(frozen=True, kw_only=True)
class Algorithm(Section):
    """PPO."""

    value_loss_coef: NotNegative = 1.0
    """Weight of the critic's loss."""

    clip_param: Positive = 0.2
    """How far an update may go."""

    entropy_coef: NotNegative = 0.005
    """Weight of the entropy."""

    num_learning_epochs: Count = 5
    """Passes over each batch."""

    num_mini_batches: Count = 4
    """Parts that a batch is learned in."""

    learning_rate: Positive = 1e-3
    """Learning rate at the start."""

    schedule: Literal["adaptive", "fixed"] = "adaptive"
    """Whether the learning rate follows the divergence of the policy."""

    gamma: Share = 0.99
    """Discount of a step."""

    lam: Share = 0.95
    """Lambda of generalized advantage estimation."""

    desired_kl: Positive = 0.02
    """Divergence of an update that the learning rate is adapted to."""

    max_grad_norm: Positive = 1.0
    """Largest gradient."""

    symmetry: Literal["none", "augmentation", "loss"] = "none"
    """Whether mirror images are learned from too, or differing from them costs."""

    mirror_loss_coeff: NotNegative = 0.5
    """Weight of that cost."""


@dataclass(frozen=True, kw_only=True)
class Runner(Section):
    """How long training takes, and what is written on the way."""

    num_steps_per_env: Count = 24
    """Steps of each environment between updates."""

    max_iterations: Count = 1500
    """Updates."""

    save_interval: Count = 100
    """Updates between checkpoints."""

    seed: Annotated[int, Limits(least=0, most=2**32 - 1)] = 1
    """Start of all random numbers."""

    logger: Literal["tensorboard", "wandb"] = "tensorboard"
    """Where the curves go."""


@dataclass(frozen=True, kw_only=True)
class Task(Section):
    """A task. SI units and radians."""

    env: Env = field(default_factory=Env)
    """Environments."""

    terrain: Terrain = field(default_factory=Terrain)
    """Ground and curriculum."""

    init_state: InitState = field(default_factory=InitState)
    """Start of an episode."""

    control: Control = field(default_factory=Control)
    """From actions to torques."""

    asset: Asset = field(default_factory=Asset)
    """What of the robot takes part."""

    commands: Commands = field(default_factory=Commands)
    """What the robot is asked to do."""

    domain_rand: DomainRand = field(default_factory=DomainRand)
    """What differs from robot to robot."""

    rewards: Rewards = field(default_factory=Rewards)
    """What is rewarded."""

    termination: Termination = field(default_factory=Termination)
    """What ends an episode."""

    normalization: Normalization = field(default_factory=Normalization)
    """What keeps numbers in a range."""

    noise: Noise = field(default_factory=Noise)
    """Noise on observations."""

    sim: Sim = field(default_factory=Sim)
    """The physics."""

    policy: Policy = field(default_factory=Policy)
    """The networks."""

    algorithm: Algorithm = field(default_factory=Algorithm)
    """PPO."""

    runner: Runner = field(default_factory=Runner)
    """How long training takes."""

    def __post_init__(self) -> None:
        """Check the sections, and what they say together.

        Raises:
            ConfigError: if there is something wrong.
        """
        super().__post_init__()
        if self.max_episode_length < 1:
            raise ConfigError(
                f"env.episode_length_s is {self.env.episode_length_s:g}; wanted one step of the "
                f"policy or more, {self.dt:g} s"
            )
        if self.asset.collisions != "all" and self.rewards.collision:
            raise ConfigError(
                f"rewards.collision is {self.rewards.collision:g}; wanted 0 with "
                f"asset.collisions {self.asset.collisions}, as penalized bodies touch nothing"
            )
        samples = self.env.num_envs * self.runner.num_steps_per_env
        if samples < self.algorithm.num_mini_batches:
            raise ConfigError(
                f"algorithm.num_mini_batches is {self.algorithm.num_mini_batches}; wanted no more "
                f"than samples, env.num_envs * runner.num_steps_per_env = {samples}"
            )

    @property
    def dt(self) -> float:
        """Time between actions [s]."""
        return self.sim.dt * self.control.decimation

    @property
    def max_episode_length(self) -> int:
        """Actions in the longest episode."""
        return round(self.env.episode_length_s / self.dt)
