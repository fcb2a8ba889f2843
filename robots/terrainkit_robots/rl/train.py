"""Train a policy for a robot on a terrain."""

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from terrainkit.errors import ConfigError, ExportError, TerrainkitError
from terrainkit_robots.rl import run, tasks
from terrainkit_robots.rl.config import Task
from terrainkit_robots.spec.robot_arrays import Robot

if TYPE_CHECKING:
    from terrainkit_robots.rl.runner import LeggedRunner
    from terrainkit_robots.rl.terrain import Ground


def train(
    robot: str | Path,
    terrain: str | Path = "plane",
    task: Task | None = None,
    *,
    folder: Path | None = None,
    resume: run.Run | None = None,
    device: str = "cpu",
    start_callback: "Callable[[LeggedRunner], object]" = lambda _: None,
    progress_callback: "Callable[[LeggedRunner], object] | None" = None,
    should_stop: Callable[[], object] = lambda: False,
) -> "LeggedRunner":
    """Train a policy, and write checkpoints at intervals, at the end, and when stopped.

    Args:
        robot: Name of a registered task, or folder of an onboarded robot.
        terrain: `plane`, a map (.npz), or a map config (.toml).
        task: The task; by default, the registered task of the robot.
        folder: Folder of the run; by default, `logs/<robot>/<date-time>`.
        resume: A run to continue. If robot, terrain and task are the same, the run continues. The
            continuation is exact if `env.num_envs` and the number of processes are also the same;
            otherwise, new episodes start. The state of recurrent networks starts at zero. If the
            robot, terrain or task differs, a new run starts with the networks of the run. It also
            starts with the optimizer state if the learning rate and its schedule are the same, and
            with the terrain levels if the map is the same.
        device: Device of the networks: `cpu`, `cuda`, `cuda:1`. The physics runs on the CPU.
        start_callback: Called with the runner before the first iteration.
        progress_callback: Called with the runner after each iteration.
        should_stop: Called before each iteration; True stops training with a checkpoint.

    Returns:
        The runner. It has the folder of the run (None in all processes except the main one), the
        number of completed iterations, and the policy.

    Raises:
        ConfigError: If the arguments do not fit together, training diverges, or another process
            trains in the folder.
        MemoryLimitError: If the environments do not fit in memory.
        ExportError: If the folder exists, or the disk is full.
    """
    from terrainkit_robots.rl.terrain import load_terrain

    task = tasks.get_task(robot).task if task is None else task
    ground = load_terrain(terrain, task.terrain.collision)
    parts = run.parts_to_load(resume, robot, terrain, task) if resume else None
    continued = resume if parts is None else None

    trained = continued.robot if continued else Robot.load(tasks.get_task(robot).folder)
    runner = _make_runner(task, trained, ground, device, progress_callback, should_stop)
    with _training_errors(runner), ExitStack() as locks:
        if continued and runner.is_main_process:  # before its last checkpoint is read
            locks.enter_context(run.run_lock(continued.folder))
        _load(runner, resume, parts)
        completed, total = runner.current_learning_iteration, task.runner.max_iterations
        if completed >= total:
            expected = f"expected more than the {completed} iterations that are completed"
            raise ConfigError(f"runner.max_iterations: got {total}; {expected}")
        if runner.is_main_process:
            runner.folder = run.prepare_run_folder(folder, robot, terrain, task, continued)
            if not continued:
                locks.enter_context(run.run_lock(runner.folder))
            start_callback(runner)
        # Resets of a new run would otherwise all time out in the same step.
        is_new = not runner.env.steps_since_reset.any()
        runner.learn(total - completed, init_at_random_ep_len=is_new)
        if runner.folder is not None and not ground.is_plane:
            (runner.folder / run.CURRICULUM_FILE).write_bytes(runner.env.curriculum.draw())
    return runner


def _make_runner(
    task: Task,
    robot: Robot,
    ground: "Ground",
    device: str,
    progress_callback: "Callable[[LeggedRunner], object] | None",
    should_stop: Callable[[], object],
) -> "LeggedRunner":
    """Return the runner of this process, with its share of the environments."""
    # Importing torch takes seconds; what is wrong with the arguments is said before.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    import torch

    from terrainkit_robots.rl.env import make_env
    from terrainkit_robots.rl.runner import LeggedRunner, process_share, resolve_device
    from terrainkit_robots.rl.stream_ground import training_ground

    task = process_share(task)
    if task.env.num_envs * task.runner.num_steps_per_env < 2:
        # PPO divides by the standard deviation of the advantages.
        raise ConfigError(
            "runner.num_steps_per_env: got 1 with one environment; expected 2 or more"
        )
    device = resolve_device(device)
    torch.set_num_threads(task.env.num_threads)
    torch.manual_seed(task.runner.seed)
    env = make_env(task, robot, training_ground(ground, task), device)
    return LeggedRunner(
        env, device=device, progress_callback=progress_callback, should_stop=should_stop
    )


@contextmanager
def _training_errors(runner: "LeggedRunner") -> Iterator[None]:
    """Add the last checkpoint to the errors of a training, and end its group of processes."""
    import torch

    try:
        yield
    except (TerrainkitError, OSError) as error:
        if runner.folder is None:
            raise
        saved = run.checkpoints(runner.folder)
        hint = f"the last checkpoint is {saved[max(saved)]}" if saved else "there is no checkpoint"
        if isinstance(error, TerrainkitError):
            raise type(error)(f"{error}; {hint}") from error
        reason = error.strerror or error
        raise ExportError(f"cannot write in {runner.folder}: {reason}; {hint}") from error
    finally:
        if torch.distributed.is_available() and torch.distributed.is_initialized():
            torch.distributed.destroy_process_group()


def _load(runner: "LeggedRunner", resume: run.Run | None, parts: dict[str, bool] | None) -> None:
    """Load the run to continue, if there is one; a distillation needs one, of its teacher."""
    if resume is not None:
        runner.load(run.last_checkpoint(resume), parts)
    elif not getattr(runner.alg, "teacher_loaded", True):
        raise ConfigError("runner.rsl_rl: got no teacher; expected --resume RUN of the teacher")
