"""The evaluation: how well a policy follows commands, how often it falls, what ground it masters.

Nothing is random but where robots start: no noise, no pushes, every robot as its model. On a plane
each robot gets a command of a grid; on a map each walks forward from a patch, and its trial ends
once it has crossed half a patch, since the ground beyond is another's. What a robot does after its
first fall does not count any more.
"""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict

from terrainkit.errors import ConfigError
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.ground import Ground, read_ground
from terrainkit_robots.rl.state import State
from terrainkit_robots.rl.task import Commands, Task

if TYPE_CHECKING:
    from terrainkit_robots.rl.run_folder import Run

FloatArray = NDArray[np.float32]
Actor = Callable[[TensorDict], torch.Tensor]
Watch = Callable[[float], object]

SETTLING = 2.0
"""Time after the start, and after each new command, that is not measured: robots speed up [s]."""

WINDOW = 1.0
"""Time over which velocities are averaged in the errors called `_1s` [s]."""

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


@dataclass(frozen=True, kw_only=True)
class Score:
    """How some robots did.

    Errors are means over their steps before they fell, and None where they never walked long enough
    to be measured.
    """

    robots: int
    """How many they are."""

    falls: int
    """How many of them fell."""

    success: float | None
    """Part of them that crossed half a patch, or came half as far as they were asked to without a
    fall; None on a plane, which has no patches."""

    lin_vel_error: float | None
    """Distance between the horizontal velocity asked for and that of each instant [m/s]."""

    lin_vel_error_1s: float | None
    """The same for velocities averaged over a second, in which swaying cancels out [m/s]."""

    ang_vel_error: float | None
    """Difference between the turning speed asked for and that of each instant [rad/s]."""

    ang_vel_error_1s: float | None
    """The same for turning speeds averaged over a second [rad/s]."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """Some of the robots, by what they have in common, and how they did."""

    command: tuple[float, float, float] | None = None
    """The command that they had."""

    terrain: str | None = None
    """The terrain that they started on."""

    level: int | None = None
    """The level that they started on."""

    score: Score
    """How they did."""

    def as_dict(self) -> dict[str, Any]:
        """Return what they have in common and their score, in one."""
        shared = {"command": self.command, "terrain": self.terrain, "level": self.level}
        return {k: v for k, v in shared.items() if v is not None} | asdict(self.score)


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """How a policy did."""

    robot: str
    """Name of the robot."""

    checkpoint: str
    """Name of the file with the policy."""

    terrain: str
    """Ground, as it was given."""

    seconds: float
    """How long robots walked [s]."""

    seed: int
    """Start of all random numbers."""

    whole: Score
    """All robots."""

    by_command: tuple[Part, ...] = ()
    """On a plane, robots by command."""

    by_terrain: tuple[Part, ...] = ()
    """On a map, robots by terrain."""

    by_level: tuple[Part, ...] = ()
    """On a map, robots by level."""

    by_terrain_and_level: tuple[Part, ...] = ()
    """On a map, robots by both."""

    def as_json(self) -> str:
        """Return it as JSON, which is the same for the same evaluation."""
        tables = ("by_command", "by_terrain", "by_level", "by_terrain_and_level")
        about = {
            "robot": self.robot,
            "checkpoint": self.checkpoint,
            "terrain": self.terrain,
            "seconds": self.seconds,
            "settling_seconds": SETTLING,
            "seed": self.seed,
            "all": asdict(self.whole),
        }
        parts = {table: [part.as_dict() for part in getattr(self, table)] for table in tables}
        return json.dumps(about | {k: v for k, v in parts.items() if v}, indent=2) + "\n"


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


def evaluate(run: "Run", asked: Asked | None = None, watch: Watch = lambda _: None) -> Evaluation:
    """Evaluate the policy of a run; the same seed gives the same result, bit for bit.

    Args:
        run: The run.
        asked: What is to be evaluated.
        watch: Is told after each step which part of the time is over, 0 to 1.

    Raises:
        ConfigError: if the run has no policy, or one of another robot; if the ground cannot be
            read; if there is no such device.
    """
    from terrainkit_robots.rl.runner import policy_of

    asked = asked or Asked()
    env, commands = prepared(run, asked)
    outcome = roll_out(env, policy_of(run, env), asked.seconds, commands, watch)
    grid = env.ground.level and asked.command is None
    return summed_up(run, asked, env, outcome, commands if grid else None)


def prepared(run: "Run", asked: Asked, *, each: int = MOST) -> tuple[LeggedEnv, FloatArray | None]:
    """Return an environment to evaluate a policy in, and the command of each robot.

    Args:
        run: The run.
        asked: What is to be evaluated.
        each: Robots on each patch of a map, at most, unless it is told how many there are.

    Returns:
        The environment, and commands of shape (n, 3); None: the task's random ones.
    """
    _require_device(asked.device)
    source, task = asked.terrain or run.terrain, run.task
    touch = task.terrain.collision
    # The policy sees as much as in training, whatever it walks on now.
    scan = task.terrain.measure_heights
    if scan is None:
        scan = not (run.terrain == "plane" or touch == "plane")
    if asked.terrain is not None and touch == "plane":
        touch = "auto"
    ground = read_ground(source, touch)
    choice = _choice(task, ground, asked)
    rows, cols = ground.env_origins.shape[:2]
    count = asked.num_envs or _count(choice, rows * cols, each)
    task = evaluation_task(task, count, seconds=asked.seconds, seed=asked.seed)
    task = replace(task, terrain=replace(task.terrain, collision=touch, measure_heights=scan))
    env = LeggedEnv(task, run.robot, ground, asked.device)
    env.careers.levels[:], env.careers.columns[:] = np.divmod(
        _spread(rows * cols, count, asked.seed), cols
    )
    env.begin_all()
    return env, None if choice is None else choice[_spread(len(choice), count, asked.seed)]


def _choice(task: Task, ground: Ground, asked: Asked) -> FloatArray | None:
    """Return the commands that robots share out, shape (k, 3); None for random ones."""
    if asked.random_commands:
        return None
    if asked.command is not None:
        return np.array([asked.command], np.float32)
    if ground.level:
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


def _require_device(device: str) -> None:
    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        raise ConfigError(f"torch has no device {device!r} here: {reason}") from None


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """How n robots did in their trials."""

    fell: NDArray[np.bool_]
    """Who fell, shape (n,)."""

    success: NDArray[np.bool_]
    """Who crossed half a patch, or came half as far as asked without a fall, shape (n,)."""

    sums: NDArray[np.float64]
    """Sums over steps of four errors, in the order of `Score`, shape (4, n)."""

    counts: NDArray[np.int64]
    """Steps that were summed, shape (4, n)."""

    def score(self, who: NDArray[np.bool_], *, patches: bool) -> Score:
        """Return how some of them did; each counts alike, however long it was measured."""
        errors: list[float | None] = []
        for total, count in zip(self.sums[:, who], self.counts[:, who], strict=True):
            known = count > 0
            errors.append(float((total[known] / count[known]).mean()) if known.any() else None)
        return Score(
            robots=int(who.sum()),
            falls=int(self.fell[who].sum()),
            success=float(self.success[who].mean()) if patches else None,
            lin_vel_error=errors[0],
            lin_vel_error_1s=errors[1],
            ang_vel_error=errors[2],
            ang_vel_error_1s=errors[3],
        )


def roll_out(
    env: LeggedEnv,
    policy: Actor,
    seconds: float,
    commands: FloatArray | None = None,
    watch: Watch = lambda _: None,
    *,
    to_the_end: bool = False,
) -> Outcome:
    """Let robots walk that have just begun, and return how they did.

    Args:
        env: The environment.
        policy: What acts.
        seconds: How long they walk [s].
        commands: What they are asked for one after the other, each for the same part of the time,
            shape (n, 3) or (k, n, 3); None for the task's random commands.
        watch: Is told after each step which part of the time is over, 0 to 1.
        to_the_end: Go on when every trial has ended before its time.
    """
    steps = max(1, round(seconds / env.cfg.dt))
    held = None if commands is None else commands.reshape(-1, env.num_envs, 3)
    trials = _Trials(env)
    if held is None:
        env.hold_commands(None)
    shown = -1
    for k in range(steps):
        if held is not None and (now := k * len(held) // steps) != shown:
            env.hold_commands(held[now])
            shown = now
        before = env.state
        with torch.inference_mode():
            actions = policy(env.get_observations())
        _, _, dones, extras = env.step(actions)
        trials.add(before, (dones & ~extras["time_outs"]).cpu().numpy())
        watch((k + 1) / steps)
        if trials.ended.all() and not to_the_end:
            break
    return trials.outcome()


class _Trials:
    """The first walk of each robot, as it is measured."""

    def __init__(self, env: LeggedEnv) -> None:
        n, dt = env.num_envs, env.cfg.dt
        self._env, self._start = env, env.start.copy()
        # A heading makes a new turning speed of every step; only new directions count then.
        self._axes = slice(0, 2 if env.cfg.commands.heading_command else 3)
        self._settling, self._window = round(SETTLING / dt), max(1, round(WINDOW / dt))
        self._half = np.inf if env.ground.level else env.ground.patch_length / 2
        self.fell, self.crossed = np.zeros(n, bool), np.zeros(n, bool)
        self._distance, self._asked = np.zeros(n), np.zeros(n)
        self._sums, self._counts = np.zeros((4, n)), np.zeros((4, n), np.int64)
        self._recent = np.zeros((self._window, n, 3), np.float32)
        self._command = np.full((n, 3), np.nan, np.float32)
        self._same = np.zeros(n, np.int64)  # steps since the command changed
        self._streak = np.zeros(n, np.int64)  # steps measured since then
        self._steps = 0

    @property
    def ended(self) -> NDArray[np.bool_]:
        """Whose trial has ended before its time, shape (n,)."""
        return self.fell | self.crossed

    def add(self, before: State, fallen: NDArray[np.bool_]) -> None:
        """Measure a step.

        Args:
            before: The state that it began with, whose commands it had to follow.
            fallen: Who fell in it, and has begun anew.
        """
        active = ~self.ended
        self.fell |= active & fallen
        active &= ~fallen
        state = self._env.state
        error = np.column_stack([state.base_lin_vel[:, :2], state.base_ang_vel[:, 2]])
        self._measure(before.commands, error - before.commands, active)
        way = np.linalg.norm(state.base_pos[:, :2] - self._start, axis=1)
        self._distance[active] = way[active]
        self._asked[active] = np.linalg.norm(self._env.careers.asked[active], axis=1)
        self.crossed |= active & (way > self._half)

    def _measure(self, commands: FloatArray, error: FloatArray, active: NDArray[np.bool_]) -> None:
        same = (commands[:, self._axes] == self._command[:, self._axes]).all(axis=1)
        self._same = np.where(same, self._same + 1, 1)
        self._command[:] = commands
        measured = active & (self._same > self._settling)
        self._streak = np.where(measured, self._streak + 1, 0)
        self._recent[self._steps % self._window] = error
        self._steps += 1
        full = self._streak >= self._window
        mean = self._recent.mean(axis=0)
        kinds = (error, mean)
        for k, (kind, counted) in enumerate(zip(kinds, (measured, full), strict=True)):
            for at, size in ((k, np.hypot(kind[:, 0], kind[:, 1])), (k + 2, np.abs(kind[:, 2]))):
                self._sums[at, counted] += size[counted]
                self._counts[at, counted] += 1

    def outcome(self) -> Outcome:
        """Return how the trials went."""
        return Outcome(
            fell=self.fell,
            success=self.crossed | (~self.fell & (self._distance >= self._asked / 2)),
            sums=self._sums,
            counts=self._counts,
        )


def summed_up(
    run: "Run",
    asked: Asked,
    env: LeggedEnv,
    outcome: Outcome,
    commands: FloatArray | None = None,
) -> Evaluation:
    """Return an evaluation; commands as they are to be told apart, shape (n, 3)."""
    patches = not env.ground.level
    levels = env.careers.levels.tolist()
    names = env.ground.terrain_names
    terrains = names[env.careers.levels, env.careers.columns].tolist()
    place = {name: k for k, name in enumerate(dict.fromkeys(names.ravel().tolist()))}
    across = np.lexsort((levels, [place[name] for name in terrains]))

    def parts(keys: Sequence[tuple[Any, ...]], kinds: Iterable[Any], *names: str) -> list[Part]:
        found = []
        for kind in dict.fromkeys(kinds):
            who = np.array([key == kind for key in keys])
            shared: dict[str, Any] = dict(zip(names, kind, strict=True))
            found.append(Part(**shared, score=outcome.score(who, patches=patches)))
        return found

    def by(*names: str) -> tuple[Part, ...]:
        columns = {"terrain": terrains, "level": levels}
        keys = list(zip(*(columns[name] for name in names), strict=True))
        ordered = sorted(keys) if names == ("level",) else [keys[k] for k in across]
        return tuple(parts(keys, ordered, *names)) if patches else ()

    given = [] if commands is None else [(each,) for each in _rounded(commands)]
    return Evaluation(
        robot=run.robot.spec.name,
        checkpoint=run.checkpoint.name if run.checkpoint is not None else "",
        terrain=str(asked.terrain or run.terrain),
        seconds=float(asked.seconds),
        seed=asked.seed,
        whole=outcome.score(np.ones(env.num_envs, bool), patches=patches),
        by_command=tuple(parts(given, given, "command")),
        by_terrain=by("terrain"),
        by_level=by("level"),
        by_terrain_and_level=by("terrain", "level"),
    )


def _rounded(commands: FloatArray) -> list[tuple[float, ...]]:
    """Return commands as they are written down: single precision has its tails cut."""
    return [tuple(round(float(each), 4) for each in command) for command in commands]


def write_evaluation(evaluation: Evaluation, path: Path, *, overwrite: bool = False) -> None:
    """Write it as JSON, whole or not at all.

    Raises:
        ExportError: if the file is there and `overwrite` is not set, or cannot be written.
    """
    from terrainkit.atomic import atomic_write

    with atomic_write(path, overwrite=overwrite) as target:
        target.write_text(evaluation.as_json())
