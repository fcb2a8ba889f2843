"""Rules on bodies that cannot collide."""

from collections import Counter

from terrainkit_robots.analysis.bodies.bodies import Body, BodyShape
from terrainkit_robots.analysis.bodies.shapes import has_bounds, min_height
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.export.canonical import has_floating_base
from terrainkit_robots.lint.rule import Part, Severity, Violation, Violations, rule
from terrainkit_robots.text import count

_MIN_FOOT_DEPTH = 0.005
"""How much lower a shape without contacts, such as a rubber skin, may be than the shapes with
contacts [m]."""


def _disabled_shapes(body: Body) -> list[BodyShape]:
    """Return the primitive shapes of a body whose contacts are disabled (MJCF only)."""
    return [
        placed
        for placed in (*body.collisions, *body.visuals)
        if not placed.geometry.contacts and placed.geometry.shape not in ("mesh", "unknown")
    ]


@rule("COL001", "no-foot-collision", "error", needs=("legs",), certainty="likely")
def no_foot_collision(robot: Facts) -> Violations:
    """A foot has no collision shape.

    A link without a collision shape passes through the ground. A robot whose feet have only visual
    shapes sinks until its shanks or its trunk touch the ground.

    Fix:
        Give the foot, or the shank that it is fixed to, a <collision>; a sphere or a box is best.

    Source:
        All simulators compute contacts from collision shapes only.
    """
    if not any(body.has_contacts for body in robot.bodies):
        return  # reported by COL003
    for leg in robot.legs:
        body = robot.bodies[leg.limb.chain[-1]]
        shapes = ""
        if not body.has_contacts:
            # COL007 reports shapes with disabled contacts.
            shapes = "" if _disabled_shapes(body) else "0"
        elif _is_visual_only(leg, body, robot):
            shapes = f"0, and the shapes of {body.top.name} end above it"
        if shapes:
            yield Violation(
                element=robot.tree.links[leg.foot],
                message=f"collision shapes of foot {leg.foot}: got {shapes}; expected 1 or more",
            )


def _is_visual_only(leg: Leg, body: Body, robot: Facts) -> bool:
    """Return whether the foot link has only visual shapes, below all collision shapes."""
    link = robot.tree.links[leg.foot]
    if link is body.top or not link.visuals or link.collisions:
        return False
    pose = body.zero_pose
    position = (pose @ body.poses[body.links.index(link)])[:3, 3]
    floor = min(min_height(placed, pose, robot.meshes) for placed in body.collisions)
    return floor > float(position[2])


@rule("COL002", "no-trunk-collision", "warning", needs=("legs",), certainty="likely")
def no_trunk_collision(robot: Facts) -> Violations:
    """The trunk has no collision shape.

    Episodes usually terminate on contact of the trunk. Without a collision shape this contact never
    occurs: a fallen robot lies with its trunk in the ground and keeps collecting rewards. It is a
    note if only the feet collide, which is a choice for speed.

    Fix:
        Give the trunk a <collision>; one box is sufficient.

    Source:
        legged_gym's terminate_after_contacts_on and Isaac Lab's illegal_contact refer to the base.
    """
    # A body that several legs share is no part of a leg. The trunk of a planar model is the last
    # body of a chain of slides.
    used = Counter(index for leg in robot.legs for index in leg.limb.chain)
    rest = [body for body in robot.bodies if used[body.index] != 1]
    if any(body.has_contacts for body in rest) or robot.bodies[0].virtual:
        return
    colliding = {body.index for body in robot.bodies if body.has_contacts}
    if colliding:
        trunk = robot.bodies[0]
        yield Violation(
            element=robot.tree.links[trunk.name],
            severity="note" if colliding <= {leg.limb.chain[-1] for leg in robot.legs} else None,
            message=f"collision shapes of trunk {trunk.name} and all other bodies outside of the "
            "legs: got 0; expected 1 or more",
        )


@rule("COL003", "no-collision", "error")
def no_collision(robot: Facts) -> Violations:
    """The robot has no collision shapes.

    It falls through the ground and has no contacts. Without legs and a free base it is a warning,
    and a note in MJCF, where contacts are disabled on purpose: pendulums, swimmers and reachers
    need none.

    Fix:
        Give the links <collision> elements; primitives are faster and more stable than meshes.

    Source:
        All simulators compute contacts from collision shapes only.
    """
    if robot.bodies and not any(body.has_contacts for body in robot.bodies):
        severity: Severity | None = None if has_floating_base(robot) else "warning"
        if robot.model.kind == "mjcf":
            severity = "note"
        yield Violation(
            severity=None if robot.legs else severity,
            message=f"collision shapes of {count(len(robot.links), 'link')}: got 0; expected 1 or "
            "more",
        )


@rule("COL007", "foot-contacts-disabled", "error", needs=("legs",), certainty="likely")
def foot_contacts_disabled(robot: Facts) -> Violations:
    """The contacts of a foot are disabled.

    A geom with contype 0 and conaffinity 0 is only visual. The robot sinks until another geom
    touches the ground.

    Fix:
        Give the geom of the foot, or its default class, contype="1" or conaffinity="1".

    Source:
        MuJoCo's XML reference, geom: contype, conaffinity.
    """
    for leg in robot.legs:
        body = robot.bodies[leg.limb.chain[-1]]
        pose, meshes = body.zero_pose, robot.meshes
        disabled = [
            (min_height(placed, pose, meshes), placed)
            for placed in _disabled_shapes(body)
            if has_bounds(placed.geometry, meshes)
        ]
        enabled = [
            min_height(placed, pose, meshes)
            for placed in body.collisions
            if placed.geometry.contacts and has_bounds(placed.geometry, meshes)
        ]
        if not disabled:
            continue
        height, placed = min(disabled, key=lambda pair: pair[0])
        if enabled and height > min(enabled) - _MIN_FOOT_DEPTH:
            continue
        yield Violation(
            element=Part(placed.geometry.name or placed.link, placed.geometry.source),
            message=f"contacts of the {placed.geometry.shape} of {placed.link}, the lowest shape "
            "of a leg: got contype 0 and conaffinity 0; expected one of them above 0",
        )
