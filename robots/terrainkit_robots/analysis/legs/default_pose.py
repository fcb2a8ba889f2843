"""Compute the default joint positions of a robot."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from terrainkit_robots.analysis.bodies.mimic_joints import mimic_positions
from terrainkit_robots.analysis.legs.standing_pose import (
    clip_to_limits,
    round_position,
    solve_standing_pose,
)
from terrainkit_robots.spec.per_joint import match_joints

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts


def default_positions(robot: "Facts") -> Mapping[str, float]:
    """Return the default position of each moving joint [rad] or [m], by name.

    Positions of the spec are used unchanged. The others come from the first keyframe, from the
    standing pose for joints of legs, or are the closest to zero that the limits allow. Positions
    of mimic joints are computed.
    """
    positions = _positions(robot)
    mimicked = mimic_positions(robot.joints, positions)
    return {**positions, **{name: float(position) for name, position in mimicked.items()}}


def _positions(robot: "Facts") -> Mapping[str, float]:
    if robot.spec is None:
        return solve_standing_pose(robot) if robot.legs else _near_zero(robot)
    actuated = [joint.name for joint in robot.actuated]
    known = match_joints(robot.spec.default_pose, actuated).values
    # The search is skipped if the spec has a position for every joint of the legs.
    incomplete = any(joint.name not in known for leg in robot.legs for joint in leg.joints)
    return {**(solve_standing_pose(robot) if incomplete else _near_zero(robot)), **known}


def _near_zero(robot: "Facts") -> dict[str, float]:
    return {
        joint.name: robot.model.keyframe.get(
            joint.name, round_position(joint, clip_to_limits(joint, joint.reference))
        )
        for joint in robot.joints
    }
