"""Evaluate a policy: velocity errors, falls, and success by terrain and level.

There is no noise, no push and no domain randomization; only the start positions are random. On a
plane each robot gets a command of a grid, on a map each robot walks forward from a patch.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from terrainkit.errors import ConfigError
from terrainkit_robots.policy.load import load_policy
from terrainkit_robots.policy.rollout import (
    SETTLING_TIME,
    BoolArray,
    EvaluationRollout,
    FloatArray,
    Progress,
)
from terrainkit_robots.rl.config import Commands, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.observations import uses_height_scan
from terrainkit_robots.rl.run import Run, is_same_terrain
from terrainkit_robots.rl.runner import resolve_device, single_torch_thread
from terrainkit_robots.rl.terrain import load_terrain

MAX_SECONDS = 3600.0
"""Longest evaluation [s]."""

MAX_DEFAULT_ENVS = 512
"""Largest default number of robots on a map."""

_PATCH_ENVS = 16
"""Default number of robots for one command on a single patch."""


@dataclass(frozen=True, kw_only=True)
class EvaluationConfig:
    """Settings of an evaluation.

    Attributes:
        seconds: Duration of the rollout [s].
        terrain: Terrain as `load_terrain` takes it; None for that of the training.
        num_envs: Number of robots; None for one per command of the grid, or several per patch.
        command: Command for all robots: forward and left velocity [m/s], yaw rate [rad/s].
        random_commands: Whether commands are sampled as in training.
        seed: Seed of all random numbers.
        device: Device of the policy, as torch names it.
    """

    seconds: float = 20.0
    terrain: str | None = None
    num_envs: int | None = None
    command: tuple[float, float, float] | None = None
    random_commands: bool = False
    seed: int = 1
    device: str = "cpu"

    def __post_init__(self) -> None:
        if not 0 < self.seconds <= MAX_SECONDS:
            limits = f"more than 0, at most {MAX_SECONDS:g}"
            raise ConfigError(f"seconds: got {self.seconds:g}; expected {limits}")
        if self.num_envs is not None and self.num_envs < 1:
            raise ConfigError(f"num_envs: got {self.num_envs}; expected 1 or more")
        if self.command is not None and not np.isfinite(self.command).all():
            raise ConfigError(f"command: got {self.command}; expected three finite numbers")
        if self.command is not None and self.random_commands:
            raise ConfigError("command: got a command and random_commands; expected one of them")
        if self.seed < 0:
            raise ConfigError(f"seed: got {self.seed}; expected 0 or more")


@dataclass(frozen=True, kw_only=True)
class RolloutMetrics:
    """Metrics of all robots, or of a group with the same command, terrain or level.

    Errors are means over robots of the mean over the robot's measured steps; None if no robot was
    measured.

    Attributes:
        command: Command of the group.
        terrain: Terrain of the group.
        level: Level of the group.
        robots: Number of robots.
        falls: Number of robots that fell.
        success: Fraction of robots that crossed half a patch, or walked half of the commanded
            distance without a fall; None on a plane.
        lin_vel_error: Norm of the horizontal velocity error [m/s].
        lin_vel_error_1s: The same for velocities averaged over 1 s, without the sway of a gait.
        ang_vel_error: Absolute yaw rate error [rad/s].
        ang_vel_error_1s: The same for yaw rates averaged over 1 s.
    """

    command: tuple[float, ...] | None = None
    terrain: str | None = None
    level: int | None = None
    robots: int
    falls: int
    success: float | None
    lin_vel_error: float | None
    lin_vel_error_1s: float | None
    ang_vel_error: float | None
    ang_vel_error_1s: float | None

    def as_dict(self) -> dict[str, Any]:
        """Return the metrics as a dict, without the keys that do not define the group."""
        keys = {"command", "terrain", "level"}
        return {k: v for k, v in asdict(self).items() if v is not None or k not in keys}


@dataclass(frozen=True, kw_only=True)
class EvaluationResult:
    """Result of an evaluation.

    Attributes:
        robot: Name of the robot.
        checkpoint: File name of the checkpoint.
        config: Settings, with the terrain of the training if none was given.
        metrics: Metrics of all robots.
        groups: Metrics of groups: `by_command` on a plane; `by_terrain`, `by_level` and
            `by_terrain_and_level` on a map.
    """

    robot: str
    checkpoint: str
    config: EvaluationConfig
    metrics: RolloutMetrics
    groups: Mapping[str, Sequence[RolloutMetrics]]

    def as_json(self) -> str:
        """Return the result as JSON; equal evaluations give equal bytes."""
        document: dict[str, Any] = {
            "robot": self.robot,
            "checkpoint": self.checkpoint,
            "terrain": self.config.terrain,
            "seconds": float(self.config.seconds),
            "settling_seconds": SETTLING_TIME,
            "seed": self.config.seed,
            "all": self.metrics.as_dict(),
        }
        document |= {k: [group.as_dict() for group in v] for k, v in self.groups.items()}
        return json.dumps(document, indent=2) + "\n"


@single_torch_thread()
def evaluate(
    run: Run, config: EvaluationConfig | None = None, progress: Progress = lambda _: None
) -> EvaluationResult:
    """Evaluate the policy of a run. The same seed gives the same result, bit for bit.

    Raises:
        ConfigError: if the run has no policy, or one of another robot; if the terrain cannot be
            read, or changed after the training; if the device does not exist.
    """
    config = config or EvaluationConfig()
    env, commands = make_evaluation_env(run, config)
    rollout = EvaluationRollout(env)
    rollout.run(load_policy(run, env), config.seconds, commands, progress)
    has_grid = env.terrain.is_flat and config.command is None
    return summarize(run, config, rollout, commands if has_grid else None)


def make_evaluation_env(
    run: Run, config: EvaluationConfig, *, max_patch_envs: int = MAX_DEFAULT_ENVS
) -> tuple[LeggedEnv, FloatArray | None]:
    """Return an environment to evaluate a policy in, and the command of each robot.

    Args:
        run: The run.
        config: Settings.
        max_patch_envs: Largest default number of robots on a patch of a map.

    Returns:
        The environment, and commands of shape (n, 3); None for the task's random commands.
    """
    device, task = resolve_device(config.device), run.task
    if config.terrain is None and not (is_flat(run) or is_same_terrain(run, run.terrain)):
        raise ConfigError(
            f"terrain: {run.terrain} changed after {run.folder} was trained; expected --terrain"
        )
    # The policy keeps the observations of its training, whatever terrain it walks on.
    scan = uses_height_scan(task, is_flat=is_flat(run))
    collision = task.terrain.collision
    if config.terrain is not None and collision == "plane":
        collision = "auto"
    terrain = load_terrain(config.terrain or run.terrain, collision)
    commands = None
    if config.command is not None:
        commands = np.array([config.command], np.float32)
    elif not config.random_commands:
        forward = np.array([[0.75 * task.commands.lin_vel_x[1], 0, 0]], np.float32)
        commands = command_grid(task.commands) if terrain.is_flat else forward
    rows, cols = terrain.env_origins.shape[:2]
    n = config.num_envs
    if n is None and commands is not None and len(commands) > 1:
        n = len(commands)
    elif n is None:
        per_patch = max(1, min(max_patch_envs, MAX_DEFAULT_ENVS // (rows * cols)))
        n = _PATCH_ENVS if rows * cols == 1 else min(MAX_DEFAULT_ENVS, rows * cols * per_patch)
    task = evaluation_task(task, n, seconds=config.seconds, seed=config.seed)
    task = replace(task, terrain=replace(task.terrain, collision=collision, measure_heights=scan))
    env = LeggedEnv(task, run.robot, terrain, device)
    patches = _assign(rows * cols, n, config.seed)
    env.curriculum.levels[:], env.curriculum.columns[:] = np.divmod(patches, cols)
    env.reset()
    return env, None if commands is None else commands[_assign(len(commands), n, config.seed)]


def is_flat(run: Run, terrain: str | None = None) -> bool:
    """Return whether a terrain, or else that of the training, is a plane."""
    if terrain is not None:
        return terrain == "plane"
    return run.terrain == "plane" or run.task.terrain.collision == "plane"


def _assign(count: int, num_envs: int, seed: int) -> Any:
    """Return one of `count` items for each robot, all equally often, shape (num_envs,).

    With fewer robots than items, the items are sampled without replacement.
    """
    if num_envs < count:
        return np.sort(np.random.default_rng(seed).permutation(count)[:num_envs])
    return np.arange(num_envs) % count


def evaluation_task(task: Task, num_envs: int, *, seconds: float = 20.0, seed: int = 1) -> Task:
    """Return a task without noise, randomization, pushes, curricula and timeouts in `seconds`."""
    no_randomization: dict[str, Any] = dict.fromkeys(
        ["friction", "added_mass", "gains", "motor_strength"]
    ) | (dict.fromkeys(["com_shift", "joint_offset", "push_interval_s", "max_push_vel_xy"], 0.0))
    return replace(
        task,
        env=replace(task.env, num_envs=num_envs, episode_length_s=2 * seconds + 1),
        terrain=replace(task.terrain, curriculum=False),
        init_state=replace(task.init_state, reset_range=(1.0, 1.0), lin_vel=0.0, ang_vel=0.0),
        commands=replace(task.commands, curriculum=False),
        domain_rand=replace(task.domain_rand, **no_randomization),
        noise=replace(task.noise, noise_level=0.0),
        algorithm=replace(task.algorithm, num_mini_batches=1),  # a few robots allow no more
        runner=replace(task.runner, seed=seed),
    )


def command_grid(commands: Commands) -> FloatArray:
    """Return a grid of commands over the ranges of a task, shape (k, 3); usually 75.

    Forward velocities and yaw rates are the full and half limits and zero, lateral velocities the
    full limits and zero. Commands below `min_norm` are zero.
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


def summarize(
    run: Run,
    config: EvaluationConfig,
    rollout: EvaluationRollout,
    commands: FloatArray | None = None,
) -> EvaluationResult:
    """Return the metrics of a rollout, on a map by terrain and level.

    With commands of shape (n, 3), the metrics on a plane are grouped by command.
    """
    env = rollout.env
    groups: dict[str, list[RolloutMetrics]] = {}
    levels, names = env.curriculum.levels, env.terrain.terrain_names
    terrains = names[levels, env.curriculum.columns]

    def add_group(table: str, mask: BoolArray, **key: Any) -> None:
        if mask.any():
            groups.setdefault(table, []).append(mean_metrics(rollout, mask, **key))

    keys = [] if commands is None else [tuple(round(float(v), 4) for v in c) for c in commands]
    for key in dict.fromkeys(keys):
        add_group("by_command", np.array([k == key for k in keys]), command=key)
    if not env.terrain.is_flat:
        types, all_levels = dict.fromkeys(names.ravel().tolist()), np.unique(levels).tolist()
        for name in types:
            add_group("by_terrain", terrains == name, terrain=name)
        for level in all_levels:
            add_group("by_level", levels == level, level=level)
        for name, level in product(types, all_levels):
            mask = (terrains == name) & (levels == level)
            add_group("by_terrain_and_level", mask, terrain=name, level=level)
    return EvaluationResult(
        robot=run.robot.spec.name,
        checkpoint=run.checkpoint.name if run.checkpoint is not None else "",
        config=replace(config, terrain=str(config.terrain or run.terrain)),
        metrics=mean_metrics(rollout, np.ones(env.num_envs, bool)),
        groups=groups,
    )


def mean_metrics(rollout: EvaluationRollout, mask: BoolArray, **key: Any) -> RolloutMetrics:
    """Return the metrics of the robots in a mask; each robot has the same weight."""
    errors: list[float | None] = []
    for row in range(4):
        measured = mask & (rollout.error_counts[row] > 0)
        means = rollout.error_sums[row, measured] / rollout.error_counts[row, measured]
        errors.append(float(means.mean()) if means.size else None)
    return RolloutMetrics(
        **key,
        robots=int(mask.sum()),
        falls=int(rollout.falls[mask].sum()),
        success=None if rollout.env.terrain.is_flat else float(rollout.success[mask].mean()),
        lin_vel_error=errors[0],
        lin_vel_error_1s=errors[1],
        ang_vel_error=errors[2],
        ang_vel_error_1s=errors[3],
    )
