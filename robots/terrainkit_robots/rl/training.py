"""Training: from a robot, a ground and a task to a run with a policy.

`train` is what `terrainkit train` calls, and what a program of yours may call::

    trained = train("quadruped", "map.npz")

Torch is imported when it is called, and learns on all processors unless `env.num_threads` says
otherwise.
"""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from terrainkit.errors import ConfigError, ExportError, TerrainkitError
from terrainkit_robots.rl import registry
from terrainkit_robots.rl.ground import read_ground
from terrainkit_robots.rl.progress import Watch, nobody
from terrainkit_robots.rl.robot import read_robot
from terrainkit_robots.rl.run_folder import (
    Run,
    changed_robot,
    checkpoints,
    create_run,
    default_folder,
    located_robot,
    located_terrain,
    rewrite_task,
    same_ground,
)
from terrainkit_robots.rl.task import Task
from terrainkit_robots.rl.threads import wait_asleep

if TYPE_CHECKING:
    from terrainkit_robots.rl.runner import LeggedRunner


_TOGETHER = 1.0
"""Signals are one asking that come so soon after the first [s]: torchrun passes on what the
terminal, or a scheduler, has told its processes already."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Trained:
    """What came of training."""

    folder: Path | None
    """The run's folder; None in any but the first of several processes."""

    iteration: int
    """Updates that the policy has had."""

    signal: int
    """The signal that ended training early, such as SIGINT; 0 for none."""


def train(
    robot: str | Path,
    terrain: str | Path = "plane",
    task: Task | None = None,
    *,
    folder: Path | None = None,
    resume: Run | None = None,
    device: str = "cpu",
    watch: Watch = nobody,
) -> Trained:
    """Train a policy, with a checkpoint every now and then, at the end, and when interrupted.

    Args:
        robot: A registered robot, or the folder of an onboarded one.
        terrain: The ground: `plane`, a map, a config of one, or a MuJoCo model.
        task: What is trained; unless given, what the robot is registered with.
        folder: Where the run goes; unless given, `logs/<robot>/<date-time>`.
        resume: A run to go on with. With the same ground and task, but for the number of
            environments and what is in `runner`, it goes on as if it had not ended, in its own
            folder unless another is given. Else a new run begins, with its networks; with its
            optimizer too, and so the learning rate that it came to, where the learning rate to
            start with and its schedule are the same; and on the same map robots stay on their
            levels. A policy that is shipped has no optimizer.
        device: Where the networks are: `cpu`, `cuda`, `cuda:1`. The physics is on the CPU.
        watch: Told of the progress after each iteration.

    Raises:
        ConfigError: if something does not fit together, or training diverges.
        MemoryLimitError: if so many environments do not fit in memory.
        ExportError: if the folder exists, or the disk is full.
    """
    wait_asleep()
    import torch

    from terrainkit_robots.rl.env import LeggedEnv
    from terrainkit_robots.rl.runner import LeggedRunner

    task = registry.find(robot).task if task is None else task
    _require_logger(task)
    before = resume if resume and _goes_on(resume, robot, terrain, task) else None
    mine = _share(task)
    body = before.robot if before else read_robot(registry.find(robot).folder)
    ground = read_ground(terrain, task.terrain.collision)
    torch.set_num_threads(mine.env.num_threads)
    torch.manual_seed(mine.runner.seed)
    device = _device(device)
    env = LeggedEnv(mine, body, ground, device)
    with _asked_to_stop() as stop, _processes_left():
        runner = LeggedRunner(env, device=device, watch=watch, stop=stop)
        if resume is not None:
            parts = None if before else _taken_over(resume, terrain, task)
            runner.load(_checkpoint(resume), parts)
        left = task.runner.max_iterations - runner.current_learning_iteration
        if left <= 0:
            raise ConfigError(
                f"{runner.current_learning_iteration} iterations are done; "
                f"runner.max_iterations is {task.runner.max_iterations}, wanted more"
            )
        if runner.first:
            runner.folder = _place(folder, robot, terrain, task, before)
        # Where all robots begin at once, they would also run out of time at once.
        _learn(runner, left, fresh=not env.steps.any())
        done = runner.current_learning_iteration
        early = done < task.runner.max_iterations
        return Trained(folder=runner.folder, iteration=done, signal=stop() if early else 0)


def _require_logger(task: Task) -> None:
    if task.runner.logger == "wandb" and find_spec("wandb") is None:
        raise ConfigError(
            "runner.logger is wandb, which is not installed: pip install wandb, or take tensorboard"
        )


def _learn(runner: "LeggedRunner", iterations: int, *, fresh: bool) -> None:
    """Learn; what ends it says which checkpoint is left."""
    try:
        runner.learn(iterations, init_at_random_ep_len=fresh)
    except (TerrainkitError, OSError) as error:
        there = checkpoints(runner.folder) if runner.folder else {}
        left = f"the last checkpoint is {there[max(there)]}" if there else "there is no checkpoint"
        if isinstance(error, OSError) and not isinstance(error, TerrainkitError):
            raise ExportError(
                f"cannot write in {runner.folder}: {error.strerror or error}; {left}"
            ) from error
        raise type(error)(f"{error}; {left}") from error


def _goes_on(run: Run, robot: str | Path, terrain: str | Path, task: Task) -> bool:
    """Whether a run can go on with a robot, a ground and a task as if it had not ended."""
    from terrainkit_robots.rl.checkpoint import read_checkpoint

    same_size = replace(
        task.env, num_envs=run.task.env.num_envs, num_threads=run.task.env.num_threads
    )
    same = replace(task, env=same_size, runner=run.task.runner) == run.task
    same &= located_terrain(terrain) == run.terrain and located_robot(robot) == run.robot_name
    if same and not same_ground(run, terrain):
        raise ConfigError(
            f"{run.terrain} is not what {run.folder} was trained on any more; another --terrain "
            "begins a new run with its networks"
        )
    if same and (files := changed_robot(run)):
        raise ConfigError(
            f"{run.robot_name} has another {' and '.join(files)} than {run.folder} was trained "
            "with; a copy of the robot in another folder begins a new run with its networks"
        )
    return same and "processes" in read_checkpoint(_checkpoint(run))


def _taken_over(run: Run, terrain: str | Path, task: Task) -> dict[str, bool]:
    """Return what a new run takes over of another.

    That is its networks; its optimizer, where the task has the same learning rate to start with, by
    the same schedule; and the levels of robots on its map.
    """
    # A map that is left flat is one patch.
    flat, was_flat = (each.terrain.collision == "plane" for each in (task, run.task))
    same = flat == was_flat and same_ground(run, terrain)
    rates = [(each.learning_rate, each.schedule) for each in (task.algorithm, run.task.algorithm)]
    return {"actor": True, "critic": True, "optimizer": rates[0] == rates[1], "careers": same}


def _checkpoint(run: Run) -> Path:
    if run.checkpoint is None:
        raise ConfigError(f"{run.folder} has no checkpoint to go on from")
    return run.checkpoint


def _place(
    folder: Path | None, robot: str | Path, terrain: str | Path, task: Task, before: Run | None
) -> Path:
    """Return the folder to write to: that of the run before, if nothing is overwritten there."""
    if folder is None and before is not None:
        there = checkpoints(before.folder)
        if there and there[max(there)] == before.checkpoint:
            if task != before.task:
                rewrite_task(before, task)
            return before.folder
    name = registry.find(robot).name
    return create_run(folder or default_folder(name), task, robot, terrain).folder


def _share(task: Task) -> Task:
    """Return the task of this process: its part of the environments, with a seed of its own.

    Several processes are torchrun's; it says in variables which one this is.
    """
    rank, count = int(os.environ.get("RANK", "0")), int(os.environ.get("WORLD_SIZE", "1"))
    here = int(os.environ.get("LOCAL_WORLD_SIZE", "1"))
    envs = task.env.num_envs
    if envs < count:
        raise ConfigError(f"env.num_envs is {envs}; wanted one for each of {count} processes")
    threads = task.env.num_threads or max(1, _processors() // here)
    mine = envs // count + (rank < envs % count)
    return replace(
        task,
        env=replace(task.env, num_envs=mine, num_threads=threads),
        runner=replace(task.runner, seed=task.runner.seed + rank),
    )


def _processors() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _device(name: str) -> str:
    """Return the device of this process: under torchrun each has its own GPU."""
    from terrainkit_robots.rl.device import require_device

    device = require_device(name)
    if device == "cpu" or int(os.environ.get("WORLD_SIZE", "1")) == 1:
        return device
    return require_device(f"cuda:{os.environ.get('LOCAL_RANK', '0')}")


@contextmanager
def _asked_to_stop() -> Iterator[Callable[[], int]]:
    """Yield what tells which signal has asked to stop: ctrl-C, or a scheduler's; 0 for none.

    The first lets the iteration come to its end, so that a checkpoint can be written; the second
    ends it at once, unless both came together.
    """
    asked: list[int] = []
    since = 0.0

    def note(number: int, _frame: FrameType | None) -> None:
        nonlocal since
        if not asked:
            since = time.monotonic()
            asked.append(number)
        elif time.monotonic() - since >= _TOGETHER:
            raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield lambda: 0  # only the main thread is told
        return
    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: asked[0] if asked else 0
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _processes_left() -> Iterator[None]:
    """Leave the other processes in the end, if there are any."""
    import torch

    try:
        yield
    finally:
        if torch.distributed.is_available() and torch.distributed.is_initialized():
            torch.distributed.destroy_process_group()
