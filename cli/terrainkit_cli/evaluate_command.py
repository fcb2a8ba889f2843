"""The command that evaluates a policy."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from terrainkit.errors import ConfigError
from terrainkit_cli import render
from terrainkit_cli.parse import Command
from terrainkit_cli.robot_options import (
    UNSET,
    Checkpoint,
    Flag,
    Output,
    optional_number,
    text_option,
)

if TYPE_CHECKING:
    from terrainkit_robots.policy.evaluate import (
        EvaluationConfig,
        EvaluationResult,
        RolloutMetrics,
    )
    from terrainkit_robots.rl.run import Run

_NO_COMMAND = (-math.inf, -math.inf, -math.inf)
"""Value of --command if it is not given; with None, tyro's errors name the types of a union."""


@dataclass(frozen=True, kw_only=True)
class PolicyCommand(Command):
    """A command that rolls out the policy of a run."""

    policy: Annotated[
        str, tyro.conf.Positional, tyro.conf.arg(metavar="RUN", help_behavior_hint="")
    ] = ""
    """A folder written by terrainkit train, a checkpoint in one, or a robot with a bundled
    policy."""

    terrain: Annotated[str, text_option("TERRAIN")] = ""
    """plane, a map (.npz), or a map config (.toml); by default, the terrain of the training."""

    command: Annotated[
        tuple[float, float, float],
        tyro.conf.arg(metavar="VX VY YAW", help_behavior_hint=""),
    ] = _NO_COMMAND
    """The same command for all robots: forward and left velocity [m/s], yaw velocity [rad/s]."""

    random_commands: Flag = False
    """Sample commands as in training."""

    num_envs: Annotated[
        int, tyro.conf.arg(metavar="INT", help_behavior_hint="(default: depends on the terrain)")
    ] = UNSET
    """Number of simulated robots."""

    checkpoint: Checkpoint = UNSET
    """The checkpoint to load."""

    seed: int = 1
    """Seed of the initial positions and of random commands."""

    device: Annotated[str, text_option("DEVICE")] = "cpu"
    """Device of the policy: cpu (the default), cuda, cuda:1."""

    def load_run(self) -> "Run":
        """Return the run.

        Raises:
            ConfigError: if there is none, or torch is not installed.
        """
        from terrainkit_cli.training_extra import require_training

        if not self.policy:
            raise ConfigError("RUN: missing; expected a run, a checkpoint, or the name of a robot")
        require_training()
        from terrainkit_robots.rl.run import open_run

        return open_run(self.policy, optional_number(self.checkpoint))

    def eval_config(self, seconds: float) -> "EvaluationConfig":
        """Return the settings of the rollout.

        Raises:
            ConfigError: if an option is out of range.
        """
        from terrainkit_robots.policy.evaluate import EvaluationConfig

        return EvaluationConfig(
            seconds=seconds,
            terrain=self.terrain or None,
            num_envs=optional_number(self.num_envs),
            command=None if self.command == _NO_COMMAND else self.command,
            random_commands=self.random_commands,
            seed=self.seed,
            device=self.device,
        )


@dataclass(frozen=True, kw_only=True)
class Evaluate(PolicyCommand):
    """Measure the velocity errors, falls and success of a policy.

    On a plane, the commands of the robots form a grid over the command ranges of the task. On a
    map, robots walk forward from the spawn origin of every patch until they have crossed half of
    it. The rollout has no noise, pushes or domain randomization. The first 2 s after a command are
    not measured, and nothing is measured after a fall. The same seed gives the same result.
    """

    seconds: float = 20.0
    """Duration of the rollout [s]."""

    format: Literal["table", "json"] = "table"
    """Format of the printed result."""

    output: Output = ""
    """Write the result to this file, as JSON."""

    overwrite: Flag = False
    """Replace an existing file."""

    def run(self) -> int:
        """Evaluate the policy, and print or write the result."""
        from terrainkit.atomic_write import atomic_write, check_target

        output = Path(self.output) if self.output else None
        if output is not None:
            check_target(output, overwrite=self.overwrite)  # before the rollout
        run = self.load_run()
        from terrainkit_robots.policy.evaluate import evaluate

        with render.steps() as steps:
            result = evaluate(
                run,
                self.eval_config(self.seconds),
                lambda fraction: steps.update(f"rollout: {fraction:.0%} of {self.seconds:g} s"),
            )
        if self.format == "json":
            render.report(result.as_json())
        else:
            render.result(summary_line(result))
            render.table(result_rows(result))
        if output is not None:
            with atomic_write(output, overwrite=self.overwrite) as path:
                path.write_text(result.as_json(), encoding="utf-8")
            if self.format == "table":
                render.result(f"wrote {output}")
        return 0


def summary_line(result: "EvaluationResult") -> str:
    """Return the metrics of all robots as one line."""
    from terrainkit_robots.text import count, display_path

    metrics, terrain = result.metrics, display_path(result.config.terrain or "plane")
    success = "" if metrics.success is None else f", {_percent(metrics.success)} success"
    error = "; ".join(format_errors(metrics))
    if metrics.lin_vel_error is None:
        error = "not measured: no robot walked longer than 2 s after a command"
    return (
        f"{result.robot}, {result.checkpoint}, on {terrain}: {count(metrics.robots, 'robot')}, "
        f"{metrics.falls} fell{success}; error {error}"
    )


def format_errors(metrics: "RolloutMetrics") -> tuple[str, str]:
    """Return the errors of the velocity and of the yaw rate as text."""
    lin, ang = _number(metrics.lin_vel_error), _number(metrics.ang_vel_error)
    lin_1s, ang_1s = _number(metrics.lin_vel_error_1s), _number(metrics.ang_vel_error_1s)
    return f"{lin} m/s ({lin_1s} averaged over 1 s)", f"{ang} rad/s ({ang_1s} averaged over 1 s)"


def result_rows(result: "EvaluationResult") -> list[tuple[str, ...]]:
    """Return the groups of a result as rows of a table: by command, or by terrain and level."""
    groups = result.groups
    if "by_command" in groups:
        rows: list[tuple[str, ...]] = [("forward", "left", "yaw", "fell", "m/s", "rad/s")]
        for group in groups["by_command"]:
            command = (f"{value:g}" for value in group.command or ())
            fell = str(group.falls) if group.robots == 1 else f"{group.falls}/{group.robots}"
            errors = _number(group.lin_vel_error), _number(group.ang_vel_error)
            rows.append((*command, fell, *errors))
        return rows
    if "by_terrain" not in groups:
        return []
    levels = [group.level for group in groups["by_level"]]
    success = {(each.terrain, each.level): each.success for each in groups["by_terrain_and_level"]}
    head = "terrain", "robots", "fell", "m/s", "rad/s", "success"
    rows = [(*head, *(f"level {level}" if level == levels[0] else str(level) for level in levels))]
    for group in groups["by_terrain"]:
        cells = (
            str(group.terrain),
            str(group.robots),
            str(group.falls),
            _number(group.lin_vel_error),
            _number(group.ang_vel_error),
            _percent(group.success),
        )
        by_level = (_percent(success.get((group.terrain, level))) for level in levels)
        rows.append((*cells, *by_level))
    return rows


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.0%}"
