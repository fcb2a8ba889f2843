"""Joints that mimic other joints, and their positions."""

from collections.abc import Iterable, Mapping

import numpy as np

from terrainkit_robots.description.model import Joint
from terrainkit_robots.transforms import Matrix

_MAX_POSITION = 1e30
"""Bound of the position of a mimic joint [rad] or [m], for any product of multipliers."""


def mimic_joints(joints: Iterable[Joint]) -> tuple[Joint, ...]:
    """Return the joints that mimic another one, each after the joint that it mimics.

    A joint that mimics a joint outside of `joints`, or itself through a cycle, is left out.
    """
    by_name: dict[str, Joint] = {}
    for joint in joints:
        by_name.setdefault(joint.name, joint)
    found: dict[str, Joint] = {}
    free = {name for name, joint in by_name.items() if joint.mimic is None}
    for start in by_name:
        path: dict[str, Joint] = {}
        name = start
        while name in by_name and name not in path and name not in found and name not in free:
            path[name] = by_name[name]
            mimic = by_name[name].mimic
            assert mimic is not None
            name = mimic.joint
        names = list(path)
        # A joint with an unknown target and the joints of a cycle are free; joints that lead there
        # mimic them.
        if name not in by_name:
            free.update(names[-1:])
        elif name in path:
            free.update(names[names.index(name) :])
        found |= {key: path[key] for key in reversed(names) if key not in free}
    return tuple(found.values())


def mimic_positions(
    joints: Iterable[Joint], positions: Mapping[str, float] | Mapping[str, Matrix]
) -> dict[str, Matrix]:
    """Return the positions of the mimic joints [rad] or [m], by name.

    Args:
        joints: All joints.
        positions: Positions of the joints that are mimicked. Joints without a position are at 0.
    """
    found: dict[str, Matrix] = {}
    for joint in mimic_joints(joints):
        assert joint.mimic is not None
        target = joint.mimic.joint
        position = found[target] if target in found else np.asarray(positions.get(target, 0.0))
        with np.errstate(over="ignore"):
            position = joint.mimic.multiplier * position + joint.mimic.offset
        found[joint.name] = np.clip(position, -_MAX_POSITION, _MAX_POSITION)
    return found
