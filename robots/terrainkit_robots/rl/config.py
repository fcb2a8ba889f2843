"""Task: the configuration of training, with legged_gym's names and nesting.

A task is set from the command line and TOML files, and saved beside the policy that it trained.
Subclass `Task`, or one of its sections, for a task of your own; see docs/adding_a_robot.md.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal, Self

from msgspec import Meta

from terrainkit.curriculum import SamplerName
from terrainkit.errors import ConfigError
from terrainkit.settings.schema import Config
from terrainkit.settings.type_hint import (
    MAX_VALUE,
    SORTED,
    Fraction,
    Interval,
    NonNegative,
    NonNegativeFloat,
    NonNegativeInterval,
    PositiveFloat,
    PositiveInt,
)
from terrainkit_robots.rl.legged_gym_names import pasted_settings

HiddenDims = Annotated[tuple[Annotated[int, Meta(ge=1, le=65536)], ...], Meta(min_length=1)]
Duration = Annotated[float, Meta(gt=0, le=MAX_VALUE)]
Velocity = Annotated[float, Meta(ge=-MAX_VALUE, le=MAX_VALUE)]
Velocities = Annotated[tuple[Velocity, Velocity], SORTED]
ScanPoints = Annotated[tuple[float, ...], Meta(min_length=1)]
Activation = Literal[
    "elu", "selu", "relu", "crelu", "lrelu", "tanh", "sigmoid", "softplus", "gelu", "swish", "mish"
]


@dataclass(frozen=True, kw_only=True)
class Env(Config):
    """Environments and episodes."""

    # The KL divergence limits how far an update changes the policy, so many small updates learn
    # more per sample. 512, 256 and 128 environments took 1.6, 1.4 and 1.2 M samples to an error of
    # 0.25 m/s.
    num_envs: PositiveInt = 128
    """Number of parallel environments; fewer need fewer samples, more use a GPU better."""
    episode_length_s: Duration = 20.0
    """Length after which an episode is truncated [s]."""
    num_threads: Annotated[int, Meta(ge=0, le=4096)] = 0
    """Threads of the physics simulation; 0 for one per processor."""


@dataclass(frozen=True, kw_only=True)
class Terrain(Config):
    """Terrain, terrain curriculum and height scan."""

    collision: Literal["auto", "hfield", "boxes", "plane"] = "auto"
    """Collision geometry of the terrain: the map's heightfield, its boxes, the better of the two
    for the map, or a flat plane in place of the map."""
    curriculum: SamplerName | None = "levels"
    """How patches are sampled: levels moves robots that succeed to more difficult rows; uniform
    samples any patch; learning_progress samples patches where success changes; prioritized_replay
    samples patches where success is hard to predict; none keeps the patch of each robot."""
    stream: bool = False
    """Whether each robot has a patch of its own, new at each reset: of the sub-terrains, sizes and
    levels of the map, at any difficulty between two levels. Its episode ends 1 m beyond the patch.
    Not for hulls and several frictions; `train` alone has it, and `evaluate` takes the map."""
    # 5, and the 17 x 11 points of the height scan below, are legged_gym's.
    max_init_level: Annotated[int, Meta(ge=0)] = 5
    """Highest row to start on; the last row of the map if it has fewer."""
    measure_heights: bool | None = None
    """Whether the policy observes the height scan; none: on any terrain but a plane."""
    measured_points_x: ScanPoints = tuple(round(-0.8 + 0.1 * k, 1) for k in range(17))
    """Points of the height scan along the heading of the robot [m]."""
    measured_points_y: ScanPoints = tuple(round(-0.5 + 0.1 * k, 1) for k in range(11))
    """Points of the height scan to the left of the robot [m]."""
    # Cells of 0.1 m show an edge to 5 cm, too little to place a foot on a stone of 25 cm.
    foot_points_x: tuple[float, ...] = ()
    """More points of the height scan: of a grid around the default position of each foot, ahead of
    it [m]."""
    foot_points_y: tuple[float, ...] = ()
    """The same to the left [m]."""
    # A policy that saw no deep holes in training stops before them: with a 10 cm gap, 0 of 8 robots
    # crossed when the scan showed its 5 m, and 3 of 8 when it showed at most 0.3 m.
    scan_depth: PositiveFloat | None = None
    """Depth below the feet at which the height scan is clipped, with the base at its target height
    [m]; none: the scan is clipped 1.5 m below the base only."""


@dataclass(frozen=True, kw_only=True)
class Observations(Config):
    """Additional observations of the policy."""

    base_lin_vel: bool = False
    """Whether the policy observes the base linear velocity, with the noise `noise.lin_vel` and the
    constant error `noise.lin_vel_bias`."""
    foot_contact: bool = False
    """Whether the policy observes which feet are in contact."""
    # From the history, a policy infers its velocity and the delay of its actions: without it, the
    # quadruped was 0.1 m/s faster or slower than commanded for a delay of 0 or of 40 ms.
    history_length: Annotated[int, Meta(ge=1, le=100)] | None = None
    """Number of latest observations, the current one included; height scans have no history. None:
    3, on two legs 5; 1 with `base_lin_vel`."""


@dataclass(frozen=True, kw_only=True)
class InitState(Config):
    """Random initial state of an episode. Heights and default pose are in the robot's spec."""

    reset_range: NonNegativeInterval | None = None
    """Factors on the default joint positions; none: from the robot's spec."""
    position: NonNegativeFloat = 0.5
    """Largest offset from the spawn origin along x and along y, where the terrain allows it [m]."""
    yaw: NonNegativeFloat = 3.14159
    """Largest heading to either side [rad]."""
    # Both velocities are legged_gym's.
    lin_vel: NonNegativeFloat = 0.5
    """Largest base linear velocity along each axis [m/s]."""
    ang_vel: NonNegativeFloat = 0.5
    """Largest base angular velocity about each axis [rad/s]."""


@dataclass(frozen=True, kw_only=True)
class Control(Config):
    """Actions and PD control. Values that are none come from the robot's spec."""

    control_type: Literal["P", "V", "T"] = "P"
    """Quantity that an action controls: position, velocity or torque of each joint."""
    stiffness: NonNegativeFloat | None = None
    """P gain of every joint that has one [N m/rad]."""
    damping: NonNegativeFloat | None = None
    """D gain of every joint [N m s/rad]."""
    action_scale: PositiveFloat | None = None
    """Factor from action to position [rad], velocity [rad/s] or torque [N m]; none: the spec's for
    P, the largest velocity for V, the largest torque for T. A 0 of the spec remains 0."""
    # 4 steps of 5 ms are legged_gym's 50 Hz.
    decimation: Annotated[int, Meta(ge=1, le=1000)] = 4
    """Number of simulation steps per policy step."""


@dataclass(frozen=True, kw_only=True)
class Asset(Config):
    """Parts of the robot that are simulated."""

    # Without self-collisions, friction loss and elliptic cones, a step takes half the time.
    self_collisions: bool = False
    """Whether the bodies of a robot collide with each other."""
    visual_collisions: bool = False
    """Whether bodies without collision shapes touch the terrain, as boxes around their visual
    shapes. In many files only the feet collide, and the rest passes through obstacles."""
    joint_friction: bool = False
    """Whether to simulate dry joint friction; this takes a quarter of the speed."""


@dataclass(frozen=True, kw_only=True)
class Commands(Config):
    """Ranges from which velocity commands are sampled."""

    # legged_gym's ranges, except for half of its lateral velocity.
    lin_vel_x: Velocities = (-1.0, 1.0)
    """Forward velocity [m/s]."""
    curriculum: bool = False
    """Whether the range of the forward velocity grows by 0.5 m/s to both sides whenever the robots
    earn half of the tracking reward."""
    max_curriculum: NonNegativeFloat = 1.0
    """Limit of that range to both sides [m/s]."""
    forward_steps: Annotated[int, Meta(ge=0)] = 0
    """Policy steps from the start of training in which no command is backward: the sign of negative
    forward velocities is changed. A run that starts with the networks of another run has none."""
    lin_vel_y: Velocities = (-0.5, 0.5)
    """Velocity to the left [m/s]."""
    ang_vel_yaw: Velocities = (-1.0, 1.0)
    """Yaw velocity to the left [rad/s]; with a heading command, its limits."""
    heading: Interval = (-3.14159, 3.14159)
    """Heading in the world frame [rad]."""
    heading_command: bool | None = None
    """Whether to command a heading in place of a yaw velocity; none: on any terrain but a plane,
    because a robot that keeps turning does not cross the terrain."""
    # The constant in legged_gym's heading controller.
    heading_stiffness: NonNegativeFloat = 0.5
    """Yaw velocity per heading error [1/s]."""
    waypoints: bool = False
    """Whether to command to walk ahead to the goals of the patch in turn, at the magnitude of the
    forward velocity. The levels then depend on the share of the goals that a robot reaches."""
    # The report card uses the same radius. Extreme Parkour has 0.2 m.
    waypoint_radius: PositiveFloat = 0.4
    """Horizontal distance at which a goal is reached [m]."""
    # 10 s and the 0.2 m/s below are legged_gym's.
    resampling_time: Duration = 10.0
    """Time after which a new command is sampled [s]."""
    min_norm: NonNegativeFloat = 0.2
    """Norm below which linear and yaw velocity commands are set to zero [m/s, rad/s]."""
    standing: Fraction = 0.1
    """Fraction of the commands that are zero."""
    # On two legs, 60 % of the commands were followed after 3.1 M samples with a factor of 2.3, and
    # 84 % after 3.7 M samples with 3.
    gait_period: NonNegativeFloat | None = None
    """Period of the gait, whose phase the policy observes [s]; none: 2.3, on two legs 3, times
    sqrt(leg length / g); 0 for no gait. Neighboring feet swing in turn: a walk or a trot."""
    # Below 0.5, the stances of opposite feet overlap between two steps.
    swing_fraction: Fraction = 0.45
    """Fraction of the period that a foot is in the air."""


@dataclass(frozen=True, kw_only=True)
class DomainRand(Config):
    """Domain randomization."""

    # legged_gym's range begins at 0.5.
    friction: NonNegativeInterval | None = (0.3, 1.25)
    """Friction coefficient of the robot's contacts; none: the robot's own."""
    # legged_gym has 1 kg for a robot of any size; 7 % are 1.05 kg on the bundled quadruped.
    added_mass: Interval | None = (-0.07, 0.07)
    """Mass added to the base, as a fraction of the robot's mass."""
    added_mass_range: Interval | None = None
    """Mass added to the base [kg]; none: that of `added_mass`."""
    com_shift: NonNegativeFloat = 0.03
    """Largest offset of the base's center of mass along each axis [m]."""
    com_pos_x_range: Interval | None = None
    """Offset of the base's center of mass ahead [m]; none: up to `com_shift` to both sides."""
    com_pos_y_range: Interval | None = None
    """The same to the left [m]."""
    com_pos_z_range: Interval | None = None
    """The same upward [m]."""
    gains: NonNegativeInterval | None = (0.9, 1.1)
    """Factors on stiffness and damping of each joint."""
    motor_strength: NonNegativeInterval | None = (0.9, 1.1)
    """Factor on all torques of a robot."""
    joint_offset: NonNegativeFloat = 0.02
    """Largest zero offset of each joint, sampled at each reset [rad]."""
    # Trained without a delay, the biped fell from 20 ms on. Delayed actuators of Isaac Lab have up
    # to 20 ms; a robot adds the latency of its state estimate and of the network.
    action_delay: NonNegativeInterval | None = (0.0, 0.04)
    """Delay of the actions, sampled at each reset, in multiples of `sim.dt` [s]; none: no delay."""
    # legged_gym pushes every 15 s, once in an episode.
    push_interval_s: NonNegative = 5.0
    """Time between pushes [s]; 0 for no pushes."""
    # With legged_gym's 1 m/s, 2 of 21 quadrupeds fell at pushes of 1 m/s. With 1.25 m/s, the biped
    # fell twice as often in training as with 1 m/s.
    max_push_vel_xy: NonNegativeFloat | None = None
    """Largest velocity that a push adds along x and along y [m/s]; none: 0.6, on two legs 0.29,
    times sqrt(g leg length)."""


@dataclass(frozen=True, kw_only=True)
class Rewards(Config):
    """Scale of each reward, per second, and the parameters of the rewards.

    Scales are dimensionless: masses are in units of the robot's mass, lengths of its leg length,
    and times of sqrt(leg length / g). A reward with the scale 0 is not computed.
    """

    units: Literal["robot", "SI"] = "robot"
    """Units of the scales: the robot's mass and leg length, which suit robots of any size; or SI,
    as in legged_gym."""
    only_positive_rewards: bool = False
    """Whether the sum of all rewards but `termination` is at least 0 in each step, as in
    legged_gym."""

    # The units in `rewards.UNITS` make the scales dimensionless. With the 15 kg and 0.448 m of the
    # bundled quadruped, many are legged_gym's; the comments give them in SI units. The ratio of the
    # two tracking scales, 2, is legged_gym's.
    tracking_lin_vel: float = 1.5
    """Tracking of the linear velocity command."""
    tracking_ang_vel: float = 0.75
    """Tracking of the yaw velocity command."""
    # Three times this scale learned more slowly per sample.
    progress: float = 0.5
    """Velocity along the command, rewarded also far from the command."""
    feet_gait: float = 0.5
    """Feet whose contact agrees with the gait."""
    upright: float = 0.25
    """A level base."""
    # -2.0, legged_gym's scale.
    lin_vel_z: float = -9.0
    """Vertical base velocity, squared."""
    # -0.046; legged_gym has -0.05.
    ang_vel_xy: float = -1.0
    """Roll and pitch velocity of the base, squared."""
    base_height: float = 0.0
    """Deviation of the base height from its target."""
    # -2.3e-4; legged_gym has -2e-4 for A1.
    torques: float = -1.0
    """Joint torques, squared."""
    # -3.1e-6 on the mean of 12 joints, 2.6e-7 on each; legged_gym has 2.5e-7.
    dof_acc: float = -0.0015
    """Joint accelerations, squared."""
    # 0.01 on each of 12 joints, as in legged_gym, since the term is a mean.
    action_rate: float = -0.12
    """Change of the action, squared."""
    action_l2: float = 0.0
    """Action, squared."""
    # legged_gym's scale.
    collision: float = -1.0
    """Contacts of penalized bodies."""
    termination: float = -100.0
    """Falls."""
    # legged_gym's scale for A1.
    dof_pos_limits: float = -10.0
    """Joint positions beyond their soft limits."""
    # legged_gym's scale of its other limits.
    dof_vel_limits: float = -1.0
    """Joint velocities beyond their limits."""
    # The penalty on low feet is what teaches a robot to walk. With -0.5, the quadruped needed twice
    # as many samples to follow as many commands.
    foot_swing_height: float = -2.0
    """Deviation of swinging feet from an arc of the height `swing_height`."""
    foothold: float = 0.0
    """Feet that stand or land in a hole or near an edge."""
    foot_slip: float = -5.0
    """Horizontal velocity of feet in contact, squared."""
    stand_still: float = -2.4
    """Deviation from the default pose at zero command."""
    # Terms of legged_gym and LeggedGym-Ex that the gait replaces, or that the terms above contain.
    orientation: float = 0.0
    """Tilt of the base, squared."""
    dof_vel: float = 0.0
    """Joint velocities, squared."""
    dof_power: float = 0.0
    """Mechanical power of the motors."""
    action_smoothness: float = 0.0
    """Change of the change of the action, squared."""
    feet_air_time: float = 0.0
    """Duration of swings above 0.5 s, when the foot lands."""
    foot_clearance: float = 0.0
    """Feet that move at the swing height."""
    hip_pos: float = 0.0
    """Deviation from the default pose of the hip joints that move legs sideways, squared."""
    no_fly: float = 0.0
    """Contact of exactly one foot, for a robot on two legs."""
    feet_stumble: float = 0.0
    """Feet that hit something steep."""
    torque_limits: float = 0.0
    """Joint torques beyond their soft limits."""
    # legged_gym has 1.0, with which the term is 0: torques are clipped at their limits.
    soft_torque_limit: Fraction = 0.9
    """Soft limit of the torque of a joint, as a fraction of its limit."""
    # legged_gym has a constant width of 0.25 m2/s2, with which standing still earned 64 % of the
    # tracking rewards for the biped's commands.
    tracking_sigma: PositiveFloat = 0.06
    """Width of the wide kernel of the tracking rewards, exp(-error^2 / sigma), at zero command
    [m2/s2]; otherwise it is proportional to the squared command."""
    tracking_in_gait: bool = False
    """Whether the tracking rewards are paid only while the contacts of all feet agree with the
    gait."""
    # Without the limit of 9 cm, anymal_c, with legs of 0.64 m, swung its feet 12 cm high.
    swing_height: PositiveFloat | None = None
    """Height of a swinging foot above the ground, as a fraction of the leg length; none: 0.18, on
    four legs at most 9 cm."""


@dataclass(frozen=True, kw_only=True)
class Termination(Config):
    """Conditions that end an episode as a fall."""

    # legged_gym's threshold for termination contacts.
    contact_force: NonNegative = 1.0
    """Largest contact force on a termination body [N]."""
    tilt: Annotated[float, Meta(gt=0, le=math.pi)] = 1.3
    """Largest angle between the z axes of base and world [rad]."""
    stuck_time: PositiveFloat | None = None
    """Time over which progress below a fifth of the commanded velocity counts as a fall [s]; none:
    never."""


@dataclass(frozen=True, kw_only=True)
class ObsScales(Config):
    """Scales of the observations."""

    # legged_gym's scales.
    lin_vel: NonNegativeFloat = 2.0
    """Scale of linear velocities and their commands."""
    ang_vel: NonNegativeFloat = 0.25
    """Scale of angular velocities and their command."""
    dof_pos: NonNegativeFloat = 1.0
    """Scale of joint positions."""
    dof_vel: NonNegativeFloat = 0.05
    """Scale of joint velocities."""
    height_measurements: NonNegativeFloat = 5.0
    """Scale of the height scan."""


@dataclass(frozen=True, kw_only=True)
class Normalization(Config):
    """Scales and limits of observations and actions."""

    obs_scales: ObsScales = field(default_factory=ObsScales)
    # legged_gym's limit.
    clip_observations: PositiveFloat = 100.0
    """Largest observation."""
    # With legged_gym's 100, a biped that observed its own growing actions ended a good training:
    # within 5 iterations they grew from 6 to 100, and the falls from 11 % to 98 %.
    clip_actions: PositiveFloat = 10.0
    """Largest action."""


@dataclass(frozen=True, kw_only=True)
class Noise(Config):
    """Uniform noise on the observations of the policy, to either side, before the scales."""

    # legged_gym's noise.
    noise_level: NonNegativeFloat = 1.0
    """Factor on all noise; 0 for none."""
    dof_pos: NonNegativeFloat = 0.01
    """Noise of joint positions [rad]."""
    dof_vel: NonNegativeFloat = 1.5
    """Noise of joint velocities [rad/s]."""
    ang_vel: NonNegativeFloat = 0.2
    """Noise of the base angular velocity [rad/s]."""
    lin_vel: NonNegativeFloat = 0.1
    """Noise of the base linear velocity, if it is observed [m/s]."""
    lin_vel_bias: NonNegativeFloat = 0.2
    """Error of the observed base linear velocity that is constant in an episode [m/s]."""
    gravity: NonNegativeFloat = 0.05
    """Noise of the gravity direction."""
    height_measurements: NonNegativeFloat = 0.1
    """Noise of the height scan [m]."""


@dataclass(frozen=True, kw_only=True)
class Sim(Config):
    """Physics simulation."""

    # legged_gym's time step.
    dt: Annotated[float, Meta(ge=1e-6, le=0.1)] = 0.005
    """Time step [s]."""
    # With 1 iteration and 5 of the line search, MuJoCo is unstable at 5 ms; 4 to 6 and 8 to 10
    # suffice.
    iterations: PositiveInt = 10
    """Largest number of solver iterations."""
    ls_iterations: PositiveInt = 10
    """Largest number of line search iterations."""


@dataclass(frozen=True, kw_only=True)
class Policy(Config):
    """Actor and critic networks."""

    # legged_gym has 1.0. Its settings of noise, entropy, KL divergence and activation, without
    # mirrored samples and with 512 environments, needed 2.77 M samples instead of 0.75 M.
    init_noise_std: PositiveFloat = 0.7
    """Initial standard deviation of the actions."""
    # `quadruped_map` climbed higher after every reduction of its noise, and early ones slow it.
    final_noise_std: PositiveFloat | None = None
    """Largest standard deviation of the actions in the last quarter of the training; in the third
    quarter, the limit falls linearly to it from `init_noise_std`. None: no limit."""
    # On a CPU, networks cost more than the physics. legged_gym has 512, 256 and 128.
    actor_hidden_dims: HiddenDims = (128, 128, 128)
    """Widths of the hidden layers of the actor."""
    critic_hidden_dims: HiddenDims = (128, 128, 128)
    """Widths of the hidden layers of the critic."""
    estimator_hidden_dims: HiddenDims | None = None
    """Widths of the hidden layers of an estimator of base linear velocity and foot contacts, which
    is trained with the policy and whose estimates the policy observes; none for no estimator.
    There is none beside a network of another class, or a student, in `runner.rsl_rl`."""
    # torch computes elu seven times as slowly as swish on a CPU: it took 34 % of an update.
    activation: Activation = "swish"
    """Activation of the hidden layers, as rsl-rl names it; elu is slow on a CPU."""
    obs_normalization: bool = True
    """Whether observations are normalized by their running mean and standard deviation."""


@dataclass(frozen=True, kw_only=True)
class Algorithm(Config):
    """PPO."""

    # Values without a comment of their own are legged_gym's.
    value_loss_coef: NonNegativeFloat = 1.0
    """Weight of the value loss."""
    clip_param: PositiveFloat = 0.2
    """Clipping of the policy ratio."""
    # 0.01, legged_gym's, was slower per sample. On maps, 0.005 keeps the actions too noisy: the
    # task `quadruped_map` has 0.0015.
    entropy_coef: NonNegativeFloat = 0.005
    """Weight of the entropy bonus."""
    # Three epochs were slower per sample, and with the default task also per CPU second.
    num_learning_epochs: PositiveInt = 5
    """Learning epochs per update."""
    num_mini_batches: PositiveInt = 4
    """Mini-batches per epoch."""
    learning_rate: PositiveFloat = 1e-3
    """Initial learning rate."""
    schedule: Literal["adaptive", "fixed"] = "adaptive"
    """Whether the learning rate follows the KL divergence of the updates."""
    gamma: Fraction = 0.99
    """Discount factor."""
    lam: Fraction = 0.95
    """Lambda of generalized advantage estimation."""
    # Twice legged_gym's, because small iterations learn more per sample; see `num_envs`.
    desired_kl: PositiveFloat = 0.02
    """KL divergence that the adaptive schedule aims at."""
    max_grad_norm: PositiveFloat = 1.0
    """Largest gradient norm."""
    use_mixed_precision: bool = False
    """Whether the networks are updated in bfloat16 where precision allows it."""
    # After 0.61 M samples, 64 % of the commands were followed with mirrored samples, and 23 % with
    # a mirror loss. They double the cost of an update.
    symmetry: bool | None = None
    """Whether mirrored samples are added to each batch; none: if left and right of the robot are
    mirror images, and the networks are not recurrent."""


@dataclass(frozen=True, kw_only=True)
class Runner(Config):
    """Length of training, checkpoints and logging."""

    # legged_gym's rollout and number of iterations.
    num_steps_per_env: PositiveInt = 24
    """Steps of each environment per iteration."""
    max_iterations: PositiveInt = 1500
    """Number of learning iterations."""
    save_interval: PositiveInt = 100
    """Iterations between checkpoints."""
    seed: Annotated[int, Meta(ge=0, le=2**32 - 1)] = 1
    """Seed of all random numbers."""
    logger: Literal["tensorboard", "wandb"] = "tensorboard"
    """Where metrics are logged."""
    rsl_rl: Mapping[str, Any] = field(default_factory=dict)
    """Tables of rsl-rl's configuration whose values replace those that terrainkit derives, such as
    the class of a network: actor, critic, student, teacher, algorithm, obs_groups. They are set in
    a task file only."""


@dataclass(frozen=True, kw_only=True)
class Task(Config):
    """Configuration of training. SI units and radians."""

    env_class: ClassVar[type | None] = None
    """Class of the environment; `LeggedEnv` unless a task of your own has another one."""

    env: Env = field(default_factory=Env)
    terrain: Terrain = field(default_factory=Terrain)
    observations: Observations = field(default_factory=Observations)
    init_state: InitState = field(default_factory=InitState)
    control: Control = field(default_factory=Control)
    asset: Asset = field(default_factory=Asset)
    commands: Commands = field(default_factory=Commands)
    domain_rand: DomainRand = field(default_factory=DomainRand)
    rewards: Rewards = field(default_factory=Rewards)
    termination: Termination = field(default_factory=Termination)
    normalization: Normalization = field(default_factory=Normalization)
    noise: Noise = field(default_factory=Noise)
    sim: Sim = field(default_factory=Sim)
    policy: Policy = field(default_factory=Policy)
    algorithm: Algorithm = field(default_factory=Algorithm)
    runner: Runner = field(default_factory=Runner)

    @classmethod
    def from_table(
        cls, table: Mapping[str, Any], default: Self | None = None, path: str = ""
    ) -> Self:
        """Return the task that a TOML table describes; see `Config.from_table`.

        The error about a setting of legged_gym names ours.
        """
        try:
            return super().from_table(table, default, path)
        except ConfigError:
            for setting, message in pasted_settings(table):
                try:
                    super().from_table(setting, default, path)
                except ConfigError:
                    raise ConfigError(message) from None
            raise

    def __post_init__(self) -> None:
        """Validate the sections, and values that depend on each other."""
        super().__post_init__()
        if self.max_episode_length < 1:
            got = f"env.episode_length_s: got {self.env.episode_length_s:g}"
            raise ConfigError(f"{got}; expected at least one policy step, {self.dt:g} s")
        if (delay := self.domain_rand.action_delay) and not self.sim.dt / 2 < delay[1] <= 1:
            expected = f"expected an end above half of sim.dt {self.sim.dt:g}, at most 1 s; or none"
            raise ConfigError(f"domain_rand.action_delay: got {list(delay)}; {expected}")
        if bool(self.terrain.foot_points_x) != bool(self.terrain.foot_points_y):
            raise ConfigError(
                "terrain.foot_points_x, foot_points_y: got only one of them; expected both, since "
                "the points are a grid around each foot"
            )
        samples = self.env.num_envs * self.runner.num_steps_per_env
        if samples < self.algorithm.num_mini_batches:
            got = f"algorithm.num_mini_batches: got {self.algorithm.num_mini_batches}"
            most = f"env.num_envs * runner.num_steps_per_env = {samples}"
            raise ConfigError(f"{got}; expected at most {most}")

    @property
    def has_estimator(self) -> bool:
        """Whether the actor is an `EstimatorModel`."""
        networks = self.runner.rsl_rl
        actor = networks.get("actor")
        is_other = isinstance(actor, Mapping) and "class_name" in actor
        has_own_networks = is_other or "student" in networks
        return self.policy.estimator_hidden_dims is not None and not has_own_networks

    @property
    def dt(self) -> float:
        """Time between policy steps [s]."""
        return self.sim.dt * self.control.decimation

    @property
    def max_delay_steps(self) -> int:
        """Simulation steps of the longest action delay; 0 without a delay."""
        return round((self.domain_rand.action_delay or (0, 0))[1] / self.sim.dt)

    @property
    def max_episode_length(self) -> int:
        """Policy steps in the longest episode."""
        return round(self.env.episode_length_s / self.dt)
