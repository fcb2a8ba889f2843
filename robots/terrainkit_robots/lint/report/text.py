"""Text for people: the robot's facts, its findings by rule, and one line that sums up."""

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

from terrainkit_robots.lint.report.plain import plain
from terrainkit_robots.lint.report.repaired import fixed, unfixed
from terrainkit_robots.lint.report.robot_summary import robot_summary
from terrainkit_robots.lint.report.tally import WORDS, fixable, grouped, place, tally
from terrainkit_robots.lint.rule import Severity
from terrainkit_robots.lint.runner import Finding, Report
from terrainkit_robots.text import count

WIDTH = 100
"""Width of a line [characters]; only what cannot be broken is longer."""

_MOST = 10
"""Most findings of one rule that are printed."""

_LONGEST = 2000
"""So much of one message is printed [characters]; names in a file can be of any length."""

_STYLES: dict[Severity, str] = {"error": "bold red", "warning": "bold yellow", "info": "bold blue"}


@dataclass(frozen=True)
class Span:
    """Some words of a line."""

    text: str
    style: str = ""
    """As rich calls it; empty for none."""


Line = tuple[Span, ...]


def write(reports: Sequence[Report]) -> str:
    """Return the reports without colors."""
    return "".join("".join(span.text for span in line) + "\n" for line in lines(reports))


def lines(reports: Sequence[Report], width: int = WIDTH) -> Iterator[Line]:
    """Yield the reports line by line, at most `width` characters wide where that can be."""
    for index, report in enumerate(reports):
        if index:
            yield ()
        yield from _robot(report, width)
    if len(reports) > 1:
        yield ()
        findings = [finding for report in reports for finding in report.findings]
        yield _sum(f"{count(len(reports), 'file')}: ", reports, findings)


def _robot(report: Report, width: int) -> Iterator[Line]:
    file = plain(str(report.facts.model.file))
    yield (Span(file, "bold"),)
    model = report.facts.model  # of a file that is no robot there is nothing to sum up
    for label, text in robot_summary(report) if model.links or not model.problems else ():
        first = f"  {label:<9} "
        yield from _wrapped(Span(first, "dim"), plain(text), width, indent=len(first))
    yield ()
    if fixed(report):
        yield (Span("fixed", "bold green"),)
        for finding in fixed(report):
            yield from _item(finding, f"{finding.code}, {_repair(finding)}", width)
        yield ()
    for (severity, code, name), found in _by_rule(report.findings):
        yield Span(WORDS[severity], _STYLES[severity]), Span(f" {code} {name}")
        yield from _rule(found, width)
        yield ()
    told = [*_about_notes(report.findings), *_left_out(report, width)]
    yield from told
    if told:
        yield ()
    yield _sum(f"{file}: ", [report], report.findings)


def _by_rule(
    findings: Sequence[Finding],
) -> Iterator[tuple[tuple[Severity, str, str], list[Finding]]]:
    """Yield severity, code and name of each rule with its findings, the errors first."""
    order = list(WORDS)
    ranked = sorted(findings, key=lambda f: (order.index(f.severity), f.code))  # stable
    for key, group in groupby(ranked, key=lambda f: (f.severity, f.code, f.name)):
        yield key, list(group)


def _rule(findings: Sequence[Finding], width: int) -> Iterator[Line]:
    shown = findings[:_MOST]
    hints = [plain(finding.hint) for finding in shown]
    for i, finding in enumerate(shown):
        likely = " (likely)" if finding.certainty == "likely" else ""
        yield from _item(finding, plain(finding.message) + likely, width)
        told = finding.severity != "info"  # `terrainkit rule` helps with notes
        if told and hints[i] and hints[i + 1 : i + 2] != [hints[i]]:
            yield from _wrapped(Span("      help: ", "green"), hints[i], width, indent=12)
    if len(findings) > _MOST:
        more = count(len(findings) - _MOST, "more finding")
        yield (Span(f"  and {more}; check-robot --format json has all of them", "dim"),)


def _item(finding: Finding, text: str, width: int) -> Iterator[Line]:
    where = Span(f"  {plain(place(finding))}: ", "cyan")
    if len(plain(str(finding.file))) > width // 3:  # by the file, so that all its rows are alike
        yield (Span(where.text.rstrip(), where.style),)
        where = Span(" " * 6)
    yield from _wrapped(where, text, width, indent=6)


def _repair(finding: Finding) -> str:
    description = finding.fix.description if finding.fix is not None else finding.message
    subject = f"{plain(finding.subject)}: " if finding.subject else ""
    return f"{subject}{plain(description)}"


def _about_notes(findings: Sequence[Finding]) -> Iterator[Line]:
    """Yield where to read on about notes: a healthy robot has several, and nothing to be done."""
    codes = sorted(finding.code for finding in findings if finding.severity == "info")
    if codes:
        how = f"terrainkit rule CODE, for example terrainkit rule {codes[0]}"
        yield Span("about a note: ", "dim"), Span(how)


def _left_out(report: Report, width: int) -> Iterator[Line]:
    """Yield what was not fixed, not checked or ignored, and why."""
    for finding, reason in unfixed(report):
        text = f"{finding.code} {finding.subject}: {reason}"
        yield from _wrapped(Span("not fixed: ", _STYLES["warning"]), plain(text), width, indent=11)
    for amiss, codes, reason in grouped(report.skipped):
        label = Span("warning: ", _STYLES["warning"]) if amiss else Span("skipped: ", "dim")
        text = f"{codes}: {reason}" if codes else reason
        yield from _wrapped(label, plain(text), width, indent=len(label.text))


def _sum(what: str, reports: Sequence[Report], findings: Sequence[Finding]) -> Line:
    verdicts = {report.verdict for report in reports}
    style = "bold red" if "fail" in verdicts else "bold yellow" if "warn" in verdicts else ""
    repairs = fixable(findings)
    more = Span(f" ({repairs})" if repairs else "")
    return Span(what, "bold"), Span(tally(reports), style or "bold green"), more


def _wrapped(first: Span, text: str, width: int, indent: int) -> Iterator[Line]:
    """Yield `first` and `text`, broken between words, with `indent` on the lines that follow."""
    rows = textwrap.wrap(
        text if len(text) <= _LONGEST else f"{text[:_LONGEST]} ...",
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
