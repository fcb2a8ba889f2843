"""Derivation: the spec of a robot from its facts, and where each number came from."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit.errors import ConfigError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint
from terrainkit_robots.onboarding.derive_spec import named_bodies
from terrainkit_robots.onboarding.derive_spec.foot_radius import foot_radius
from terrainkit_robots.onboarding.derive_spec.motors import (
    action_scales,
    armatures,
    efforts,
    velocities,
)
from terrainkit_robots.spec.column import Column, collect_provenance, rounded
from terrainkit_robots.spec.robot_spec import Provenance, RobotSpec
from terrainkit_robots.text import names

if TYPE_CHECKING:
    from terrainkit_robots.simulation.gain import Gain

_SOFT = 0.9
"""Share of a joint's range that is left free; legged_gym's and Isaac Lab's for their robots."""

_RESET = (0.5, 1.5)
"""Factors on the default pose between which legged_gym starts an episode."""


def derive_spec(
    facts: Facts,
    *,
    gains: "Mapping[str, Gain]",
    floating: bool,
    urdf: str = "robot.urdf",
    mjcf: str = "robot.xml",
) -> RobotSpec:
    """Return the spec of a robot.

    Args:
        facts: The robot.
        gains: Suggested gains of each actuated joint, by name.
        floating: Whether the base moves freely.
        urdf: Name of its URDF, beside the spec.
        mjcf: Name of its MJCF, beside the spec.

    Raises:
        ConfigError: if there is no body, or a joint without gains.
    """
    base = named_bodies.base_body(facts)
    if base is None:
        raise ConfigError(f"{facts.model.title} has no bodies; there is nothing to derive")
    missing = [joint.name for joint in facts.actuated if joint.name not in gains]
    if missing:
        raise ConfigError(f"no gains for {names(missing)}; wanted some for each actuated joint")
    twins = facts.mirror_map
    columns = _columns(facts, gains)
    columns["effort"] = efforts(facts, gains, twins)
    columns["velocity"] = velocities(facts, twins)
    columns["armature"] = armatures(facts, gains)
    columns["action_scale"] = action_scales(facts, gains, columns["effort"], columns["velocity"])
    pose = columns["default_pose"].values
    reset, reset_reason = _reset_range(facts, pose)
    lengths = _lengths(facts)
    tables: dict[str, Any] = {name: column.values for name, column in columns.items()}
    heights: dict[str, Any] = {name: value for name, (value, _) in lengths.items()}
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
        **tables,
        soft_limits=_soft_limits(facts, pose),
        reset_range=reset,
        **heights,
        mirror=twins,
        provenance={
            **collect_provenance(columns),
            "soft_limits": _suggested(f"{_SOFT:g} of each range, about its middle"),
            "reset_range": _suggested(reset_reason),
            **{name: origin for name, (_, origin) in lengths.items()},
            "mirror": _measured("places and axes of the joints, all of them at 0"),
        },
    )


def _suggested(reason: str) -> Provenance:
    return Provenance(origin="suggested", reason=reason)


def _measured(reason: str) -> Provenance:
    return Provenance(origin="measured", reason=reason)


def _solved(reason: str) -> Provenance:
    return Provenance(origin="solved", reason=reason)


def _columns(facts: Facts, gains: "Mapping[str, Gain]") -> dict[str, Column]:
    pose, stiffness, damping = Column(), Column(), Column()
    origin = _origin_of_pose(facts)
    for joint in facts.actuated:
        gain = gains[joint.name]
        pose.add(joint.name, rounded(facts.positions[joint.name]), origin)
        stiffness.add(joint.name, rounded(gain.stiffness, 3), _suggested(gain.reason))
        damping.add(joint.name, rounded(gain.damping, 3), _suggested("goes with the stiffness"))
    return {"default_pose": pose, "stiffness": stiffness, "damping": damping}


def _origin_of_pose(facts: Facts) -> Provenance:
    home = facts.model.home
    joints = [joint for leg in facts.legs for joint in leg.joints] or facts.actuated
    if home and all(joint.name in home for joint in joints):
        return Provenance(origin="declared", reason=f"first keyframe of {facts.model.file.name}")
    if facts.legs:
        return _solved("legs bent, feet below the centre of mass, the other joints near 0")
    return _suggested("as close to 0 as the limits allow")


def _soft_limits(facts: Facts, pose: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Return limits for rewards, within those of the joint, and around the default pose."""
    limits = {}
    for joint in facts.actuated:
        if joint.range is None or not math.isfinite(joint.range[1] - joint.range[0]):
            continue
        lower, upper = joint.range
        spare = (1 - _SOFT) / 2 * (upper - lower)
        soft = rounded(lower + spare), rounded(upper - spare)
        position = pose[joint.name]
        limits[joint.name] = min(soft[0], position), max(soft[1], position)
    return limits


def _reset_range(facts: Facts, pose: Mapping[str, float]) -> tuple[tuple[float, float], str]:
    """Return factors on the default pose that keep every joint within its limits, and why those."""
    factors = [_factors(joint, pose[joint.name]) for joint in facts.actuated]
    lowest = max((low for low, _ in factors), default=_RESET[0])
    highest = min((high for _, high in factors), default=_RESET[1])
    inner = min(1.0, math.ceil(100 * lowest) / 100), max(1.0, math.floor(100 * highest) / 100)
    if inner == _RESET:
        return inner, "legged_gym's for its robots"
    bound = [
        joint.name
        for joint, (low, high) in zip(facts.actuated, factors, strict=True)
        if low == lowest > _RESET[0] or high == highest < _RESET[1]
    ]
    usual = f"{_RESET[0]:g} to {_RESET[1]:g} of legged_gym's robots"
    return inner, f"{usual}, as far as the limits of {names(bound, most=2)} allow"


def _factors(joint: Joint, position: float) -> tuple[float, float]:
    """Return the factors on a position at which the joint is at its limits, within _RESET."""
    if joint.range is None or position == 0:
        return _RESET
    with np.errstate(all="ignore"):
        ends = sorted(float(np.float64(end) / position) for end in joint.range)
    return float(np.clip(ends[0], _RESET[0], 1.0)), float(np.clip(ends[1], 1.0, _RESET[1]))


def _lengths(facts: Facts) -> dict[str, tuple[float, Provenance]]:
    """Return the lengths of a robot with legs that are known, and where they came from [m]."""
    stance = facts.stance
    if stance is None:
        return {}
    count = f"mean of {len(facts.legs)} legs"
    with np.errstate(all="ignore"):  # lengths of 1e308 are told by a rule, not by numpy
        width = float(np.ptp(stance.contacts @ facts.mirror.normal))
        length = float(np.mean([leg.length for leg in facts.legs]))
    found = {
        "base_height_target": (stance.height, _solved("standing at the default pose")),
        "spawn_height": (stance.spawn_height, _solved("standing at the default pose, 1 cm higher")),
        "leg_length": (length, _measured(f"from hip over knee to contact, {count}")),
        "stance_width": (width, _solved("between the contacts at the default pose")),
        "foot_radius": (foot_radius(facts), _measured(f"collision shapes of the feet, {count}")),
    }
    if facts.bodies[0].virtual:  # of what the world holds, no height is that of its base
        del found["base_height_target"], found["spawn_height"]
    return {
        name: (rounded(value), origin)
        for name, (value, origin) in found.items()
        if value is not None and math.isfinite(value)
    }
