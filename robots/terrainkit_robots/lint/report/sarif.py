"""SARIF 2.1.0: one document for all robots, for code hosts and editors."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote_from_bytes

from terrainkit_robots.lint.check import Suppressed
from terrainkit_robots.lint.report.facts_json import facts_json
from terrainkit_robots.lint.report.json_report import to_json
from terrainkit_robots.lint.rule import TASK_FAMILIES, Finding, Rule, families, rules
from terrainkit_robots.lint.runner import Report, Skipped
from terrainkit_robots.text import display_path

SCHEMA = (
    "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
)


def to_text(reports: Sequence[Report]) -> str:
    """Return one document with the findings of all robots, including suppressed ones.

    Findings that repeat are not merged: code hosts show each result at its own line.
    """
    document = {"$schema": SCHEMA, "version": "2.1.0", "runs": [_run(reports)]}
    return json.dumps(to_json(document), indent=2, allow_nan=False) + "\n"


def _run(reports: Sequence[Report]) -> dict[str, Any]:
    from terrainkit import __version__

    is_task = bool(reports) and reports[0].facts.model.kind == "task"
    listed = rules("task" if is_task else "robot")
    index = {rule.code: place for place, rule in enumerate(listed)}
    results: list[dict[str, Any]] = []
    notifications: list[dict[str, Any]] = []
    for report in reports:
        results += [_result(finding, index) for finding in report.findings]
        for skipped in report.skipped:
            if isinstance(skipped, Suppressed):
                comment = skipped.comment
                source = {"kind": "inSource" if comment else "external"}
                source["justification"] = comment.reason if comment else skipped.reason
                results.append({**_result(skipped.finding, index), "suppressions": [source]})
            else:
                notifications.append(_notification(skipped, report.facts.model.file))
    driver = {"name": "terrainkit", "version": __version__, "rules": [_rule(r) for r in listed]}
    invocation = {"executionSuccessful": True, "toolExecutionNotifications": notifications}
    return {
        "tool": {"driver": driver},
        "invocations": [invocation],
        "results": results,
        "properties": {
            "facts": {
                display_path(r.facts.model.file): facts_json(r.facts, may_simulate=r.may_simulate)
                for r in reports
            }
        },
    }


def _rule(rule: Rule) -> dict[str, Any]:
    title, why, how_to_fix, reference = rule.page
    subject = "task" if rule.family in TASK_FAMILIES else "robot"
    paragraphs = (why, f"How to fix: {how_to_fix}", f"Source: {reference}")
    return {
        "id": rule.code,
        "name": rule.name,
        "shortDescription": {"text": title},
        "fullDescription": {"text": why},
        "help": {"text": "\n\n".join(paragraphs)},
        "defaultConfiguration": {"level": rule.severity},
        "properties": {"tags": [subject, families()[rule.family].title], "fixes": rule.fixes},
    }


def _result(finding: Finding, index: dict[str, int]) -> dict[str, Any]:
    return {
        "ruleId": finding.code,
        "ruleIndex": index[finding.code],
        "level": finding.severity,
        "message": _message(f"{finding.message}\n{finding.hint}".strip()),
        "locations": [_location(finding.file, finding.line, finding.subject)],
        "properties": dict(_properties(finding)),
    }


def _properties(finding: Finding) -> Iterator[tuple[str, Any]]:
    yield "certainty", finding.certainty
    yield "measured", dict(finding.measured)
    if finding.fix is not None:
        # SARIF's own `fix` contains bytes of the file, which a report does not read.
        yield "fix", {"safety": finding.fix.safety, "description": finding.fix.description}


def _notification(skipped: Skipped, file: Path) -> dict[str, Any]:
    unused = skipped.kind == "unused"
    notification: dict[str, Any] = {
        "level": "warning" if unused else "note",
        "message": _message(f"{skipped.code}: {skipped.reason}"),
        "locations": [_location(file)],
    }
    if not unused:  # the comment may name an unknown rule
        notification["associatedRule"] = {"id": skipped.code}
    return notification


def _location(file: Path, line: int = 0, subject: str = "") -> dict[str, Any]:
    physical: dict[str, Any] = {"artifactLocation": {"uri": uri(file)}}
    if line:
        physical["region"] = {"startLine": line}
    location: dict[str, Any] = {"physicalLocation": physical}
    if subject:
        location["logicalLocations"] = [{"name": subject, "kind": "element"}]
    return location


def uri(file: Path) -> str:
    """Return the URI of a file, relative to the working directory if the file is below it."""
    path = Path(display_path(file))
    return path.as_uri() if path.is_absolute() else quote_from_bytes(bytes(path), safe="/")


def _message(text: str) -> dict[str, str]:
    # Single braces would be placeholders for arguments.
    return {"text": text.replace("{", "{{").replace("}", "}}")}
