"""Rule on the symmetry of collision shapes."""

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body, BodyShape
from terrainkit_robots.analysis.bodies.shapes import bounds, has_bounds
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.mirror_pairs import MirrorPair, MirrorSide
from terrainkit_robots.description.model import Geometry
from terrainkit_robots.lint.rule import Violation, Violations, rule
from terrainkit_robots.text import numbers
from terrainkit_robots.transforms import Matrix

_MAX_SIZE_RATIO = 1.5
"""Allowed ratio of the sizes of two mirrored primitives."""

_MAX_SHAPE_ERROR, _SHAPE_MARGIN = 0.3, 0.01
"""Allowed distance between two mirrored bounding boxes: a share of the diagonal plus a constant
[m]."""


@rule("SYM013", "collision-asymmetry", "warning", certainty="likely")
def collision_asymmetry(robot: Facts) -> Violations:
    """The collision shapes of a body differ from its mirror image in position or size.

    A shape is turned, shifted or scaled on one side only, or has the mesh of another part. The legs
    collide at different positions, and one foot may reach deeper than the other. The sizes of
    primitives are compared on all pairs, arms included.

    Fix:
        Mirror the <origin> and the size of the collision shapes.

    Source:
        Bounding boxes at position 0. On published robots they agree to 30 % of their diagonal.
    """
    # Bodies behind a misaligned joint are elsewhere; SYM006 reports the joint.
    _, displaced = robot.misalignments
    for pair in robot.uncopied_pairs:
        left, right = pair.left, pair.right
        resized = _resized(robot, pair)
        if resized is not None:
            yield resized
            continue
        if displaced & pair.indices or not pair.indices <= robot.leg_bodies:
            continue
        a, b = _box(robot, left), _box(robot, right)
        if a is None or b is None:
            continue
        corners = robot.mirror.image(a)
        image = np.array([corners.min(axis=0), corners.max(axis=0)])
        error = float(np.abs(image - b).max())
        size = min(float(np.linalg.norm(box[1] - box[0])) for box in (a, b))
        limit = _MAX_SHAPE_ERROR * size + _SHAPE_MARGIN
        if error <= limit:
            continue

        def extent(body: Body) -> Matrix | None:
            if body.joint is None:
                return None
            box = bounds(body.collisions, robot.meshes)
            return None if box is None else box.ravel()

        odd, other = robot.outlier_first(pair, extent)
        yield Violation(
            subject=odd.body.name,
            source=odd.body.collisions[0].geometry.source,
            message=f"bounding box of the collision shapes of {odd.body.name}: got a face "
            f"{1000 * error:.3g} mm from its mirror image {other.body.name}; expected at most "
            f"{1000 * limit:.3g} mm",
            measured={"difference": error, "mirror_image": other.body.name},
        )


def _resized(robot: Facts, pair: MirrorPair) -> Violation | None:
    """Return the violation of a pair whose primitives have different sizes, or None."""
    shapes = _primitives(pair.left.body), _primitives(pair.right.body)
    if [each.shape for each in shapes[0]] != [each.shape for each in shapes[1]]:
        return None
    for left, right in zip(*shapes, strict=True):
        sizes = np.array(left.size), np.array(right.size)
        ratio = float(max((sizes[0] / sizes[1]).max(), (sizes[1] / sizes[0]).max()))
        if ratio <= _MAX_SIZE_RATIO:
            continue

        def size(body: Body, index: int = shapes[0].index(left)) -> Matrix | None:
            siblings = _primitives(body)
            return np.array(siblings[index].size) if len(siblings) == len(shapes[0]) else None

        odd, other = robot.outlier_first(pair, size)
        own, mirrored = (left, right) if odd is pair.left else (right, left)
        return Violation(
            subject=odd.body.name,
            source=own.size_source or own.source,
            message=f"size of the collision {own.shape} of {odd.body.name}: got "
            f"{numbers(own.size)} m, and {numbers(mirrored.size)} m for its mirror image "
            f"{other.body.name} (radii and half lengths); expected at most a factor of "
            f"{_MAX_SIZE_RATIO:g}",
            measured={"ratio": ratio, "mirror_image": other.body.name},
        )
    return None


def _primitives(body: Body) -> list[Geometry]:
    """Return the collision primitives of a body, by shape and size."""
    found = [s.geometry for s in body.collisions if s.geometry.size and min(s.geometry.size) > 0]
    return sorted(found, key=lambda each: (each.shape, each.size))


def _box(robot: Facts, side: MirrorSide) -> Matrix | None:
    """Return the bounding box of collision shapes from the joint, in the axes of the trunk [m]."""
    shapes = [
        BodyShape(geometry=s.geometry, link=s.link, pose=side.body.zero_pose @ s.pose)
        for s in side.body.collisions
    ]
    if not shapes or not all(has_bounds(s.geometry, robot.meshes) for s in shapes):
        return None
    box = bounds(shapes, robot.meshes)
    return None if box is None else box - side.point
