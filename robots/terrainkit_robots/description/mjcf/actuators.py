"""Read the force limits and gains of MJCF actuators."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from terrainkit_robots.description.mjcf.compiled_bodies import JointScale
from terrainkit_robots.description.mjcf.tree import Node
from terrainkit_robots.description.model import Actuator, PositionGains


def read_actuators(
    spec: mujoco.MjSpec, node_of: Callable[[Any], Node], scales: Mapping[str, JointScale]
) -> Iterator[Actuator]:
    """Yield the actuators of a model.

    Args:
        spec: The parsed spec.
        node_of: Function that returns the node of a MuJoCo element.
        scales: Factors of the frames around each joint, by name.
    """
    joints = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    for actuator in spec.actuators:
        node = node_of(actuator)
        gear = float(actuator.gear[0])
        joint = actuator.target if actuator.trntype in joints else ""
        scale = scales.get(joint, JointScale())
        control, autolimits = actuator.ctrlrange, actuator.compiler.autolimits
        command = _max_magnitude(actuator.ctrllimited, control, autolimits)
        commanded = None if "plugin" in node.written else _commanded_force(actuator, command)
        limit = _max_magnitude(actuator.forcelimited, actuator.forcerange, autolimits)
        force = min((f for f in (commanded, limit) if f is not None), default=None)
        stiffness = _stiffness(actuator, gear)
        low, high = sorted(float(end) / (gear or 1.0) for end in control)
        yield Actuator(
            name=actuator.name or (f"{joint}_actuator" if joint else node.tag),
            source=node.source,
            joint=joint,
            effort=None if force is None else force * abs(gear) * scale.force,
            armature=float(getattr(actuator, "armature", 0.0)) * gear**2 * scale.armature,
            gear=gear,
            stiffness=None if stiffness is None else stiffness * scale.armature,
            # A positive value is a damping ratio.
            damping=-float(actuator.biasprm[2]) * gear**2 * scale.armature
            if actuator.biasprm[2] < 0
            else 0.0,
            commands=None if commanded is None else (float(control[0]), float(control[1])),
            targets=(low, high) if stiffness and command is not None and gear else None,
        )


def _commanded_force(actuator: Any, command: float | None) -> float | None:
    """Return the force of the largest command; None if commands do not limit the force.

    The force of a servo also depends on the joint position, so that no command limits it.
    """
    direct = actuator.dyntype in (
        mujoco.mjtDyn.mjDYN_NONE,
        mujoco.mjtDyn.mjDYN_FILTER,
        mujoco.mjtDyn.mjDYN_FILTEREXACT,
    )
    constant = actuator.gaintype == mujoco.mjtGain.mjGAIN_FIXED
    free = actuator.biastype == mujoco.mjtBias.mjBIAS_NONE or not np.any(actuator.biasprm)
    if command is None or not (direct and constant and free):
        return None
    force = command * abs(float(actuator.gainprm[0]))
    return force if math.isfinite(force) else None


def _stiffness(actuator: Any, gear: float) -> float | None:
    """Return the position gain on the joint; None if the actuator does not control a position."""
    fixed = actuator.gaintype == mujoco.mjtGain.mjGAIN_FIXED
    affine = actuator.biastype == mujoco.mjtBias.mjBIAS_AFFINE
    gain = float(actuator.gainprm[0])
    is_position = fixed and affine and gain > 0 and float(actuator.biasprm[1]) == -gain
    return gain * gear**2 if is_position else None


def _max_magnitude(limited: Any, bounds: Sequence[float], autolimits: bool) -> float | None:
    """Return the largest absolute value of a range; None if the range is not active."""
    low, high = map(float, bounds)
    states = mujoco.mjtLimited
    holds = limited == states.mjLIMITED_TRUE or (
        limited == states.mjLIMITED_AUTO and autolimits and low < high
    )
    largest = max(abs(low), abs(high))
    return largest if holds and math.isfinite(largest) else None


def force_limit(joint: Any, actuators: Sequence[Actuator], factor: float) -> float | None:
    """Return the maximum effort of the actuators of a joint; None if unlimited.

    Args:
        joint: The MuJoCo joint.
        actuators: Its actuators.
        factor: Factor of the frames around the joint on its own limit.
    """
    own = _max_magnitude(joint.actfrclimited, joint.actfrcrange, joint.compiler.autolimits)
    limits = [] if own is None else [own * factor]
    efforts = [actuator.effort for actuator in actuators if actuator.effort is not None]
    if actuators and len(efforts) == len(actuators):
        limits.append(sum(efforts))
    return min(limits, default=None)


def position_gains(actuators: Sequence[Actuator]) -> PositionGains | None:
    """Return the sum of the gains of the position actuators of a joint; None if it has none."""
    servos = [actuator for actuator in actuators if actuator.stiffness]
    if not servos:
        return None
    return PositionGains(
        source=servos[0].source,
        stiffness=sum(actuator.stiffness or 0.0 for actuator in servos),
        damping=sum(actuator.damping for actuator in actuators) or None,
    )
