"""The commands that check robot files and print documentation of the rules."""

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from terrainkit.errors import ConfigError, TerrainkitError
from terrainkit_cli import render
from terrainkit_cli.argument_types import (
    Feet,
    IgnoredRules,
    InputPath,
    OptionalFlag,
    OutputPath,
    Packages,
    XacroArguments,
    is_map,
    parse_settings,
    split_commas,
)
from terrainkit_cli.parse import Command, option, positional

if TYPE_CHECKING:
    from terrainkit_robots.lint.baseline import Baseline
    from terrainkit_robots.lint.rule import Rule as RobotRule
    from terrainkit_robots.lint.runner import Report
    from terrainkit_robots.lint.settings import Settings


@dataclass(frozen=True, kw_only=True)
class CheckRobot(Command):
    """Check URDF, xacro and MJCF files for errors.

    The rules find errors that break training or simulation, from XML syntax to the behavior in
    simulation; `terrainkit rule` lists them.

    For a folder, all robot files in it and its subfolders are checked, except scenes and files that
    other files include. Links to folders, hidden folders, and folders with a COLCON_IGNORE file are
    skipped.

    Exit code 0: no errors, and no warnings with --strict. 1: errors were found. 2: a file cannot
    be read, or an option is invalid; the other files are still checked.

    Default options are read from [tool.terrainkit.check-robot] in pyproject.toml or [check-robot]
    in terrainkit.toml, in the folder of the robot or above it: select, ignore, package, xacro-arg,
    feet, strict, simulation.

    The comment <!-- terrainkit: ignore INR004 the reason --> suppresses a rule for the element that
    contains the comment, for the elements on the same line, and for the next element.
    """

    files: Annotated[tuple[str, ...], positional("FILE [FILE ...]")] = ()
    """Files to check; folders, whose robot files are all checked, with one line for each in the
    text report; or names of robots: quadruped, biped, or names in the package robot_descriptions,
    such as go2_description."""

    format: Literal["text", "json", "sarif", "github", "markdown"] = "text"
    """Format of the report. For several files, json prints one document per line."""

    output: OutputPath | None = None
    """Write the report to this file. An existing file is replaced."""

    picture: Annotated[Path, option("FILE")] | None = None
    """Write a PNG that shows the masses, limits and gains of the robot among those of published
    robots. An existing file is replaced."""

    select: Annotated[tuple[str, ...], option("CODES", is_repeated=True)] = ()
    """Run only these rules: comma-separated codes, prefixes of codes, or names."""

    ignore: IgnoredRules = ()
    """Do not run these rules; the reason is printed in the report."""

    package: Packages = ()
    """Folder of a ROS package, for package:// and $(find ...)."""

    xacro_arg: XacroArguments = ()
    """Value of a xacro argument of the file."""

    feet: Feet = ()
    """Links that are the feet, comma-separated, if they are not found."""

    against: Annotated[str, option("FILE")] = ""
    """Compare with another file of the same robot: URDF, xacro or MJCF."""

    spec: InputPath | None = None
    """Compare with the robot.toml of the robot."""

    simulation: OptionalFlag | None = None
    """Run the rules that simulate the robot: drop test, standing test, joint sweep. This is the
    default."""

    strict: OptionalFlag | None = None
    """Exit with code 1 if there are warnings."""

    baseline: InputPath | None = None
    """Accept the errors and warnings that this file records."""

    write_baseline: bool = False
    """Record the errors and warnings of the checked files in the --baseline file."""

    changed: bool = False
    """FILE is a changed file of any kind, as in a pre-commit hook: check the robots in the working
    directory and its subfolders that read one of the files, also as an included file or a mesh."""

    notes: bool = False
    """Print notes in full; the text report has one line for each. For a folder, print the reports
    in full."""

    fix: bool = False
    """Apply the safe fixes: they do not change the robot for any parser that reads the file."""

    unsafe_fixes: bool = False
    """Also apply fixes that change a number, a shape or another file. Review the result."""

    diff: bool = False
    """Print the changes of --fix or --unsafe-fixes, and write nothing."""

    def run(self) -> int:
        """Check each file and print the reports."""
        if not self.files:
            raise ConfigError("FILE: missing; expected robot files, quadruped, or biped")
        for name in filter(is_map, self.files):
            raise ConfigError(f"{name} is a map; terrainkit check-map {name} checks it")
        if self.diff and self.format != "text":
            raise ConfigError(f"--diff prints a diff and cannot be combined with {self.format}")
        settings = self._settings()
        files = self._find_files(settings)
        if len(files) > 1 and (self.against or self.spec or self.feet or self.picture):
            options = "--against, --spec, --feet and --picture"
            raise ConfigError(f"{options}: got {len(files)} files; expected one")
        inputs = [Path(name) for name in files]
        _check_output("--output", self.output, inputs)
        _check_output("--picture", self.picture, [*inputs, *filter(None, [self.output])])
        baseline = self._read_baseline()
        results = [result for name in files if (result := self._check_file(name, settings))]
        if self.write_baseline:
            baseline = baseline.updated(result.report for result in results)
            baseline.write()
            render.note(f"wrote {baseline.path}")
        results = [replace(result, report=baseline.accept(result.report)) for result in results]
        self._print([result.report for result in results], "".join(r.diff for r in results))
        if self.picture and results:
            from terrainkit.files.atomic_write import atomic_write
            from terrainkit_robots.rendering.norms_picture import draw_norms

            with atomic_write(self.picture, overwrite=True) as path:
                path.write_bytes(draw_norms(results[0].report.facts))
            render.note(f"wrote {self.picture}")
        crashed = [rule for result in results for rule in result.report.crashed]
        for rule in crashed:
            render.error(f"{rule.code}: {rule.reason}")
        if crashed or len(results) < len(files):
            return 2
        return int(any(result.failed for result in results))

    def _settings(self) -> "Settings":
        from terrainkit_robots.lint.check import select_rules

        settings = replace(
            parse_settings(self.ignore, self.package, self.xacro_arg, self.feet),
            select=tuple(word for words in self.select for word in split_commas(words)),
            strict=self.strict,
            simulate=self.simulation,
        )
        select_rules(settings)  # reject unknown codes before reading files
        return settings

    def _find_files(self, settings: "Settings") -> list[str]:
        from terrainkit_robots.description.robot_folder import robot_files
        from terrainkit_robots.lint.changed import changed_robots

        if not self.changed:
            found = [robot_files(Path(f)) if _is_folder(f) else [f] for f in self.files]
            return [str(file) for files in found for file in files]
        robots = changed_robots(map(Path, self.files), settings)
        if not robots:
            render.note("no robot in this folder reads a changed file")
        return list(map(str, robots))

    def _read_baseline(self) -> "Baseline":
        """Return the baseline; an empty one without a file."""
        from terrainkit_robots.lint.baseline import Baseline

        if self.write_baseline and self.baseline is None:
            raise ConfigError("--write-baseline: got no file; expected --baseline FILE as well")
        if self.baseline is None or (self.write_baseline and not self.baseline.exists()):
            return Baseline(path=self.baseline or Path())
        if not self.baseline.exists():
            raise ConfigError(f"there is no file {self.baseline}; --write-baseline creates it")
        return Baseline.read(self.baseline)

    def _check_file(self, name: str, settings: "Settings") -> "_FileResult | None":
        """Return the result for a file; print an error and return None if the check fails."""
        from terrainkit_robots.lint.report.facts_json import facts_json
        from terrainkit_robots.lint.runner import INTERNAL_ERROR

        try:
            result = self._lint_and_fix(name, settings)
            # Errors in computing facts must be reported here, not while a report is written.
            facts_json(result.report.facts, may_simulate=result.report.may_simulate)
            return result
        except TerrainkitError as error:
            render.error(str(error))
        except OSError as error:
            render.error(f"{name}: {error.strerror or error}")
        except MemoryError:
            render.error(f"{name}: out of memory")
        except Exception as error:  # a bug; the other files are still checked
            render.error(f"{name}: {INTERNAL_ERROR}: {type(error).__name__}: {error}")
        return None

    def _lint_and_fix(self, name: str, settings: "Settings") -> "_FileResult":
        from terrainkit_robots.description import bundled
        from terrainkit_robots.lint.check import check_robot
        from terrainkit_robots.lint.settings import read_settings

        settings = settings.over(read_settings(Path(name).parent))

        def lint_contents(contents: Mapping[Path, bytes]) -> "Report":
            against = self.against or None
            spec = self.spec
            return check_robot(name, settings, against=against, spec=spec, contents=contents)

        with render.steps() as steps:
            steps.update(f"checking {name}")
            report = lint_contents({})
            diff = ""
        path = report.facts.model.file
        if self.fix or self.unsafe_fixes or self.diff:
            from terrainkit_robots.lint.fixes.apply import fix_robot, unified_diff, write_fixes

            if not self.diff and (bundled.is_bundled(path) or path != Path(name)):
                raise ConfigError(
                    f"{name} is not your file and cannot be changed; copy {path} first"
                )
            if report.facts.model.kind == "xacro":
                raise ConfigError(f"{name}: xacro files cannot be fixed; edit the reported lines")
            result = fix_robot(path, lint_contents, report=report, unsafe=self.unsafe_fixes)
            if self.diff:
                diff = unified_diff(result)
            else:
                write_fixes(result)
                report = result.report
        return _FileResult(report=report, strict=bool(settings.strict), diff=diff)

    def _print(self, reports: "Sequence[Report]", diff: str) -> None:
        from terrainkit_robots.lint.report import to_text
        from terrainkit_robots.lint.report.summary import summarize_findings

        if self.diff:
            text = diff
            if reports and not text:
                render.note("there is nothing to fix")
        elif self.format == "text":
            from terrainkit_robots.lint.report import text_report

            brief = any(map(_is_folder, self.files)) and not (self.notes or self.changed)
            options = {"verbose": self.notes, "brief": brief}
            if self.output is None and render.has_colors():
                lines = text_report.format_lines(reports, width=render.width(), **options)
                render.print_lines(lines)
                return
            text = text_report.to_text(reports, **options)
        else:
            text = to_text(reports, self.format)
        if self.output is None:
            render.report(text)
        elif reports:
            from terrainkit.files.atomic_write import atomic_write

            _check_output(
                "--output", self.output, [path for r in reports for path in r.facts.model.sources]
            )
            with atomic_write(self.output, overwrite=True) as path:
                path.write_bytes(text.encode("utf-8", "backslashreplace"))
            render.result(f"wrote {self.output}: {summarize_findings(reports)}")


@dataclass(frozen=True, kw_only=True)
class _FileResult:
    """The result of checking a file."""

    report: "Report"
    strict: bool
    """Whether warnings count as errors."""

    diff: str = ""
    """The changes of the fixes, with --diff."""

    @property
    def failed(self) -> bool:
        """Whether the exit code is 1."""
        return self.report.verdict in (("fail", "warn") if self.strict else ("fail",))


def _is_folder(name: str) -> bool:
    """Return whether a name is a folder, and not a bundled robot."""
    from terrainkit_robots.description import bundled
    from terrainkit_robots.description.package_resolver import is_folder

    return name not in ("", *bundled.robot_names()) and is_folder(Path(name))


def _check_output(name: str, output: Path | None, others: Sequence[Path]) -> None:
    """Raise an error if an output cannot be written, or would replace another file."""
    from terrainkit.files.atomic_write import check_target

    if output is None:
        return
    check_target(output, overwrite=True)
    for path in others:
        is_link = output.exists() and path.exists() and output.samefile(path)
        if is_link or output.resolve() == path.resolve():
            raise ConfigError(f"{name} {output} would replace {path}; expected another file")


@dataclass(frozen=True, kw_only=True)
class Rule(Command):
    """Explain a rule of check-robot or check-task, or list all rules."""

    code: Annotated[str, positional("[CODE]")] = ""
    """Code of the rule, such as INR001, or its name."""

    all: bool = False
    """List all rules. This is the default without CODE."""

    def run(self) -> int:
        """Print the documentation of a rule, or a list of rules."""
        from terrainkit_robots.lint.rule import families, get_rule, rules

        if self.code and self.all:
            raise ConfigError("got CODE and --all; expected one of them")
        if self.code:
            render.result(_rule_page(get_rule(self.code)))
            return 0
        for name, family in families().items():
            render.result(f"{name}: {family.title}")
            members = [r for r in rules() + rules("task") if r.family == name]
            render.table(
                [
                    (f"  {r.code}", r.name, r.severity, _FIX_OPTIONS[r.fixes], r.page.title)
                    for r in members
                ]
            )
            render.result("")
        render.result("Run `terrainkit rule CODE` for details.")
        return 0


_FIX_OPTIONS = {"safe": "--fix", "unsafe": "--unsafe-fixes", "no": ""}
"""The option that fixes the findings of a rule."""


def _rule_page(rule: "RobotRule") -> str:
    from terrainkit_robots.lint.rule import families

    fixes = f"; fixed by {_FIX_OPTIONS[rule.fixes]}" if rule.fixes != "no" else ""
    title, why, how_to_fix, reference = rule.page
    paragraphs = [
        f"{rule.code} {rule.name} ({rule.severity}{fixes}), {families()[rule.family].title}",
        title,
        *why.split("\n\n"),
        f"Fix: {how_to_fix}",
        f"Source: {reference}",
    ]
    return "\n\n".join(textwrap.fill(paragraph, 88) for paragraph in paragraphs)
