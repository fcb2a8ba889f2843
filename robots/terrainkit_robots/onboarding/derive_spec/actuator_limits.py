"""Derive effort, velocity, armature and action scale of each joint from the file or the gains."""

import math
from collections.abc import Mapping

from terrainkit.errors import one_line
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.stance import GRAVITY
from terrainkit_robots.description.model import Joint
from terrainkit_robots.simulation.gain import Gain
from terrainkit_robots.spec.column import Column, rounded
from terrainkit_robots.spec.robot_spec import MirrorJoint, Provenance

_DEFAULT_ERROR = {"revolute": 1.0, "prismatic": 0.1}
"""Position error at which a motor of unknown effort saturates [rad] or [m]."""

_LEG_FACTOR = 0.5
"""Unknown effort of a leg joint over weight times leg length. It is 0.24 for anymal_c, 0.36 to 0.7
for go2, h1 and g1, and 0.4 to 1.1 for a1."""

_HOLDING_FACTOR = 2.0
"""Smallest ratio of an unknown effort to the holding torque."""

_DEFAULT_VELOCITY = {"revolute": 20.0, "prismatic": 1.0}
"""Speed of a motor with unknown limits [rad/s] or [m/s]. The motors of Go2 reach 30, of H1 14 to
23, of G1 20 to 37."""

_ACTION_FACTOR = 0.75
"""Share of the effort that an action of 1 commands, at most."""

_MAX_ACTION_SCALE = {"revolute": 0.25, "prismatic": 0.025}
"""Largest action scale [rad] or [m], as in legged_gym. mjlab's 0.25 * effort / stiffness is 0.1 rad
at the hips of the bundled quadruped, which then learned more slowly
(benchmarks/results/learning.md)."""

_WHEEL_ACTION_FACTOR = 0.25
"""Share of the largest speed of a wheel that an action of 1 commands."""

_MAX_RANGE_FACTOR = 0.25
"""Largest ratio of the action scale to the joint range."""


def effort_column(
    facts: Facts, gains: Mapping[str, Gain], mirror: Mapping[str, MirrorJoint]
) -> Column:
    """Return the effort limit of each joint [N m] or [N].

    Args:
        facts: The robot.
        gains: PD gains of each joint.
        mirror: The joint on the other side of each joint.
    """
    limits = {joint.name: joint.effort for joint in facts.actuated}
    in_file = _limits_in_file(facts, limits, mirror)
    return {
        joint.name: in_file.get(joint.name)
        or _suggest_effort(facts, joint, gains[joint.name].stiffness)
        for joint in facts.actuated
    }


def _suggest_effort(facts: Facts, joint: Joint, stiffness: float) -> tuple[float, Provenance]:
    """Return an effort limit for a joint whose limit is unknown [N m] or [N]."""
    leg_effort = _leg_effort(facts)
    if joint in facts.leg_joints and joint.kind != "prismatic" and leg_effort > 0:
        value, reason = leg_effort, f"{_LEG_FACTOR:g} x weight x leg length"
    else:
        error = _by_kind(_DEFAULT_ERROR, joint)
        value, reason = stiffness * error, f"the stiffness at an error of {error:g} {joint.unit}"
    torques = facts.stance.torques if facts.stance is not None else {}
    holding = _HOLDING_FACTOR * abs(torques.get(joint.name, 0.0))
    if math.isfinite(holding) and holding > value:
        value, reason = holding, f"{_HOLDING_FACTOR:g} times the holding torque"
    return rounded(value, 2) or 1.0, _suggested(f"not in the file; {reason}")


def _leg_effort(facts: Facts) -> float:
    """Return an estimate of the effort of a leg joint [N m]; 0 if the mass or length is unknown."""
    lengths = [leg.length for leg in facts.legs]
    effort = _LEG_FACTOR * facts.total_mass * GRAVITY * sum(lengths) / max(len(lengths), 1)
    return effort if 0 < effort < math.inf else 0.0


def velocity_column(facts: Facts, mirror: Mapping[str, MirrorJoint]) -> Column:
    """Return the velocity limit of each joint [rad/s] or [m/s].

    Args:
        facts: The robot.
        mirror: The joint on the other side of each joint.
    """
    limits = {joint.name: joint.velocity for joint in facts.actuated}
    in_file = _limits_in_file(facts, limits, mirror)
    typical = _suggested("not in the file; typical of motors of legged robots")
    return {
        joint.name: in_file.get(joint.name, (_by_kind(_DEFAULT_VELOCITY, joint), typical))
        for joint in facts.actuated
    }


def armature_column(facts: Facts, gains: Mapping[str, Gain]) -> Column:
    """Return the armature of each joint [kg m2] or [kg]."""
    column: Column = {}
    for joint in facts.actuated:
        in_file, required = joint.armature, gains[joint.name].armature
        if 0 < in_file < math.inf and required <= in_file:
            column[joint.name] = rounded(in_file), _from_file(facts)
            continue
        reason = f"{in_file:.3g} in the file" if in_file > 0 else "not in the file"
        reason += "; required by the gains" if required > 0 else ""
        column[joint.name] = rounded(required, 3), _suggested(reason)
    return column


def action_scale_column(
    facts: Facts, gains: Mapping[str, Gain], effort: Column, velocity: Column
) -> Column:
    """Return the change of each joint target for an action of 1 [rad] or [m].

    It is the same for all joints of the legs, but less where it would exceed a share of the effort
    or of the joint range. The target of a wheel, which has no stiffness, is a speed [rad/s]. On a
    robot with legs, it is 0 for the other joints, which hold the default pose: g1 learned to
    balance only without noise on its arms and waist (benchmarks/results/policies.md).

    Args:
        facts: The robot.
        gains: PD gains of each joint.
        effort: Effort limits.
        velocity: Velocity limits.
    """
    column: Column = {}
    in_legs = {joint.name for leg in facts.legs for joint in (*leg.joints, *leg.branches)}
    for joint in facts.actuated:
        stiffness = gains[joint.name].stiffness
        if stiffness > 0 and in_legs and joint.name not in in_legs:
            value, reason = 0.0, "not a joint of a leg: it holds the default pose"
        elif stiffness > 0:
            largest = _by_kind(_MAX_ACTION_SCALE, joint)
            scales = {
                largest: f"{largest:g} {joint.unit}, the largest suggested scale",
                _ACTION_FACTOR * effort[joint.name][0] / stiffness: (
                    f"{_ACTION_FACTOR:g} * effort / stiffness"
                ),
            }
            lower, upper = joint.range or (-math.inf, math.inf)
            if math.isfinite(upper - lower):
                scale = _MAX_RANGE_FACTOR * (upper - lower)
                scales[scale] = f"{_MAX_RANGE_FACTOR:g} of the joint range"
            value, reason = min(scales), scales[min(scales)]
        else:
            value = _WHEEL_ACTION_FACTOR * velocity[joint.name][0]
            reason = f"{_WHEEL_ACTION_FACTOR:g} * velocity; the target is a speed without stiffness"
        column[joint.name] = rounded(value, 3), _suggested(reason)
    return column


def _by_kind(values: Mapping[str, float], joint: Joint) -> float:
    return values["prismatic" if joint.kind == "prismatic" else "revolute"]


def _limits_in_file(
    facts: Facts, limits: Mapping[str, float | None], mirror: Mapping[str, MirrorJoint]
) -> Column:
    """Return the valid limits of the file; a joint without one gets its mirror joint's limit."""
    valid = {
        name: rounded(limit)
        for name, limit in limits.items()
        if limit is not None and 0 < limit < math.inf and rounded(limit)
    }
    copied = {
        name: (valid[other.joint], _suggested(f"not in the file; copied from {other.joint}"))
        for name, other in mirror.items()
        if other.joint in valid
    }
    return copied | {name: (limit, _from_file(facts)) for name, limit in valid.items()}


def _suggested(reason: str) -> Provenance:
    return Provenance(origin="suggested", reason=reason)


def _from_file(facts: Facts) -> Provenance:
    return Provenance(origin="declared", reason=f"in {one_line(facts.model.file.name)}")
