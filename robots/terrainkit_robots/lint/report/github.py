"""GitHub workflow commands: one annotation per finding, at its line."""

from collections.abc import Sequence

from terrainkit_robots.lint.report.escape import escape_surrogates
from terrainkit_robots.lint.rule import Finding
from terrainkit_robots.lint.runner import Report
from terrainkit_robots.text import display_path

_LEVELS = {"error": "error", "warning": "warning", "note": "notice"}


def to_text(reports: Sequence[Report]) -> str:
    """Return one line per finding.

    Findings that repeat are not merged: each annotation belongs to one line of a file.
    """
    return "".join(_command(finding) for report in reports for finding in report.findings)


def _command(finding: Finding) -> str:
    properties = {"file": display_path(finding.file).replace("\\", "/")}
    if finding.line:
        properties["line"] = str(finding.line)
    properties["title"] = f"{finding.code} {finding.name}"
    listed = ",".join(f"{key}={_escape_property(value)}" for key, value in properties.items())
    message = finding.message if not finding.hint else f"{finding.message}\n{finding.hint}"
    return f"::{_LEVELS[finding.severity]} {listed}::{_escape(message)}\n"


def _escape(text: str) -> str:
    """Return `text` with the escapes that the runner decodes."""
    return escape_surrogates(text).replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _escape_property(text: str) -> str:
    return _escape(text).replace(":", "%3A").replace(",", "%2C")
