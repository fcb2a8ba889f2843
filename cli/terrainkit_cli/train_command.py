"""The command that trains a policy."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

import tyro

from terrainkit.coerce import coerce
from terrainkit.errors import ConfigError
from terrainkit_cli import render
from terrainkit_cli.parse import value_of
from terrainkit_cli.robot_options import plain
from terrainkit_cli.task_options import TaskCommand
from terrainkit_cli.training_extra import require_training

if TYPE_CHECKING:
    from terrainkit_robots.rl.run import Run
    from terrainkit_robots.rl.task import Task
    from terrainkit_robots.rl.train import TrainResult

Whole = Annotated[str, plain("INT")]


@dataclass(frozen=True, kw_only=True)
class Train(TaskCommand):
    """Train a policy for a robot on a ground, and write it down as a run.

    A run is a folder with the task, checkpoints (model_100.pt is that after 100 iterations), and
    curves for TensorBoard. ctrl-C writes a checkpoint too. The same seed on the same number of
    threads trains the same policy.

    Under torchrun, the environments are shared among its processes.
    """

    named: Annotated[str, tyro.conf.arg(name="robot", metavar="ROBOT", help_behavior_hint="")] = ""
    """The same as ROBOT."""

    terrain: Annotated[str, plain("GROUND")] = ""
    """The ground: a map (.npz), the config of one (.toml), a MuJoCo model (.xml), or plane, which
    it is unless given."""

    num_envs: Whole = ""
    """The same as --env.num-envs: environments that are stepped together."""

    max_iterations: Whole = ""
    """The same as --runner.max-iterations: updates of the policy, those before --resume too."""

    seed: Whole = ""
    """The same as --runner.seed: start of all random numbers."""

    log_dir: Annotated[str, plain("FOLDER")] = ""
    """The run's folder, which may not hold anything yet; unless given, logs/ROBOT/DATE-TIME."""

    resume: Annotated[str, plain("RUN")] = ""
    """Go on with a run: its folder, or one of its checkpoints. Robot, ground and task are those of
    the run, unless given. It goes on in its own folder, exactly as if it had not ended; with
    another ground or task, a new run begins with its networks and, unless
    --algorithm.learning-rate or .schedule differ, with the learning rate that it came to."""

    device: Annotated[str, plain("DEVICE")] = "cpu"
    """Where the networks are: cpu, cuda, cuda:1. The physics is on the CPU."""

    def start_task(self) -> "Task":
        """Return the task before options: that of the run, or of the robot; then --config."""
        from terrainkit_robots.rl.registry import find
        from terrainkit_robots.rl.task_file import read_task

        run = self._resumed
        task = find(self._robot(None)).task if run is None else run.task
        return read_task(self.config, task) if self.config else task

    def task(self) -> "Task":
        """Return the task, as the command line wants it."""
        from terrainkit_robots.rl.task_file import changed

        task = super().task()
        env = self._given("env", num_envs=self.num_envs)
        runner = self._given("runner", max_iterations=self.max_iterations, seed=self.seed)
        return replace(
            task, env=changed("env.", task.env, env), runner=changed("runner.", task.runner, runner)
        )

    def run(self) -> int:
        """Train, and say what to do next."""
        require_training()
        from terrainkit_robots.rl.train import train

        run = self._resumed
        robot, terrain, task = self._robot(run), self._terrain(run), self.task()
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
        _tell(trained, task)
        return 128 + trained.signal if trained.signal else 0

    @cached_property  # read once, or a checkpoint that is written meanwhile would count for a part
    def _resumed(self) -> "Run | None":
        from terrainkit_robots.rl.run import open_run

        return open_run(self.resume) if self.resume else None

    def _robot(self, run: "Run | None") -> str:
        given = {name for name in (self.robot, self.named) if name}
        if len(given) > 1:
            raise ConfigError(f"two robots, {self.robot} and --robot {self.named}; wanted one")
        if given:
            return given.pop()
        if run is None:
            from terrainkit.errors import listing
            from terrainkit_robots.rl.registry import names

            raise ConfigError(
                "no ROBOT to train; wanted a folder that terrainkit onboard wrote, or one of: "
                f"{listing(names())}"
            )
        return run.robot_name

    def _given(self, section: str, **words: str) -> dict[str, int]:
        """Return the whole numbers that were given, by the name of their value in a section."""
        given = {name: word for name, word in words.items() if word}
        for name in given:
            if self.has_given(section, name):
                option = name.replace("_", "-")
                raise ConfigError(f"--{option} and --{section}.{option} are one; wanted it once")
        return {
            name: coerce(f"--{name.replace('_', '-')}", value_of(word), int)
            for name, word in given.items()
        }

    def _terrain(self, run: "Run | None") -> str:
        return self.terrain or ("plane" if run is None else run.terrain)


def _tell(trained: "TrainResult", task: "Task") -> None:
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
