"""Convert the facts of a robot to a dictionary, which every report contains."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.analysis.legs.legs import mean_length
from terrainkit_robots.analysis.simulator_conventions.loaded_robot import loaded_robots
from terrainkit_robots.analysis.task_facts import TaskFacts

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts
    from terrainkit_robots.analysis.legs.legs import Leg
    from terrainkit_robots.analysis.simulator_conventions.loaded_robot import LoadedRobot

_DIGITS = 6
"""Significant digits of each number."""


def facts_json(facts: "Facts | TaskFacts", *, may_simulate: bool = False) -> dict[str, Any]:
    """Return the facts as a JSON-compatible dictionary, in SI units and radians.

    Those of a task are its rewards by behavior.

    All robots have the same keys. Unknown values are None. `observation_size` is the size for a
    legged_gym policy without height scan: 12 values for velocities, gravity and command, and
    position, velocity and last action of each actuated joint. `joint_orders` contains the joints
    in the order of the file as `file`, and for each simulator `joints`, `bodies`, whether the
    order is `certain`, and the `reason`. `simulators` contains what each simulator makes of the
    file: `total_mass`, `bodies`, the body that each `merged` link is a part of, `feet` that are
    bodies of their own, and what is `lost`; the order of its joints is in `joint_orders`.

    Args:
        facts: The robot.
        may_simulate: Whether to compute `suggested_gains`, which requires a MuJoCo model.
    """
    if isinstance(facts, TaskFacts):
        return facts.to_json()
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
        "leg_length": number(mean_length(legs)) if legs else None,
        "joint_orders": _joint_orders(facts),
        "simulators": {robot.order.key: _loaded_robot(robot) for robot in loaded_robots(facts)},
        "mirror_plane": {
            "normal": [number(float(x)) for x in facts.mirror.normal],
            "offset": number(facts.mirror.offset),
        },
        "mirrored_joints": _mirrored_joints(facts),
        **_standing(facts),
        "suggested_gains": _gains(facts) if may_simulate and not facts.tree.rejected else None,
        "action_size": actuated,
        "observation_size": 12 + 3 * actuated,
    }


def number(value: float) -> float | None:
    """Return `value` rounded to 6 significant digits, or None if it is not finite."""
    return float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None


def _gains(facts: "Facts") -> dict[str, Any] | None:
    """Return the suggested PD gains of each actuated joint, or None if they cannot be computed."""
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


def _joint_orders(facts: "Facts") -> dict[str, Any]:
    orders: dict[str, Any] = {"file": [joint.name for joint in facts.model.joints if joint.moves]}
    for order in facts.simulator_orders:
        orders[order.key] = {
            "joints": list(order.joints),
            "bodies": list(order.bodies),
            "certain": order.certain,
            "reason": order.reason,
        }
    return orders


def _loaded_robot(robot: "LoadedRobot") -> dict[str, Any]:
    return {
        "total_mass": number(robot.mass),
        "bodies": len(robot.bodies),
        "merged": dict(robot.merged),
        "feet": list(robot.feet),
        "lost": list(robot.losses),
    }


def _leg(leg: "Leg") -> dict[str, Any]:
    pairs = zip(leg.joints, leg.roles, strict=True)
    return {
        "foot": leg.foot,
        "length": number(leg.length),
        "joints": [{"name": joint.name, "role": role} for joint, role in pairs],
    }


def _mirrored_joints(facts: "Facts") -> list[dict[str, Any]]:
    pairs = []
    for pair in facts.mirror.pairs:
        left, right = facts.bodies[pair.left].joint, facts.bodies[pair.right].joint
        if left is not None and right is not None and left.moves and right.moves:
            pairs.append({"left": left.name, "right": right.name, "sign": pair.sign})
    return pairs


def _standing(facts: "Facts") -> dict[str, Any]:
    stance = facts.stance
    if stance is None:
        keys = ("standing_pose", "standing_height", "spawn_height", "standing_width")
        return dict.fromkeys((*keys, "support_polygon", "support_margin", "holding_torques"))
    with np.errstate(all="ignore"):  # a rule reports lengths of 1e308
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
