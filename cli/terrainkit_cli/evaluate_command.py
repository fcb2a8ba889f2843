"""The command that evaluates a policy."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from msgspec import Meta

from terrainkit.errors import ConfigError
from terrainkit_cli import render
from terrainkit_cli.argument_types import (
    Checkpoint,
    Device,
    OutputPath,
    RobotName,
    TaskFile,
    TerrainName,
    is_map,
)
from terrainkit_cli.parse import option, positional
from terrainkit_cli.plugin_command import PluginCommand

if TYPE_CHECKING:
    from terrainkit_robots.policy.evaluate import EvaluationConfig
    from terrainkit_robots.policy.metrics import RolloutMetrics
    from terrainkit_robots.policy.result_table import ResultTable
    from terrainkit_robots.rl.run import PolicySpec

DEFAULT_REPETITIONS, MAX_REPETITIONS = 10, 100
"""Default and largest number of robots on each patch of a suite."""


@dataclass(frozen=True, kw_only=True)
class PolicyCommand(PluginCommand):
    """A command that rolls out a policy."""

    source: Annotated[str, positional("RUN")] = ""
    """A folder written by terrainkit train, a checkpoint in one, or a robot with a bundled
    policy."""

    policy: Annotated[Path, option("FILE.onnx|FILE.pt")] | None = None
    """In place of RUN: a policy of any project, as ONNX or TorchScript, with policy.json or
    Unitree's deploy.yaml beside it, or with metadata of terrainkit or mjlab."""

    contract: Annotated[Path, option("FILE")] | None = None
    """The contract of --policy, if it is elsewhere: policy.json, or a YAML file in the form of
    deploy.yaml or unitree_rl_gym's deploy_mujoco."""

    robot: RobotName = ""
    """The robot of --policy: a robot's name, or a folder written by terrainkit onboard."""

    terrain: TerrainName = ""
    """plane, a map (.npz), or a map config (.toml); by default, the terrain of the training, and
    plane with --policy."""

    command: Annotated[tuple[float, float, float], option("VX VY YAW")] | None = None
    """The same command for all robots: forward and left velocity [m/s], yaw velocity [rad/s]."""

    random_commands: bool = False
    """Sample commands as in training."""

    num_envs: Annotated[int, option("INT")] | None = None
    """Number of simulated robots; the default depends on the terrain."""

    task: TaskFile | None = None
    """A Python file with a task of your own, which the run was trained with; it is executed."""

    checkpoint: Checkpoint | None = None
    """The checkpoint to load; by default, the last one."""

    seed: int = 1
    """Seed of the initial positions and of random commands."""

    device: Device = "cpu"
    """Device of the policy: cpu, cuda, cuda:1."""

    def load_spec(self) -> "PolicySpec":
        """Return the run, or the policy of --policy.

        Raises:
            ConfigError: if there is none or both, or torch is not installed.
        """
        from terrainkit_cli.training_extra import require_training

        if self.source and self.policy:
            raise ConfigError("RUN, --policy: got both; expected one of them")
        if not self.source and not self.policy:
            expected = "expected a run, a checkpoint, or the name of a robot; or --policy"
            raise ConfigError(f"RUN: missing; {expected}")
        if self.policy and not self.robot and not self.task:
            raise ConfigError("--robot: missing; expected the robot of --policy")
        if not self.policy and (self.robot or self.contract):
            name = "--robot" if self.robot else "--contract"
            raise ConfigError(f"{name}: got a value; expected none without --policy")
        if self.policy and self.checkpoint is not None:
            raise ConfigError("--checkpoint: got a value; expected none with --policy")
        require_training()
        if self.policy:
            from terrainkit_robots.policy.open_policy import open_policy
            from terrainkit_robots.rl.tasks import robot_and_task

            robot, task = robot_and_task(self.robot, self.task)
            return open_policy(self.policy, robot, self.contract, task)
        from terrainkit_robots.rl.run import open_run

        return open_run(self.source, self.checkpoint, self.task)

    def eval_config(self, seconds: float) -> "EvaluationConfig":
        """Return the settings of the rollout.

        Raises:
            ConfigError: if an option is out of range.
        """
        from terrainkit_robots.policy.evaluate import EvaluationConfig

        return EvaluationConfig(
            seconds=seconds,
            terrain=self.terrain or None,
            num_envs=self.num_envs,
            command=self.command,
            random_commands=self.random_commands,
            seed=self.seed,
            device=self.device,
        )


@dataclass(frozen=True, kw_only=True)
class Evaluate(PolicyCommand):
    """Measure velocity errors, gait, falls and success of a policy.

    On a plane, the commands of the robots form a grid over the command ranges of the task; a task
    with commands of its own samples them, and each robot keeps those that it starts with. On a
    map, robots walk forward, backward, left and right from the spawn origin of every patch until
    they have crossed half of it, at three quarters of the task's largest velocities. The success is
    the share that crosses, of the robots that fell or were commanded that far. The rollout has no
    noise, pushes or domain randomization. The first 2 s after each command and the time after a
    fall are not measured. The same seed gives the same result.
    """

    seconds: float = 20.0
    """Duration of the rollout [s]."""

    format: Literal["table", "json"] = "table"
    """Format of the printed result."""

    suite: Annotated[str, option("SUITE|MAP.npz")] = ""
    """Measure how often robots cross the patches of this suite (terrainkit suite list) or map,
    along their goals or to a far side, and print a report card."""

    limits: bool = False
    """Measure the steps, gaps, slopes and passages that 90 % and 50 % of robots cross, with 95 %
    intervals."""

    margins: bool = False
    """Measure on a plane what the policy bears of latency, pushes, low friction, and errors of
    masses, motors, gains and sensors. With --suite, the report card has the margins as well."""

    repetitions: Annotated[int, Meta(ge=1, le=MAX_REPETITIONS), option("N")] | None = None
    """With --suite or --limits: robots on each patch, by default 10; --limits has six rounds. With
    --margins: robots with each command and disturbance, by default 3."""

    output: OutputPath | None = None
    """Write the result to this file, as JSON. With --suite also as Markdown and as a picture, to
    files with the suffixes .json, .md and .png."""

    diagram: Annotated[Path, option("PNG")] | None = None
    """Draw the contacts of the feet over 2 s in this picture."""

    overwrite: bool = False
    """Replace existing files."""

    def run(self) -> int:
        """Evaluate the policy, and print or write the result."""
        from terrainkit.files.atomic_write import atomic_write, check_target

        if self.suite or self.limits or self.margins:
            return self._report_card()
        if self.repetitions is not None:
            expected = "expected none without --suite, --limits or --margins"
            raise ConfigError(f"--repetitions: got a value; {expected}")
        for target in filter(None, (self.output, self.diagram)):
            check_target(target, overwrite=self.overwrite)  # before the rollout
        spec = self.load_spec()
        from terrainkit_robots.policy.evaluate import evaluate

        with render.steps() as steps:
            result = evaluate(
                spec,
                self.eval_config(self.seconds),
                lambda fraction: steps.update(f"rollout: {fraction:.0%} of {self.seconds:g} s"),
            )
        if self.format == "json":
            render.report(result.to_json(indent=2))
        else:
            render.result("\n".join([summary_line(result), *gait_lines(result)]))
            render.table(result_rows(result))
            render.table(dimension_rows(result))
        if self.output is not None:
            with atomic_write(self.output, overwrite=self.overwrite) as path:
                path.write_text(result.to_json(indent=2), encoding="utf-8")
        if self.diagram is not None:
            from terrainkit_cli.contact_diagram import draw_contacts

            with atomic_write(self.diagram, overwrite=self.overwrite) as path:
                contacts = dict(result.about["contacts"])
                path.write_bytes(draw_contacts(contacts, contacts.pop("dt")))
        for target in filter(None, (self.output, self.diagram)):
            if self.format == "table":
                render.result(f"wrote {target}")
        return 0

    def _report_card(self) -> int:
        """Measure the policy on a suite or up to its limits; print and write the result."""
        from terrainkit.files.atomic_write import check_target
        from terrainkit.suites import get_suite
        from terrainkit_cli import report_card

        if self.limits and (self.suite or self.margins):
            other = "--suite" if self.suite else "--margins"
            raise ConfigError(f"{other}, --limits: got both; expected one of them")
        unused = "terrain command random_commands num_envs format diagram"
        for name in unused.split() if self.margins else [*unused.split(), "seconds"]:
            if getattr(self, name) != getattr(type(self), name):
                option = f"--{name}".replace("_", "-")
                expected = "expected none with --suite, --limits or --margins"
                raise ConfigError(f"{option}: got a value; {expected}")
        targets = report_card.targets(self.output, is_card=bool(self.suite)) if self.output else []
        for target in targets:
            check_target(target, overwrite=self.overwrite)
        if self.suite and not is_map(self.suite):
            get_suite(self.suite)  # an unknown name is reported before the run is loaded
        spec, config = self.load_spec(), self.eval_config(self.seconds)
        repetitions = self.repetitions or DEFAULT_REPETITIONS
        margins = None
        if self.margins:
            margins = report_card.report_margins(spec, config, self.repetitions)
        if self.suite:
            contents = report_card.report_suite(spec, self.suite, config, repetitions, margins)
        else:
            result = margins or report_card.report_limits(spec, config, repetitions)
            contents = [result.to_json().encode()]
        if targets:
            report_card.write_files(targets, contents)
        return 0


def summary_line(result: "ResultTable[RolloutMetrics]") -> str:
    """Return the metrics of all robots as one line."""
    from terrainkit_robots.text import count, display_path

    about, metrics = result.about, result.about["all"]
    terrain = display_path(about["terrain"])
    if about["collision"] != "plane":
        terrain += f" (collision: {about['collision']})"
    success = "" if metrics.success is None else f", {_percent(metrics.success)} success"
    success += "" if metrics.drift is None else f" with {_percent(metrics.drift)} sideways drift"
    error = "; ".join(format_errors(metrics))
    if metrics.lin_vel_error is None:
        error = "not measured: no robot walked longer than 2 s after a command"
    if "velocity" not in about.get("commands", ["velocity"]):
        error = "not measured: no velocities are commanded"
    return (
        f"{about['robot']}, {about['checkpoint']}, on {terrain}: "
        f"{count(metrics.robots, 'robot')}, "
        f"{metrics.falls} fell{success}; error {error}"
    )


def format_errors(metrics: "RolloutMetrics") -> tuple[str, str]:
    """Return the errors of the velocity and of the yaw rate as text."""
    lin, ang = _number(metrics.lin_vel_error), _number(metrics.ang_vel_error)
    lin_1s, ang_1s = _number(metrics.lin_vel_error_1s), _number(metrics.ang_vel_error_1s)
    return f"{lin} m/s ({lin_1s} averaged over 1 s)", f"{ang} rad/s ({ang_1s} averaged over 1 s)"


def gait_lines(result: "ResultTable[RolloutMetrics]") -> list[str]:
    """Return the gait of the robots that are commanded to move, and a contact diagram, as lines."""
    metrics, feet = result.about["all"], result.about["feet"]
    lines = [] if metrics.followed is None else [f"commands followed: {metrics.followed:.0%}"]
    if metrics.lin_vel_error is None:
        lines = ["commands followed: not measured"]
    if "commands" in result.about:
        lines = []
    if metrics.terms:
        means = (
            f"{name} {'-' if value is None else f'{value:.3g}'}"
            for name, value in metrics.terms.items()
        )
        lines.append(f"means (rewards per second): {', '.join(means)}")
    if metrics.swing_height is None or metrics.duty_factor is None:
        return lines
    heights = (_number(value, 100, 1) for value in metrics.swing_height)
    values = (
        f"{_number(metrics.step_frequency, 1, 1)} steps/s per foot",
        f"feet slip at {_number(metrics.foot_slip, 1, 2)} m/s",
        f"left and right differ by {_percent(metrics.asymmetry)}",
        f"nose down {_number(metrics.base_pitch, 180 / math.pi, 1)} deg",
        f"cost of transport {_number(metrics.cost_of_transport, 1, 2)}",
    )
    swings = ", ".join(f"{foot} {height}" for foot, height in zip(feet, heights, strict=True))
    lines += [f"gait: {', '.join(values)}", f"swing height [cm]: {swings}"]
    loads = metrics.load_cells()
    lines.append(
        f"largest loads (and 95th percentile): torque {loads[0]} and joint speed {loads[1]} of the "
        f"limits, foot force {loads[2]} times the weight"
    )
    width = max(map(len, feet))
    for foot, duty in zip(feet, metrics.duty_factor, strict=True):
        blocks = result.about["contacts"][foot].translate({ord("1"): "#", ord("0"): "."})
        lines.append(f"{foot:{width}}  {blocks}  {_percent(duty)} in contact")
    return lines


def result_rows(result: "ResultTable[RolloutMetrics]") -> list[tuple[str, ...]]:
    """Return the groups of a result as rows of a table: by command, or by terrain and level."""
    groups, about = result.tables, result.about
    sizes = about.get("commands", dict.fromkeys(["forward", "left", "yaw"], 1))
    terms = [name for name in about["all"].terms or {} if not name.startswith("rew_")]
    if "by_command" in groups:
        head = [name if n == 1 else f"{name}[{k}]" for name, n in sizes.items() for k in range(n)]
        head += ["fell", "m/s", "rad/s", "followed", "swing [cm]", *terms]
        rows: list[tuple[str, ...]] = [tuple(head)]
        for group in sorted(groups["by_command"], key=lambda group: group.command or ()):
            command = (f"{value:g}" for value in group.command or ())
            fell = str(group.falls) if group.robots == 1 else f"{group.falls}/{group.robots}"
            errors = _number(group.lin_vel_error), _number(group.ang_vel_error)
            swing = [height for height in group.swing_height or () if height is not None]
            lowest = _number(min(swing, default=None), 100, 1)
            means = (_number(value) for name, value in (group.terms or {}).items() if name in terms)
            rows.append((*command, fell, *errors, _percent(group.followed), lowest, *means))
        return _measured_columns(rows) if "commands" in about else rows
    if "by_terrain" not in groups:
        return []
    levels = [group.level for group in groups["by_level"]]
    by_level = *groups["by_terrain_and_level"], *groups.get("by_direction_and_level", ())
    success = {(group.terrain or group.direction, group.level): group.success for group in by_level}
    names = "terrain", "robots", "fell", "m/s", "rad/s", "success"
    rows = [(*names, *(f"level {level}" if level == levels[0] else str(level) for level in levels))]
    for group in (*groups["by_terrain"], *groups.get("by_direction", ())):
        cells = (
            str(group.terrain or group.direction),
            str(group.robots),
            str(group.falls),
            _number(group.lin_vel_error),
            _number(group.ang_vel_error),
            _percent(group.success),
        )
        key = group.terrain or group.direction
        rows.append((*cells, *(_percent(success.get((key, level))) for level in levels)))
    return _measured_columns(rows) if "commands" in about else rows


def _measured_columns(rows: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Return a table without the columns in which nothing was measured."""
    columns = [cells for cells in zip(*rows, strict=True) if {*cells[1:]} != {"-"}]
    return list(zip(*columns, strict=True))


def dimension_rows(result: "ResultTable[RolloutMetrics]") -> list[tuple[str, ...]]:
    """Return how many robots succeed at each dimension of stairs, gaps and obstacles, as rows."""
    groups = result.tables.get("by_terrain_dimension", ())
    directions = list(dict.fromkeys(str(group.direction) for group in groups))
    rows: dict[tuple[str, str], dict[str, str]] = {}
    for group in groups:
        fell = f", {group.falls} fell" if group.falls else ""
        cell = "not measured"
        if group.success is not None:
            cell = f"{round(group.success * group.robots)} of {group.robots}{fell}"
        size = f"{group.parameter} {_number(group.value, 100, 1)} cm"
        rows.setdefault((str(group.terrain), size), {})[str(group.direction)] = cell
    head = [("\nterrain", "dimension", *directions)] if rows else []
    cells = ((*key, *(row.get(name, "-") for name in directions)) for key, row in rows.items())
    return [*head, *cells]


def _number(value: float | None, factor: float = 1, digits: int = 3) -> str:
    return "-" if value is None else f"{factor * value:.{digits}f}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.0%}"
