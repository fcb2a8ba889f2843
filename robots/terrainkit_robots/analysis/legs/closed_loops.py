"""Close the loops of a robot: solve for joint positions at which its connections meet."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.kinematics import ancestors, body_poses
from terrainkit_robots.description.model import Joint, Loop
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

_MAX_GAP = 1e-5
"""Largest distance of the two points of a closed loop, along each axis [m]."""

_MAX_STEP = 0.2
"""Largest change of a joint in an iteration [rad] or [m]; it keeps the solution on its branch."""

_ITERATIONS = 100

_MAX_JOINTS = 300
"""Loops with more joints are not closed: the memory grows with the square of their number."""

_DIFFERENCE = 1e-6
"""Step of the finite differences [rad] or [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyLoop:
    """A loop in terms of bodies."""

    bodies: tuple[int, int]
    """Indices of the bodies that it connects."""

    points: tuple[Matrix, Matrix]
    """Where it connects them, in the frame of each body, shape (4,) with a last component of 1
    [m]."""


def body_loops(loops: Sequence[Loop], bodies: Sequence[Body]) -> tuple[BodyLoop, ...]:
    """Return the loops between two bodies of a robot."""
    frames = {
        link.name: (body.index, local)
        for body in bodies
        for link, local in zip(body.links, body.poses, strict=True)
    }
    found = []
    for loop in loops:
        if not frames.keys() >= set(loop.links):
            continue
        (first, first_frame), (second, second_frame) = (frames[link] for link in loop.links)
        origin, other_origin = (pose[:, 3] for pose in loop.origins)
        points = first_frame @ origin, second_frame @ other_origin
        found.append(BodyLoop(bodies=(first, second), points=points))
    return tuple(found)


def close_loops(
    robot: "Facts",
    positions: Mapping[str, float],
    *,
    legs: Collection[str],
    actuated: Collection[str],
) -> dict[str, float]:
    """Return joint positions at which the loops are closed; the given ones if there are none.

    The branches beside the legs follow the legs; if they cannot, all joints without an actuator
    move.

    Args:
        robot: The robot.
        positions: Position of each moving joint [rad] or [m], by name.
        legs: Names of the joints of the legs.
        actuated: Names of the joints with an actuator.
    """
    bodies = robot.bodies
    in_loops = {
        index
        for loop in robot.loops
        for index in set(ancestors(bodies, loop.bodies[0])) ^ set(ancestors(bodies, loop.bodies[1]))
    }
    joints = [
        joint
        for index in sorted(in_loops)
        if (joint := bodies[index].joint) is not None and joint.moves and joint.mimic is None
    ]
    for held in (legs, actuated):
        moved = [joint for joint in joints if joint.name not in held]
        solution = _solve(robot, positions, moved)
        if solution:
            return {**positions, **solution}
    return dict(positions)


def largest_gap(robot: "Facts", positions: Mapping[str, float]) -> float:
    """Return the largest distance between the two points of a loop [m]; see `close_loops`."""
    gaps = _gaps(robot.loops, body_poses(robot.bodies, positions)).reshape(-1, 3)
    return float(np.linalg.norm(gaps, axis=1).max())


def _solve(
    robot: "Facts", positions: Mapping[str, float], joints: Sequence[Joint]
) -> dict[str, float]:
    """Return the positions of some joints that close the loops, by Gauss-Newton; or none."""
    if not 0 < len(joints) <= _MAX_JOINTS:
        return {}
    q = np.array([positions[joint.name] for joint in joints])
    ranges = [joint.range or (-np.inf, np.inf) for joint in joints]
    lower, upper = np.transpose(ranges)
    steps = np.vstack([np.zeros(len(joints)), _DIFFERENCE * np.eye(len(joints))])
    for _ in range(_ITERATIONS):
        columns = (q + steps).T
        everything = {name: np.full(len(steps), value) for name, value in positions.items()}
        everything |= {joint.name: column for joint, column in zip(joints, columns, strict=True)}
        gaps = _gaps(robot.loops, body_poses(robot.bodies, everything))
        if np.abs(gaps[0]).max() <= _MAX_GAP:
            return {joint.name: float(x) for joint, x in zip(joints, q.round(5), strict=True)}
        jacobian = (gaps[1:] - gaps[0]).T / _DIFFERENCE
        change, *_ = np.linalg.lstsq(jacobian, -gaps[0], rcond=1e-6)
        at_limit = ((q <= lower) & (change < 0)) | ((q >= upper) & (change > 0))
        if at_limit.any():
            change, *_ = np.linalg.lstsq(jacobian * ~at_limit, -gaps[0], rcond=1e-6)
        q = np.clip(q + np.clip(change, -_MAX_STEP, _MAX_STEP), lower, upper)
    return {}


def _gaps(loops: Sequence[BodyLoop], poses: Sequence[Matrix]) -> Matrix:
    """Return the vectors between the two points of each loop, shape (..., 3 * loops) [m]."""
    gaps = [
        (poses[loop.bodies[0]] @ loop.points[0] - poses[loop.bodies[1]] @ loop.points[1])[..., :3]
        for loop in loops
    ]
    return np.concatenate(np.broadcast_arrays(*gaps), axis=-1)
