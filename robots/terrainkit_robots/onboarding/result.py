"""The result of onboarding a robot."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from terrainkit_robots.lint.rule import Finding
from terrainkit_robots.lint.runner import Report
from terrainkit_robots.text import names

if TYPE_CHECKING:
    from terrainkit_robots.onboarding.convert import RobotFiles
    from terrainkit_robots.onboarding.verify import Verification


PUBLISHED = "report/published.png"
"""Name of the picture of the robot among published ones."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OnboardResult:
    """The outcome of `onboard`."""

    report: Report
    """Findings that remain after the fixes."""

    fixed: tuple[Finding, ...] = ()
    """Findings of the source file that do not apply to the written files."""

    folder: Path | None = None
    """The folder that was written; None if blocking errors remain."""

    robot: "RobotFiles | None" = None
    """The robot in the folder; None if blocking errors remain."""

    verification: "Verification | None" = None
    """The comparison of the written files with the source, and the standing test."""

    configs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Names of the files for each framework. The first one is the configuration."""

    skipped_configs: Mapping[str, str] = field(default_factory=dict)
    """Why the configuration of a requested framework was not written, by framework."""

    images: tuple[str, ...] = ()
    """Names of the picture files."""

    images_error: str = ""
    """The reason why there are no pictures."""

    edits: tuple[str, ...] = ()
    """Names of the files that keep user edits of the replaced folder."""

    @property
    def unjudged(self) -> str:
        """Why the standing of the robot says nothing: errors about masses or units, or empty."""
        errors = (f for f in self.report.findings if f.is_blocking and f.family in ("INR", "UNI"))
        codes = names(dict.fromkeys(finding.code for finding in errors))
        return codes and f"not judged: errors about masses or units remain ({codes})"
