"""Actuators of MJCF: how much force each can put on a joint, and which joints follow others."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.description.mjcf.document import Node
from terrainkit_robots.description.model import Actuator, Mimic, Source

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True, kw_only=True)
class Drive:
    """An actuator before the frames around its joint scale it."""

    name: str
    source: Source

    joint: str
    """Name of the joint; empty if it drives something else."""

    effort: float | None
    """Largest torque [N m] or force [N] that it puts on the joint; None if it is unlimited."""

    armature: float
    """What it adds to the reflected inertia of the joint [kg m2] or [kg]."""

    def actuator(self, factor: float, most: float | None) -> Actuator:
        """Return the actuator, with its force times `factor`, of which the joint lets `most` by."""
        effort = None if self.effort is None else self.effort * factor
        if most is not None:
            effort = most if effort is None else min(effort, most)
        return Actuator(name=self.name, source=self.source, joint=self.joint, effort=effort)


def actuators(spec: "mujoco.MjSpec", node_of: Callable[[Any], Node]) -> Iterator[Drive]:
    """Yield the actuators of a model; `node_of` tells which element each one is."""
    import mujoco

    joints = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    for each in spec.actuators:
        node = node_of(each)
        gear = float(each.gear[0])
        joint = each.target if each.trntype in joints else ""
        force = None if "plugin" in node.written else _commanded(each)
        limit = _limit(each.forcelimited, each.forcerange, each.compiler.autolimits)
        force = limit if force is None else force if limit is None else min(force, limit)
        yield Drive(
            name=each.name or (f"{joint}_actuator" if joint else node.tag),
            source=node.source,
            joint=joint,
            effort=None if force is None else force * abs(gear),
            armature=float(getattr(each, "armature", 0.0)) * gear**2,
        )


def _commanded(actuator: Any) -> float | None:
    """Return the largest force that can be asked for: that of a motor with a range of commands.

    Where the force also hangs on where the joint is, as for a servo, no command limits it.
    """
    import mujoco

    direct = actuator.dyntype in (
        mujoco.mjtDyn.mjDYN_NONE,
        mujoco.mjtDyn.mjDYN_FILTER,
        mujoco.mjtDyn.mjDYN_FILTEREXACT,
    )
    constant = actuator.gaintype == mujoco.mjtGain.mjGAIN_FIXED
    free = actuator.biastype == mujoco.mjtBias.mjBIAS_NONE or not np.any(actuator.biasprm)
    if not (direct and constant and free):
        return None
    command = _limit(actuator.ctrllimited, actuator.ctrlrange, actuator.compiler.autolimits)
    force = None if command is None else command * abs(float(actuator.gainprm[0]))
    return force if force is None or math.isfinite(force) else None


def _limit(limited: Any, bounds: Sequence[float], automatic: bool) -> float | None:
    """Return the largest size of what lies between two bounds; None if they do not hold."""
    import mujoco

    low, high = map(float, bounds)
    states = mujoco.mjtLimited
    holds = limited == states.mjLIMITED_TRUE or (
        limited == states.mjLIMITED_AUTO and automatic and low < high
    )
    largest = max(abs(low), abs(high))
    return largest if holds and math.isfinite(largest) else None


def force_limit(joint: Any, drives: Sequence[Drive], factor: float) -> float | None:
    """Return the most that actuators can put on a joint, and that it lets through; None if no end.

    Args:
        joint: The joint.
        drives: Its actuators.
        factor: What the frames around it do to forces.
    """
    limits = [
        _limit(joint.actfrclimited, joint.actfrcrange, joint.compiler.autolimits),
        sum(drive.effort for drive in drives if drive.effort is not None)
        if drives and all(drive.effort is not None for drive in drives)
        else None,
    ]
    known = [limit for limit in limits if limit is not None]
    return min(known) * factor if known else None


def mimics(spec: "mujoco.MjSpec", node_of: Callable[[Any], Node]) -> dict[str, Mimic]:
    """Return what each joint follows that an equality ties to another, in proportion."""
    import mujoco

    joints = {joint.name: joint for joint in spec.joints}
    found: dict[str, Mimic] = {}
    for each in spec.equalities:
        follower, target = joints.get(each.name1), joints.get(each.name2)
        tied = each.type == mujoco.mjtEq.mjEQ_JOINT and each.active
        if not tied or follower is None or target is None or not each.name2:
            continue
        offset, factor, *higher = map(float, each.data[:5])
        if any(higher) or not (math.isfinite(offset) and math.isfinite(factor)):
            continue
        ends = [float(joint.ref) * _unit(joint) for joint in (follower, target)]
        found[each.name1] = Mimic(
            source=node_of(each).source,
            joint=each.name2,
            multiplier=factor,
            offset=offset + ends[0] - factor * ends[1],
        )
    return found


def _unit(joint: Any) -> float:
    import mujoco

    hinge = joint.type == mujoco.mjtJoint.mjJNT_HINGE
    return math.pi / 180 if hinge and joint.compiler.degree else 1.0
