"""The report on a robot after its fixes were written."""

from dataclasses import dataclass

from terrainkit_robots.lint.runner import Finding, Report


@dataclass(frozen=True, kw_only=True)
class FixedReport(Report):
    """A report on a fixed robot, with the findings before the fixes."""

    fixed: tuple[Finding, ...] = ()
    """Findings that were fixed."""

    unfixed: tuple[tuple[Finding, str], ...] = ()
    """Findings with a fix that was not applied, and the reasons."""


def fixed_findings(report: Report) -> tuple[Finding, ...]:
    """Return the findings that were fixed."""
    return report.fixed if isinstance(report, FixedReport) else ()


def unfixed_findings(report: Report) -> tuple[tuple[Finding, str], ...]:
    """Return the findings whose fixes were not applied, and the reasons."""
    return report.unfixed if isinstance(report, FixedReport) else ()
