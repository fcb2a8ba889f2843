"""The command that trains a policy."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, ClassVar

from terrainkit.errors import ConfigError
from terrainkit_cli import render
from terrainkit_cli.config_options import TaskCommand
from terrainkit_cli.robot_options import text_option
from terrainkit_cli.training_extra import require_training

if TYPE_CHECKING:
    from terrainkit_robots.rl.config import Task
    from terrainkit_robots.rl.run import Run
    from terrainkit_robots.rl.train import TrainResult


@dataclass(frozen=True, kw_only=True)
class Train(TaskCommand):
    """Train a policy for a robot on a terrain, and save it as a run.

    A run is a folder with the task, checkpoints (model_100.pt is the one after 100 iterations) and
    TensorBoard logs. ctrl-C saves a checkpoint too. Training is deterministic: the same seed and
    number of threads give the same policy.

    With torchrun, the environments are distributed over its processes.
    """

    ALIASES: ClassVar[Mapping[str, str]] = {
        "env.num_envs": "--num-envs",
        "runner.max_iterations": "--max-iterations",
        "runner.seed": "--seed",
    }

    terrain: Annotated[str, text_option("TERRAIN")] = ""
    """A map (.npz), a map config (.toml), a MuJoCo model (.xml), or plane, which is the default."""

    log_dir: Annotated[str, text_option("FOLDER")] = ""
    """Folder of the run, which must be empty; the default is logs/ROBOT/DATE-TIME."""

    resume: Annotated[str, text_option("RUN")] = ""
    """Resume a run: its folder, or one of its checkpoints. Robot, terrain and task are those of
    the run unless given. Training continues in the same folder, exactly as without interruption.
    With another terrain or task, a new run starts with the networks of the run and, unless
    --algorithm.learning-rate or .schedule differ, its last learning rate."""

    device: Annotated[str, text_option("DEVICE")] = "cpu"
    """Device of the networks: cpu, cuda, cuda:1. The physics runs on the CPU."""

    def default_config(self) -> "Task":
        """Return the task before options: that of the run, or of the robot; then --config."""
        from terrainkit_robots.rl.config import Task
        from terrainkit_robots.rl.tasks import get_task

        run = self._resume_run
        task = get_task(self._robot(None)).task if run is None else run.task
        return Task.load(self.config, task) if self.config else task

    def run(self) -> int:
        """Train, and say what to do next."""
        require_training()
        from terrainkit_robots.rl.train import train

        run = self._resume_run
        robot, terrain, task = self._robot(run), self._terrain(run), self.changed_config()
        with render.training() as show_progress:
            trained = train(
                robot,
                terrain,
                task,
                folder=Path(self.log_dir) if self.log_dir else None,
                resume=run,
                device=self.device,
                progress_callback=show_progress,
            )
        _print_result(trained, task)
        return 128 + trained.signal if trained.signal else 0

    @cached_property  # read once, or a checkpoint that is written meanwhile would count for a part
    def _resume_run(self) -> "Run | None":
        from terrainkit_robots.rl.run import open_run

        return open_run(self.resume) if self.resume else None

    def _robot(self, run: "Run | None") -> str:
        if self.robot or run is not None:
            return self.robot or run.robot_name  # type: ignore[union-attr]
        from terrainkit.errors import listing
        from terrainkit_robots.rl.tasks import task_names

        raise ConfigError(
            "ROBOT: missing; expected a folder of terrainkit onboard, or one of: "
            f"{listing(task_names())}"
        )

    def _terrain(self, run: "Run | None") -> str:
        return self.terrain or ("plane" if run is None else run.terrain)


def _print_result(trained: "TrainResult", task: "Task") -> None:
    """Say what was done, and what can be done with it."""
    if trained.folder is None:  # the first of several processes says it
        return
    run = quote(str(trained.folder))
    whole = task.runner.max_iterations
    if trained.iteration < whole:
        render.result(f"stopped after {trained.iteration} of {whole} iterations: {run}")
        render.result(f"go on: terrainkit train --resume {run}")
        return
    render.result(f"trained {whole} iterations: {run}")
    render.result(
        f"next: terrainkit play {run}  (look at it)\n"
        f"      terrainkit evaluate {run}  (measure it)\n"
        f"      terrainkit export {run}  (ONNX, TorchScript)\n"
        f"      tensorboard --logdir {run}  (its curves)"
    )
