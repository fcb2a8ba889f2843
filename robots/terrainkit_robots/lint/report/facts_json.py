"""The facts of a robot as plain data, which every report carries."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.analysis.simulator_conventions.joint_order import simulator_orders

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts
    from terrainkit_robots.analysis.legs.legs import Leg

_DIGITS = 6
"""Significant digits of each number: more than any robot is built to."""


def facts_json(facts: "Facts", *, simulated: bool = False) -> dict[str, Any]:
    """Return the facts as JSON has them: SI units and radians, and None for what is not known.

    The keys are the same for every robot: one without legs has no feet and no standing pose.
    `observation_size` counts what legged_gym's policies see without the terrain: velocities,
    gravity and command (12 numbers), and position, speed and last action of each actuated joint.
    `joint_orders` has the joints in the order of the file under `file`, those outside the main tree
    included, and under each simulator its `joints` and `bodies`, whether that is `certain`, and the
    `reason`.
    `suggested_gains` take a model in MuJoCo, and are None unless the robot was simulated.
    """
    legs, actuated = facts.legs, len(facts.actuated)
    return {
        "name": facts.model.name,
        "total_mass": number(facts.total_mass),
        "links": len(facts.links),
        "bodies": sum(not body.virtual for body in facts.bodies),
        "joints": len(facts.joints),
        "actuated_joints": actuated,
        "joint_names": [joint.name for joint in facts.joints],
        "legs": [_leg(leg) for leg in legs],
        "feet": [leg.foot for leg in legs],
        "leg_length": number(sum(leg.length for leg in legs) / len(legs)) if legs else None,
        "joint_orders": _orders(facts),
        "mirror_plane": {
            "normal": [number(float(x)) for x in facts.mirror.normal],
            "offset": number(facts.mirror.offset),
        },
        "mirrored_joints": _mirrored(facts),
        **_standing(facts),
        "suggested_gains": _gains(facts) if simulated else None,
        "action_size": actuated,
        "observation_size": 12 + 3 * actuated,
    }


def number(value: float) -> float | None:
    """Return `value` rounded to the digits that mean something; None if it is not finite."""
    return float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None


def _gains(facts: "Facts") -> dict[str, Any] | None:
    """Return what a position controller of each actuated joint may have; None where none can be."""
    from terrainkit_robots.analysis.cannot_check import CannotCheckError
    from terrainkit_robots.simulation.pd_gains import suggest_gains

    try:
        gains = suggest_gains(facts)
    except CannotCheckError:
        return None
    return {
        name: {
            "stiffness": number(gain.stiffness),
            "damping": number(gain.damping),
            "armature": number(gain.armature),
            "reason": gain.reason,
        }
        for name, gain in gains.items()
    }


def _orders(facts: "Facts") -> dict[str, Any]:
    orders: dict[str, Any] = {"file": [joint.name for joint in facts.model.joints if joint.moves]}
    for order in simulator_orders(facts):
        orders[order.key] = {
            "joints": list(order.joints),
            "bodies": list(order.bodies),
            "certain": order.certain,
            "reason": order.reason,
        }
    return orders


def _leg(leg: "Leg") -> dict[str, Any]:
    pairs = zip(leg.joints, leg.roles, strict=True)
    return {
        "foot": leg.foot,
        "length": number(leg.length),
        "joints": [{"name": joint.name, "role": role} for joint, role in pairs],
    }


def _mirrored(facts: "Facts") -> list[dict[str, Any]]:
    records = []
    for pair in facts.mirror.pairs:
        left, right = facts.bodies[pair.left].joint, facts.bodies[pair.right].joint
        if left is not None and right is not None and left.moves and right.moves:
            records.append({"left": left.name, "right": right.name, "sign": pair.sign})
    return records


def _standing(facts: "Facts") -> dict[str, Any]:
    stance = facts.stance
    if stance is None:
        keys = ("standing_pose", "standing_height", "spawn_height", "standing_width")
        return dict.fromkeys((*keys, "support_polygon", "support_margin", "holding_torques"))
    with np.errstate(all="ignore"):  # lengths of 1e308 are told by a rule, not by numpy
        width = float(np.ptp(stance.contacts @ facts.mirror.normal))
    return {
        "standing_pose": _numbers(stance.positions),
        "standing_height": number(stance.height),
        "spawn_height": number(stance.spawn_height),
        "standing_width": number(width),
        "support_polygon": [[number(float(v)) for v in corner] for corner in stance.support],
        "support_margin": number(stance.margin),
        "holding_torques": _numbers(stance.torques),
    }


def _numbers(values: Mapping[str, float]) -> dict[str, float | None]:
    return {name: number(value) for name, value in values.items()}
