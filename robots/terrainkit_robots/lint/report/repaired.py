"""The report on a robot whose fixes were made."""

from dataclasses import dataclass

from terrainkit_robots.lint.runner import Finding, Report


@dataclass(frozen=True, kw_only=True)
class Repaired(Report):
    """What is left to be said of a robot after its fixes, and what they did."""

    fixed: tuple[Finding, ...] = ()
    """What was found before, and is not any more."""

    unfixed: tuple[tuple[Finding, str], ...] = ()
    """What could be fixed and was not, and why not."""


def fixed(report: Report) -> tuple[Finding, ...]:
    """Return the findings that were fixed; none where nothing was to be."""
    return report.fixed if isinstance(report, Repaired) else ()


def unfixed(report: Report) -> tuple[tuple[Finding, str], ...]:
    """Return the findings whose fixes were not made, and why not."""
    return report.unfixed if isinstance(report, Repaired) else ()
