"""Mark the fixes that onboarding applies by itself as safe: it works on a copy and reports them."""

from dataclasses import replace

from terrainkit_robots.lint.rule import Finding
from terrainkit_robots.lint.runner import Report

_MAX_CHANGE = 0.01
"""Largest change of the inertia of a rigid body, over its smallest principal moment. CAD inertias
are less accurate than this."""


def with_repairs_marked_safe(report: Report) -> Report:
    """Return a report in which the fixes of mesh paths and negligible inertias are safe.

    A sensor frame with a placeholder inertia prevents MuJoCo from loading a robot, but has no
    effect on the motion of the body that it is fixed to. A missing mesh is replaced by the file of
    the same name in another folder of the robot.
    """
    findings = tuple(_with_safe_fix(report, finding) for finding in report.findings)
    return replace(report, findings=findings)


def _with_safe_fix(report: Report, finding: Finding) -> Finding:
    if finding.onboarding != "repairs" or finding.fix is None:
        return finding
    if finding.family == "MSH":
        return replace(finding, fix=replace(finding.fix, safety="safe"))
    body = report.facts.body_of.get(finding.subject)
    if body is None:
        return finding
    link = next(link for link in body.links if link.name == finding.subject)
    change = report.facts.inertia_repair.relative_change(link)
    if change > _MAX_CHANGE:
        return finding
    description = (
        f"{finding.fix.description.rstrip('.')}; the inertia of body {body.name} changes by "
        f"{change:.2g} of its smallest moment."
    )
    return replace(finding, fix=replace(finding.fix, safety="safe", description=description))
