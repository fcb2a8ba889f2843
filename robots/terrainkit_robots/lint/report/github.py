"""GitHub annotations: workflow commands that put each finding beside its line."""

from collections.abc import Sequence

from terrainkit_robots.lint.report.plain import encodable
from terrainkit_robots.lint.runner import Finding, Report

_LEVELS = {"error": "error", "warning": "warning", "info": "notice"}


def write(reports: Sequence[Report]) -> str:
    """Return one line for each finding; nothing where there is none."""
    return "".join(_line(finding) for report in reports for finding in report.findings)


def _line(finding: Finding) -> str:
    properties = {"file": finding.file.as_posix()}
    if finding.line:
        properties["line"] = str(finding.line)
    properties["title"] = f"{finding.code} {finding.name}"
    told = ",".join(f"{key}={_property(value)}" for key, value in properties.items())
    message = finding.message if not finding.hint else f"{finding.message}\n{finding.hint}"
    return f"::{_LEVELS[finding.severity]} {told}::{_escaped(message)}\n"


def _escaped(text: str) -> str:
    """Return `text` as the runner decodes it; a line end of its own would be a command's."""
    return encodable(text).replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _escaped(text).replace(":", "%3A").replace(",", "%2C")
