"""Tallies: how many findings there are of each severity, in words."""

from collections import Counter
from collections.abc import Sequence

from terrainkit_robots.lint.rule import Severity
from terrainkit_robots.lint.runner import Finding, Report, Skipped
from terrainkit_robots.lint.selection import UnusedSuppression
from terrainkit_robots.text import count as count

WORDS: dict[Severity, str] = {"error": "error", "warning": "warning", "info": "note"}
"""What each severity is called; the order is that of reports."""


def tally(reports: Sequence[Report]) -> str:
    """Return such as `2 errors, 1 warning`, or `no problems found`."""
    counts = Counter(finding.severity for report in reports for finding in report.findings)
    parts = [count(counts[s], word) for s, word in WORDS.items() if counts[s]]
    if not counts["error"] + counts["warning"]:
        parts.insert(0, "no problems found")
    return ", ".join(parts)


def fixable(findings: Sequence[Finding]) -> str:
    """Return which options would repair some of them; empty if none would."""
    fixes = [finding.fix.safety for finding in findings if finding.fix is not None]
    options = {"safe": "--fix", "unsafe": "--unsafe-fixes"}
    parts = [f"{fixes.count(s):,} with {option}" for s, option in options.items() if s in fixes]
    return f"fixable: {', '.join(parts)}" if parts else ""


def place(finding: Finding) -> str:
    """Return where it is, as editors and terminals open it."""
    return f"{finding.file}:{finding.line}" if finding.line else str(finding.file)


def grouped(skipped: Sequence[Skipped]) -> list[tuple[bool, str, str]]:
    """Return what was not checked, one entry for each reason: if it is amiss, the codes, and why.

    Amiss is what somebody should put right: a comment that quiets nothing.
    """
    reasons: dict[tuple[bool, str], dict[str, None]] = {}
    for each in skipped:
        reasons.setdefault((isinstance(each, UnusedSuppression), each.reason), {})[each.code] = None
    return [(amiss, ", ".join(codes), reason) for (amiss, reason), codes in reasons.items()]
