"""Recognize a floating base that is written as ordinary joints.

Many models move the trunk by three slides and three hinges or a ball, with empty links between
them, in place of a free joint. Planar models have two slides and a hinge.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.kinematics import joint_axis
from terrainkit_robots.analysis.bodies.tree import Tree
from terrainkit_robots.description.model import WORLD, Joint, Link, RobotModel
from terrainkit_robots.transforms import Matrix

_MAX_LINK_MASS = 0.01
"""Mass of a link between the joints of a base, at most, over the mass of the robot."""

_MIN_ANGLE_SINE = 0.1
"""Smallest singular value of the axes of independent joints."""


def find_base_joints(tree: Tree, model: RobotModel) -> tuple[Joint, ...]:
    """Return the joints from the world to the first link with mass if they move it freely.

    They are unactuated slides and hinges or a ball for all six directions, or for those of a
    vertical plane. The arm of a gantry and a base that drives on the ground have motors or keep
    their height.

    Args:
        tree: The tree of links.
        model: The robot.
    """
    driven = {actuator.joint for actuator in model.actuators}
    path: list[Joint] = []
    pose = np.eye(3)
    slides: list[Matrix] = []
    turns: list[Matrix] = []
    for joint in _joints_to_mass(tree, model):
        if joint.kind == "floating" or (joint.kind != "fixed" and joint.name in driven):
            return ()
        path.append(joint)
        pose = pose @ joint.origin[:3, :3]
        new_slides, new_turns = _axes(joint)
        slides += [pose @ axis for axis in new_slides]
        turns += [pose @ axis for axis in new_turns]
        if len(slides) == len(turns) == _rank(slides) == _rank(turns) == 3:
            return tuple(path)
    while path and path[-1].kind == "fixed":
        path.pop()
    return tuple(path) if _is_vertical_plane(slides, turns) else ()


def _joints_to_mass(tree: Tree, model: RobotModel) -> Iterator[Joint]:
    """Yield the joints from the world down to the first link with mass or several children."""
    if not tree.order:
        return
    link = tree.order[0]
    # The joint of an MJCF body to the world is not in the tree.
    yield from (joint for joint in model.joints if (joint.parent, joint.child) == (WORLD, link))
    total_mass = sum(map(_mass, tree.links.values()))
    while len(tree.child_joints[link]) == 1 and _is_empty(tree.links[link], total_mass):
        (joint,) = tree.child_joints[link]
        yield joint
        link = joint.child


def _axes(joint: Joint) -> tuple[list[Matrix], list[Matrix]]:
    """Return the axes along and about which a joint moves, each of shape (3,)."""
    if joint.kind == "ball":
        return [], list(np.eye(3))
    if joint.kind == "planar":
        _, _, rows = np.linalg.svd(joint.direction[None])
        return list(rows[1:]), [joint.direction]
    if not joint.moves:
        return [], []
    return ([joint.direction], []) if joint.kind == "prismatic" else ([], [joint.direction])


def moves_freely(base: Sequence[Joint]) -> bool:
    """Return whether the joints of a base have all six degrees of freedom."""
    freedom = {"fixed": 0, "ball": 3, "planar": 3}
    return sum(freedom.get(joint.kind, 1) for joint in base) == 6


def moves_in_plane(bodies: Sequence[Body]) -> bool:
    """Return whether all joints of a robot have parallel axes, so that it is a planar model."""
    axes = [
        joint_axis(body, body.zero_pose)[1]
        for body in bodies
        if (joint := body.joint) is not None and joint.moves and joint.kind != "prismatic"
    ]
    return all(abs(axis @ axes[0]) > 1 - _MIN_ANGLE_SINE for axis in axes)


def _is_vertical_plane(slides: Sequence[Matrix], turns: Sequence[Matrix]) -> bool:
    """Return whether axes move a body in a vertical plane."""
    if (len(slides), len(turns)) != (2, 1) or _rank(slides) < 2:
        return False
    normal = turns[0]
    return bool(max(abs(normal @ slide) for slide in slides) < 0.1 and abs(normal[2]) < 0.5)


def _rank(axes: Sequence[Matrix]) -> int:
    return int(np.linalg.matrix_rank(np.array(axes), tol=_MIN_ANGLE_SINE)) if axes else 0


def _mass(link: Link) -> float:
    mass = link.inertial.mass if link.inertial else None
    return mass if mass is not None and 0 < mass < np.inf else 0.0


def _is_empty(link: Link, total_mass: float) -> bool:
    return not link.collisions and _mass(link) <= _MAX_LINK_MASS * total_mass
