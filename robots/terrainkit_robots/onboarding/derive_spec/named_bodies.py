"""Find the bodies that training frameworks refer to: base, thighs, shanks and feet.

Frameworks merge fixed joints and keep the name of the parent link, so a body has the name of its
top link. A foot on a fixed joint remains a separate body.
"""

import re

from terrainkit_robots.analysis.bodies.bodies import Body, subtree_of
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.legs import Leg

_UPPER_BODY_NAMES = frozenset({"head", "torso", "chest", "trunk", "neck"})
"""Words in names of bodies of a biped that must not touch the ground."""


def base_body(robot: Facts) -> Body | None:
    """Return the first body that is not virtual; None if there is none."""
    return next((body for body in robot.bodies if not body.virtual), None)


def body_name(body: Body) -> str:
    """Return the name of a body in simulators: its first link that is in the file."""
    return next((link for link in body.links if not link.virtual), body.top).name


def feet(robot: Facts) -> tuple[str, ...]:
    """Return the foot link of each leg."""
    return tuple(leg.foot for leg in robot.legs)


def shanks(robot: Facts) -> tuple[str, ...]:
    """Return the body below each knee; legs without a knee have none."""
    found = (_below_knee(robot, leg) for leg in robot.legs)
    return tuple(dict.fromkeys(body_name(body) for body in found if body is not None))


def thighs(robot: Facts) -> tuple[str, ...]:
    """Return the body above each knee, the last one if there are several."""
    found = []
    for leg in robot.legs:
        shank = _below_knee(robot, leg)
        thigh = robot.physical_parent(shank) if shank is not None else None
        if thigh is not None and thigh.index in leg.limb.chain:
            found.append(body_name(thigh))
    return tuple(dict.fromkeys(found))


def termination_contacts(robot: Facts) -> tuple[str, ...]:
    """Return the bodies whose ground contact ends an episode.

    This is the base, as in legged_gym, and for bipeds also a torso and a head.
    """
    base = base_body(robot)
    found = [] if base is None else [body_name(base)]
    if len(robot.legs) == 2:
        found += [body_name(body) for body in robot.bodies[1:] if _is_upper_body(robot, body)]
    return tuple(dict.fromkeys(found))


def penalized_contacts(robot: Facts) -> tuple[str, ...]:
    """Return the bodies whose contacts are penalized: thighs and shanks that are not feet."""
    standing = feet(robot)
    return tuple(name for name in (*thighs(robot), *shanks(robot)) if name not in standing)


def _below_knee(robot: Facts, leg: Leg) -> Body | None:
    knee = leg.joint("knee")
    if knee is None:
        return None
    start = robot.body_of_joint[knee.name].index
    chain = leg.limb.chain[leg.limb.chain.index(start) :]
    return next((robot.bodies[i] for i in chain if not robot.bodies[i].virtual), None)


def _is_upper_body(robot: Facts, body: Body) -> bool:
    """Return whether a body is a torso or a head.

    It must have a collision shape and no mirrored body, and must not be part of a leg. A torso has
    limbs on both sides; a head is recognized by its name.
    """
    if body.index in robot.leg_bodies or body.virtual or not body.collisions:
        return False
    if robot.mirror.image_body(body.index) is not None:
        return False
    subtree = subtree_of(robot.bodies, body.index)
    if any(pair.left in subtree and pair.right in subtree for pair in robot.mirror.pairs):
        return True
    names = " ".join(link.name for link in body.links if link.collisions)
    words = {word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", names)}
    return not _UPPER_BODY_NAMES.isdisjoint(words)
