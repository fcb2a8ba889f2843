import io
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

import torch

from terrainkit_cli import training_progress
from terrainkit_cli.training_progress import TrainingProgress, shown_progress
from terrainkit_robots.rl.config import Task

METRICS = {"env steps/s": "1234", "to go": "1:02:03", "noise std": "0.88", "level stairs": "3.5"}
PROGRESS = TrainingProgress(
    folder=Path("logs/rover"),
    iteration=20,
    max_iterations=400,
    metrics=METRICS,
    learning="25%",
    success={"stairs": "75%"},
    rewards={"tracking_lin_vel": "+0.500 /s (25%)", "torques": "-0.062 /s (-3%)"},
)


def test_training_progress_lines_are_sparse(capsys):
    with shown_progress() as watch:
        for iteration in range(1, 51):
            watch(PROGRESS._replace(iteration=iteration))
        watch(PROGRESS._replace(iteration=53, max_iterations=53))
    out, err = capsys.readouterr()
    metrics = "env steps/s 1234, to go 1:02:03, noise std 0.88, level stairs 3.5"
    rewards = "success stairs 75%, tracking_lin_vel +0.500 /s (25%), torques -0.062 /s (-3%)"
    expected = [f"iteration {k}/400: {metrics}" for k in (10, 20, 30, 40, 50)]
    expected += [f"iteration 50/400: {rewards}"]
    expected += [f"iteration 53/53: {metrics}", f"iteration 53/53: {rewards}"]
    assert (out, err.splitlines()) == ("", expected)


def test_training_progress_on_terminal_is_table(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with shown_progress() as watch:
        watch(PROGRESS)
    shown = terminal.getvalue()
    for text in ("iteration 20/400", "1:02:03", "tracking_lin_vel", "+0.500 /s", "75% succeed"):
        assert text in shown


def test_progress_meter_shows_means_of_episodes_shares_and_time(monkeypatch):
    shown, times = [], iter([100.0, 104.0, 108.0])
    monkeypatch.setattr(training_progress.time, "perf_counter", lambda: next(times))
    policy = SimpleNamespace(output_std=torch.tensor([0.5, 1.0]))
    runner = SimpleNamespace(
        folder=Path("logs/rover"),
        current_learning_iteration=10,
        last_iteration=30,
        collect_time=1.0,
        learn_time=3.0,
        gpu_world_size=2,
        logger=SimpleNamespace(rewbuffer=[], lenbuffer=[]),
        alg=SimpleNamespace(get_policy=lambda: policy),
        env=SimpleNamespace(num_envs=5, cfg=Task()),
    )
    meter = training_progress.ProgressMeter(shown.append)
    meter.start(runner)
    runner.current_learning_iteration = 11
    meter.update(runner)
    told = {"env steps/s": "60", "to go": "0:01:16", "noise std": "0.75"}  # 19 times 4 s
    assert (dict(shown[0].metrics), shown[0].rewards) == (told, {})
    rates = {"Episode/falls": 0.5, "Episode/speed": 1.0, "Episode/rew_progress": 0.2}
    runner.logger.episode_callback(3, rates)
    more = {"Episode/falls": 1.0, "Episode/rew_torques": -0.5, "Curriculum/level_stairs": 2.0}
    runner.logger.episode_callback(1, rates | more | {"Curriculum/success_stairs": 0.25})
    runner.logger.rewbuffer, runner.logger.lenbuffer = [1.0, 2.0], [100.0, 200.0]
    runner.current_learning_iteration = 12
    meter.update(runner)
    last = shown[1]
    assert (last.folder, last.iteration, last.max_iterations) == (Path("logs/rover"), 12, 30)
    assert last.metrics == {
        "env steps/s": "60",  # 24 steps of 5 robots in each of 2 processes in 4 s
        "to go": "0:01:12",  # 18 times 4 s
        "reward": "1.50",
        "episode": "3.0 s",
        "falls": "62%",  # (3 * 0.5 + 1) / 4
        "speed": "1.00 m/s",
        "noise std": "0.75",
        "level stairs": "2.0",
    }
    assert (last.learning, last.success) == ("75%", {"stairs": "25%"})
    # Of the scale 0.5, and of the sum of the positive scales, here of `progress` alone.
    assert last.rewards == {"progress": "+0.200 /s (40%)", "torques": "-0.500 /s (-100%)"}
