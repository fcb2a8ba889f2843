"""The command that checks whether robots can be trained."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from msgspec import Meta

from terrainkit.errors import ConfigError, TerrainkitError, listing
from terrainkit_cli import render
from terrainkit_cli.argument_types import (
    IgnoredRules,
    InputPath,
    OutputPath,
    Packages,
    XacroArguments,
    parse_settings,
)
from terrainkit_cli.parse import Command, positional
from terrainkit_cli.training_extra import require_training

if TYPE_CHECKING:
    from terrainkit_robots.policy.result_table import ResultTable
    from terrainkit_robots.smoke_test.checks import Check

    SmokeTestResult = ResultTable[Check]


@dataclass(frozen=True, kw_only=True)
class SmokeTest(Command):
    """Check in a minute whether a robot can be trained.

    The robot must stand and get rewards. In a short training, the reward must not drop, the
    falls must not increase, and no penalty may be far larger than the positive rewards. Robot files
    are onboarded into a temporary folder first.

    Exit code 0: every robot can be trained. 1: a check failed. 2: a robot cannot be read, or an
    option is invalid.
    """

    robots: Annotated[tuple[str, ...], positional("ROBOT [ROBOT ...]")] = ()
    """Names of robots, folders written by terrainkit onboard, or URDF, xacro or MJCF files; names
    of the package robot_descriptions, such as go2_description, count as files."""

    samples: Annotated[int, Meta(ge=0)] = 100_000
    """Samples of the short training; 0 for none. With fewer than 50,000, only its losses are
    checked."""

    seed: Annotated[int, Meta(ge=0, le=2**32 - 1)] = 1
    """Seed of the random numbers of the short training."""

    format: Literal["text", "json"] = "text"
    """Format of the report. For several robots, json writes one document per line."""

    output: OutputPath | None = None
    """Write the report to this file; an existing file is replaced."""

    ignore: IgnoredRules = ()
    """For robot files: rules to ignore, with the reason."""

    package: Packages = ()
    """For robot files: folder of a ROS package, for package:// and $(find ...)."""

    xacro_arg: XacroArguments = ()
    """For robot files: value of a xacro argument."""

    spec: InputPath | None = None
    """For a robot file: a robot.toml whose values override the derived values."""

    def run(self) -> int:
        """Test each robot, and report."""
        self._check_options()
        require_training()
        results: dict[str, SmokeTestResult] = {}
        with render.steps() as steps:
            for name in self.robots:
                step = f"smoke test of {name}"
                steps.update(step)
                try:
                    results[name] = self._smoke_test(name, partial(show_progress, steps, step))
                except TerrainkitError as error:
                    render.error(str(error))
                except OSError as error:
                    render.error(f"{name}: {error.strerror or error}")
        text = as_json(results) if self.format == "json" else as_text(results)
        if self.output:
            from terrainkit.files.atomic_write import atomic_write

            with atomic_write(self.output, overwrite=True) as path:
                path.write_text(text, encoding="utf-8")
            render.result(f"wrote {self.output}: {', '.join(map(summary, results.values()))}")
        else:
            render.report(text)
        if len(results) < len(set(self.robots)):
            return 2
        return int(any(map(failed_checks, results.values())))

    def _check_options(self) -> None:
        from terrainkit_robots.description.robot_file import is_description

        if not self.robots:
            raise ConfigError("ROBOT: missing; expected a name, a folder, or a robot file")
        if self.spec and len(self.robots) > 1:
            raise ConfigError(f"--spec: got {len(self.robots)} robots; expected one")
        names = "package", "xacro-arg", "ignore", "spec"
        given = [name for name in names if getattr(self, name.replace("-", "_"))]
        if given and not any(Path(name).is_file() or is_description(name) for name in self.robots):
            robots = listing(self.robots)
            raise ConfigError(f"--{given[0]}: got no robot file among {robots}; expected one")
        if self.output:
            from terrainkit.files.atomic_write import check_target

            check_target(self.output, overwrite=True)  # before the tests

    def _smoke_test(self, name: str, progress: Callable[[float], None]) -> "SmokeTestResult":
        from terrainkit_robots.onboarding.onboard_options import OnboardOptions
        from terrainkit_robots.smoke_test.checks import smoke_test

        settings = parse_settings(self.ignore, self.package, self.xacro_arg)
        options = OnboardOptions(settings=settings, spec=self.spec)
        return smoke_test(name, options, samples=self.samples, seed=self.seed, progress=progress)


def show_progress(steps: render.Steps, step: str, fraction: float) -> None:
    """Show how much of a short training is completed, 0 to 1."""
    steps.update(f"{step}: training, {fraction:.0%}")


def failed_checks(result: "SmokeTestResult") -> int:
    """Return the number of checks that failed."""
    return sum(not check.passed for check in result["checks"])


def summary(result: "SmokeTestResult") -> str:
    """Return a result as one line."""
    robot = result.about["robot"]
    failed = failed_checks(result)
    if not failed:
        return f"{robot} can be trained"
    return f"{robot}: {failed} of {len(result['checks'])} checks failed"


def as_text(results: "dict[str, SmokeTestResult]") -> str:
    """Return a table of checks for each robot, with the expectation of failed ones."""
    from terrainkit_robots.text import display_path

    blocks = []
    for name, result in results.items():
        width = max(len(check.name) for check in result["checks"])
        lines = [f"robot     {result.about['robot']} ({display_path(name)})", ""]
        for check in result["checks"]:
            word = "ok  " if check.passed else "FAIL"
            lines.append(f"{word}  {check.name.ljust(width)}  {check.measured}")
            if not check.passed:
                lines.append(f"{'':4}  {'':{width}}  expected: {check.expected}")
        blocks.append("\n".join([*lines, "", f"{summary(result)}\n"]))
    return "\n".join(blocks)


def as_json(results: "dict[str, SmokeTestResult]") -> str:
    """Return one indented document; for several robots, one document per line."""
    from terrainkit import __version__

    tool = {"name": "terrainkit", "version": __version__}
    documents = [
        {
            "schema_version": result.schema_version,
            "tool": tool,
            "file": name,
            "verdict": "fail" if failed_checks(result) else "pass",
            **result.document(),
        }
        for name, result in results.items()
    ]
    indent = 2 if len(documents) == 1 else None
    return "".join(f"{json.dumps(document, indent=indent)}\n" for document in documents)
