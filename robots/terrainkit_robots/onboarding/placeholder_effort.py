"""Remove placeholder efforts of leg joints, so that they are estimated."""

from dataclasses import replace
from typing import TYPE_CHECKING

from terrainkit_robots.text import names

if TYPE_CHECKING:
    from collections.abc import Iterable

    from terrainkit_robots.analysis.facts import Facts
    from terrainkit_robots.description.model import RobotModel
    from terrainkit_robots.lint.rule import Finding


def placeholder_effort(facts: "Facts", findings: "Iterable[Finding]") -> frozenset[str]:
    """Return the joints of legs whose effort limit is a placeholder, such as 1000 N m."""
    legs = {joint.name for joint in facts.leg_joints if joint.kind != "prismatic"}
    return frozenset(
        finding.subject
        for finding in findings
        if finding.onboarding == "repairs"
        and "effort" in finding.measured
        and finding.subject in legs
    )


def without_effort(
    model: "RobotModel", joints: frozenset[str]
) -> tuple["RobotModel", tuple[str, ...]]:
    """Return a model in which the efforts of some joints are unknown, and the change."""
    if not joints:
        return model, ()
    limits = {
        joint.name: joint.limit
        for joint in model.joints
        if joint.name in joints and joint.limit is not None
    }
    efforts = sorted({limit.effort for limit in limits.values() if limit.effort is not None})
    changed = replace(
        model,
        joints=tuple(
            replace(joint, limit=replace(limits[joint.name], effort=None))
            if joint.name in limits
            else joint
            for joint in model.joints
        ),
        actuators=tuple(
            replace(actuator, effort=None) if actuator.joint in joints else actuator
            for actuator in model.actuators
        ),
    )
    listed = names((joint.name for joint in model.joints if joint.name in joints), max_count=4)
    got = names(f"{effort:g}" for effort in efforts)
    change = (
        f"the effort limit of {listed} is a placeholder ({got} N m); it was replaced by an "
        "estimate from the mass and the leg length, see [effort] in robot.toml"
    )
    return changed, (change,)
