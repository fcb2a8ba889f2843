"""Evaluate a policy without noise and randomization: velocity errors, gait, falls and success."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, product
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.settings.schema import Config
from terrainkit.settings.type_hint import PositiveInt
from terrainkit_robots.policy.load_policy import load_policy, single_torch_thread
from terrainkit_robots.policy.metrics import RolloutMetrics
from terrainkit_robots.policy.patch_dimensions import collision_kind, patch_dimensions
from terrainkit_robots.policy.policy_rollout import SETTLING_TIME, EvaluationRollout, Progress
from terrainkit_robots.policy.result_table import ResultTable
from terrainkit_robots.rl.config import Commands, Task
from terrainkit_robots.rl.env import LeggedEnv, has_own_commands, make_env
from terrainkit_robots.rl.observations import uses_height_scan
from terrainkit_robots.rl.run import PolicySpec, Run, is_same_terrain
from terrainkit_robots.rl.runner import available_processors, resolve_device
from terrainkit_robots.rl.terrain import Ground, load_terrain
from terrainkit_robots.transforms import BoolArray, FloatArray

MAX_MAP_ENVS, SINGLE_PATCH_ENVS = 512, 16
"""Default numbers of robots: at most on a map, and for one command on a single patch."""


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


@single_torch_thread()
def evaluate(
    spec: PolicySpec, config: EvaluationConfig | None = None, progress: Progress = lambda _: None
) -> ResultTable[RolloutMetrics]:
    """Evaluate a policy: of a run, an ONNX file (`open_policy`), or any function.

    The same seed gives the same result, bit for bit. See `summarize` for what it has.

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
    if config.command is not None and not env.has_velocity:
        raise ConfigError("command: got a velocity; expected none: the task does not command it")
    groups = commands
    if has_own_commands(spec.task) and not config.random_commands:
        for term in env.active_commands.values():
            term.hold()
        groups = np.column_stack([term.values for term in env.active_commands.values()])
    rollout = EvaluationRollout(env)
    rollout.run(load_policy(spec, env), config.seconds, commands, progress)
    has_grid = env.terrain.is_plane and config.command is None
    return summarize(spec, config, rollout, groups if has_grid else None)


def make_eval_env(
    spec: PolicySpec, config: EvaluationConfig, *, max_patch_envs: int = MAX_MAP_ENVS
) -> tuple[LeggedEnv, FloatArray | None]:
    """Return an environment to evaluate a policy in, and the commands of its robots.

    Args:
        spec: The policy with its task and robot.
        config: Settings of the evaluation.
        max_patch_envs: Maximum number of robots on a patch if `config.num_envs` is None.

    Returns:
        The environment, and commands of shape (n, 3); None for the task's random commands, as for a
        task with commands of its own.
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
    elif not config.random_commands and not has_own_commands(task):
        directions = direction_commands(task.commands).values()
        commands = command_grid(task.commands) if terrain.is_plane else np.array([*directions])
    rows, cols = terrain.env_origins.shape[:2]
    n = config.num_envs
    patches = rows * cols
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
    spec: PolicySpec,
    terrain: Ground,
    num_envs: int,
    config: EvaluationConfig,
    domain_rand: Mapping[str, Any] | None = None,
) -> LeggedEnv:
    """Return an environment on a terrain, for a policy with the observations of its training.

    Args:
        spec: The policy with its task and robot.
        terrain: The terrain.
        num_envs: Number of robots.
        config: Settings of the evaluation.
        domain_rand: Values of the domain randomization, which is off by default.
    """
    device = resolve_device(config.device)
    scan = uses_height_scan(spec.task, is_plane=is_plane(spec))
    task = eval_task(spec.task, num_envs, seconds=config.seconds, seed=config.seed)
    task = replace(
        task,
        terrain=replace(task.terrain, measure_heights=scan),
        domain_rand=replace(task.domain_rand, **(domain_rand or {})),
    )
    return make_env(task, spec.robot, terrain, device, spec.interface)


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
    names = "friction added_mass added_mass_range gains motor_strength action_delay"
    axes = [f"com_pos_{axis}_range" for axis in "xyz"]
    off: dict[str, Any] = dict.fromkeys([*names.split(), *axes])
    off |= dict.fromkeys(["com_shift", "joint_offset", "push_interval_s", "max_push_vel_xy"], 0.0)
    return replace(
        task,
        env=replace(
            task.env,
            num_envs=num_envs,
            num_threads=available_processors(),  # the result is the same with any number
            episode_length_s=2 * seconds + 1,
        ),
        terrain=replace(task.terrain, curriculum=None),
        commands=replace(task.commands, waypoints=False),
        init_state=replace(task.init_state, reset_range=(1.0, 1.0), lin_vel=0.0, ang_vel=0.0),
        domain_rand=replace(task.domain_rand, **off),
        termination=replace(task.termination, stuck_time=None),  # it would count as a fall
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
    halves = (-1.0, -0.5, 0.0, 0.5, 1.0)
    grid = commands_at(commands, list(product(halves, (-1.0, 0.0, 1.0), halves)))
    grid[np.hypot(grid[:, 0], grid[:, 1]) < commands.min_norm, :2] = 0
    grid[np.abs(grid[:, 2]) < commands.min_norm, 2] = 0
    return np.unique(grid, axis=0)


def commands_at(commands: Commands, fractions: Sequence[Sequence[float]]) -> FloatArray:
    """Return commands at fractions of the limits of a task: of the lower limit if negative.

    Args:
        commands: The ranges of the task.
        fractions: Fractions for each command, shape (k, 3).

    Returns:
        Forward and left velocity [m/s] and yaw velocity [rad/s], in these ranges, shape (k, 3).
    """
    ranges = (commands.lin_vel_x, commands.lin_vel_y, commands.ang_vel_yaw)
    low, high = np.array(ranges, np.float32).T
    parts = np.array(fractions, np.float32)
    # + 0 turns -0 into 0.
    return np.clip(np.where(parts < 0, -parts * low, parts * high), low, high) + np.float32(0)


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


def summarize(
    spec: PolicySpec,
    config: EvaluationConfig,
    rollout: EvaluationRollout,
    commands: FloatArray | None = None,
) -> ResultTable[RolloutMetrics]:
    """Return the metrics of a rollout: by command, or on a map by terrain and level.

    Args:
        spec: The evaluated policy.
        config: Settings of the evaluation.
        rollout: The finished rollout.
        commands: Command of each robot, shape (n, w), to group by; None for no such groups.

    Returns:
        `about["all"]` has the metrics of all robots, and `about["contacts"]` the contacts of each
        foot in the last 2 s, for the robot with the fastest forward command: one character per
        step of `dt` seconds, 1 in contact. Tables are `by_command` on a plane; `by_direction`,
        `by_direction_and_level`, `by_terrain`, `by_level`, `by_terrain_and_level` and
        `by_terrain_dimension` on a map. For a task with commands of its own, `about["commands"]`
        has how many numbers each of them has.
    """
    env = rollout.env
    groups: dict[str, list[RolloutMetrics]] = {}
    for table, mask, key in chain(_command_masks(commands), _map_masks(rollout)):
        if mask.any():
            groups.setdefault(table, []).append(rollout.metrics(mask, **key))
    contacts = rollout.contacts()
    sizes = {name: term.values.shape[1] for name, term in env.active_commands.items()}
    about = {
        "robot": spec.robot.spec.name,
        "checkpoint": spec.policy_name,
        "terrain": str(config.terrain or spec.terrain),
        "collision": collision_kind(env.terrain),
        "seconds": config.seconds,
        "settling_seconds": SETTLING_TIME,
        "seed": config.seed,
        "feet": list(contacts),
        "contacts": {"dt": env.cfg.dt, **contacts},
        **({"commands": sizes} if has_own_commands(spec.task) else {}),
        "all": rollout.metrics(np.ones(env.num_envs, bool)),
    }
    return ResultTable(about=about, tables=groups, schema_version=None)


_Group = tuple[str, BoolArray, dict[str, Any]]
"""Name of a table, mask of the robots, and the fields that define the group."""


def _command_masks(commands: FloatArray | None) -> Iterator[_Group]:
    """Yield the groups of robots with the same command."""
    keys = [] if commands is None else [tuple(round(float(v), 4) for v in c) for c in commands]
    for key in dict.fromkeys(keys):
        yield "by_command", np.array([k == key for k in keys]), {"command": key}


def _map_masks(rollout: EvaluationRollout) -> Iterator[_Group]:
    """Yield the groups of robots on a map: by direction, terrain, level and dimension."""
    env = rollout.env
    if env.terrain.is_plane:
        return
    levels, names = env.curriculum.levels, env.terrain.terrain_names
    places = levels, env.curriculum.columns
    terrains, sizes = names[places], patch_dimensions(env.terrain)[places]
    types, all_levels = dict.fromkeys(names.ravel().tolist()), np.unique(levels).tolist()
    directions = {
        name: (rollout.last_commands == command).all(axis=1)
        for name, command in direction_commands(env.cfg.commands).items()
    }
    for name, mask in directions.items():
        key = {"direction": name}
        yield "by_direction", mask, key
        for level in all_levels:
            yield "by_direction_and_level", mask & (levels == level), {**key, "level": level}
    for name in types:
        yield "by_terrain", terrains == name, {"terrain": name}
    for level in all_levels:
        yield "by_level", levels == level, {"level": level}
    for name, level in product(types, all_levels):
        mask = (terrains == name) & (levels == level)
        yield "by_terrain_and_level", mask, {"terrain": name, "level": level}
    for size in sorted({*sizes} - {None}):
        key = dict(zip(("terrain", "parameter", "value"), size, strict=True))
        on_size = np.array([robot_size == size for robot_size in sizes])
        for name, mask in directions.items():
            yield "by_terrain_dimension", mask & on_size, {**key, "direction": name}
