"""Followers: joints that mimic others, and where those put them."""

from collections.abc import Iterable, Mapping

import numpy as np

from terrainkit_robots.description.model import Joint
from terrainkit_robots.transforms import Matrix

_FARTHEST = 1e30
"""No joint is farther off [rad] or [m], whatever the factors of a chain multiply to."""


def followers(joints: Iterable[Joint]) -> tuple[Joint, ...]:
    """Return the joints that follow another, each after the one that it follows.

    A joint follows none if it mimics one that is not among `joints`, or in the end itself.
    """
    known: dict[str, Joint] = {}
    for joint in joints:
        known.setdefault(joint.name, joint)
    found: dict[str, Joint] = {}
    free = {name for name, joint in known.items() if joint.mimic is None}
    for name in known:
        path: dict[str, Joint] = {}
        at = name
        while at in known and at not in path and at not in found and at not in free:
            path[at] = known[at]
            mimic = known[at].mimic
            assert mimic is not None
            at = mimic.joint
        names = list(path)
        # What leads to nobody, or to itself, is free; what leads there follows it.
        if at not in known:
            free.update(names[-1:])
        elif at in path:
            free.update(names[names.index(at) :])
        found |= {name: path[name] for name in reversed(names) if name not in free}
    return tuple(found.values())


def follower_positions(
    joints: Iterable[Joint], positions: Mapping[str, float] | Mapping[str, Matrix]
) -> dict[str, Matrix]:
    """Return the positions of the joints that follow another [rad] or [m], by name.

    Args:
        joints: The joints.
        positions: Positions of those that are followed, in the end; what is not named is at 0.
    """
    found: dict[str, Matrix] = {}
    for joint in followers(joints):
        assert joint.mimic is not None
        lead = joint.mimic.joint
        position = found[lead] if lead in found else np.asarray(positions.get(lead, 0.0))
        with np.errstate(over="ignore"):
            moved = joint.mimic.multiplier * position + joint.mimic.offset
        found[joint.name] = np.clip(moved, -_FARTHEST, _FARTHEST)
    return found
