"""The commands that check robots, and explain what they are checked for."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from terrainkit.errors import ConfigError, TerrainkitError
from terrainkit_cli import render
from terrainkit_cli.parse import Command
from terrainkit_cli.robot_options import (
    Output,
    Packages,
    Text,
    Words,
    XacroArguments,
    find_robot,
    listed,
    packages,
    reasons,
    repeated,
    xacro_arguments,
)

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts
    from terrainkit_robots.lint.rule import Rule as RobotRule
    from terrainkit_robots.lint.runner import Report
    from terrainkit_robots.lint.settings import Settings


@dataclass(frozen=True, kw_only=True)
class CheckRobot(Command):
    """Check a robot's URDF, xacro or MJCF file: what would go wrong when it is trained.

    Exit code 0: no errors (warnings are allowed; not with --strict). 1: errors were found. 2: a
    file cannot be opened, or an option is wrong; the other files are reported all the same.

    Options are also read from [tool.terrainkit.check-robot] in pyproject.toml or [check-robot] in
    terrainkit.toml, in the folder of the robot or above it: select, ignore, package, xacro-arg,
    strict, simulation. A comment in the robot's file ignores a rule for the element that it is on,
    in or above:
    <!-- terrainkit: ignore INR004 the reason -->
    """

    files: Annotated[
        Words,
        tyro.conf.Positional,
        tyro.conf.arg(metavar="FILE [FILE ...]", help_behavior_hint=""),
    ] = field(default_factory=list)
    """Files to check, or names of bundled robots: quadruped, biped."""

    format: Literal["text", "json", "sarif", "github", "markdown"] = "text"
    """How to report. Of several files, json writes one document on a line each."""

    output: Output = ""
    """Write the report to this file; one that is there is replaced."""

    select: Annotated[Words, *repeated("CODES")] = field(default_factory=list)
    """Ask only these rules: codes, starts of codes, or names, with commas between."""

    ignore: Annotated[Words, *repeated("CODES=REASON")] = field(default_factory=list)
    """Do not ask these rules; the reason goes into the report."""

    package: Packages = field(default_factory=list)
    """Folder of a ROS package, for package:// and $(find ...)."""

    xacro_arg: XacroArguments = field(default_factory=list)
    """Value of a xacro argument."""

    against: Text = ""
    """Another file of the same robot, to compare with: URDF, xacro or MJCF."""

    spec: Text = ""
    """The robot.toml of the robot, to check against it."""

    no_simulation: bool = False
    """Simulate nothing: neither drop the robot, nor let it stand, nor move its joints."""

    strict: bool = False
    """Let warnings count as errors in the exit code."""

    fix: bool = False
    """Repair the files where that changes nothing for a reader that could read them."""

    unsafe_fixes: bool = False
    """Repair more: also where a number, a shape or another file changes. Look at the result."""

    diff: bool = False
    """Show what --fix (or --unsafe-fixes) would change, and write nothing."""

    train_smoke: bool = False
    """In place of all that, see in seconds whether the robot can be trained: it starts on its feet,
    stands, is rewarded, and learns a few times. FILE may also be a folder that terrainkit onboard
    wrote, or any robot with a task. Exit code 1 if a check fails. As text or json."""

    def run(self) -> int:
        """Check each file, and report."""
        if not self.files:
            raise ConfigError("no FILE to check; wanted one or more, or quadruped, or biped")
        if self.train_smoke:
            from terrainkit_cli.train_smoke import check_training

            return check_training(self)
        if self.diff and self.format != "text":
            raise ConfigError(f"--diff shows a diff, not a report as {self.format}; wanted one")
        if len(self.files) > 1 and (self.against or self.spec):
            raise ConfigError(
                f"--against and --spec compare one robot, and there are {len(self.files)} files"
            )
        options = self._settings()
        output = Path(self.output) if self.output else None
        if output is not None:
            _check_output(output, [Path(name) for name in self.files])
        checks = [check for name in self.files if (check := _tried(name, self, options))]
        self._say(checks, output)
        crashed = [rule for check in checks for rule in check.report.crashed]
        for rule in crashed:
            render.error(f"{rule.code}: {rule.reason}")
        if crashed or len(checks) < len(self.files):
            return 2
        return int(any(check.bad for check in checks))

    def _settings(self) -> "Settings":
        from terrainkit_robots.lint.selection import select_rules
        from terrainkit_robots.lint.settings import Settings

        settings = Settings(
            select=tuple(word for words in self.select for word in listed(words)),
            ignore=reasons(self.ignore),
            packages=packages(self.package),
            xacro_arguments=xacro_arguments(self.xacro_arg),
            strict=self.strict,
            simulate=not self.no_simulation,
        )
        select_rules(settings)
        return settings

    def _say(self, checks: "Sequence[_Checked]", output: Path | None) -> None:
        from terrainkit_robots.lint.report import format_reports
        from terrainkit_robots.lint.report.summary import summarize_findings

        reports = [check.report for check in checks]
        if self.diff:
            text = "".join(check.diff for check in checks)
            if checks and not text:
                render.note("there is nothing to fix")
        elif output is None and self.format == "text" and render.has_colors():
            from terrainkit_robots.lint.report.text import format_lines

            render.styled(format_lines(reports, width=render.width()))
            return
        else:
            text = format_reports(reports, self.format)
        if output is None:
            render.report(text)
        elif reports:
            _check_output(output, [path for r in reports for path in r.facts.model.sources])
            _write(output, text)
            render.result(f"wrote {output}: {summarize_findings(reports)}")


@dataclass(frozen=True, kw_only=True)
class _Checked:
    """What there is to say of one file."""

    report: "Report"
    bad: bool
    """Whether the exit code has to be 1."""

    diff: str = ""


def _tried(name: str, command: CheckRobot, options: "Settings") -> _Checked | None:
    """Return what there is to say of a file; None, and one line of error, if that failed."""
    from terrainkit_robots.lint.report.facts_json import facts_json
    from terrainkit_robots.lint.runner import INTERNAL_ERROR

    try:
        check = _check(name, command, options)
        # So that what fails in it fails here.
        facts_json(check.report.facts, simulated=check.report.simulated)
        return check
    except TerrainkitError as error:
        render.error(str(error))
    except OSError as error:
        render.error(f"{name}: {error.strerror or error}")
    except MemoryError:
        render.error(f"{name}: out of memory")
    except Exception as error:  # a bug of ours is told as one, and costs no other file
        render.error(f"{name}: {INTERNAL_ERROR}: {type(error).__name__}: {error}")
    return None


def _check(name: str, command: CheckRobot, options: "Settings") -> _Checked:
    from terrainkit_robots.analysis.facts import Facts
    from terrainkit_robots.description import bundled
    from terrainkit_robots.description.load import load_robot
    from terrainkit_robots.lint.selection import lint_selected
    from terrainkit_robots.lint.settings import read_settings
    from terrainkit_robots.mesh.mesh_cache import Meshes
    from terrainkit_robots.spec.robot_spec import RobotSpec

    path = find_robot(name)
    ours = path == bundled.find(name)
    settings = options.over(read_settings(Path() if ours else path.parent))
    other = _other(command.against, settings)
    spec = RobotSpec.load(Path(command.spec)) if command.spec else None

    def look(contents: Mapping[Path, bytes]) -> "Report":
        model = load_robot(
            path,
            packages=settings.packages,
            xacro_arguments=settings.xacro_arguments,
            contents=contents,
        )
        facts = Facts(model, Meshes(contents), against=other, spec=spec)
        return lint_selected(facts, settings, contents)

    report, diff = look({}), ""
    if command.fix or command.unsafe_fixes or command.diff:
        if ours:
            raise ConfigError(f"{name} is a bundled robot, which is not changed; copy it first")
        if report.facts.model.kind == "xacro":
            raise ConfigError(f"{name} is xacro, which is not changed; edit what the findings name")
        report, diff = _repaired(path, report, look, command)
    bad = ("fail", "warn") if settings.strict else ("fail",)
    return _Checked(report=report, bad=report.verdict in bad, diff=diff)


def _other(name: str, settings: "Settings") -> "Facts | None":
    """Return the robot to compare with; None without one."""
    from terrainkit_robots.analysis.facts import Facts
    from terrainkit_robots.description.load import load_robot

    if not name:
        return None
    model = load_robot(
        find_robot(name),
        packages=settings.packages,
        xacro_arguments=settings.xacro_arguments,
    )
    if not model.links:
        why = f": {model.problems[0].message}" if model.problems else ""
        raise ConfigError(f"--against {name} is no robot{why}")
    return Facts(model)


def _repaired(
    path: Path,
    found: "Report",
    look: "Callable[[Mapping[Path, bytes]], Report]",
    command: CheckRobot,
) -> "tuple[Report, str]":
    """Return the report once the fixes are written; what was found and a diff, if none is to be."""
    from terrainkit_robots.lint.fixes.apply import fix_robot, unified_diff, write_fixes
    from terrainkit_robots.lint.report.fixed_report import FixedReport

    result = fix_robot(
        path, lambda contents: look(contents) if contents else found, unsafe=command.unsafe_fixes
    )
    if command.diff:
        return found, unified_diff(result)
    write_fixes(result)
    wanted = ("safe", "unsafe") if command.unsafe_fixes else ("safe",)
    left = tuple(
        (each.finding, each.reason)
        for each in result.unfixed
        if each.finding.fix is not None and each.finding.fix.safety in wanted
    )
    report = result.report
    return FixedReport(
        facts=report.facts,
        findings=report.findings,
        skipped=report.skipped,
        simulated=report.simulated,
        fixed=result.fixed,
        unfixed=left,
    ), ""


def _check_output(output: Path, inputs: Sequence[Path]) -> None:
    """Raise an error if the report cannot be written, or would replace what it is about."""
    from terrainkit.atomic import check_target

    check_target(output, overwrite=True)
    for path in inputs:
        if output.exists() and path.exists() and output.samefile(path):
            raise ConfigError(f"--output {output} would replace {path}, which is checked")


def _write(output: Path, text: str) -> None:
    from terrainkit.atomic import atomic_write

    with atomic_write(output, overwrite=True) as path:
        path.write_bytes(text.encode("utf-8", "backslashreplace"))


@dataclass(frozen=True, kw_only=True)
class Rule(Command):
    """Print what a rule of check-robot looks for, why, and how to fix what it finds."""

    code: Annotated[
        str, tyro.conf.Positional, tyro.conf.arg(metavar="CODE", help_behavior_hint="")
    ] = ""
    """Code or name of the rule."""

    all: bool = False
    """List all rules."""

    def run(self) -> int:
        """Print the page of a rule, or a line for each."""
        from terrainkit_robots.lint.rule import FAMILIES, get_rule, rules

        if self.code and self.all:
            raise ConfigError("wanted the code or the name of a rule, or --all")
        if self.code:
            render.result(_page(get_rule(self.code)))
            return 0
        for family, about in FAMILIES.items():
            render.result(f"{family}: {about}")
            mine = [rule for rule in rules() if rule.family == family]
            render.table(
                [(f"  {r.code}", r.name, r.severity, _FIXES[r.fixes], r.title) for r in mine]
            )
            render.result("")
        render.result("terrainkit rule CODE says more.")
        return 0


_FIXES = {"safe": "--fix", "unsafe": "--unsafe-fixes", "no": ""}
"""The option that repairs what a rule finds."""


def _page(rule: "RobotRule") -> str:
    import textwrap

    from terrainkit_robots.lint.rule import FAMILIES

    fixes = f"; repaired by {_FIXES[rule.fixes]}" if rule.fixes != "no" else ""
    paragraphs = [
        f"{rule.code} {rule.name} ({rule.severity}{fixes}), of {FAMILIES[rule.family]}",
        rule.title,
        *rule.why.split("\n\n"),
        f"Fix: {rule.how_to_fix}",
        f"Source: {rule.reference}",
    ]
    return "\n\n".join(textwrap.fill(paragraph, 88) for paragraph in paragraphs)
