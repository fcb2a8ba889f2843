"""Markdown: a section for each robot with its facts and findings, for issues and pull requests."""

import re
from collections.abc import Iterator, Sequence

from terrainkit_robots.lint.report.plain import plain
from terrainkit_robots.lint.report.repaired import fixed, unfixed
from terrainkit_robots.lint.report.robot_summary import robot_summary
from terrainkit_robots.lint.report.tally import WORDS, fixable, grouped, place, tally
from terrainkit_robots.lint.runner import Finding, Report


def write(reports: Sequence[Report]) -> str:
    """Return a section for each robot."""
    return "\n".join(line for report in reports for line in _section(report))


def _section(report: Report) -> Iterator[str]:
    yield f"## {cell(str(report.facts.model.file))}\n"
    repairs = fixable(report.findings)
    yield f"**{tally([report])}**{f' ({repairs})' if repairs else ''}\n"
    yield "| | |\n|---|---|"
    for label, text in robot_summary(report):
        yield f"| {label.strip()} | {cell(text)} |"
    yield ""
    yield from titled_list("Fixed", [(f.code, f"{f.name}: {f.message}") for f in fixed(report)])
    left = [(f.code, f"{f.subject or f.name}: {reason}") for f, reason in unfixed(report)]
    yield from titled_list("Could not be fixed", left)
    if report.findings:
        yield "| | rule | where | what | what to do |\n|---|---|---|---|---|"
        yield from (finding_row(finding) for finding in report.findings)
        yield ""
    skipped = [(codes, reason) for _, codes, reason in grouped(report.skipped)]
    yield from titled_list("Not checked, or ignored", skipped)


def titled_list(title: str, items: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Yield a list under a title; nothing without items."""
    if items:
        yield f"{title}:\n"
        yield from (f"- {cell(head)}: {cell(text)}" for head, text in items)
        yield ""


def finding_row(finding: Finding) -> str:
    """Return the row of a finding in the table of findings."""
    likely = " (likely)" if finding.certainty == "likely" else ""
    cells = (
        WORDS[finding.severity],
        f"{finding.code} {finding.name}",
        place(finding),
        finding.message + likely,
        finding.hint,
    )
    return f"| {' | '.join(map(cell, cells))} |"


def cell(text: str) -> str:
    """Return `text` so that it shows as it is: no markup, no mention of people, one line."""
    escaped = re.sub(r"([\\`*_{}\[\]|~#$])", r"\\\1", plain(text))
    return (
        escaped.replace("&", "&amp;")
        .replace("<", "&lt;")
        .replace(">", "&gt;")
        .replace("@", "&#64;")
    )
