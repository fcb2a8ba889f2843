"""The default pose: where the joints of a robot start, whoever says so."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from terrainkit_robots.analysis.bodies.mimic_joints import follower_positions
from terrainkit_robots.analysis.legs.standing_pose import nearest, solve_positions
from terrainkit_robots.spec.per_joint import match_joints

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts


def starting_positions(facts: "Facts") -> Mapping[str, float]:
    """Return the position of each moving joint that the robot starts from [rad] or [m], by name.

    What the spec says of a joint is taken as it is. The others are where the first keyframe has
    them, where legs stand, or as close to zero as the limits allow. A joint that follows another is
    where that puts it.
    """
    positions = _positions(facts)
    followed = follower_positions(facts.joints, positions)
    return {**positions, **{name: float(position) for name, position in followed.items()}}


def _positions(facts: "Facts") -> Mapping[str, float]:
    if facts.spec is None:
        return solve_positions(facts) if facts.legs else _close_to_zero(facts)
    actuated = [joint.name for joint in facts.actuated]
    told = match_joints(facts.spec.default_pose, actuated).values
    # Where the spec leaves nothing open, there is nothing to search for.
    open_ones = any(joint.name not in told for leg in facts.legs for joint in leg.joints)
    return {**(solve_positions(facts) if open_ones else _close_to_zero(facts)), **told}


def _close_to_zero(facts: "Facts") -> dict[str, float]:
    home = facts.model.home
    return {
        joint.name: home.get(joint.name, nearest(joint, joint.reference)) for joint in facts.joints
    }
