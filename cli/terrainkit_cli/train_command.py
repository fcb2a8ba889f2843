"""The command that trains a policy."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, ClassVar

from terrainkit.errors import ConfigError
from terrainkit_cli import render
from terrainkit_cli.config_options import TaskCommand
from terrainkit_cli.robot_options import text_option
from terrainkit_cli.signals import stop_on_signals
from terrainkit_cli.training_extra import require_training

if TYPE_CHECKING:
    from terrainkit_robots.rl.config import Task
    from terrainkit_robots.rl.run import Run
    from terrainkit_robots.rl.runner import LeggedRunner


@dataclass(frozen=True, kw_only=True)
class Train(TaskCommand):
    """Train a policy for a robot on a terrain, and save it as a run.

    A run is a folder with the task, checkpoints (model_100.pt is the one after 100 iterations) and
    TensorBoard logs. Ctrl-C writes a checkpoint and stops. Training is deterministic: the same seed
    and number of threads give the same policy. With torchrun, each process simulates a part of the
    environments.

    The options of the groups below are the values of the task; the defaults shown are those of
    ROBOT, --resume and --config.
    """

    ALIASES: ClassVar[Mapping[str, str]] = {
        "env.num_envs": "--num-envs",
        "runner.max_iterations": "--max-iterations",
        "runner.seed": "--seed",
    }

    terrain: Annotated[str, text_option("TERRAIN")] = ""
    """plane (the default), a map (.npz), or a map config (.toml)."""

    log_dir: Annotated[str, text_option("FOLDER")] = ""
    """Folder of the run, new or empty; by default logs/ROBOT/DATE-TIME."""

    resume: Annotated[str, text_option("RUN")] = ""
    """Continue a run: its folder, or one of its checkpoints. Robot, terrain and task default to
    those of the run. Training continues in the same folder, as if it had not been interrupted.
    With another terrain or task, a new run starts with the networks of this run. It also starts
    with its optimizer state if --algorithm.learning-rate and --algorithm.schedule are the same, and
    with its terrain levels if the map is the same."""

    device: Annotated[str, text_option("DEVICE")] = "cpu"
    """Device of the networks: cpu (the default), cuda, cuda:1. The physics runs on the CPU."""

    def default_config(self) -> "Task":
        """Return the task before options: that of the run, or of the robot; then --config."""
        from terrainkit_robots.rl.config import Task
        from terrainkit_robots.rl.tasks import get_task

        run = self._resume_run
        task = get_task(self._robot(None)).task if run is None else run.task
        return Task.load(self.config, task) if self.config else task

    def run(self) -> int:
        """Train, and print the next commands."""
        require_training()
        from terrainkit_robots.rl.train import train

        run = self._resume_run
        robot, terrain, task = self._robot(run), self._terrain(run), self.changed_config()
        if task.runner.logger == "wandb" and find_spec("wandb") is None:
            raise ConfigError("runner.logger: wandb is not installed: pip install wandb")
        with stop_on_signals() as stop_signal, render.training() as show_progress:
            runner = train(
                robot,
                terrain,
                task,
                folder=Path(self.log_dir) if self.log_dir else None,
                resume=run,
                device=self.device,
                start_callback=lambda runner: _print_start(runner, terrain),
                progress_callback=show_progress,
                should_stop=stop_signal,
            )
            completed = runner.current_learning_iteration
            number = stop_signal() if completed < task.runner.max_iterations else 0
        _print_result(runner, task)
        return 128 + number if number else 0

    @cached_property  # read once: training may write a checkpoint in between
    def _resume_run(self) -> "Run | None":
        from terrainkit_robots.rl.run import open_run

        return open_run(self.resume) if self.resume else None

    def _robot(self, run: "Run | None") -> str:
        if self.robot or run is not None:
            return self.robot or run.info.robot  # type: ignore[union-attr]
        from terrainkit.errors import listing
        from terrainkit_robots.rl.tasks import task_names

        raise ConfigError(
            "ROBOT: missing; expected a folder written by terrainkit onboard, or one of: "
            f"{listing(task_names())}"
        )

    def _terrain(self, run: "Run | None") -> str:
        return self.terrain or ("plane" if run is None else run.terrain)


def _print_start(runner: "LeggedRunner", terrain: str) -> None:
    """Print at once what is trained, where, and with how many threads."""
    from terrainkit_robots.text import count, display_path

    env = runner.env.cfg.env
    where = f"{runner.env.robot.spec.name} on {display_path(terrain)}"
    parallel = f"{count(env.num_envs, 'robot')}, {count(env.num_threads, 'thread')}"
    render.note(f"training {where}: {parallel}, in {runner.folder}")


def _print_result(runner: "LeggedRunner", task: "Task") -> None:
    """Print the result and the next commands."""
    if runner.folder is None:  # only the first of several processes prints
        return
    from terrainkit_robots.text import count

    run, completed = quote(str(runner.folder)), runner.current_learning_iteration
    whole = task.runner.max_iterations
    if completed < whole:
        render.result(f"stopped after {completed} of {whole} iterations: {run}")
        render.result(f"continue: terrainkit train --resume {run}")
        return
    render.result(f"trained {count(whole, 'iteration')}: {run}")
    render.result(
        f"next: terrainkit play {run}  (record a video)\n"
        f"      terrainkit evaluate {run}  (measure it)\n"
        f"      terrainkit export {run}  (ONNX, TorchScript)\n"
        f"      tensorboard --logdir {run}  (learning curves)"
    )
