"""Named bodies: which bodies of a robot training calls base, thigh, shank and foot.

Frameworks merge fixed joints and keep the name of the link above them, so that a body is called as
its top link is; a foot on a fixed joint is kept as a body of its own.
"""

import re

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.legs import Leg

_UPPER_WORDS = frozenset({"head", "torso", "chest", "trunk", "neck"})
"""Words for what is above the legs of a biped, and must not touch the ground."""


def base_body(robot: Facts) -> Body | None:
    """Return the body that carries the limbs; None if there is no body."""
    return next((body for body in robot.bodies if not body.virtual), None)


def body_name(body: Body) -> str:
    """Return what simulators call a body: the first link of it that the file has."""
    return next((link for link in body.links if not link.virtual), body.top).name


def feet(robot: Facts) -> tuple[str, ...]:
    """Return the link on which each leg stands."""
    return tuple(leg.foot for leg in robot.legs)


def shanks(robot: Facts) -> tuple[str, ...]:
    """Return the body below each knee; a leg without a knee has none."""
    found = (_below_knee(robot, leg) for leg in robot.legs)
    return tuple(dict.fromkeys(body_name(body) for body in found if body is not None))


def thighs(robot: Facts) -> tuple[str, ...]:
    """Return the body that ends in each knee: of several between hip and knee the last."""
    found = []
    for leg in robot.legs:
        shank = _below_knee(robot, leg)
        thigh = robot.physical_parent(shank) if shank is not None else None
        if thigh is not None and thigh.index in leg.limb.chain:
            found.append(body_name(thigh))
    return tuple(dict.fromkeys(found))


def termination_contacts(robot: Facts) -> tuple[str, ...]:
    """Return the bodies that touch the ground when the robot has fallen.

    As in legged_gym the base; of two legs that carry a torso, that and a head, too.
    """
    base = base_body(robot)
    found = [] if base is None else [body_name(base)]
    if len(robot.legs) == 2:
        found += [body_name(body) for body in robot.bodies[1:] if _is_upper(robot, body)]
    return tuple(dict.fromkeys(found))


def penalized_contacts(robot: Facts) -> tuple[str, ...]:
    """Return thighs and shanks, but for shanks that are the feet."""
    standing = feet(robot)
    return tuple(name for name in (*thighs(robot), *shanks(robot)) if name not in standing)


def _below_knee(robot: Facts, leg: Leg) -> Body | None:
    knee = leg.joint("knee")
    if knee is None:
        return None
    start = robot.body_of_joint[knee.name].index
    chain = leg.limb.chain[leg.limb.chain.index(start) :]
    return next((robot.bodies[i] for i in chain if not robot.bodies[i].virtual), None)


def _is_upper(robot: Facts, body: Body) -> bool:
    """Return whether a body is a torso or a head: in the middle, above the legs, with a shape.

    A torso carries limbs on both sides; a head is known by its name.
    """
    if body.index in robot.leg_bodies or body.virtual or not body.collisions:
        return False
    if robot.mirror.counterpart(body.index) is not None:
        return False
    carried = _carried(robot, body.index)
    pairs = robot.mirror.pairs
    names = [link.name for link in body.links if link.collisions]
    return any(pair.left in carried and pair.right in carried for pair in pairs) or any(
        _UPPER_WORDS & _words(name) for name in names
    )


def _carried(robot: Facts, index: int) -> set[int]:
    found = {index}
    for body in robot.bodies[index + 1 :]:
        if body.parent in found:
            found.add(body.index)
    return found


def _words(name: str) -> set[str]:
    return {word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", name)}
