"""The command that averages checkpoints."""

from dataclasses import dataclass
from shlex import quote
from typing import Annotated

from terrainkit.errors import ConfigError
from terrainkit_cli import render
from terrainkit_cli.argument_types import OutputPath, TaskFile
from terrainkit_cli.parse import Command, option, positional
from terrainkit_cli.training_extra import require_training


@dataclass(frozen=True, kw_only=True)
class Average(Command):
    """Average the networks of the last checkpoints of a run.

    Checkpoints of one training differ: one climbs a step, and the next stumbles over it. Their mean
    is often better than any of them, but not always: compare with terrainkit evaluate. The output
    is a new run without the state of the training.
    """

    source: Annotated[str, positional("RUN")] = ""
    """A folder written by terrainkit train, or a checkpoint in one; later ones are not used."""

    checkpoints: Annotated[int, option("N")] = 7
    """Number of checkpoints to average, at least 2; by default, training writes one every 100
    iterations (--runner.save-interval)."""

    base: Annotated[str, option("RUN")] = ""
    """The run that the training started from: the result is the mean of its policy and of the mean
    of the checkpoints. This preserves more of the skills that the training did not practice."""

    output: OutputPath | None = None
    """Folder of the new run."""

    task: TaskFile | None = None
    """A Python file with a task of your own, which the run was trained with; it is executed."""

    def run(self) -> int:
        """Write the new run."""
        if not self.source or not self.output:
            raise ConfigError("RUN, --output: missing; expected a run, and the folder of a new one")
        require_training()
        from terrainkit_robots.policy.average import average_checkpoints
        from terrainkit_robots.rl.run import open_run

        run = open_run(self.source, task_file=self.task)
        base = open_run(self.base, task_file=self.task) if self.base else None
        averaged = average_checkpoints(run, self.checkpoints, self.output, base)
        first, *_, last = averaged.info.averaged
        render.result(
            f"wrote {averaged.folder}: {f'the mean of {self.base} and of ' if self.base else ''}"
            f"the mean of {self.checkpoints} checkpoints, {first} to {last}"
        )
        task = f" --task {quote(str(self.task))}" if self.task else ""
        render.result(f"next: terrainkit evaluate {quote(str(averaged.folder))}{task}")
        return 0
