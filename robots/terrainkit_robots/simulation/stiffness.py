"""Stiffness: what each joint needs to hold itself and what it carries, and may have for that.

A need is capped by the effort of the motor, which is not to be spent on a small error, and by the
time step: a joint that is too light for what it needs is suggested an armature.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.stance import GRAVITY, stands_alone
from terrainkit_robots.simulation.sim_model import TIME_STEP, Plant
from terrainkit_robots.simulation.time_step import (
    JointInertia,
    needed_inertia,
    stable_stiffness,
)
from terrainkit_robots.simulation.units import SLIDING, Units, units_of

Inertias = Mapping[str, JointInertia]
"""Inertia of each joint in the standing pose, by name."""

_UPRIGHT = 1.5
"""Stiffness of a leg over m g l / n: weight times leg length over the number of legs is the rate at
which gravity tips a leg over, and a spring that is weaker does not hold it upright."""

_FULL_EFFORT_LEG = 1.0
"""Error at which a joint of a leg gives all of its effort [rad]. What people train with is close to
it on all robots; a stiffer leg saturates in every step."""

_FULL_EFFORT = 0.5
"""The same for arms, hands and waists, which are to be where they are told [rad]."""

_SAG_LEG = 0.09
"""How far a joint may give way in the standing pose [rad]. Legs that are bent bend on as they sag:
a1, go2 and the quadruped that comes along sit down from 0.13 rad on, however they are damped."""

_FULL_EFFORT_HOLDING = 0.3
"""What holding asks for may take more of the motor [rad]; anymal_c and b1 need it."""

_SAG = 0.02
"""How far a stretched limb may sag under its own weight [rad]: 1 degree."""

_BANDWIDTH = 20.0
"""Least natural frequency of a joint that holds no weight, such as a steering [rad/s]."""

_LEVER = 0.1
"""Lever at which a sliding joint does the same as a turning one [m]: what is said of 1 rad goes for
0.1 m."""

_LIGHT = 0.75
"""A joint that bears less than this share of the stiffness it needs is given an armature."""


@dataclass(frozen=True, kw_only=True)
class Wish:
    """What joints that are alike should have, before it is rounded."""

    joints: tuple[str, ...]
    stiffness: float
    reason: str

    inertia: float
    """Smallest of the joints, when all others give way, armature included."""

    armature: float
    """What is declared, or suggested."""

    units: Units
    """What the numbers of the joints are in."""

    too_light: bool = False
    """Whether the armature is suggested."""


@dataclass(frozen=True, kw_only=True)
class _Need:
    """A stiffness that a task asks for, and how much of the motor it may take."""

    stiffness: float
    why: str

    error: float
    """Error at which the joint gives all of its effort, at least [rad]; of one that slides, divided
    by the lever."""


def leg_wish(facts: Facts, scene: Plant, inertias: Inertias, joints: Sequence[str]) -> Wish:
    """Return what joints of legs need that are for the same, and all turn or all slide."""
    count = len(facts.legs)
    weight = float(scene.model.body_subtreemass[0]) * GRAVITY
    length = float(np.mean([leg.length for leg in facts.legs]))
    units = units_of(scene, joints[0])
    if units == SLIDING:
        needed = weight / count / (_SAG_LEG * length)
        why = f"to sink in by {_SAG_LEG:.0%} of the leg under the weight = {needed:.3g}"
        needs = [_Need(stiffness=needed, why=why, error=_FULL_EFFORT)]
    else:
        needed = _UPRIGHT * weight * length / count
        why = f"{_UPRIGHT:g} x weight x leg length / {count} legs = {needed:.3g}"
        needs = [_Need(stiffness=needed, why=why, error=_FULL_EFFORT_LEG)]
    if facts.stance is not None and stands_alone(facts):
        needs.append(_holding(facts.stance.torques, scene, units))
    return _wish(scene, inertias, joints, needs)


def _holding(torques: Mapping[str, float], scene: Plant, units: Units) -> _Need:
    """Return what the standing pose asks of joints with these units: as much as of the worst."""
    alike = (name for name in torques if units_of(scene, name) == units)
    held = max((abs(torques[name]) for name in alike), default=0.0)
    sag = _SAG_LEG * _lever(units)
    why = f"to hold {held:.2g} {units.push} in the standing pose within {sag:g} {units.place}"
    stiffness = held / sag
    return _Need(stiffness=stiffness, why=f"{why} = {stiffness:.3g}", error=_FULL_EFFORT_HOLDING)


def other_wish(scene: Plant, inertias: Inertias, joints: Sequence[str]) -> Wish:
    """Return what a joint needs that is none of a leg, and its mirror image."""
    units = units_of(scene, joints[0])
    sag = _SAG * _lever(units)
    held = max(_gravity(scene, name) for name in joints)
    brisk = _BANDWIDTH**2 * max(inertias[name].locked for name in joints)
    load = f"{held:.2g} {units.push}"
    holding = f"to hold its own {load} within {sag:g} {units.place} = {held / sag:.3g}"
    turning = f"for a natural frequency of {_BANDWIDTH:g} rad/s = {brisk:.3g}"
    needs = [
        _Need(stiffness=held / sag, why=holding, error=_FULL_EFFORT),
        _Need(stiffness=brisk, why=turning, error=_FULL_EFFORT),
    ]
    return _wish(scene, inertias, joints, needs)


def _lever(units: Units) -> float:
    """Return by what to multiply an angle to have what is said of a joint [m/rad], or 1."""
    return _LEVER if units == SLIDING else 1.0


def effort_in(scene: Plant, name: str) -> float:
    """Return the effort of an actuated joint [N m] or [N]; infinite if it is not limited."""
    actuator = scene.drives.index(name)
    limited = scene.model.actuator_forcelimited[actuator]
    return float(scene.model.actuator_forcerange[actuator, 1]) if limited else math.inf


def _wish(scene: Plant, inertias: Inertias, joints: Sequence[str], needs: Sequence[_Need]) -> Wish:
    """Return the most that is needed, as far as the motor and the time step bear it."""
    effort = min(effort_in(scene, name) for name in joints)
    units = units_of(scene, joints[0])
    needed, why = max(_within_effort(need, effort, units) for need in needs)
    if not math.isfinite(needed):
        raise CannotCheckError(f"what {joints[0]} carries is too heavy for any number")
    inertia = min(inertias[name].free for name in joints)
    armature = max(float(scene.model.joint(name).armature[0]) for name in joints)
    borne = stable_stiffness(inertia)
    too_light = borne < _LIGHT * needed
    if too_light:
        more = _rounded_up(armature + needed_inertia(needed) - inertia) - armature
        inertia, armature = inertia + more, armature + more
    elif borne < needed:
        needed = borne
        borne_by = f"{inertia:.2g} {units.inertia}"
        why = f"what a time step of {1000 * TIME_STEP:g} ms bears at {borne_by}"
    return Wish(
        joints=tuple(joints),
        stiffness=needed,
        reason=why,
        inertia=inertia,
        armature=armature,
        units=units,
        too_light=too_light,
    )


def _within_effort(need: _Need, effort: float, units: Units) -> tuple[float, str]:
    error = need.error * _lever(units)
    most = effort / error
    if need.stiffness <= most:
        return need.stiffness, need.why
    all_of_it = f"all of its effort of {effort:.3g} {units.push}"
    return most, f"{all_of_it} at an error of {error:g} {units.place}"


def _gravity(scene: Plant, name: str) -> float:
    """Return a bound of gravity's torque on a joint [N m], or force [N], in any pose.

    Each mass pulls at most with its weight times the length of the chain from the joint to it.
    """
    model = scene.model
    body = int(model.joint(name).bodyid[0])
    if units_of(scene, name) == SLIDING:
        return float(model.body_subtreemass[body]) * GRAVITY
    reach = {body: float(np.linalg.norm(model.joint(name).pos))}
    total = 0.0
    for index in range(body, model.nbody):
        parent = int(model.body_parentid[index])
        if index != body and parent not in reach:
            continue
        if index != body:
            reach[index] = reach[parent] + float(np.linalg.norm(model.body_pos[index]))
        lever = reach[index] + float(np.linalg.norm(model.body_ipos[index]))
        total += float(model.body_mass[index]) * lever
    return total * GRAVITY


def _rounded_up(value: float) -> float:
    """Return the next number that starts with 1, 2, 3 or 5."""
    scale = 10.0 ** math.floor(math.log10(value))
    return next(float(f"{s * scale:.1g}") for s in (1, 2, 3, 5, 10) if s * scale >= 0.999 * value)
