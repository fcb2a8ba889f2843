"""The command that measures what a policy can do."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from terrainkit.errors import ConfigError
from terrainkit_cli import render
from terrainkit_cli.parse import Command
from terrainkit_cli.robot_options import NO_NUMBER, Checkpoint, Output, number_given, plain

if TYPE_CHECKING:
    from terrainkit_robots.policy.evaluate import Asked
    from terrainkit_robots.policy.score import Evaluation, Score
    from terrainkit_robots.rl.run import Run

_NOT_ASKED = (-math.inf, -math.inf, -math.inf)
"""No command; not None, since tyro's errors about a union name its members."""


@dataclass(frozen=True, kw_only=True)
class PolicyCommand(Command):
    """A command that rolls the policy of a run."""

    policy: Annotated[
        str, tyro.conf.Positional, tyro.conf.arg(metavar="RUN", help_behavior_hint="")
    ] = ""
    """A folder that terrainkit train wrote, a checkpoint in one, or a robot whose policy is
    shipped."""

    terrain: Annotated[str, plain("GROUND")] = ""
    """Ground: plane, a map (.npz), the config of one (.toml), or a MuJoCo model (.xml); unless
    given, that of the training."""

    command: Annotated[
        tuple[float, float, float],
        tyro.conf.arg(metavar="VX VY YAW", help_behavior_hint=""),
    ] = _NOT_ASKED
    """Ask every robot for this: speed forward, to the left [m/s], turning to the left [rad/s]."""

    random_commands: bool = False
    """Ask for what the task draws at random."""

    num_envs: Annotated[
        int, tyro.conf.arg(metavar="INT", help_behavior_hint="(default: as many as are of use)")
    ] = NO_NUMBER
    """Robots."""

    checkpoint: Checkpoint = NO_NUMBER
    """The checkpoint to take."""

    seed: int = 1
    """Start of all random numbers: those of where robots start."""

    device: str = "cpu"
    """Device of the policy, by torch's name."""

    def open(self) -> "Run":
        """Return the run.

        Raises:
            ConfigError: if there is none, or torch is not installed.
        """
        from terrainkit_cli.training_extra import require_training

        if not self.policy:
            raise ConfigError("no RUN; wanted the folder of a run, a checkpoint, or a robot's name")
        require_training()
        from terrainkit_robots.rl.run import open_run

        return open_run(self.policy, number_given(self.checkpoint))

    def asked(self, seconds: float) -> "Asked":
        """Return what is to be rolled.

        Raises:
            ConfigError: if an option is outside its limits.
        """
        from terrainkit_robots.policy.evaluate import Asked

        return Asked(
            seconds=seconds,
            terrain=self.terrain or None,
            num_envs=number_given(self.num_envs),
            command=None if self.command == _NOT_ASKED else self.command,
            random_commands=self.random_commands,
            seed=self.seed,
            device=self.device,
        )


@dataclass(frozen=True, kw_only=True)
class Evaluate(PolicyCommand):
    """Measure how well a policy walks: velocity errors, falls, success by terrain and level.

    On a plane, each robot gets a command of a grid over the ranges of the task. On a map, robots
    walk forward from every patch, each until it has crossed half a patch. There is no noise, and
    there are no pushes; the first 2 s after a command are not measured, nor what comes after a
    fall. The same seed gives the same result. It is JSON.
    """

    seconds: float = 20.0
    """How long robots walk [s]."""

    output: Output = ""
    """Where to write the JSON; unless given, it is printed."""

    overwrite: bool = False
    """Replace an existing file."""

    def run(self) -> int:
        """Measure, and print or write the result."""
        from terrainkit.atomic_write import check_target

        output = Path(self.output) if self.output else None
        if output is not None:
            check_target(output, overwrite=self.overwrite)  # before the wait
        run = self.open()
        from terrainkit_robots.policy.evaluate import evaluate
        from terrainkit_robots.policy.score import write_evaluation

        with render.steps() as steps:
            found = evaluate(
                run,
                self.asked(self.seconds),
                lambda done: steps.say(f"robots walk: {done:.0%} of {self.seconds:g} s"),
            )
        if output is None:
            render.report(found.as_json())
        else:
            write_evaluation(found, output, overwrite=self.overwrite)
            render.result(f"wrote {output}")
        render.headline(headline(found))
        return 0


def headline(found: "Evaluation") -> str:
    """Return an evaluation in a line."""
    whole = found.whole
    success = "" if whole.success is None else f", {whole.success:.0%} success"
    off = f"off by {'; '.join(errors(whole))}"
    if whole.lin_vel_error is None:
        off = "errors are measured from 2 s after a command on, and none walked so long"
    return (
        f"{found.robot}, {found.checkpoint}, on {found.terrain}: {whole.robots} robots, "
        f"{whole.falls} fell{success}; {off}"
    )


def errors(score: "Score") -> tuple[str, str]:
    """Return the errors of velocity and of turning in words."""
    pairs = (
        (score.lin_vel_error, score.lin_vel_error_1s, "m/s"),
        (score.ang_vel_error, score.ang_vel_error_1s, "rad/s"),
    )
    first, second = (
        f"{number(now)} {unit} ({number(mean)} averaged over 1 s)" for now, mean, unit in pairs
    )
    return first, second


def number(value: float | None) -> str:
    """Return an error as it is printed; a dash if it was never measured."""
    return "-" if value is None else f"{value:.3f}"
