"""Compute the stiffness that each joint requires, within its effort limit and the time step.

The effort limit must not be reached at a small error. A joint whose inertia is too small for the
required stiffness gets an armature.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.legs import mean_length
from terrainkit_robots.analysis.legs.stance import GRAVITY, is_statically_stable
from terrainkit_robots.description.model import PRISMATIC, JointUnits
from terrainkit_robots.simulation.gain import GainSet
from terrainkit_robots.simulation.sim_model import TIME_STEP, SimModel
from terrainkit_robots.simulation.time_step import (
    JointInertia,
    max_stable_stiffness,
    min_stable_inertia,
)

_UPRIGHT_FACTOR = 1.5
"""Stiffness of a leg over m g l / n, the rate at which gravity tips it over: weight times leg
length over the number of legs. A weaker spring does not hold it upright."""

_TRAIN_FACTOR = 0.36
"""Stiffness for training over weight times leg length. It is 0.30 to 0.39 for the gains that a1 and
go2 (20), h1 (150) and g1 (80 to 100) are trained with, and 0.24 for anymal_c (80)."""

_MIN_LEG_ERROR = 1.0
"""Error at which a joint of a leg reaches its effort limit, at least [rad]. Published gains of all
robots are close to it; a stiffer leg saturates in every step."""

_MIN_ERROR = 0.5
"""The same for arms, hands and waists, which track positions [rad]."""

_MAX_LEG_SAG = 0.09
"""Deflection of a joint in the standing pose, at most [rad]. Bent legs bend further as they sag:
a1, go2 and the bundled quadruped collapse from 0.13 rad on, with any damping."""

_MIN_HOLDING_ERROR = 0.3
"""Error at which the holding torque may reach the effort limit [rad]; anymal_c and b1 need it."""

_MAX_SAG = 0.02
"""Deflection of a horizontal limb under its own weight, at most [rad]: 1 degree."""

_MIN_FREQUENCY = 20.0
"""Natural frequency of a joint without load, such as a steering joint, at least [rad/s]."""

_BALANCE_FREQUENCY = 3.0
"""Natural frequency of a leg's joint without load over sqrt(g / leg length), at least, on two legs.
A slower servo does not catch the robot, which tips over at that rate. It is 3.0 and 3.2 for Open
Duck Mini and OP3, and 3 to 20 for larger robots that walk. MicroDuck, with 1.5, did not learn to
walk (benchmarks/results/policies.md)."""

_LEVER = 0.1
"""Lever at which a prismatic joint corresponds to a revolute one [m]: 1 rad is 0.1 m."""

_MIN_STIFFNESS_SHARE = 0.75
"""If a joint is stable at less than this share of the required stiffness, it gets an armature."""


@dataclass(frozen=True, kw_only=True)
class GainTarget:
    """The stiffness of similar joints, before rounding."""

    joints: tuple[str, ...]
    stiffness: float
    reason: str

    inertia: float
    """Smallest inertia of the joints when all others are free, including the armature."""

    armature: float
    """Declared or added armature."""

    units: JointUnits

    extra_armature: bool = False
    """Whether the armature is added."""


@dataclass(frozen=True, kw_only=True)
class _RequiredStiffness:
    """A stiffness that a task requires."""

    stiffness: float
    task: str

    min_error: float = _MIN_ERROR
    """Error at which the joint may reach its effort limit, at least [rad]; for a prismatic joint
    divided by the lever."""


def leg_gain_target(
    facts: Facts,
    sim: SimModel,
    inertia: Mapping[str, JointInertia],
    joints: Sequence[str],
    gain_set: GainSet = "stand",
) -> GainTarget:
    """Return the target of joints of legs with the same role and units."""
    count = len(facts.legs)
    weight = float(sim.model.body_subtreemass[0]) * GRAVITY
    length = mean_length(facts.legs)
    units = sim.units(joints[0])
    if units == PRISMATIC:
        stiffness, min_error = weight / count / (_MAX_LEG_SAG * length), _MIN_ERROR
        task = f"to sink by {_MAX_LEG_SAG:.0%} of the leg under the weight"
    elif gain_set == "train":
        stiffness, min_error = _TRAIN_FACTOR * weight * length, _MIN_LEG_ERROR
        task = f"{_TRAIN_FACTOR:g} x weight x leg length"
    else:
        stiffness, min_error = _UPRIGHT_FACTOR * weight * length / count, _MIN_LEG_ERROR
        task = f"{_UPRIGHT_FACTOR:g} x weight x leg length / {count} legs"
    required = [_RequiredStiffness(stiffness=stiffness, task=task, min_error=min_error)]
    holds_pose = gain_set == "stand" or units == PRISMATIC
    if holds_pose and facts.stance is not None and is_statically_stable(facts.legs):
        required.append(_stance_stiffness(facts.stance.torques, sim, units))
    frequency = balance_frequency(facts, sim)
    if frequency and units != PRISMATIC:
        slowest = max(inertia[name].free for name in joints)
        task = f"for a natural frequency of {frequency:.3g} rad/s, {_BALANCE_FREQUENCY:g} times "
        task += "sqrt(g / leg length)"
        required.append(_RequiredStiffness(stiffness=frequency**2 * slowest, task=task))
    return _make_target(sim, inertia, joints, required)


def balance_frequency(facts: Facts, sim: SimModel) -> float:
    """Return the natural frequency that joints of legs need to balance a robot [rad/s].

    It is 0 for a robot that nothing has to balance: without legs, with three or more, on a fixed
    base, or on wheels.
    """
    has_wheels = any(leg.limb.has_wheel for leg in facts.legs)
    if not facts.legs or is_statically_stable(facts.legs) or has_wheels or not sim.base_dofs:
        return 0.0
    return _BALANCE_FREQUENCY * math.sqrt(GRAVITY / mean_length(facts.legs))


def _stance_stiffness(
    torques: Mapping[str, float], sim: SimModel, units: JointUnits
) -> _RequiredStiffness:
    """Return the stiffness for the largest holding torque of the joints with these units."""
    same_units = (name for name in torques if sim.units(name) == units)
    torque = max((abs(torques[name]) for name in same_units), default=0.0)
    sag = _MAX_LEG_SAG * _length_scale(units)
    task = f"to hold {torque:.2g} {units.effort} in the standing pose within {sag:g} "
    return _RequiredStiffness(
        stiffness=torque / sag, task=task + units.position, min_error=_MIN_HOLDING_ERROR
    )


def other_gain_target(
    sim: SimModel, inertia: Mapping[str, JointInertia], joints: Sequence[str]
) -> GainTarget:
    """Return the target of a joint that is not part of a leg, and of its mirror image."""
    units = sim.units(joints[0])
    sag = _MAX_SAG * _length_scale(units)
    # A spring k deflects by load / k, and oscillates at sqrt(k / inertia).
    load = max(_max_gravity_load(sim, name) for name in joints)
    dynamic = _MIN_FREQUENCY**2 * max(inertia[name].locked for name in joints)
    required = [
        _RequiredStiffness(
            stiffness=load / sag,
            task=f"to hold its own {load:.2g} {units.effort} within {sag:g} {units.position}",
        ),
        _RequiredStiffness(
            stiffness=dynamic, task=f"for a natural frequency of {_MIN_FREQUENCY:g} rad/s"
        ),
    ]
    return _make_target(sim, inertia, joints, required)


def _length_scale(units: JointUnits) -> float:
    """Return the factor from angles to positions of a joint: [m/rad] or 1."""
    return _LEVER if units == PRISMATIC else 1.0


def _make_target(
    sim: SimModel,
    inertia: Mapping[str, JointInertia],
    joints: Sequence[str],
    required: Sequence[_RequiredStiffness],
) -> GainTarget:
    """Return the largest required stiffness within the effort limit and the time step."""
    effort = min(sim.effort_limit(name) for name in joints)
    units = sim.units(joints[0])
    stiffness, reason = max(_limit_by_effort(need, effort, units) for need in required)
    if not math.isfinite(stiffness):
        raise CannotCheckError(f"the load of joint {joints[0]} is too large to compute its gains")
    free = min(inertia[name].free for name in joints)
    armature = max(float(sim.model.joint(name).armature[0]) for name in joints)
    stable = max_stable_stiffness(free)
    extra_armature = stable < _MIN_STIFFNESS_SHARE * stiffness
    if extra_armature:
        # Armature adds to the inertia of its own joint, so the missing inertia is the missing
        # armature. It is rounded up to one digit; the 0.1 % absorb rounding errors.
        required_armature = armature + min_stable_inertia(stiffness) - free
        scale = 10.0 ** math.floor(math.log10(required_armature))
        rounded_up = (s * scale for s in (1, 2, 3, 5, 10) if s * scale >= 0.999 * required_armature)
        added = float(f"{next(rounded_up):.1g}") - armature
        free, armature = free + added, armature + added
    elif stable < stiffness:
        stiffness = stable
        reason = (
            f"stability limit at a time step of {1000 * TIME_STEP:g} ms, {free:.2g} {units.inertia}"
        )
    return GainTarget(
        joints=tuple(joints),
        stiffness=stiffness,
        reason=reason,
        inertia=free,
        armature=armature,
        units=units,
        extra_armature=extra_armature,
    )


def _limit_by_effort(
    required: _RequiredStiffness, effort: float, units: JointUnits
) -> tuple[float, str]:
    error = required.min_error * _length_scale(units)
    limit = effort / error
    if required.stiffness <= limit:
        return required.stiffness, f"{required.task} = {required.stiffness:.3g}"
    limit_text = f"its effort limit of {effort:.3g} {units.effort}"
    return limit, f"{limit_text} at an error of {error:g} {units.position}"


def _max_gravity_load(sim: SimModel, name: str) -> float:
    """Return an upper bound of gravity's torque on a joint [N m], or force [N], over all poses.

    Each mass contributes at most its weight times the length of the chain from the joint to it.
    """
    model = sim.model
    body = int(model.joint(name).bodyid[0])
    if sim.units(name) == PRISMATIC:
        return float(model.body_subtreemass[body]) * GRAVITY
    distances = {body: float(np.linalg.norm(model.joint(name).pos))}
    for index in range(body + 1, model.nbody):
        parent = int(model.body_parentid[index])
        if parent in distances:
            distances[index] = distances[parent] + float(np.linalg.norm(model.body_pos[index]))
    total = 0.0
    for index, distance in distances.items():
        # By the triangle inequality, no pose moves the mass further from the axis than this.
        lever = distance + float(np.linalg.norm(model.body_ipos[index]))
        total += float(model.body_mass[index]) * lever
    return total * GRAVITY
