"""Read the force limits and gains of MJCF actuators."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.description.mjcf.tree import Node
from terrainkit_robots.description.model import Actuator, PositionGains, Source

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True, kw_only=True)
class ActuatorData:
    """An actuator, before the frames around its joint scale it."""

    name: str
    source: Source

    joint: str
    """Name of the joint; empty if the actuator acts on something else."""

    effort: float | None
    """Maximum torque [N m] or force [N] on the joint; None if unlimited."""

    armature: float
    """Inertia that it adds to the armature of the joint [kg m2] or [kg]."""

    gear: float
    """Force on the joint divided by the force of the actuator."""

    stiffness: float | None
    """Position gain on the joint [N m/rad] or [N/m]; None if it is not a position actuator."""

    damping: float | None
    """Derivative gain on the joint [N m s/rad] or [N s/m]; None if it is 0 or a ratio."""

    commands: tuple[float, float] | None
    """Range of the commanded force; None if it is unlimited or commands something else."""

    targets: tuple[float, float] | None
    """Range of the target position of the joint [rad] or [m]; None if it is unlimited or commands
    something else."""

    def to_actuator(self, factor: float, max_effort: float | None) -> Actuator:
        """Return the actuator of the model.

        Args:
            factor: Factor on its force.
            max_effort: Limit of the joint on actuator forces; None if there is none.
        """
        effort = None if self.effort is None else self.effort * factor
        if max_effort is not None:
            effort = max_effort if effort is None else min(effort, max_effort)
        return Actuator(
            name=self.name,
            source=self.source,
            joint=self.joint,
            effort=effort,
            gear=self.gear,
            stiffness=None if self.stiffness is None else self.stiffness * factor,
            commands=self.commands,
            targets=self.targets,
        )


def read_actuators(spec: "mujoco.MjSpec", node_of: Callable[[Any], Node]) -> Iterator[ActuatorData]:
    """Yield the actuators of a model; `node_of` returns the node of a MuJoCo element."""
    import mujoco

    joints = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    for actuator in spec.actuators:
        node = node_of(actuator)
        gear = float(actuator.gear[0])
        joint = actuator.target if actuator.trntype in joints else ""
        commanded = None if "plugin" in node.written else _max_commanded_force(actuator)
        limit = _max_magnitude(
            actuator.forcelimited, actuator.forcerange, actuator.compiler.autolimits
        )
        force = min((f for f in (commanded, limit) if f is not None), default=None)
        stiffness, control = _stiffness(actuator, gear), actuator.ctrlrange
        is_limited = (
            _max_magnitude(actuator.ctrllimited, control, actuator.compiler.autolimits) is not None
        )
        low, high = sorted(float(end) / (gear or 1.0) for end in control)
        yield ActuatorData(
            name=actuator.name or (f"{joint}_actuator" if joint else node.tag),
            source=node.source,
            joint=joint,
            effort=None if force is None else force * abs(gear),
            armature=float(getattr(actuator, "armature", 0.0)) * gear**2,
            gear=gear,
            stiffness=stiffness,
            # A positive value is a damping ratio.
            damping=-float(actuator.biasprm[2]) * gear**2 if actuator.biasprm[2] < 0 else None,
            commands=None if commanded is None else (float(control[0]), float(control[1])),
            targets=(low, high) if stiffness and is_limited and gear else None,
        )


def _max_commanded_force(actuator: Any) -> float | None:
    """Return the largest force that a command can request; None if commands do not limit it.

    The force of a servo also depends on the joint position, so that no command limits it.
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
    command = _max_magnitude(actuator.ctrllimited, actuator.ctrlrange, actuator.compiler.autolimits)
    force = None if command is None else command * abs(float(actuator.gainprm[0]))
    return force if force is None or math.isfinite(force) else None


def _stiffness(actuator: Any, gear: float) -> float | None:
    """Return the position gain on the joint; None if the actuator does not control a position."""
    import mujoco

    fixed = actuator.gaintype == mujoco.mjtGain.mjGAIN_FIXED
    affine = actuator.biastype == mujoco.mjtBias.mjBIAS_AFFINE
    gain = float(actuator.gainprm[0])
    is_position = fixed and affine and gain > 0 and float(actuator.biasprm[1]) == -gain
    return gain * gear**2 if is_position else None


def _max_magnitude(limited: Any, bounds: Sequence[float], autolimits: bool) -> float | None:
    """Return the largest absolute value of a range; None if the range is not active."""
    import mujoco

    low, high = map(float, bounds)
    states = mujoco.mjtLimited
    holds = limited == states.mjLIMITED_TRUE or (
        limited == states.mjLIMITED_AUTO and autolimits and low < high
    )
    largest = max(abs(low), abs(high))
    return largest if holds and math.isfinite(largest) else None


def force_limit(joint: Any, actuators: Sequence[ActuatorData], factor: float) -> float | None:
    """Return the maximum effort of the actuators of a joint; None if unlimited.

    Args:
        joint: The MuJoCo joint.
        actuators: Its actuators.
        factor: Factor of the frames around the joint on forces.
    """
    limits = [
        _max_magnitude(joint.actfrclimited, joint.actfrcrange, joint.compiler.autolimits),
        sum(actuator.effort for actuator in actuators if actuator.effort is not None)
        if actuators and all(actuator.effort is not None for actuator in actuators)
        else None,
    ]
    known = [limit for limit in limits if limit is not None]
    return min(known) * factor if known else None


def position_gains(actuators: Sequence[ActuatorData], factor: float) -> PositionGains | None:
    """Return the sum of the gains of the position actuators of a joint; None if it has none.

    Args:
        actuators: The actuators of the joint.
        factor: Factor of the frames around the joint on gains.
    """
    servos = [actuator for actuator in actuators if actuator.stiffness]
    damping = factor * sum(actuator.damping or 0.0 for actuator in actuators)
    if not servos:
        return None
    return PositionGains(
        source=servos[0].source,
        stiffness=factor * sum(actuator.stiffness or 0.0 for actuator in servos),
        damping=damping or None,
    )
