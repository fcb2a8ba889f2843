"""Markdown: one section per robot, for issues and pull requests."""

import re
from collections.abc import Iterator, Sequence

from terrainkit_robots.lint.report import summary
from terrainkit_robots.lint.report.escape import escape_control
from terrainkit_robots.lint.report.grouping import FindingGroup, group_findings
from terrainkit_robots.lint.report.robot_summary import robot_summary
from terrainkit_robots.lint.runner import Report
from terrainkit_robots.text import display_path


def to_text(reports: Sequence[Report]) -> str:
    """Return one section per robot. Findings that repeat over joints or links are one row."""
    return "\n".join(line for report in reports for line in _section(report))


def _section(report: Report) -> Iterator[str]:
    model = report.facts.model
    yield f"## {cell(display_path(model.file))}\n"
    fixes = summary.summarize_fixes([report])
    yield f"**{summary.summarize_findings([report])}**{f' ({fixes})' if fixes else ''}\n"
    yield "| | |\n|---|---|"
    for label, text in robot_summary(report):
        yield f"| {label.strip()} | {cell(text)} |"
    yield ""
    fixed = group_findings(model, report.fixed)
    yield from titled_list("Fixed", [(g.first.code, f"{g.first.name}: {_text(g)}") for g in fixed])
    unfixed = [(f.code, f"{f.subject or f.name}: {why}") for f, why in report.unfixed]
    yield from titled_list("Not fixed", unfixed)
    yield from findings_table(group_findings(model, report.findings))
    skipped = [(codes, reason) for _, codes, reason in summary.group_skipped(report.skipped)]
    yield from titled_list("Not checked or ignored", skipped)


def titled_list(title: str, items: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Yield the lines of a list with a title, or nothing if there are no items."""
    if items:
        yield f"{title}:\n"
        yield from (
            f"- {cell(head)}: {cell(text)}" if head else f"- {cell(text)}" for head, text in items
        )
        yield ""


def findings_table(groups: Sequence[FindingGroup]) -> Iterator[str]:
    """Yield the lines of a table of findings, or nothing if there are none."""
    if groups:
        yield "| | rule | location | finding | how to fix |\n|---|---|---|---|---|"
        yield from map(_finding_row, groups)
        yield ""
    if any(group.first.certainty == "likely" for group in groups):
        yield f"{summary.LIKELY}.\n".capitalize()


def _finding_row(group: FindingGroup) -> str:
    finding = group.first
    cells = (
        finding.severity,
        f"{finding.code} {finding.name}",
        summary.format_location(finding),
        _text(group) + (" (likely)" if finding.certainty == "likely" else ""),
        finding.hint,
    )
    return f"| {' | '.join(map(cell, cells))} |"


def _text(group: FindingGroup) -> str:
    return "; ".join(filter(None, (group.text, group.also)))


def cell(text: str) -> str:
    """Return `text` on one line, without markup, HTML or mentions of users."""
    escaped = re.sub(r"([\\`*_{}\[\]|~#$])", r"\\\1", escape_control(text))
    return (
        escaped.replace("&", "&amp;")
        .replace("<", "&lt;")
        .replace(">", "&gt;")
        .replace("@", "&#64;")
    )
