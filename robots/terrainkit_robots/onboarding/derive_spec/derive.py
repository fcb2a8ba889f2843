"""Derive the spec of a robot from its facts, with the provenance of each number."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from terrainkit.errors import ConfigError, one_line
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.keyframe import is_standing_keyframe
from terrainkit_robots.description.model import Joint
from terrainkit_robots.onboarding.derive_spec import named_bodies
from terrainkit_robots.onboarding.derive_spec.actuator_limits import (
    action_scale_column,
    armature_column,
    effort_column,
    velocity_column,
)
from terrainkit_robots.onboarding.derive_spec.foot_radius import foot_radius
from terrainkit_robots.simulation.gain import Gain
from terrainkit_robots.spec.column import Column, collect_provenance, rounded, rounded_length
from terrainkit_robots.spec.loops import closed_loops
from terrainkit_robots.spec.name_patterns import by_pattern
from terrainkit_robots.spec.robot_spec import Origin, Provenance, RobotSpec
from terrainkit_robots.text import names

_SOFT_LIMIT_FACTOR = 0.9
"""Share of the joint range within the soft limits, as in legged_gym and Isaac Lab."""

_DEFAULT_RESET_RANGE = (0.5, 1.5)
"""Range of the factor on the default pose at a reset, as in legged_gym."""

_MAX_BIPED_RESET_OFFSET = 0.25
"""Largest offset from the default pose at a reset on two legs [rad]: an action of 1 corrects it.
Isaac Lab resets its bipeds at the default pose. Quadrupeds also stand with larger offsets."""


def derive_spec(
    facts: Facts,
    *,
    gains: Mapping[str, Gain],
    floating: bool,
    urdf: str = "robot.urdf",
    mjcf: str = "robot.xml",
) -> RobotSpec:
    """Return the spec of a robot.

    Args:
        facts: The robot.
        gains: PD gains of each actuated joint.
        floating: Whether the base is floating.
        urdf: Name of the URDF file in the folder of the spec.
        mjcf: Name of the MJCF file in the folder of the spec.

    Raises:
        ConfigError: if the robot has no bodies, or gains are missing.
    """
    base = named_bodies.base_body(facts)
    if base is None:
        raise ConfigError(f"{facts.model.title} has no bodies, so no spec can be derived")
    missing = [joint.name for joint in facts.actuated if joint.name not in gains]
    if missing:
        raise ConfigError(f"gains of {names(missing)} are missing; expected all actuated joints")
    mirror = facts.mirror_map
    columns = _pose_and_gain_columns(facts, gains)
    columns["effort"] = effort_column(facts, gains, mirror)
    columns["velocity"] = velocity_column(facts, mirror)
    columns["armature"] = armature_column(facts, gains)
    columns["action_scale"] = action_scale_column(
        facts, gains, columns["effort"], columns["velocity"]
    )
    pose = {joint: value for joint, (value, _) in columns["default_pose"].items()}
    reset, reset_reason = _reset_range(facts, pose)
    lengths = _lengths(facts)
    columns = {name: by_pattern(column, list(column)) for name, column in columns.items()}
    values: dict[str, Any] = {
        name: {key: value for key, (value, _) in column.items()} for name, column in columns.items()
    }
    length_values: dict[str, Any] = {name: value for name, (value, _) in lengths.items()}
    return RobotSpec(
        name=facts.model.title,
        urdf=urdf,
        mjcf=mjcf,
        floating=floating,
        joint_order=tuple(joint.name for joint in facts.actuated),
        base=named_bodies.body_name(base),
        feet=named_bodies.feet(facts),
        shanks=named_bodies.shanks(facts),
        thighs=named_bodies.thighs(facts),
        termination_contacts=named_bodies.termination_contacts(facts),
        penalized_contacts=named_bodies.penalized_contacts(facts),
        loops=closed_loops(facts.model),
        **values,
        soft_limits=by_pattern(_soft_limits(facts, pose), [j.name for j in facts.actuated]),
        reset_range=reset,
        **length_values,
        mirror=mirror,
        provenance={
            **collect_provenance(columns),
            "soft_limits": Provenance(
                origin="suggested", reason=f"{_SOFT_LIMIT_FACTOR:g} of each joint range, centered"
            ),
            "reset_range": Provenance(origin="suggested", reason=reset_reason),
            **{name: origin for name, (_, origin) in lengths.items()},
            "mirror": Provenance(origin="measured", reason="joint positions and axes at zero pose"),
        },
    )


def _pose_and_gain_columns(facts: Facts, gains: Mapping[str, Gain]) -> dict[str, Column]:
    pose: Column = {}
    stiffness: Column = {}
    damping: Column = {}
    origin = _pose_provenance(facts)
    see = Provenance(origin="suggested", reason="see stiffness")
    for joint in facts.actuated:
        name, gain = joint.name, gains[joint.name]
        origin_of_gain = Provenance(
            origin="declared" if gain.declared else "suggested", reason=gain.reason
        )
        pose[name] = rounded(facts.default_pose[name]), origin
        # A declared gain is kept as it is; a suggested one is not known to more than two digits.
        digits = 6 if gain.declared else 2
        stiffness[name] = rounded(gain.stiffness, digits), origin_of_gain
        damping[name] = rounded(gain.damping, digits), replace(see, origin=origin_of_gain.origin)
    return {"default_pose": pose, "stiffness": stiffness, "damping": damping}


def _pose_provenance(facts: Facts) -> Provenance:
    reason = f"first keyframe of {one_line(facts.model.file.name)}"
    declared = Provenance(origin="declared", reason=reason)
    if facts.legs:
        if is_standing_keyframe(facts):
            return declared
        return Provenance(
            origin="solved", reason="legs bent, feet below the center of mass, other joints near 0"
        )
    keyframe = facts.model.keyframe
    if keyframe and all(joint.name in keyframe for joint in facts.actuated):
        return declared
    return Provenance(origin="suggested", reason="closest to 0 within the limits")


def _soft_limits(facts: Facts, pose: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Return soft limits within the joint limits that include the default pose."""
    limits = {}
    for joint in facts.actuated:
        if joint.range is None or not math.isfinite(joint.range[1] - joint.range[0]):
            continue
        lower, upper = joint.range
        margin = (1 - _SOFT_LIMIT_FACTOR) / 2 * (upper - lower)
        soft = rounded(lower + margin, 3), rounded(upper - margin, 3)
        if not lower <= soft[0] < soft[1] <= upper:  # a small range far from 0
            soft = lower + margin, upper - margin
        position = pose[joint.name]
        limits[joint.name] = min(soft[0], position), max(soft[1], position)
    return limits


def _reset_range(facts: Facts, pose: Mapping[str, float]) -> tuple[tuple[float, float], str]:
    """Return factors on the default pose that keep all joints within their limits, and why."""
    is_biped = len(named_bodies.feet(facts)) == 2
    offset = _MAX_BIPED_RESET_OFFSET if is_biped else math.inf
    factors = [_reset_scale(joint, pose[joint.name], offset) for joint in facts.actuated]
    lowest = max((low for low, _ in factors), default=_DEFAULT_RESET_RANGE[0])
    highest = min((high for _, high in factors), default=_DEFAULT_RESET_RANGE[1])
    # Rounded inward, to two digits, so that no joint leaves its limits.
    inner = min(1.0, math.ceil(100 * lowest) / 100), max(1.0, math.floor(100 * highest) / 100)
    if inner == _DEFAULT_RESET_RANGE:
        return inner, "as in legged_gym"
    bound = [
        joint.name
        for joint, (low, high) in zip(facts.actuated, factors, strict=True)
        if low == lowest > _DEFAULT_RESET_RANGE[0] or high == highest < _DEFAULT_RESET_RANGE[1]
    ]
    default = "{:g} to {:g}".format(*_DEFAULT_RESET_RANGE)
    limits = f"the limits, or {offset:g} rad on two legs, of" if is_biped else "the limits of"
    return inner, f"{default} as in legged_gym, reduced by {limits} {names(bound, max_count=2)}"


def _reset_scale(joint: Joint, position: float, offset: float) -> tuple[float, float]:
    """Return the factors on a position that move the joint to its limits or by an offset."""
    if position == 0:
        return _DEFAULT_RESET_RANGE
    # A factor f moves the joint to f * position. The limits over the position are therefore the
    # factors, in reverse order if it is negative.
    lower, upper = joint.range or (-math.inf, math.inf)
    ends = np.array([max(lower, position - offset), min(upper, position + offset)])
    with np.errstate(all="ignore"):
        low, high = sorted((ends / position).tolist())
    lowest, highest = _DEFAULT_RESET_RANGE
    return float(np.clip(low, lowest, 1.0)), float(np.clip(high, 1.0, highest))


def _lengths(facts: Facts) -> dict[str, tuple[float, Provenance]]:
    """Return the known lengths of a robot with legs, with their provenance [m]."""
    stance = facts.stance
    if stance is None:
        return {}
    count = f"mean of {len(facts.legs)} legs"
    with np.errstate(all="ignore"):  # a lint rule reports lengths such as 1e308
        width = float(np.ptp(stance.contacts @ facts.mirror.normal))
        length = float(np.mean([leg.length for leg in facts.legs]))
    found: dict[str, tuple[float | None, Origin, str]] = {
        "base_height_target": (stance.height, "solved", "standing at the default pose"),
        "spawn_height": (stance.spawn_height, "solved", "1 cm above the standing height"),
        "leg_length": (length, "measured", f"hip to knee to contact, {count}"),
        "stance_width": (width, "solved", "distance between the contacts at the default pose"),
        "foot_radius": (foot_radius(facts), "measured", f"collision shapes of the feet, {count}"),
    }
    if facts.bodies[0].virtual:  # the base is the world, which has no height
        del found["base_height_target"], found["spawn_height"]
    return {
        name: (rounded_length(value), Provenance(origin=origin, reason=reason))
        for name, (value, origin, reason) in found.items()
        if value is not None and math.isfinite(value)
    }
