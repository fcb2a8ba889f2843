"""Check a robot file, and repair a copy of it in memory; the file itself is not changed."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.lint.check import check_robot
from terrainkit_robots.lint.rule import Finding
from terrainkit_robots.lint.runner import Report
from terrainkit_robots.lint.settings import Settings
from terrainkit_robots.spec.loops import LoopSpec
from terrainkit_robots.text import names

_MAX_CHANGE = 0.01
"""Largest change of the inertia of a rigid body, over its smallest principal moment. CAD inertias
are less accurate than this."""


def check_and_repair(
    path: Path, settings: Settings, loop_spec: LoopSpec, *, unsafe: bool
) -> tuple[Report, tuple[Finding, ...]]:
    """Check a robot, with the safe fixes of the rules and the repairs of onboarding.

    Args:
        path: A robot file, or the name of a robot.
        settings: How the file is read and checked.
        loop_spec: Loops and motors that a spec adds.
        unsafe: Whether to apply fixes that change a number, a shape or a mesh.

    Returns:
        What remains, and the findings of the file that do not apply to the written files.
    """
    from terrainkit_robots.lint.fixes.apply import fix_robot

    def check(contents: Mapping[Path, bytes]) -> Report:
        report = check_robot(path, settings, spec=loop_spec, contents=contents)
        findings = tuple(_with_safe_fix(report, finding) for finding in report.findings)
        return replace(report, findings=findings)

    report = check({})
    fixed: tuple[Finding, ...] = ()
    if report.facts.model.kind != "xacro" and any(f.fix is not None for f in report.findings):
        result = fix_robot(path, check, report=report, unsafe=unsafe)
        report, fixed = result.report, result.report.fixed
    # The export rewrites these parts. The fix of the lint rule is not applied, so its description
    # is removed.
    converted = [f for f in report.findings if f.severity == "error" and f.onboarding == "converts"]
    remaining = tuple(finding for finding in report.findings if finding not in converted)
    fixed += tuple(replace(finding, fix=None) for finding in converted)
    return replace(report, findings=remaining, fixed=(), unfixed=()), fixed


def _with_safe_fix(report: Report, finding: Finding) -> Finding:
    """Return a finding whose fix is safe if it repairs a mesh path or a negligible inertia.

    A missing mesh is replaced by the file of the same name in another folder of the robot. A sensor
    frame with a placeholder inertia prevents MuJoCo from loading a robot, but has no effect on the
    motion of the body that it is fixed to.
    """
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


def without_placeholder_efforts(report: Report) -> tuple[Facts, tuple[str, ...]]:
    """Return a robot in which placeholder efforts of leg joints are unknown, and the change.

    An effort limit such as 1000 N m says nothing about the motor, so an estimate is better.
    """
    facts = report.facts
    legs = {joint.name for joint in facts.leg_joints if joint.kind != "prismatic"}
    joints = {
        finding.subject
        for finding in report.findings
        if finding.onboarding == "repairs"
        and "effort" in finding.measured
        and finding.subject in legs
    }
    if not joints:
        return facts, ()
    model = facts.model
    limits = {joint.name: joint.limit for joint in model.joints if joint.name in joints}
    efforts = sorted(
        {limit.effort for limit in limits.values() if limit and limit.effort is not None}
    )
    changed = replace(
        model,
        joints=tuple(
            replace(joint, limit=replace(limit, effort=None))
            if (limit := limits.get(joint.name))
            else joint
            for joint in model.joints
        ),
        actuators=tuple(
            replace(motor, effort=None) if motor.joint in joints else motor
            for motor in model.actuators
        ),
    )
    listed = names((joint.name for joint in model.joints if joint.name in joints), max_count=4)
    got = names(f"{effort:g}" for effort in efforts)
    change = (
        f"the effort limit of {listed} is a placeholder ({got} N m); it was replaced by an "
        "estimate from the mass and the leg length, see [effort] in robot.toml"
    )
    return facts.with_model(changed), (change,)
