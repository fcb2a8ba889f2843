"""Evaluate a policy without noise and randomization: velocity errors, gait, falls and success."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from itertools import product
from typing import Annotated, Any, NamedTuple

import numpy as np
import torch
from msgspec import Meta
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.settings.schema import Config
from terrainkit.settings.type_hint import PositiveInt
from terrainkit_robots.policy import gait
from terrainkit_robots.policy.load import Policy, load_policy, single_torch_thread
from terrainkit_robots.rl.config import Commands, Task
from terrainkit_robots.rl.env import LeggedEnv, make_env
from terrainkit_robots.rl.observations import uses_height_scan
from terrainkit_robots.rl.run import PolicySpec, Run, is_same_terrain
from terrainkit_robots.rl.runner import resolve_device
from terrainkit_robots.rl.symmetry import mirror_feet
from terrainkit_robots.rl.terrain import Ground, load_terrain
from terrainkit_robots.transforms import BoolArray, FloatArray

Progress = Callable[[float], object]
"""Called after each step with the completed fraction of the time, 0 to 1."""

SETTLING_TIME, AVERAGING_TIME = 2.0, 1.0
"""Time without measurements after each new command, and time of averaged velocities [s]."""

MAX_MAP_ENVS, SINGLE_PATCH_ENVS = 512, 16
"""Default numbers of robots: at most on a map, and for one command on a single patch."""

MAX_GAIT_STEPS, DIAGRAM_TIME = 1000, 2.0
"""Steps after which the gait is no longer recorded, and time of the contact diagram [s]."""

MIN_FOLLOWED = 0.5
"""Share of a command's velocity from which the command is followed."""


@dataclass(frozen=True, kw_only=True)
class EvaluationConfig(Config):
    """Settings of an evaluation.

    Attributes:
        seconds: Duration of the rollout [s].
        terrain: Terrain as `load_terrain` takes it; None for the terrain of the training.
        num_envs: Number of robots; None for one per command of the grid, or several per patch.
        command: Command for all robots: forward and left velocity [m/s], yaw velocity [rad/s].
        random_commands: Whether commands are sampled as in training.
        seed: Seed of all random numbers.
        device: Device of the policy, as torch names it.
    """

    seconds: Annotated[float, Meta(gt=0, le=3600)] = 20.0
    terrain: str | None = None
    num_envs: PositiveInt | None = None
    command: tuple[float, float, float] | None = None
    random_commands: bool = False
    seed: Annotated[int, Meta(ge=0)] = 1
    device: str = "cpu"

    def __post_init__(self) -> None:
        """Validate the values, and that the commands are given once."""
        super().__post_init__()
        if self.command is not None and self.random_commands:
            raise ConfigError("command: got a command and random_commands; expected one of them")


@dataclass(frozen=True, kw_only=True)
class RolloutMetrics:
    """Metrics of all robots, or of a group with the same command, terrain or level.

    Errors are averaged over the measured steps of each robot, then over robots. They are None if no
    robot was measured. The metrics of the gait (:mod:`.gait`) only include robots that are
    commanded to move, and are None if there are no such robots.

    Attributes:
        command: Command of the group: forward and left velocity [m/s], yaw velocity [rad/s].
        direction: Direction of the group's commands on a map.
        terrain: Terrain of the group.
        level: Level of the group.
        robots: Number of robots.
        falls: Number of robots that fell.
        success: Fraction of successful robots; None on a plane.
        lin_vel_error: Norm of the horizontal velocity error [m/s].
        lin_vel_error_1s: The same with velocities averaged over 1 s, which removes the sway of the
            gait.
        ang_vel_error: Absolute yaw velocity error [rad/s].
        ang_vel_error_1s: The same with velocities averaged over 1 s.
        swing_height: Mean peak height of the swings of each foot [m].
        duty_factor: Share of the time that each foot is in contact.
        step_frequency: Complete swings per foot and second [Hz].
        foot_slip: Mean horizontal speed of feet in contact [m/s].
        asymmetry: The larger of the asymmetries of swing height and duty factor.
        base_pitch: Mean pitch of the base [rad], positive when the nose is down.
        followed: Fraction of robots that reach half of their command's linear and yaw velocity.
        cost_of_transport: Power / (weight * speed).
    """

    command: tuple[float, ...] | None = None
    direction: str | None = None
    terrain: str | None = None
    level: int | None = None
    robots: int
    falls: int
    success: float | None
    lin_vel_error: float | None
    lin_vel_error_1s: float | None
    ang_vel_error: float | None
    ang_vel_error_1s: float | None
    swing_height: tuple[float | None, ...] | None = None
    duty_factor: tuple[float | None, ...] | None = None
    step_frequency: float | None = None
    foot_slip: float | None = None
    asymmetry: float | None = None
    base_pitch: float | None = None
    followed: float | None = None
    cost_of_transport: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the metrics as a dict, without the keys that do not define the group."""
        keys = "command", "direction", "terrain", "level"
        return {k: v for k, v in asdict(self).items() if v is not None or k not in keys}


@dataclass(frozen=True, kw_only=True)
class EvaluationResult:
    """Result of an evaluation. If no terrain was given, `config` names the terrain of the training.

    Attributes:
        robot: Name of the robot in its spec.
        checkpoint: File name of the checkpoint, or name of the policy function.
        config: Settings of the evaluation.
        metrics: Metrics of all robots.
        groups: Metrics of groups of robots: `by_command` on a plane; `by_direction`,
            `by_direction_and_level`, `by_terrain`, `by_level` and `by_terrain_and_level` on a map.
        contacts: Contacts of each foot in the last 2 s, for the robot with the fastest forward
            command: one character per step, 1 in contact.
        dt: Time between two steps [s].
    """

    robot: str
    checkpoint: str
    config: EvaluationConfig
    metrics: RolloutMetrics
    groups: Mapping[str, Sequence[RolloutMetrics]]
    contacts: Mapping[str, str]
    dt: float

    def as_json(self) -> str:
        """Return the result as JSON; equal evaluations give equal bytes."""
        config, settling = self.config, {"settling_seconds": SETTLING_TIME}
        result: dict[str, Any] = {"robot": self.robot, "checkpoint": self.checkpoint}
        result |= {"terrain": config.terrain, "seconds": config.seconds, **settling}
        result |= {"seed": config.seed, "feet": list(self.contacts)}
        result |= {"contacts": {"dt": self.dt, **self.contacts}, "all": self.metrics.as_dict()}
        result |= {k: [group.as_dict() for group in v] for k, v in self.groups.items()}
        return json.dumps(result, indent=2) + "\n"


@single_torch_thread()
def evaluate(
    spec: PolicySpec, config: EvaluationConfig | None = None, progress: Progress = lambda _: None
) -> EvaluationResult:
    """Evaluate a policy: of a run, an ONNX file (:func:`.open_onnx`), or any function.

    The same seed gives the same result, bit for bit.

    Args:
        spec: The policy with its task and robot.
        config: Settings; None for the defaults.
        progress: Called after each step with the completed fraction, 0 to 1.

    Raises:
        ConfigError: If the run has no policy, or its policy is for another robot; if the terrain
            cannot be read, or changed after the training; if the device does not exist.
    """
    config = config or EvaluationConfig()
    env, commands = make_eval_env(spec, config)
    rollout = EvaluationRollout(env)
    rollout.run(load_policy(spec, env), config.seconds, commands, progress)
    has_grid = env.terrain.is_plane and config.command is None
    return summarize(spec, config, rollout, commands if has_grid else None)


def make_eval_env(
    spec: PolicySpec, config: EvaluationConfig, *, max_patch_envs: int = MAX_MAP_ENVS
) -> tuple[LeggedEnv, FloatArray | None]:
    """Return an environment to evaluate a policy in, and the commands of its robots.

    Args:
        spec: The policy with its task and robot.
        config: Settings of the evaluation.
        max_patch_envs: Maximum number of robots on a patch if `config.num_envs` is None.

    Returns:
        The environment, and commands of shape (n, 3); None for the task's random commands.
    """
    task = spec.task
    is_run_terrain = config.terrain is None and not is_plane(spec)
    if is_run_terrain and isinstance(spec, Run) and not is_same_terrain(spec, spec.terrain):
        changed = f"{spec.terrain} changed after {spec.folder} was trained"
        raise ConfigError(f"terrain: {changed}; expected --terrain")
    collision = task.terrain.collision
    if config.terrain is not None and collision == "plane":
        collision = "auto"
    terrain = load_terrain(config.terrain or spec.terrain, collision)
    commands = None
    if config.command is not None:
        commands = np.array([config.command], np.float32)
    elif not config.random_commands:
        directions = direction_commands(task.commands).values()
        commands = command_grid(task.commands) if terrain.is_plane else np.array([*directions])
    rows, cols = terrain.env_origins.shape[:2]
    n, patches = config.num_envs, rows * cols
    if n is None and terrain.is_plane and commands is not None and len(commands) > 1:
        n = len(commands)
    elif n is None:
        per_patch = max(1, min(max_patch_envs, MAX_MAP_ENVS // patches))
        n = SINGLE_PATCH_ENVS if patches == 1 else min(MAX_MAP_ENVS, patches * per_patch)
    env = build_eval_env(spec, terrain, n, config)
    levels_and_columns = np.divmod(_assign(patches, n, config.seed), cols)
    env.curriculum.levels[:], env.curriculum.columns[:] = levels_and_columns
    env.reset()
    if commands is None:
        return env, None
    if not terrain.is_plane:  # every direction on every patch
        return env, commands[np.arange(n) // patches % len(commands)]
    return env, commands[_assign(len(commands), n, config.seed)]


def build_eval_env(
    spec: PolicySpec, terrain: Ground, num_envs: int, config: EvaluationConfig
) -> LeggedEnv:
    """Return an environment on a terrain, for a policy with the observations of its training."""
    device = resolve_device(config.device)
    scan = uses_height_scan(spec.task, is_plane=is_plane(spec))
    task = eval_task(spec.task, num_envs, seconds=config.seconds, seed=config.seed)
    task = replace(task, terrain=replace(task.terrain, measure_heights=scan))
    return make_env(task, spec.robot, terrain, device)


def is_plane(spec: PolicySpec, terrain: str | None = None) -> bool:
    """Return whether `terrain`, or the terrain of the training if it is None, is a plane."""
    return "plane" in ([terrain] if terrain else [spec.terrain, spec.task.terrain.collision])


def _assign(count: int, num_envs: int, seed: int) -> NDArray[np.int64]:
    """Return an item for each robot, all equally often; a random subset if there are too many."""
    if num_envs < count:
        return np.sort(np.random.default_rng(seed).permutation(count)[:num_envs])
    return np.arange(num_envs) % count


def eval_task(task: Task, num_envs: int, *, seconds: float = 20.0, seed: int = 1) -> Task:
    """Return a task without noise, randomization, pushes, waypoints, curricula and timeouts."""
    names = "friction added_mass gains motor_strength action_delay"
    off: dict[str, Any] = dict.fromkeys(names.split())
    off |= dict.fromkeys(["com_shift", "joint_offset", "push_interval_s", "max_push_vel_xy"], 0.0)
    return replace(
        task,
        env=replace(task.env, num_envs=num_envs, episode_length_s=2 * seconds + 1),
        terrain=replace(task.terrain, curriculum=None),
        commands=replace(task.commands, waypoints=False),
        init_state=replace(task.init_state, reset_range=(1.0, 1.0), lin_vel=0.0, ang_vel=0.0),
        domain_rand=replace(task.domain_rand, **off),
        noise=replace(task.noise, noise_level=0.0),
        algorithm=replace(task.algorithm, num_mini_batches=1),  # a few robots allow no more
        runner=replace(task.runner, seed=seed),
    )


def command_grid(commands: Commands) -> FloatArray:
    """Return a grid of commands over the ranges of a task.

    Forward and yaw velocities are the full and half limits and zero, lateral velocities the full
    limits and zero. Commands below `min_norm` are zero.

    Returns:
        Forward and left velocity [m/s] and yaw velocity [rad/s], shape (k, 3). Usually, k is 75.
    """
    ranges = (commands.lin_vel_x, commands.lin_vel_y, commands.ang_vel_yaw)
    fractions = ((1.0, 0.5), (1.0,), (1.0, 0.5))
    axes = [
        np.clip([low * f for f in parts] + [0.0] + [high * f for f in parts], low, high)
        for (low, high), parts in zip(ranges, fractions, strict=True)
    ]
    grid = np.array(list(product(*axes)), np.float32)
    grid[np.hypot(grid[:, 0], grid[:, 1]) < commands.min_norm, :2] = 0
    grid[np.abs(grid[:, 2]) < commands.min_norm, 2] = 0
    return np.unique(grid + np.float32(0), axis=0)  # + 0 turns -0 into 0


def direction_commands(commands: Commands) -> dict[str, FloatArray]:
    """Return a command for each direction of travel of a task, at 75 % of its limits."""
    limits = (*commands.lin_vel_x[::-1], *commands.lin_vel_y[::-1])
    axes = {"forward": (1, 0, 0), "backward": (1, 0, 0), "left": (0, 1, 0), "right": (0, 1, 0)}
    signs = (1, -1, 1, -1)
    return {
        name: np.float32(0.75 * limit) * np.array(axis, np.float32)
        for (name, axis), limit, sign in zip(axes.items(), limits, signs, strict=True)
        if limit * sign > 0
    }


def rollout(
    env: LeggedEnv, policy: Policy, schedule: Iterable[FloatArray | None]
) -> Iterator[tuple[FloatArray, BoolArray]]:
    """Step the environment with a policy.

    Args:
        env: The environment.
        policy: Function from observations to actions.
        schedule: Commands of each step, shape (n, 3), or None for the task's random commands.

    Yields:
        After each step, the commands during it, shape (n, 3), and which robots fell, shape (n,).
    """
    previous: object = ...  # neither commands nor None, so that the first entry is applied
    for commands in schedule:
        if commands is not previous:
            env.set_commands(commands)
            previous = commands
        state = env.state
        with torch.inference_mode():
            _, _, dones, extras = env.step(policy(env.get_observations()))
            if reset := getattr(policy, "reset", None):  # of a recurrent network
                reset(dones)
        yield state.commands, (dones & ~extras["time_outs"]).cpu().numpy()


def command_schedule(commands: FloatArray | None, num_steps: int) -> list[FloatArray | None]:
    """Return the commands of each step.

    Args:
        commands: Commands of shape (n, 3), or of shape (k, n, 3) for k parts of equal length; None
            for the task's random commands.
        num_steps: Number of steps.
    """
    if commands is None:
        return [None] * num_steps
    parts = list(commands.reshape(-1, *commands.shape[-2:]))
    return [parts[step * len(parts) // num_steps] for step in range(num_steps)]


class ErrorMean:
    """The mean of an error over the measured steps of each of n robots."""

    def __init__(self, num_envs: int) -> None:
        self.total, self.count = np.zeros(num_envs), np.zeros(num_envs, np.int64)

    def add(self, errors: FloatArray, measured: BoolArray) -> None:
        """Add the errors of a step.

        Args:
            errors: Error of each robot, shape (n,).
            measured: Which robots are measured in this step, shape (n,).
        """
        self.total[measured] += errors[measured]
        self.count[measured] += 1

    def over(self, robots: BoolArray) -> float | None:
        """Return the mean error of some robots, each with the same weight.

        Args:
            robots: Mask of the robots, shape (n,).

        Returns:
            The mean, or None if none of the robots was measured.
        """
        measured = robots & (self.count > 0)
        means = self.total[measured] / self.count[measured]
        return float(means.mean()) if means.size else None


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionSums:
    """Sums over the measured steps of robots that are commanded to move, shapes (n,).

    Power and speed count only under a linear command.
    """

    lin_vel: NDArray[Any]  # dot product of linear velocity and command [m2/s2]
    lin_command: NDArray[Any]  # squared norm of the linear command [m2/s2]
    ang_vel: NDArray[Any]  # product of yaw velocity and command [rad2/s2]
    ang_command: NDArray[Any]  # squared yaw command [rad2/s2]
    pitch: NDArray[Any]  # [rad], positive when the nose is down
    power: NDArray[Any]  # mechanical power of the motors [W]
    speed: NDArray[Any]  # horizontal [m/s]
    steps: NDArray[Any]  # number of steps

    def of(self, robots: BoolArray) -> "MotionSums":
        """Return the sums of the robots in a mask."""
        return MotionSums(**{name: total[robots] for name, total in vars(self).items()})

    def add(self, step: "MotionSums", robots: BoolArray) -> None:
        """Add a step of the robots in a mask."""
        for name, total in vars(self).items():
            total[robots] += getattr(step, name)[robots]


class GaitStep(NamedTuple):
    """The feet in one step."""

    measured: BoolArray  # robots that are commanded to move, shape (n,)
    contact: BoolArray  # shape (n, f)
    height: FloatArray  # above the ground [m], shape (n, f)
    speed: FloatArray  # horizontal [m/s], shape (n, f)


class EvaluationRollout:
    """A rollout that measures each robot up to its first fall.

    On a map, a robot is measured until it has crossed half a patch: the terrain beyond belongs to
    another patch. It succeeds if it crosses, or walks half of the commanded distance without a
    fall.
    """

    def __init__(self, env: LeggedEnv) -> None:
        n, dt = env.num_envs, env.cfg.dt
        self.env, self.start_pos = env, env.curriculum.progress.start.copy()
        self.half_patch = np.inf if env.terrain.is_plane else env.terrain.patch_length / 2
        self.falls, self.crossed = np.zeros(n, bool), np.zeros(n, bool)
        self.distance, self.commanded_distance = np.zeros(n), np.zeros(n)
        names = "lin_vel_error", "lin_vel_error_1s", "ang_vel_error", "ang_vel_error_1s"
        self.errors = {name: ErrorMean(n) for name in names}  # as in `RolloutMetrics`
        self._settling_steps = round(SETTLING_TIME / dt)
        self._window = max(1, round(AVERAGING_TIME / dt))
        self._recent_errors = np.zeros((self._window, n, 3), np.float32)  # ring buffer
        self.last_commands = np.full((n, 3), np.nan, np.float32)
        self._command_steps = np.zeros(n, np.int64)  # since the command changed
        self._measured_steps = np.zeros(n, np.int64)  # without interruption
        self._num_steps = 0
        self.motion = MotionSums(**{each.name: np.zeros(n) for each in fields(MotionSums)})
        self.gait: list[GaitStep] = []

    def run(
        self,
        policy: Policy,
        seconds: float,
        commands: FloatArray | None = None,
        progress: Progress = lambda _: None,
        *,
        stop_early: bool = True,
    ) -> None:
        """Run the policy and measure it.

        Args:
            policy: Function from observations to actions.
            seconds: Duration [s].
            commands: Commands; see :func:`command_schedule`.
            progress: Called after each step with the completed fraction, 0 to 1.
            stop_early: Whether to stop once every robot has fallen or crossed half a patch.
        """
        steps = max(1, round(seconds / self.env.cfg.dt))
        schedule = command_schedule(commands, steps)
        for index, step in enumerate(rollout(self.env, policy, schedule), 1):
            self._update(*step)
            progress(index / steps)
            if stop_early and (self.falls | self.crossed).all():
                break

    def _update(self, commands: FloatArray, falls: BoolArray) -> None:
        active = ~(self.falls | self.crossed)
        self.falls |= active & falls
        active &= ~falls
        state = self.env.state
        velocity = np.column_stack([state.base_lin_vel[:, :2], state.base_ang_vel[:, 2]])
        settled = self._update_errors(commands, velocity - commands, active)
        self._update_gait(commands, velocity, settled)
        distance = np.linalg.norm(state.base_pos[:, :2] - self.start_pos, axis=1)
        commanded = np.linalg.norm(self.env.curriculum.progress.target, axis=1)
        self.distance[active] = distance[active]
        self.commanded_distance[active] = commanded[active]
        self.crossed |= active & (distance > self.half_patch)

    def _update_gait(self, commands: FloatArray, velocity: FloatArray, settled: BoolArray) -> None:
        state, moving = self.env.state, settled & (commands != 0).any(axis=1)
        along, squares = velocity * commands, np.square(commands)
        lin_command = squares[:, :2].sum(axis=1)
        step = MotionSums(
            lin_vel=along[:, :2].sum(axis=1),
            lin_command=lin_command,
            ang_vel=along[:, 2],
            ang_command=squares[:, 2],
            pitch=np.arctan2(state.projected_gravity[:, 0], -state.projected_gravity[:, 2]),
            power=np.abs(state.torques * state.dof_vel).sum(axis=1) * (lin_command > 0),
            speed=np.hypot(velocity[:, 0], velocity[:, 1]) * (lin_command > 0),
            steps=np.ones(len(commands)),
        )
        self.motion.add(step, moving)
        if len(self.gait) < MAX_GAIT_STEPS and settled.any():
            foot_speed = np.hypot(state.foot_vel[..., 0], state.foot_vel[..., 1])
            feet = state.foot_contact, state.foot_height.copy(), foot_speed
            self.gait.append(GaitStep(moving, *feet))

    def _update_errors(
        self, commands: FloatArray, error: FloatArray, active: BoolArray
    ) -> BoolArray:
        # A heading command changes the yaw velocity at every step, which is no new command.
        command = self.env.velocity_command
        axes = 2 if command.heading_command and command.fixed is None else 3
        same = (commands[:, :axes] == self.last_commands[:, :axes]).all(axis=1)
        self._command_steps = np.where(same, self._command_steps + 1, 1)
        self.last_commands[:] = commands
        settled = active & (self._command_steps > self._settling_steps)
        self._measured_steps = np.where(settled, self._measured_steps + 1, 0)
        self._recent_errors[self._num_steps % self._window] = error
        self._num_steps += 1
        averaged = self._measured_steps >= self._window
        mean_error = self._recent_errors.mean(axis=0)
        for suffix, value, mask in (("", error, settled), ("_1s", mean_error, averaged)):
            self.errors[f"lin_vel_error{suffix}"].add(np.hypot(value[:, 0], value[:, 1]), mask)
            self.errors[f"ang_vel_error{suffix}"].add(np.abs(value[:, 2]), mask)
        return settled

    def metrics(self, mask: BoolArray, **key: Any) -> RolloutMetrics:
        """Return the metrics of some robots, each with the same weight.

        Args:
            mask: Mask of the robots, shape (n,).
            **key: Fields of :class:`RolloutMetrics` that define the group.
        """
        success = self.crossed | (~self.falls & (self.distance >= self.commanded_distance / 2))
        errors: dict[str, Any] = {name: each.over(mask) for name, each in self.errors.items()}
        return RolloutMetrics(
            **key,
            robots=int(mask.sum()),
            falls=int(self.falls[mask].sum()),
            success=None if self.env.terrain.is_plane else float(success[mask].mean()),
            **errors,
            **self._gait_metrics(mask),
        )

    def _gait_metrics(self, mask: BoolArray) -> dict[str, Any]:
        """Return the gait of the robots in a mask, as fields of :class:`RolloutMetrics`."""
        scene, motion = self.env.scene, self.motion.of(mask)
        moved = motion.steps > 0
        commanded = (self.last_commands[mask] != 0).any(axis=1) | moved
        followed = moved & (motion.lin_vel >= MIN_FOLLOWED * motion.lin_command)
        followed &= motion.ang_vel >= MIN_FOLLOWED * motion.ang_command
        result = {"followed": float(followed[commanded].mean())} if commanded.any() else {}
        if not moved.any():
            return result
        measured, contact, height, foot_speed = (
            np.array([each[mask] for each in parts]) for parts in zip(*self.gait, strict=True)
        )
        heights = gait.swing_heights(contact, height, measured)
        duty = gait.duty_factors(contact, measured)
        mirror = mirror_feet(scene.foot_pos)
        # Energy over weight times distance; the time step cancels in the ratio of the two sums.
        work = 9.81 * scene.model.body_subtreemass[scene.base] * motion.speed.sum()
        return result | {
            "step_frequency": _number(gait.step_frequency(contact, measured, self.env.cfg.dt)),
            "foot_slip": _number(gait.foot_slip(contact, foot_speed, measured)),
            "asymmetry": max(gait.asymmetry(each, mirror) for each in (heights, duty)),
            "base_pitch": float(motion.pitch.sum() / motion.steps.sum()),
            "cost_of_transport": float(motion.power.sum() / work) if work else None,
            "swing_height": tuple(map(_number, heights)),
            "duty_factor": tuple(map(_number, duty)),
        }

    def contacts(self) -> dict[str, str]:
        """Return the contacts that :class:`EvaluationResult` has."""
        forward, left, yaw = self.last_commands.T
        robot = int((forward - np.abs(left) - np.abs(yaw)).argmax())
        steps = round(DIAGRAM_TIME / self.env.cfg.dt)
        rows = [step.contact[robot] for step in self.gait if step.measured[robot]][-steps:]
        feet = self.env.robot.spec.feet
        return {foot: "".join(str(int(row[k])) for row in rows) for k, foot in enumerate(feet)}


def _number(value: float) -> float | None:
    """Return a number of numpy as a float; None for NaN, which JSON does not have."""
    return None if np.isnan(value) else float(value)


def summarize(
    spec: PolicySpec,
    config: EvaluationConfig,
    rollout: EvaluationRollout,
    commands: FloatArray | None = None,
) -> EvaluationResult:
    """Return the metrics of a rollout: by command, or on a map by terrain and level.

    Args:
        spec: The evaluated policy.
        config: Settings of the evaluation.
        rollout: The finished rollout.
        commands: Command of each robot, shape (n, 3), to group by; None for no such groups.
    """
    env = rollout.env
    groups: dict[str, list[RolloutMetrics]] = {}
    levels, names = env.curriculum.levels, env.terrain.terrain_names
    terrains = names[levels, env.curriculum.columns]

    def add_group(table: str, mask: BoolArray, **key: Any) -> None:
        if mask.any():
            groups.setdefault(table, []).append(rollout.metrics(mask, **key))

    keys = [] if commands is None else [tuple(round(float(v), 4) for v in c) for c in commands]
    for key in dict.fromkeys(keys):
        add_group("by_command", np.array([k == key for k in keys]), command=key)
    if not env.terrain.is_plane:
        types, all_levels = dict.fromkeys(names.ravel().tolist()), np.unique(levels).tolist()
        for name, command in direction_commands(env.cfg.commands).items():
            mask = (rollout.last_commands == command).all(axis=1)
            add_group("by_direction", mask, direction=name)
            for k in all_levels:
                add_group("by_direction_and_level", mask & (levels == k), direction=name, level=k)
        for name in types:
            add_group("by_terrain", terrains == name, terrain=name)
        for level in all_levels:
            add_group("by_level", levels == level, level=level)
        for name, level in product(types, all_levels):
            mask = (terrains == name) & (levels == level)
            add_group("by_terrain_and_level", mask, terrain=name, level=level)
    return EvaluationResult(
        robot=spec.robot.spec.name,
        checkpoint=spec.policy_name,
        config=replace(config, terrain=str(config.terrain or spec.terrain)),
        metrics=rollout.metrics(np.ones(env.num_envs, bool)),
        groups=groups,
        contacts=rollout.contacts(),
        dt=env.cfg.dt,
    )
