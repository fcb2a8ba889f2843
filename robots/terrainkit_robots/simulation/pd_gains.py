"""Compute PD gains for each joint, with the reason.

The stiffness follows from the loads of a joint, and is capped by its effort limit and the time
step. The damping is critical. Similar joints share one rounded value. The constants were compared
with the gains that a1, go2, cassie, h1 and g1 are trained with in legged_gym, walk-these-ways,
unitree_rl_gym and Isaac Lab. The results for bipeds are close. Quadrupeds get 1.5 to 3 times the
stiffness, and more the lower they stand: with the 20 N m/rad of a go2 or the 80 of an anymal_c,
legs that are bent as much as here collapse without a policy. The gain set `train` is as soft as
these.
"""

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from terrainkit_robots.analysis.facts import Facts, cached_fact
from terrainkit_robots.analysis.legs.wheels import turns_without_limits
from terrainkit_robots.simulation.gain import Gain, GainSet
from terrainkit_robots.simulation.sim_model import TIME_STEP, SimModel, make_sim_model
from terrainkit_robots.simulation.stiffness import GainTarget, leg_gain_target, other_gain_target
from terrainkit_robots.simulation.time_step import JointInertia, joint_inertia

if TYPE_CHECKING:
    from terrainkit_robots.description.model import JointUnits

_MIN_STIFFNESS_RATIO = 20.0
"""Stiffness over damping, at least [1/s]. A joint with more damping returns too slowly."""

_TRAIN_STIFFNESS_RATIO = 40.0
"""The same ratio for training, as in legged_gym for a1 (20 and 0.5) and anymal_c (80 and 2)."""

_MAX_SIMILAR_RATIO = 1.3
"""Joints of legs whose stiffness differs by a smaller factor share one value."""

_WHEEL_TIME_CONSTANT = 0.05
"""Time constant of the velocity of a wheel without effort or velocity limit [s]."""

_MAX_WHEEL_DAMPING = 0.5
"""Damping times the time step over the inertia of a wheel, at most. From 2 on it diverges."""

_MANTISSAS = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
"""Leading digits of a rounded gain."""

_Groups = dict[tuple[str, str], list[str]]


@cached_fact
def suggest_gains(facts: Facts) -> Mapping[str, Gain]:
    """Return gains for each actuated joint, in actuator order, that hold the default pose.

    Raises:
        CannotCheckError: if the robot cannot be simulated.
    """
    return _compute_gains(facts, "stand")


@cached_fact
def suggest_training_gains(facts: Facts) -> Mapping[str, Gain]:
    """Return gains for each actuated joint, in actuator order, with softer legs for training.

    The armature is at least that of `suggest_gains`, which DYN004 asks for: it belongs to the
    motor, not to the gains.

    Raises:
        CannotCheckError: if the robot cannot be simulated.
    """
    stiff = suggest_gains(facts)
    return {
        name: replace(gain, armature=max(gain.armature, stiff[name].armature))
        for name, gain in _compute_gains(facts, "train").items()
    }


def _compute_gains(facts: Facts, gain_set: GainSet) -> Mapping[str, Gain]:
    sim = make_sim_model(facts)
    inertia = joint_inertia(sim)
    wheels = _wheels(facts, sim)
    found = {name: _wheel_gain(facts, sim, inertia, name) for name in wheels}
    legs, others = _group_joints(facts, [name for name in sim.actuated if name not in wheels])
    leg_targets = {
        key: leg_gain_target(facts, sim, inertia, joints, gain_set) for key, joints in legs.items()
    }
    ratio = _MIN_STIFFNESS_RATIO if gain_set == "stand" else _TRAIN_STIFFNESS_RATIO
    for target in _merge_similar(leg_targets):
        found |= dict.fromkeys(target.joints, _make_gain(target, target.inertia, ratio))
    # Other joints of the same stiffness get the same damping.
    similar: dict[tuple[float, float, JointUnits], list[GainTarget]] = defaultdict(list)
    for joints in others.values():
        target = other_gain_target(sim, inertia, joints)
        similar[_round(target.stiffness), target.armature, target.units].append(target)
    for targets in similar.values():
        lightest = min(target.inertia for target in targets)
        for target in targets:
            found |= dict.fromkeys(target.joints, _make_gain(target, lightest))
    return {name: found[name] for name in sim.actuated}


def _make_gain(target: GainTarget, inertia: float, min_ratio: float = _MIN_STIFFNESS_RATIO) -> Gain:
    stiffness = _round(target.stiffness)
    # The roots of inertia s^2 + d s + k coincide at d = 2 sqrt(k inertia).
    critical = 2 * math.sqrt(target.stiffness * inertia)
    limit = target.stiffness / min_ratio
    reason = f"kp {target.reason}; kd " + (
        f"critical for the lightest inertia of these joints, {inertia:.2g} {target.units.inertia}"
        if critical <= limit
        else f"kp / {min_ratio:g}, below critical for a fast response"
    )
    if target.extra_armature:
        reason += f"; armature for stability at a time step of {1000 * TIME_STEP:g} ms"
    return Gain(
        stiffness=stiffness,
        damping=_round(min(critical, limit)),
        armature=target.armature,
        reason=reason,
    )


def _round(value: float) -> float:
    """Return the closest number whose leading digits are one of `_MANTISSAS`."""
    if not 0 < value < math.inf:
        return 0.0
    scale = 10.0 ** math.floor(math.log10(value))
    # Closest by ratio, since gains span several orders of magnitude.
    best = min(_MANTISSAS, key=lambda m: abs(math.log(m * scale / value)))
    return float(f"{best * scale:.2g}")


def _group_joints(facts: Facts, joints: Sequence[str]) -> tuple[_Groups, _Groups]:
    """Return the joints of legs by section and role, and other joints with their mirror images."""
    legs: _Groups = defaultdict(list)
    others: _Groups = defaultdict(list)
    sections = _sections(facts)
    for name in joints:
        if name in sections:
            legs[sections[name]].append(name)
        else:
            others[min(name, _mirror_joint(facts, name, joints) or name), ""].append(name)
    return legs, others


def _mirror_joint(facts: Facts, name: str, joints: Sequence[str]) -> str | None:
    """Return the mirrored joint, if it is of the same type and one of `joints`."""
    body = facts.body_of_joint.get(name)
    counterpart = facts.mirror.image_body(body.index) if body is not None else None
    if body is None or body.joint is None or counterpart is None:
        return None
    other = facts.bodies[counterpart[0]].joint
    if other is None or other.kind != body.joint.kind or other.name not in joints:
        return None
    return other.name


def _sections(facts: Facts) -> dict[str, tuple[str, str]]:
    """Return section and role of each joint of the legs. Past the knee all are ankle joints."""
    found: dict[str, tuple[str, str]] = {}
    for leg in facts.legs:
        section = "hip"
        for joint, role in zip(leg.joints, leg.roles, strict=True):
            if role == "knee":
                found[joint.name] = "knee", role
                section = "ankle"
            elif role not in ("waist", "wheel"):
                is_ankle = section == "ankle" and role != "slide"
                found[joint.name] = section, "ankle" if is_ankle else role
    return found


def _merge_similar(targets: Mapping[tuple[str, str], GainTarget]) -> Iterable[GainTarget]:
    """Return targets with one stiffness for all joints of a leg, or of a section, if similar."""
    found = [target for (_, role), target in targets.items() if role == "slide"]
    revolute = {key: target for key, target in targets.items() if key[1] != "slide"}
    if _are_similar(revolute.values()):
        return [*found, *_merge(revolute.values())]
    for section in dict.fromkeys(section for section, _ in revolute):
        part = [target for (of, _), target in revolute.items() if of == section]
        found += _merge(part) if _are_similar(part) else part
    return found


def _are_similar(targets: Iterable[GainTarget]) -> bool:
    values = [target.stiffness for target in targets]
    return bool(values) and max(values) <= _MAX_SIMILAR_RATIO * min(values)


def _merge(targets: Iterable[GainTarget]) -> list[GainTarget]:
    """Return targets with the same stiffness, armature and inertia."""
    lowest = min(targets, key=lambda target: target.stiffness)
    armature = max(target.armature for target in targets)
    inertia = min(target.inertia + armature - target.armature for target in targets)
    return [
        replace(
            target,
            stiffness=lowest.stiffness,
            reason=lowest.reason,
            inertia=inertia,
            armature=armature,
            extra_armature=any(target.extra_armature for target in targets),
        )
        for target in targets
    ]


def _wheels(facts: Facts, sim: SimModel) -> frozenset[str]:
    """Return the actuated joints that turn a wheel at the end of a leg, or elsewhere."""
    legs = {joint.name for leg in facts.legs for joint in (*leg.joints, *leg.branches)}

    def is_wheel(name: str) -> bool:
        body = facts.body_of_joint.get(name)
        if body is None or body.joint is None:
            return False
        is_other = name not in legs and turns_without_limits(body.joint) and facts.is_wheel(body)
        return body.index in facts.wheels or is_other

    return frozenset(filter(is_wheel, sim.actuated))


def _wheel_gain(
    facts: Facts, sim: SimModel, inertia: Mapping[str, JointInertia], name: str
) -> Gain:
    """Return the gains of a wheel, which control its velocity."""
    joint = facts.body_of_joint[name].joint
    assert joint is not None
    effort = sim.effort_limit(name)
    velocity = joint.limit.velocity if joint.limit else None
    free = inertia[name].free
    # Explicit damping multiplies the velocity by 1 - d h / inertia in each step.
    limit = _MAX_WHEEL_DAMPING * free / TIME_STEP
    if math.isfinite(effort) and velocity is not None and 0 < velocity < math.inf:
        damping = effort / velocity
        reason = f"its effort limit of {effort:.3g} N m at an error of its maximum velocity"
    else:
        damping = free / _WHEEL_TIME_CONSTANT
        reason = f"a time constant of {_WHEEL_TIME_CONSTANT:g} s"
    if damping > limit:
        damping = limit
        reason = f"stability limit at a time step of {1000 * TIME_STEP:g} ms, {free:.2g} kg m2"
    return Gain(
        stiffness=0.0,
        damping=_round(damping),
        armature=float(sim.model.joint(name).armature[0]),
        reason=f"kp 0, because the target of a wheel is a velocity; kd {reason}",
    )
