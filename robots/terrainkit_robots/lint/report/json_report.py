"""JSON: one document for each robot, on a line of its own where there are several."""

import json
import math
from collections.abc import Sequence
from typing import Any

from terrainkit_robots.lint.report.facts_json import facts_json
from terrainkit_robots.lint.report.plain import encodable
from terrainkit_robots.lint.report.repaired import fixed, unfixed
from terrainkit_robots.lint.runner import Finding, Report

SCHEMA_VERSION = 1
"""Raised when a key changes its meaning or goes; new keys may come without."""


def write(reports: Sequence[Report]) -> str:
    """Return one document, indented; several are JSON lines."""
    indent = 2 if len(reports) == 1 else None
    documents = (json.dumps(sound(record(r)), indent=indent, allow_nan=False) for r in reports)
    return "".join(f"{document}\n" for document in documents)


def record(report: Report) -> dict[str, Any]:
    """Return a report as plain data."""
    from terrainkit import __version__

    model = report.facts.model
    return {
        "schema_version": SCHEMA_VERSION,
        "tool": {"name": "terrainkit", "version": __version__},
        "file": str(model.file),
        "kind": model.kind,
        "verdict": report.verdict,
        "facts": facts_json(report.facts, simulated=report.simulated),
        "findings": [finding_record(finding) for finding in report.findings],
        "fixed": [finding_record(finding) for finding in fixed(report)],
        "unfixed": [{**finding_record(f), "reason": reason} for f, reason in unfixed(report)],
        "skipped": [{"code": s.code, "reason": s.reason} for s in report.skipped],
    }


def finding_record(finding: Finding) -> dict[str, Any]:
    """Return a finding as plain data."""
    return {
        "code": finding.code,
        "name": finding.name,
        "severity": finding.severity,
        "certainty": finding.certainty,
        "subject": finding.subject,
        "message": finding.message,
        "hint": finding.hint,
        "file": str(finding.file),
        "line": finding.line,
        "measured": dict(finding.measured),
        "fix": finding.fix.safety if finding.fix is not None else None,
    }


def sound(value: Any) -> Any:
    """Return `value` with only what JSON can hold: no infinite numbers, no halves of characters."""
    if isinstance(value, dict):
        return {encodable(str(key)): sound(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [sound(item) for item in value]
    if isinstance(value, str):
        return encodable(value)
    if hasattr(value, "item"):
        value = value.item()  # numpy's
    return None if isinstance(value, float) and not math.isfinite(value) else value
