"""JSON: one document per robot; several robots are JSON lines."""

import json
import math
from collections.abc import Sequence
from typing import Any

from terrainkit_robots.lint.report.escape import escape_surrogates
from terrainkit_robots.lint.report.facts_json import facts_json
from terrainkit_robots.lint.rule import Finding
from terrainkit_robots.lint.runner import Report
from terrainkit_robots.text import display_path

SCHEMA_VERSION = 1
"""Incremented when a key changes its meaning or is removed. New keys do not increment it."""


def to_text(reports: Sequence[Report]) -> str:
    """Return one indented document, or one document per line for several robots.

    Findings that repeat are not merged: each has its own subject, line and numbers.
    """
    indent = 2 if len(reports) == 1 else None
    documents = (
        json.dumps(to_json(report_json(r)), indent=indent, allow_nan=False) for r in reports
    )
    return "".join(f"{document}\n" for document in documents)


def report_json(report: Report) -> dict[str, Any]:
    """Return a report as a dictionary."""
    from terrainkit import __version__

    model = report.facts.model
    return {
        "schema_version": SCHEMA_VERSION,
        "tool": {"name": "terrainkit", "version": __version__},
        "file": display_path(model.file),
        "kind": model.kind,
        "verdict": report.verdict,
        "facts": facts_json(report.facts, may_simulate=report.may_simulate),
        "findings": [finding_json(finding) for finding in report.findings],
        "fixed": [finding_json(finding) for finding in report.fixed],
        "unfixed": [{**finding_json(f), "reason": why} for f, why in report.unfixed],
        "skipped": [{"code": s.code, "reason": s.reason} for s in report.skipped],
    }


def finding_json(finding: Finding) -> dict[str, Any]:
    """Return a finding as a dictionary."""
    return {
        "code": finding.code,
        "name": finding.name,
        "severity": finding.severity,
        "certainty": finding.certainty,
        "subject": finding.subject,
        "message": finding.message,
        "hint": finding.hint,
        "file": display_path(finding.file),
        "line": finding.line,
        "measured": dict(finding.measured),
        "fix": finding.fix.safety if finding.fix is not None else None,
    }


def to_json(value: Any) -> Any:
    """Return `value` with NumPy scalars converted, infinities as None and surrogates escaped."""
    if isinstance(value, dict):
        return {escape_surrogates(str(key)): to_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [to_json(item) for item in value]
    if isinstance(value, str):
        return escape_surrogates(value)
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
