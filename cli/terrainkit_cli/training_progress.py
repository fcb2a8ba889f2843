"""The progress of a training on stderr: lines, or a live table on a terminal."""

import statistics
import sys
import time
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from rich.table import Table

    from terrainkit_robots.rl.runner import LeggedRunner

LINE_INTERVAL, TERMS_INTERVAL = 10, 50
"""Iterations between lines of progress, and of success and rewards, if there is no terminal."""

MAX_EPISODES = 100
"""Number of the last episodes whose means are shown, as rsl-rl's buffers have."""


class TrainingProgress(NamedTuple):
    """The progress of a training, with means over the last episodes."""

    folder: Path | None
    iteration: int
    max_iterations: int
    steps_per_second: float  # environment steps, learning included
    learning_fraction: float  # of the time, 0 to 1
    eta: float  # [s]
    reward: float | None  # sum of an episode; None before the first has ended
    episode_length: float | None  # [s]
    falls: float | None  # fraction of the episodes
    speed: float | None  # horizontal [m/s]
    noise_std: float
    rewards: Mapping[str, float]  # of each term [1/s]
    shares: Mapping[str, float]  # of the most that the term can be; of a penalty: that all can be
    levels: Mapping[str, float]  # on each terrain; empty on a plane
    success: Mapping[str, float]  # on each terrain, 0 to 1


class ProgressMeter:
    """Measures the progress of a training, and shows it after each iteration."""

    def __init__(self, show: Callable[[TrainingProgress], object]) -> None:
        self._show = show
        self._logs: list[dict[str, float]] = []  # of the steps of an iteration that ended episodes
        self._means: dict[str, float] = {}  # latest mean of each value in these logs
        self._falls = deque[float](maxlen=MAX_EPISODES)
        self._speeds = deque[float](maxlen=MAX_EPISODES)

    def start(self, runner: "LeggedRunner") -> None:
        """Measure a training from its first iteration on."""
        self._start_time, self._first = time.perf_counter(), runner.current_learning_iteration
        runner.logger.episode_callback = self._add_episodes

    def _add_episodes(self, count: int, log: Mapping[str, float]) -> None:
        self._logs.append(dict(log))
        self._falls.extend([log["Episode/falls"]] * count)
        self._speeds.extend([log["Episode/speed"]] * count)

    def update(self, runner: "LeggedRunner") -> None:
        """Show the progress after an iteration."""
        for key in dict.fromkeys(key for log in self._logs for key in log):
            self._means[key] = statistics.mean(log[key] for log in self._logs if key in log)
        self._logs.clear()
        rewards, levels, success = (
            {k.removeprefix(p): mean for k, mean in self._means.items() if k.startswith(p)}
            for p in ("Episode/rew_", "Curriculum/level_", "Curriculum/success_")
        )
        env, logger = runner.env, runner.logger
        scales = {name: float(getattr(env.cfg.rewards, name)) for name in rewards}
        most = sum(scale for scale in scales.values() if scale > 0) or 1.0
        iteration, last = runner.current_learning_iteration, runner.last_iteration
        seconds = runner.collect_time + runner.learn_time
        steps = env.cfg.runner.num_steps_per_env * env.num_envs * runner.gpu_world_size
        pace = (time.perf_counter() - self._start_time) / (iteration - self._first)
        progress = TrainingProgress(
            folder=runner.folder,
            iteration=iteration,
            max_iterations=last,
            steps_per_second=steps / seconds,
            learning_fraction=runner.learn_time / seconds,
            eta=(last - iteration) * pace,
            reward=_mean(logger.rewbuffer),
            episode_length=_mean([env.cfg.dt * length for length in logger.lenbuffer]),
            falls=_mean(self._falls),
            speed=_mean(self._speeds),
            noise_std=runner.alg.get_policy().output_std.detach().mean().item(),
            rewards=rewards,
            shares={k: v / (scales[k] if scales[k] > 0 else most) for k, v in rewards.items()},
            levels=levels,
            success=success,
        )
        self._show(progress)


def _mean(values: Collection[float]) -> float | None:
    return statistics.mean(values) if values else None


@contextmanager
def shown_progress() -> Iterator[Callable[[TrainingProgress], object]]:
    """Yield a function that shows the progress of a training, live if stderr is a terminal."""
    if not sys.stderr.isatty():
        yield _print_lines
        return
    from rich.console import Console
    from rich.live import Live

    with Live(console=Console(stderr=True), auto_refresh=False) as live:
        yield lambda progress: live.update(_make_table(progress), refresh=True)


def _print_lines(progress: TrainingProgress) -> None:
    iteration, last = progress.iteration, progress.max_iterations
    lines = []
    if iteration % LINE_INTERVAL == 0 or iteration == last:
        lines.append([f"{name} {value}" for name, value in _metrics(progress)])
    if iteration % TERMS_INTERVAL == 0 or iteration == last:
        terms = [f"success {name} {rate:.0%}" for name, rate in progress.success.items()]
        rewards = [f"{name} {value}" for name, value in _rewards(progress)]
        lines.append(terms + rewards)
    with suppress(OSError):  # such as from a closed terminal
        for line in filter(None, lines):
            sys.stderr.write(f"iteration {iteration}/{last}: {', '.join(line)}\n")
            sys.stderr.flush()


def _rewards(progress: TrainingProgress) -> list[tuple[str, str]]:
    """Return each reward per second, and as a share of the most that it can be.

    The share of a penalty is relative to the sum of the most that all rewards can be.
    """
    shares = progress.shares
    return [(k, f"{v:+.3f} /s ({shares[k]:.0%})") for k, v in progress.rewards.items()]


def _metrics(progress: TrainingProgress) -> list[tuple[str, str]]:
    """Return names and values of the metrics that both formats show."""
    metrics = [
        ("env steps/s", f"{progress.steps_per_second:.0f}"),
        ("to go", _clock(progress.eta)),
        ("noise std", f"{progress.noise_std:.2f}"),
    ]
    if progress.reward is not None and progress.episode_length is not None:
        metrics.insert(2, ("reward", f"{progress.reward:.2f}"))
        metrics.insert(3, ("episode", f"{progress.episode_length:.1f} s"))
    if progress.falls is not None and progress.speed is not None:
        metrics.insert(4, ("falls", f"{progress.falls:.0%}"))
        metrics.insert(5, ("speed", f"{progress.speed:.2f} m/s"))
    return metrics + [(f"level {name}", f"{level:.1f}") for name, level in progress.levels.items()]


def _make_table(progress: TrainingProgress) -> "Table":
    from rich.table import Table

    title = f"iteration {progress.iteration}/{progress.max_iterations}"
    where = None if progress.folder is None else str(progress.folder)
    table = Table(title=title, caption=where, show_header=False, title_justify="left")
    table.add_column()
    table.add_column(justify="right")
    for name, value in _metrics(progress):
        rate = progress.success.get(name.removeprefix("level "))
        reached = "" if rate is None or not name.startswith("level ") else f"  {rate:.0%} succeed"
        table.add_row(name, value + reached)
    table.add_row("time learning", f"{progress.learning_fraction:.0%}")
    table.add_section()
    for row in _rewards(progress):
        table.add_row(*row)
    return table


def _clock(seconds: float) -> str:
    """Return a duration as text, such as 1:02:03."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"
