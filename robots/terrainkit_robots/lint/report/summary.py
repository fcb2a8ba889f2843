"""Summaries of reports: counts, locations and reasons, as all formats for people print them."""

from collections import Counter
from collections.abc import Sequence

from terrainkit_robots.lint.check import Suppressed
from terrainkit_robots.lint.report.grouping import group_findings
from terrainkit_robots.lint.rule import SEVERITIES, Finding
from terrainkit_robots.lint.runner import Report, SkipKind, Skipped
from terrainkit_robots.text import count, display_path, names

_MAX_CODES = 6
"""Maximum number of rules that are listed for one reason."""

LIKELY = "likely: the finding depends on a heuristic, such as leg detection"
"""Explanation of the mark `(likely)`."""


def summarize_findings(reports: Sequence[Report]) -> str:
    """Return the number of findings, such as `2 errors, 1 warning` or `no problems found`.

    A finding that repeats over joints or links counts once.
    """
    counts = Counter(finding.severity for finding in _unique_findings(reports))
    parts = [count(counts[severity], severity) for severity in SEVERITIES if counts[severity]]
    if not counts["error"] + counts["warning"]:
        parts.insert(0, "no problems found")
    return ", ".join(parts)


def summarize_fixes(reports: Sequence[Report]) -> str:
    """Return how many findings each option fixes, or an empty text if none can be fixed."""
    fixes = [f.fix.safety for f in _unique_findings(reports) if f.fix is not None]
    options = {"safe": "--fix", "unsafe": "--unsafe-fixes"}
    parts = [f"{fixes.count(s):,} with {option}" for s, option in options.items() if s in fixes]
    return f"fixable: {', '.join(parts)}" if parts else ""


def _unique_findings(reports: Sequence[Report]) -> list[Finding]:
    return [
        group.first
        for report in reports
        for group in group_findings(report.facts.model, report.findings)
    ]


def format_location(finding: Finding) -> str:
    """Return file and line in the form that editors and terminals open."""
    file = display_path(finding.file)
    return f"{file}:{finding.line}" if finding.line else file


def group_skipped(skipped: Sequence[Skipped]) -> list[tuple[bool, str, str]]:
    """Return one entry per reason: whether it is a warning, the codes of the rules, the reason.

    Many codes are counted instead of listed; the JSON report lists all.

    An unused suppression comment is a warning. The findings that one comment suppresses are one
    entry.
    """
    reasons: dict[tuple[SkipKind, str], dict[str, None]] = {}
    suppressed: dict[tuple[object, str], list[Suppressed]] = {}
    for skip in skipped:
        if isinstance(skip, Suppressed) and skip.comment:
            suppressed.setdefault((skip.comment, skip.comment.reason), []).append(skip)
        else:
            reasons.setdefault((skip.kind, skip.reason), {})[skip.code] = None
    for (_, why), members in suppressed.items():
        subjects = names(member.finding.subject for member in members)
        reason = f"suppressed for {subjects}: {why}"
        reason = members[0].reason if len(members) == 1 else reason
        reasons.setdefault(("suppressed", reason), {})[members[0].code] = None
    entries = []
    for (kind, reason), codes in reasons.items():
        listed = ", ".join(codes)
        if kind == "no-legs":
            does = "rule does" if len(codes) == 1 else "rules do"
            listed, reason = "", f"not a legged robot: {len(codes)} {does} not apply"
        elif len(codes) > _MAX_CODES:
            listed = f"{len(codes)} rules"
        entries.append((kind == "unused", listed, reason))
    return entries
