"""The progress of a training on stderr: lines, or a live table on a terminal."""

import statistics
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
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
    """The progress of a training, as texts by name."""

    folder: Path | None
    iteration: int
    max_iterations: int
    metrics: Mapping[str, str]  # in the order in which they are shown
    learning: str  # share of the time
    success: Mapping[str, str]  # on each terrain
    rewards: Mapping[str, str]  # per second, and as a share of the most that they can be


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
        self._start_time = time.perf_counter()
        self._first = runner.current_learning_iteration
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
        progress = TrainingProgress(
            folder=runner.folder,
            iteration=runner.current_learning_iteration,
            max_iterations=runner.last_iteration,
            metrics=self._metrics(runner)
            | {f"level {name}": f"{level:.1f}" for name, level in levels.items()},
            learning=f"{runner.learn_time / (runner.collect_time + runner.learn_time):.0%}",
            success={name: f"{rate:.0%}" for name, rate in success.items()},
            rewards=reward_texts(rewards, runner.env.cfg.rewards),
        )
        self._show(progress)

    def _metrics(self, runner: "LeggedRunner") -> dict[str, str]:
        """Return speed, time to go, and means over the last episodes, once one has ended."""
        env = runner.env
        logger = runner.logger
        completed = runner.current_learning_iteration
        steps = env.cfg.runner.num_steps_per_env * env.num_envs * runner.gpu_world_size
        pace = (time.perf_counter() - self._start_time) / (completed - self._first)
        metrics = {
            "env steps/s": f"{steps / (runner.collect_time + runner.learn_time):.0f}",
            "to go": _clock((runner.last_iteration - completed) * pace),
        }
        if logger.lenbuffer:
            metrics["reward"] = f"{statistics.mean(logger.rewbuffer):.2f}"
            metrics["episode"] = f"{env.cfg.dt * statistics.mean(logger.lenbuffer):.1f} s"
        if self._falls:
            metrics["falls"] = f"{statistics.mean(self._falls):.0%}"
            metrics["speed"] = f"{statistics.mean(self._speeds):.2f} m/s"
        noise = runner.alg.get_policy().output_std.detach().mean().item()
        return metrics | {"noise std": f"{noise:.2f}"}


def reward_texts(rewards: Mapping[str, float], scales: object) -> dict[str, str]:
    """Return each reward per second, and as a share of the most that it can be.

    The share of a penalty is relative to the sum of the most that all rewards can be.

    Args:
        rewards: Mean of each reward [1/s].
        scales: Object with the scales of the rewards.
    """
    own = {name: float(getattr(scales, name)) for name in rewards}
    most = sum(scale for scale in own.values() if scale > 0) or 1.0
    shares = {k: v / (own[k] if own[k] > 0 else most) for k, v in rewards.items()}
    return {k: f"{v:+.3f} /s ({shares[k]:.0%})" for k, v in rewards.items()}


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
        lines.append([f"{name} {value}" for name, value in progress.metrics.items()])
    if iteration % TERMS_INTERVAL == 0 or iteration == last:
        terms = [f"success {name} {rate}" for name, rate in progress.success.items()]
        lines.append(terms + [f"{name} {value}" for name, value in progress.rewards.items()])
    with suppress(OSError):  # such as from a closed terminal
        for line in filter(None, lines):
            sys.stderr.write(f"iteration {iteration}/{last}: {', '.join(line)}\n")
            sys.stderr.flush()


def _make_table(progress: TrainingProgress) -> "Table":
    from rich.table import Table

    title = f"iteration {progress.iteration}/{progress.max_iterations}"
    where = None if progress.folder is None else str(progress.folder)
    table = Table(title=title, caption=where, show_header=False, title_justify="left")
    table.add_column()
    table.add_column(justify="right")
    for name, value in progress.metrics.items():
        rate = progress.success.get(name.removeprefix("level "))
        is_level = rate is not None and name.startswith("level ")
        table.add_row(name, f"{value}  {rate} succeed" if is_level else value)
    table.add_row("time learning", progress.learning)
    table.add_section()
    for name, value in progress.rewards.items():
        table.add_row(name, value)
    return table


def _clock(seconds: float) -> str:
    """Return a duration as text, such as 1:02:03."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"
