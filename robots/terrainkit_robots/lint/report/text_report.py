"""Text for people: a summary of the robot, its findings by rule, and a line with the counts."""

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from terrainkit.settings.text import truncate
from terrainkit_robots.lint.report import summary
from terrainkit_robots.lint.report.escape import escape_control
from terrainkit_robots.lint.report.grouping import FindingGroup, group_findings
from terrainkit_robots.lint.report.robot_summary import robot_summary
from terrainkit_robots.lint.rule import Finding, Severity
from terrainkit_robots.lint.runner import Report
from terrainkit_robots.text import count, display_path, names

DEFAULT_WIDTH = 100
"""Width of a line [characters]. Only lines with longer words are wider."""

_MAX_ENTRIES = 10
"""Maximum number of entries of one rule."""

_MAX_LENGTH = 2000
"""Maximum length of a message [characters]; names in a file can have any length."""

_STYLES: dict[Severity, str] = {"error": "bold red", "warning": "bold yellow", "note": "bold blue"}


@dataclass(frozen=True)
class Span:
    """A part of a line with one style."""

    text: str
    style: str = ""
    """Name of a rich style, or empty."""


Line = tuple[Span, ...]


def to_text(reports: Sequence[Report], *, verbose: bool = False, brief: bool = False) -> str:
    """Return the reports without colors."""
    lines = format_lines(reports, verbose=verbose, brief=brief)
    return "".join("".join(span.text for span in line) + "\n" for line in lines)


def format_lines(
    reports: Sequence[Report],
    width: int = DEFAULT_WIDTH,
    *,
    verbose: bool = False,
    brief: bool = False,
) -> Iterator[Line]:
    """Yield the lines of the reports, wrapped at `width` characters.

    A finding that repeats over joints or links is one entry with a list. A note is one line unless
    `verbose` is set. If `brief` is set, a report is one line.
    """
    for index, report in enumerate(reports):
        if index and not brief:
            yield ()
        yield from [_brief(report)] if brief else _robot(report, width, verbose=verbose)
    if len(reports) > 1:
        yield ()
        yield _counts(f"{count(len(reports), 'file')}: ", reports)


def _brief(report: Report) -> Line:
    """Return the counts of a report, and the codes of its errors, on one line."""
    file = escape_control(display_path(report.facts.model.file))
    errors = dict.fromkeys(f.code for f in report.findings if f.severity == "error")
    codes = f" [{names(errors)}]" if errors else ""
    fixed = f", {count(len(report.fixed), 'finding')} fixed" if report.fixed else ""
    return *_counts(f"{file}: ", [report]), Span(f"{fixed}{codes}")


def _robot(report: Report, width: int, *, verbose: bool) -> Iterator[Line]:
    model = report.facts.model
    file = escape_control(display_path(model.file))
    yield (Span(file, "bold"),)
    # There is nothing to summarize if the file contains no robot. A task has a table of its own.
    has_robot = model.kind != "task" and (model.links or not model.problems)
    for label, text in robot_summary(report) if has_robot else ():
        first = f"  {label:<9} "
        yield from _wrap(Span(first, "dim"), escape_control(text), width, indent=len(first))
    yield ()
    fixed = group_findings(model, report.fixed, _fix_description)
    if fixed:
        yield (Span("fixed", "bold green"),)
        for group in fixed:
            yield from _entry(group, f"{group.first.code}, {group.text}", model.file, width)
        yield ()
    groups = group_findings(model, report.findings)
    short = [] if verbose else [group for group in groups if group.first.severity == "note"]
    by_rule = groupby(
        (group for group in groups if group not in short),
        lambda group: (group.first.severity, group.first.code, group.first.name),
    )
    for (severity, code, name), members in by_rule:
        yield Span(severity, _STYLES[severity]), Span(f" {code} {name}")
        yield from _rule(list(members), model.file, width)
        yield ()
    for group in short:
        yield _note(group, width)
    if short:
        yield ()
    footer = [*_help(report.findings, verbose=verbose), *_skipped(report, width)]
    yield from footer
    if footer:
        yield ()
    yield _counts(f"{file}: ", [report])


def _note(group: FindingGroup, width: int) -> Line:
    """Return a note on one line, cut at `width` characters."""
    first = group.first
    label = Span("note", _STYLES["note"])
    code = f" {first.code}"
    more = f" (+{len(group.others)})" if group.others else ""
    text = " ".join(escape_control(group.text[:_MAX_LENGTH]).split())
    room = max(width - len(f"{label.text}{code} {more}"), 20)
    return label, Span(code), Span(f" {truncate(text, room)}{more}")


def _rule(groups: Sequence[FindingGroup], robot_file: Path, width: int) -> Iterator[Line]:
    shown = groups[:_MAX_ENTRIES]
    hints = [escape_control(group.first.hint) for group in shown]
    for i, group in enumerate(shown):
        likely = " (likely)" if group.first.certainty == "likely" else ""
        yield from _entry(group, group.text + likely, robot_file, width)
        # The help of notes is left to `terrainkit rule`.
        is_note = group.first.severity == "note"
        if not is_note and hints[i] and hints[i + 1 : i + 2] != [hints[i]]:
            yield from _wrap(Span("      help: ", "green"), hints[i], width, indent=12)
    if len(groups) > _MAX_ENTRIES:
        more = count(len(groups) - _MAX_ENTRIES, "more finding")
        yield (Span(f"  and {more}; use --format json for all", "dim"),)


def _entry(group: FindingGroup, text: str, robot_file: Path, width: int) -> Iterator[Line]:
    first = group.first
    place = escape_control(summary.format_location(first))
    if first.file == robot_file:  # its path is in the header
        place = f"line {first.line}" if first.line else ""
    location = Span(f"  {place}: " if place else "  ", "cyan")
    if len(place) > width // 3:
        yield (Span(location.text.rstrip(), location.style),)
        location = Span(" " * 6)
    yield from _wrap(location, escape_control(text), width, indent=6)
    if group.also:
        label, _, others = escape_control(group.also).partition(": ")
        yield from _wrap(Span(f"      {label}: ", "dim"), others, width, indent=12)


def _fix_description(finding: Finding) -> str:
    description = finding.fix.description if finding.fix is not None else finding.message
    return f"{finding.subject}: {description}" if finding.subject else description


def _help(findings: Sequence[Finding], *, verbose: bool) -> Iterator[Line]:
    """Yield what `(likely)` means, and how to get help on notes, which are listed without help."""
    shown = [finding for finding in findings if verbose or finding.severity != "note"]
    if any(finding.certainty == "likely" for finding in shown):
        label, text = summary.LIKELY.split(" ", 1)
        yield Span(f"{label} ", "dim"), Span(text)
    codes = [finding.code for finding in findings if finding.severity == "note"]
    if codes and not verbose:
        yield Span("notes in full: ", "dim"), Span("--notes")
    if codes:
        yield Span("details of a note: ", "dim"), Span(f"terrainkit rule CODE, such as {codes[0]}")


def _skipped(report: Report, width: int) -> Iterator[Line]:
    """Yield what was not fixed, not checked or ignored, with the reasons."""
    for finding, reason in report.unfixed:
        text = escape_control(f"{finding.code} {finding.subject}: {reason}")
        yield from _wrap(Span("not fixed: ", _STYLES["warning"]), text, width, indent=11)
    for is_warning, codes, reason in summary.group_skipped(report.skipped):
        label = Span("warning: ", _STYLES["warning"]) if is_warning else Span("skipped: ", "dim")
        text = escape_control(f"{codes}: {reason}" if codes else reason)
        yield from _wrap(label, text, width, indent=len(label.text))


def _counts(label: str, reports: Sequence[Report]) -> Line:
    verdicts = {report.verdict for report in reports}
    style = "bold red" if "fail" in verdicts else "bold yellow" if "warn" in verdicts else ""
    fixes = summary.summarize_fixes(reports)
    counts = Span(summary.summarize_findings(reports), style or "bold green")
    return Span(label, "bold"), counts, Span(f" ({fixes})" if fixes else "")


def _wrap(first: Span, text: str, width: int, indent: int) -> Iterator[Line]:
    """Yield `first` and `text`, wrapped between words, with `indent` on the following lines."""
    rows = textwrap.wrap(
        text if len(text) <= _MAX_LENGTH else f"{text[:_MAX_LENGTH]} ...",
        width=max(width, indent + 20),
        initial_indent=" " * len(first.text),
        subsequent_indent=" " * indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
    head, *rest = rows or [""]
    yield first, Span(head[len(first.text) :])
    for row in rest:
        yield (Span(row),)
