"""Gains: stiffness and damping of a position controller for each joint, and why.

Stiffness comes from what a joint has to hold, and is capped by what its motor and the time step
bear; damping is critical. One round number serves all joints that are alike. The constants were
held against what a1, go2, cassie, h1 and g1 are trained with in legged_gym, walk-these-ways,
unitree_rl_gym and Isaac Lab: bipeds come out close to it. Quadrupeds come out 1.5 to 3 times as
stiff, the more the deeper they stand: with the 20 N m/rad of a go2 or the 80 of an anymal_c legs
that are bent like here sit down, unless a policy holds them up.
"""

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.cached_fact import per_robot
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.joint_roles import bodies_by_joint, is_wheel
from terrainkit_robots.simulation.sim_model import TIME_STEP, Plant, plant
from terrainkit_robots.simulation.stiffness import (
    Inertias,
    Wish,
    effort_in,
    leg_wish,
    other_wish,
)
from terrainkit_robots.simulation.time_step import joint_inertias
from terrainkit_robots.simulation.units import TURNING, Units, units_of

_QUICKEST = 20.0
"""Stiffness over damping, at least [1/s]: a joint that is damped more comes back too slowly."""

_ALIKE = 1.3
"""Joints of a leg whose stiffness differs by less than this factor share one."""

_WHEEL_TIME = 0.05
"""Time in which a wheel without declared effort or speed takes a new speed [s]."""

_WHEEL_SHARE = 0.5
"""Damping times the time step over a wheel's inertia, at most; from 2 on its speed diverges."""

_ROUND = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
"""What a suggested number may start with."""


@dataclass(frozen=True, kw_only=True)
class Gain:
    """A controller: torque = stiffness * (target - q) - damping * dq."""

    stiffness: float
    """[N m/rad] or [N/m]; 0 for a wheel, which is told a speed."""

    damping: float
    """[N m s/rad] or [N s/m]."""

    armature: float
    """Inertia of the rotor, reflected to the joint [kg m2] or [kg]: as declared, or more where the
    joint is too light for its gains without."""

    reason: str
    """How the numbers came about."""


@per_robot
def suggest_gains(facts: Facts) -> Mapping[str, Gain]:
    """Return a gain for each actuated joint, in the order of the actuators.

    Raises:
        CannotCheckError: if the robot cannot be simulated.
    """
    scene = plant(facts)
    inertias = joint_inertias(scene)
    wheels = _wheels(facts, scene)
    found = {name: _wheel(facts, scene, inertias, name) for name in wheels}
    legs, rest = _groups(facts, [name for name in scene.drives if name not in wheels])
    leg_wishes = {key: leg_wish(facts, scene, inertias, joints) for key, joints in legs.items()}
    for wish in _shared(leg_wishes):
        found |= dict.fromkeys(wish.joints, _gain(wish, wish.inertia))
    # Joints of arms that are equally stiff are damped alike.
    alike: dict[tuple[float, float, Units], list[Wish]] = defaultdict(list)
    for joints in rest.values():
        wish = other_wish(scene, inertias, joints)
        alike[_rounded(wish.stiffness), wish.armature, wish.units].append(wish)
    for wishes in alike.values():
        lightest = min(wish.inertia for wish in wishes)
        for wish in wishes:
            found |= dict.fromkeys(wish.joints, _gain(wish, lightest))
    return {name: found[name] for name in scene.drives}


def _gain(wish: Wish, inertia: float) -> Gain:
    stiffness = _rounded(wish.stiffness)
    critical = 2 * math.sqrt(wish.stiffness * inertia)
    most = wish.stiffness / _QUICKEST
    reason = f"kp {wish.reason}; kd " + (
        f"critical on the lightest inertia of such joints, {inertia:.2g} {wish.units.inertia}"
        if critical <= most
        else f"kp / {_QUICKEST:g}, less than critical, so that the joint is quick"
    )
    if wish.too_light:
        reason += f"; armature so that all bear kp at a time step of {1000 * TIME_STEP:g} ms"
    return Gain(
        stiffness=stiffness,
        damping=_rounded(min(critical, most)),
        armature=wish.armature,
        reason=reason,
    )


def _rounded(value: float) -> float:
    """Return the closest number that starts with one of _ROUND."""
    if not 0 < value < math.inf:
        return 0.0
    scale = 10.0 ** math.floor(math.log10(value))
    best = min(_ROUND, key=lambda start: abs(math.log(start * scale / value)))
    return float(f"{best * scale:.2g}")


# Which joints are alike.

_Groups = dict[tuple[str, str], list[str]]


def _groups(facts: Facts, joints: Sequence[str]) -> tuple[_Groups, _Groups]:
    """Return joints of legs by section and role, and others with their mirror images."""
    legs: _Groups = defaultdict(list)
    rest: _Groups = defaultdict(list)
    roles = _roles(facts)
    bodies = bodies_by_joint(facts)
    for name in joints:
        if name in roles:
            legs[roles[name]].append(name)
            continue
        rest[min(name, _twin_of(facts, bodies.get(name), joints) or name), ""].append(name)
    return dict(legs), dict(rest)


def _twin_of(facts: Facts, body: Body | None, joints: Sequence[str]) -> str | None:
    """Return the joint that mirrors that of a body, if it is one of those and of its kind."""
    twin = facts.mirror.twin(body.index) if body is not None else None
    if body is None or body.joint is None or twin is None:
        return None
    other = facts.bodies[twin[0]].joint
    alike = other is not None and other.kind == body.joint.kind and other.name in joints
    return other.name if other is not None and alike else None


def _roles(facts: Facts) -> dict[str, tuple[str, str]]:
    """Return section and role of each joint of the legs; past the knee all are of the ankle."""
    found: dict[str, tuple[str, str]] = {}
    for leg in facts.legs:
        section = "hip"
        for joint, role in zip(leg.joints, leg.roles, strict=True):
            if role == "knee":
                found[joint.name] = "knee", role
                section = "ankle"
            elif role == "waist":
                continue
            else:
                plain = section == "ankle" and role != "slide"
                found[joint.name] = section, "ankle" if plain else role
    return found


def _shared(wishes: Mapping[tuple[str, str], Wish]) -> Iterable[Wish]:
    """Return wishes of the same stiffness where those of a leg, or of a section, are close."""
    found = [wish for (_, role), wish in wishes.items() if role == "slide"]
    turning = {key: wish for key, wish in wishes.items() if key[1] != "slide"}
    if _close(turning.values()):
        return [*found, *_same(turning.values())]
    for section in dict.fromkeys(section for section, _ in turning):
        part = [wish for (of, _), wish in turning.items() if of == section]
        found += _same(part) if _close(part) else part
    return found


def _close(wishes: Iterable[Wish]) -> bool:
    values = [wish.stiffness for wish in wishes]
    return bool(values) and max(values) <= _ALIKE * min(values)


def _same(wishes: Iterable[Wish]) -> list[Wish]:
    """Return wishes with one stiffness, one armature and one inertia to be damped."""
    lowest = min(wishes, key=lambda wish: wish.stiffness)
    armature = max(wish.armature for wish in wishes)
    inertia = min(wish.inertia + armature - wish.armature for wish in wishes)
    return [
        replace(
            wish,
            stiffness=lowest.stiffness,
            reason=lowest.reason,
            inertia=inertia,
            armature=armature,
            too_light=any(wish.too_light for wish in wishes),
        )
        for wish in wishes
    ]


# Wheels.


def _wheels(facts: Facts, scene: Plant) -> frozenset[str]:
    """Return the actuated joints that spin without end what is balanced on them, but for legs'."""
    bodies = bodies_by_joint(facts)
    legs = {joint.name for leg in facts.legs for joint in leg.joints}
    return frozenset(
        name
        for name in scene.drives
        if name in bodies
        and name not in legs
        and not scene.model.joint(name).limited[0]
        and units_of(scene, name) == TURNING
        and is_wheel(facts, bodies[name])
    )


def _wheel(facts: Facts, scene: Plant, inertias: Inertias, name: str) -> Gain:
    """Return the gain of a wheel: of its speed alone."""
    joint = bodies_by_joint(facts)[name].joint
    assert joint is not None
    effort = effort_in(scene, name)
    speed = joint.limit.velocity if joint.limit else None
    inertia = inertias[name].free
    most = _WHEEL_SHARE * inertia / TIME_STEP
    if math.isfinite(effort) and speed is not None and 0 < speed < math.inf:
        damping = effort / speed
        reason = f"all of its effort of {effort:.3g} N m at an error of its top speed"
    else:
        damping = inertia / _WHEEL_TIME
        reason = f"it takes a new speed within {_WHEEL_TIME:g} s"
    if damping > most:
        damping = most
        reason = f"what a time step of {1000 * TIME_STEP:g} ms bears at {inertia:.2g} kg m2"
    return Gain(
        stiffness=0.0,
        damping=_rounded(damping),
        armature=float(scene.model.joint(name).armature[0]),
        reason=f"a wheel is told a speed, so kp is 0; kd: {reason}",
    )
