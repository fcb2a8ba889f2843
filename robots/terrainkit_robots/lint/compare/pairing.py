"""Pairing: the joints, links and bodies of two descriptions of one robot, side by side."""

from collections.abc import Iterator
from dataclasses import dataclass

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint
from terrainkit_robots.lint.compare.name_pairs import NamePairs, pair_names
from terrainkit_robots.transforms import Matrix, invert_poses


@dataclass(frozen=True, kw_only=True)
class Pairing:
    """What belongs together in two descriptions; ours comes first."""

    joint_names: NamePairs
    """Of the joints with one degree of freedom."""

    joints: tuple[tuple[Joint, Joint], ...]
    """The pairs of joints, in our order."""

    links: tuple[tuple[str, str], ...]
    """Pairs of links: of the same name, or below a pair of joints; in our order."""

    base: tuple[str, str]
    """The pair of links that is taken for the base: on both trunks, and of one name if any is."""

    bodies: tuple[tuple[Body, Body], ...]
    """Pairs of bodies that are made of the same parts: as many as all joints around them have a
    partner."""


def pair_robots(one: Facts, other: Facts) -> Pairing | None:
    """Return what belongs together in two descriptions; None if one of them has no links."""
    if not one.links or not other.links:
        return None
    ours, theirs = _by_name(one), _by_name(other)
    names = pair_names(tuple(ours), tuple(theirs))
    joints = tuple((ours[a], theirs[b]) for a, b in names.pairs)
    base = _base(one, other)
    return Pairing(
        joint_names=names,
        joints=joints,
        links=_links(one, other, joints, base),
        base=base,
        bodies=tuple(_bodies(one, other, names)),
    )


def from_link(robot: Facts, link: str) -> Matrix:
    """Return the trunk's frame as a link sees it with all joints at 0, shape (4, 4)."""
    body = robot.body_of[link]
    place = next(p for part, p in zip(body.links, body.poses, strict=True) if part.name == link)
    return invert_poses(robot.zero_poses[body.index] @ place)


def _by_name(robot: Facts) -> dict[str, Joint]:
    """Return the joints with one degree of freedom, the first of each name."""
    joints: dict[str, Joint] = {}
    for joint in robot.joints:
        joints.setdefault(joint.name, joint)
    return joints


def _solid_links(robot: Facts) -> list[str]:
    return [link.name for link in robot.links]


def _base(one: Facts, other: Facts) -> tuple[str, str]:
    """Return a link of the trunk that has the same name in both; else what is on top of each."""
    theirs = {link.name for link in other.bodies[0].links if not link.virtual}
    for link in one.bodies[0].links:
        if link.name in theirs and not link.virtual:
            return link.name, link.name
    return _solid_links(one)[0], _solid_links(other)[0]


def _links(
    one: Facts, other: Facts, joints: tuple[tuple[Joint, Joint], ...], base: tuple[str, str]
) -> tuple[tuple[str, str], ...]:
    """Return the pairs of links by name, and of the rest those below a pair of joints."""
    partner = dict(pair_names(_solid_links(one), _solid_links(other)).pairs)
    ours, theirs = set(_solid_links(one)), set(_solid_links(other))
    for a, b in (base, *((a.child, b.child) for a, b in joints)):
        if a in ours and b in theirs and a not in partner and b not in partner.values():
            partner[a] = b
    return tuple((name, partner[name]) for name in _solid_links(one) if name in partner)


def _bodies(one: Facts, other: Facts, names: NamePairs) -> Iterator[tuple[Body, Body]]:
    """Yield the bodies that the same joints cut out of both robots."""
    partner = dict(names.pairs)
    theirs = {body.joint.name: body for body in other.bodies if body.joint is not None}
    for body in one.bodies:
        if body.joint is None:
            twin = other.bodies[0] if body.parent is None else None
        else:
            twin = theirs.get(partner.get(body.joint.name, ""))
        if twin is None or body.virtual or twin.virtual:
            continue
        if {partner.get(name) for name in _below(one, body)} == set(_below(other, twin)):
            yield body, twin


def _below(robot: Facts, body: Body) -> list[str]:
    """Return the joints that hang from a body, by name."""
    return [
        other.joint.name
        for other in robot.bodies
        if other.parent == body.index and other.joint is not None
    ]
