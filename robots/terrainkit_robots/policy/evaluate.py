"""The evaluation: how well a policy follows commands, how often it falls, what ground it masters.

Nothing is random but where robots start: no noise, no pushes, every robot as its model. On a plane
each robot gets a command of a grid; on a map each walks forward from a patch, and its trial ends
once it has crossed half a patch, since the ground beyond is another's. What a robot does after its
first fall does not count any more.
"""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit_robots.policy.actor import policy_of
from terrainkit_robots.policy.score import Evaluation, summed_up
from terrainkit_robots.policy.trials import Watch, roll_out
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.observations import uses_height_scan
from terrainkit_robots.rl.run import Run, is_same_terrain
from terrainkit_robots.rl.runner import resolve_device, single_torch_thread
from terrainkit_robots.rl.task import Commands, Task
from terrainkit_robots.rl.terrain import Terrain, load_terrain

FloatArray = NDArray[np.float32]

LONGEST = 3600.0
"""Longest evaluation [s]."""

_FORWARD = 0.75
"""Forward speed on a map, as a part of the task's largest."""

_ALIKE = 16
"""Robots for a single command on a plane, and for grounds of other people."""

MOST = 512
"""Robots on a map, at most, unless told; each patch has equally many, or some patches have one."""


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What is to be evaluated."""

    seconds: float = 20.0
    """How long robots walk [s]."""

    terrain: str | None = None
    """Ground, as `read_ground` takes it; unless given, that of the training."""

    num_envs: int | None = None
    """Robots; unless given, one for each command of the grid, or some on every patch."""

    command: tuple[float, float, float] | None = None
    """What each robot is asked for: speed forward, to the left [m/s], turning to the left [rad/s].
    """

    random_commands: bool = False
    """Whether robots get the task's random commands."""

    seed: int = 1
    """Start of all random numbers."""

    device: str = "cpu"
    """Device of the policy, by torch's name."""

    def __post_init__(self) -> None:
        if not 0 < self.seconds <= LONGEST:
            raise ConfigError(f"seconds is {self.seconds:g}; wanted more than 0, at most {LONGEST}")
        if self.num_envs is not None and self.num_envs < 1:
            raise ConfigError(f"num_envs is {self.num_envs}; wanted 1 or more")
        if self.command is not None and not np.isfinite(self.command).all():
            raise ConfigError(f"command is {self.command}; wanted three numbers")
        if self.command is not None and self.random_commands:
            raise ConfigError("a command and random commands are both asked for; wanted one")
        if self.seed < 0:
            raise ConfigError(f"seed is {self.seed}; wanted 0 or more")


def evaluation_task(task: Task, num_envs: int, *, seconds: float = 20.0, seed: int = 1) -> Task:
    """Return a task in which robots are as their models, and stay where they are put.

    Args:
        task: The task of the training.
        num_envs: How many robots.
        seconds: How long they walk; no episode runs out of time before [s].
        seed: Start of all random numbers.
    """
    return replace(
        task,
        env=replace(task.env, num_envs=num_envs, episode_length_s=2 * seconds + 1),
        terrain=replace(task.terrain, curriculum=False),
        init_state=replace(task.init_state, reset_range=(1.0, 1.0), lin_vel=0.0, ang_vel=0.0),
        commands=replace(task.commands, curriculum=False),
        domain_rand=replace(
            task.domain_rand,
            friction=None,
            added_mass=None,
            com_shift=0.0,
            gains=None,
            motor_strength=None,
            joint_offset=0.0,
            push_interval_s=0.0,
            max_push_vel_xy=0.0,
        ),
        noise=replace(task.noise, noise_level=0.0),
        algorithm=replace(task.algorithm, num_mini_batches=1),  # a few robots may have no more
        runner=replace(task.runner, seed=seed),
    )


def command_grid(settings: Commands) -> FloatArray:
    """Return commands all over the ranges of a task, shape (k, 3): 75 for ranges around 0.

    Forward and turning speeds are none, half and all of what there is to either side, speeds to the
    side none and all. What is so small that the task makes it zero is zero.
    """
    spans = (settings.lin_vel_x, settings.lin_vel_y, settings.ang_vel_yaw)
    parts = ((1.0, 0.5), (1.0,), (1.0, 0.5))
    axes = [
        np.clip([low * p for p in part] + [0.0] + [high * p for p in part], low, high)
        for (low, high), part in zip(spans, parts, strict=True)
    ]
    grid = np.array(list(product(*axes)), np.float32)
    grid[np.hypot(grid[:, 0], grid[:, 1]) < settings.min_norm, :2] = 0
    grid[np.abs(grid[:, 2]) < settings.min_norm, 2] = 0
    return np.unique(grid + np.float32(0), axis=0)  # + 0 makes a zero of a negative zero


def forward_command(settings: Commands) -> FloatArray:
    """Return the command to walk forward at three quarters of the task's speed, shape (3,)."""
    return np.array([_FORWARD * settings.lin_vel_x[1], 0, 0], np.float32)


@single_torch_thread()
def evaluate(run: Run, asked: Asked | None = None, watch: Watch = lambda _: None) -> Evaluation:
    """Evaluate the policy of a run; the same seed gives the same result, bit for bit.

    Args:
        run: The run.
        asked: What is to be evaluated.
        watch: Is told after each step which part of the time is over, 0 to 1.

    Raises:
        ConfigError: if the run has no policy, or one of another robot; if the ground cannot be
            read, or that of the training is another by now; if there is no such device.
    """
    asked = asked or Asked()
    env, commands = prepared(run, asked)
    outcome = roll_out(env, policy_of(run, env), asked.seconds, commands, watch)
    grid = env.terrain.is_flat and asked.command is None
    return summed_up(run, asked, env, outcome, commands if grid else None)


def prepared(run: Run, asked: Asked, *, each: int = MOST) -> tuple[LeggedEnv, FloatArray | None]:
    """Return an environment to evaluate a policy in, and the command of each robot.

    Args:
        run: The run.
        asked: What is to be evaluated.
        each: Robots on each patch of a map, at most, unless it is told how many there are.

    Returns:
        The environment, and commands of shape (n, 3); None: the task's random ones.
    """
    device = resolve_device(asked.device)
    own = asked.terrain is None and not is_flat(run, asked)
    if own and not is_same_terrain(run, run.terrain):
        raise ConfigError(
            f"{run.terrain} is not what {run.folder} was trained on any more; "
            "--terrain says what to take"
        )
    source, task = asked.terrain or run.terrain, run.task
    # The policy sees as much as in training, whatever it walks on now.
    scan = uses_height_scan(task, is_flat=is_flat(run, Asked()))
    touch = task.terrain.collision
    if asked.terrain is not None and touch == "plane":
        touch = "auto"
    ground = load_terrain(source, touch)
    choice = _choice(task, ground, asked)
    rows, cols = ground.env_origins.shape[:2]
    count = asked.num_envs or _count(choice, rows * cols, each)
    task = evaluation_task(task, count, seconds=asked.seconds, seed=asked.seed)
    task = replace(task, terrain=replace(task.terrain, collision=touch, measure_heights=scan))
    env = LeggedEnv(task, run.robot, ground, device)
    env.curriculum.levels[:], env.curriculum.columns[:] = np.divmod(
        _spread(rows * cols, count, asked.seed), cols
    )
    env.reset()
    return env, None if choice is None else choice[_spread(len(choice), count, asked.seed)]


def is_flat(run: Run, asked: Asked) -> bool:
    """Return whether robots walk on a plane, or on what a map has in its place."""
    if asked.terrain is not None:
        return asked.terrain == "plane"
    return run.terrain == "plane" or run.task.terrain.collision == "plane"


def _choice(task: Task, ground: Terrain, asked: Asked) -> FloatArray | None:
    """Return the commands that robots share out, shape (k, 3); None for random ones."""
    if asked.random_commands:
        return None
    if asked.command is not None:
        return np.array([asked.command], np.float32)
    if ground.is_flat:
        return command_grid(task.commands)
    return forward_command(task.commands)[None]


def _count(choice: FloatArray | None, patches: int, each: int) -> int:
    """Return how many robots there are unless told."""
    if choice is not None and len(choice) > 1:
        return len(choice)
    if patches == 1:
        return _ALIKE
    return patches * min(each, MOST // patches) if patches <= MOST else MOST


def _spread(things: int, count: int, seed: int) -> NDArray[np.int64]:
    """Return which thing each of `count` robots gets, shape (count,): all equally often.

    With fewer robots than things, these are drawn, so that no kind is favored.
    """
    if count < things:
        return np.sort(np.random.default_rng(seed).permutation(things)[:count])
    return np.arange(count) % things
