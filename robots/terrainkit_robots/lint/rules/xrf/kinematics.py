"""Rule that compares the poses of links."""

import math

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.lint.compare.pose_differences import (
    MAX_ANGLE,
    MAX_DISTANCE,
    LinkPoseDifference,
    compare_link_poses,
)
from terrainkit_robots.lint.rule import Severity, Violation, Violations, rule
from terrainkit_robots.lint.rules.xrf.joints import joint_difference
from terrainkit_robots.lint.rules.xrf.other_robot import joint_pairs, other_name, other_robot


@rule("XRF008", "kinematics-differ", "error", needs=("against",))
def compare_kinematics(robot: Facts) -> Violations:
    """The pose of a link differs between the files at equal joint positions.

    A length, an origin, or the zero position of a joint differs. The feet then touch the ground
    where the policy does not expect it.

    Fix:
        Compare the origin of the joint of the first link that differs.

    Source:
        Both robots are compared in 20 random poses. MuJoCo compiles the frames of an MJCF.
    """
    held = [a.name for a, b in joint_pairs(robot) if joint_difference(robot, a, b)[2] == "error"]
    gap = compare_link_poses(robot, other_robot(robot), locked=held)
    if gap.is_within_tolerance:
        return
    severity: Severity | None = "warning" if gap.is_rotation_only else None
    if gap.is_base_offset and gap.base[0] != gap.base[1]:
        severity = "note"
    links = {link.name: link for link in robot.links}
    subject = gap.base[0] if gap.is_base_offset else gap.first
    yield Violation(
        element=links[subject],
        severity=severity,
        message=_kinematics_message(gap, other_name(robot)),
        measured={
            "distance": gap.distance,
            "angle": gap.angle,
            "link": gap.link,
            "pose": gap.pose,
            "poses": gap.poses,
            "seed": gap.seed,
        },
    )


def _kinematics_message(gap: LinkPoseDifference, other: str) -> str:
    ours, theirs = gap.base
    base = ours if ours == theirs else f"{ours} ({theirs} there)"
    angle = f"{math.degrees(gap.angle):.3g} deg"
    expected = f"expected at most {1000 * MAX_DISTANCE:g} mm and {math.degrees(MAX_ANGLE):.1g} deg"
    if gap.is_base_offset:
        return (
            f"frame of {base} on the trunk: got a difference to {other} of "
            f"{1000 * gap.distance:.4g} mm and {angle}, the same for all {gap.links} links; "
            f"{expected}"
        )
    if gap.is_rotation_only:
        return (
            f"rotation of link frames relative to {other}: got up to {angle} at {gap.link}, "
            f"the same in every pose, first at {gap.first}; {expected}; all origins agree to "
            f"{1000 * gap.distance:.2g} mm"
        )
    return (
        f"position of link {gap.link} relative to {base}: got a difference to {other} of "
        f"{1000 * gap.distance:.4g} mm and up to {angle} in pose {gap.pose} of {gap.poses} (seed "
        f"{gap.seed}); {expected}; the first of {gap.links} links that differs is {gap.first}"
    )
