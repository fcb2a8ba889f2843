"""Match the joints, links and bodies of two descriptions of a robot."""

from collections.abc import Iterator
from dataclasses import dataclass

from terrainkit.settings.text import truncate
from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint
from terrainkit_robots.lint.compare.name_pairs import NamePairs, pair_names
from terrainkit_robots.transforms import Matrix, invert_poses


@dataclass(frozen=True, kw_only=True)
class RobotPairs:
    """The matching elements of two descriptions. In each pair, the first robot comes first."""

    joint_names: NamePairs
    """Names of the joints with one degree of freedom."""

    joints: tuple[tuple[Joint, Joint], ...]
    """Pairs of joints, in the order of the first robot."""

    links: tuple[tuple[str, str], ...]
    """Pairs of links with matching names, or below a pair of joints, in the order of the first
    robot."""

    base: tuple[str, str]
    """Pair of links that serves as the base. Both are part of the trunk, if possible with the same
    name."""

    bodies: tuple[tuple[Body, Body], ...]
    """Pairs of bodies with the same joints around them."""


def pair_robots(robot: Facts, other: Facts) -> RobotPairs:
    """Return the matching elements of two descriptions.

    Raises:
        CannotCheckError: If one of them has no links.
    """
    for facts in (robot, other):
        if not facts.links:
            raise CannotCheckError(f"{truncate(facts.model.file.name)} has no links")
    by_name, other_by_name = _by_name(robot), _by_name(other)
    names = pair_names(tuple(by_name), tuple(other_by_name))
    joints = tuple((by_name[a], other_by_name[b]) for a, b in names.pairs)
    base = _base(robot, other)
    return RobotPairs(
        joint_names=names,
        joints=joints,
        links=_links(robot, other, joints, base),
        base=base,
        bodies=tuple(_bodies(robot, other, names)),
    )


def trunk_pose_in_link(robot: Facts, link: str) -> Matrix:
    """Return the pose of the trunk in the frame of a link, all joints at 0, shape (4, 4) [m]."""
    body = robot.body_of[link]
    pose = next(p for part, p in zip(body.links, body.poses, strict=True) if part.name == link)
    return invert_poses(body.zero_pose @ pose)


def _by_name(robot: Facts) -> dict[str, Joint]:
    """Return the joints with one degree of freedom by name. The first of each name is used."""
    joints: dict[str, Joint] = {}
    for joint in robot.joints:
        joints.setdefault(joint.name, joint)
    return joints


def _link_names(robot: Facts) -> list[str]:
    return [link.name for link in robot.links]


def _base(robot: Facts, other: Facts) -> tuple[str, str]:
    """Return a link of the trunk that has the same name in both, else the first links."""
    other_names = {link.name for link in other.bodies[0].links if not link.virtual}
    for link in robot.bodies[0].links:
        if link.name in other_names and not link.virtual:
            return link.name, link.name
    return _link_names(robot)[0], _link_names(other)[0]


def _links(
    robot: Facts, other: Facts, joints: tuple[tuple[Joint, Joint], ...], base: tuple[str, str]
) -> tuple[tuple[str, str], ...]:
    """Return the pairs of links with matching names, and of others below a pair of joints."""
    names, other_names = _link_names(robot), _link_names(other)
    matches = dict(pair_names(names, other_names).pairs)
    for a, b in (base, *((a.child, b.child) for a, b in joints)):
        if a in names and b in other_names and a not in matches and b not in matches.values():
            matches[a] = b
    return tuple((name, matches[name]) for name in names if name in matches)


def _bodies(robot: Facts, other: Facts, names: NamePairs) -> Iterator[tuple[Body, Body]]:
    """Yield the bodies whose joint and child joints match."""
    matches = dict(names.pairs)
    by_joint = {body.joint.name: body for body in other.bodies if body.joint is not None}
    for body in robot.bodies:
        if body.joint is None:
            match = other.bodies[0] if body.parent is None else None
        else:
            match = by_joint.get(matches.get(body.joint.name, ""))
        if match is None or body.virtual or match.virtual:
            continue
        if {matches.get(name) for name in _child_joints(robot, body)} == set(
            _child_joints(other, match)
        ):
            yield body, match


def _child_joints(robot: Facts, body: Body) -> list[str]:
    """Return the names of the joints whose parent is a body."""
    return [
        child.joint.name
        for child in robot.bodies
        if child.parent == body.index and child.joint is not None
    ]
