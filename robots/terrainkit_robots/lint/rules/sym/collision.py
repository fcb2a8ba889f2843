"""Rule on the symmetry of collision shapes."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.gaps import box_at_zero
from terrainkit_robots.analysis.bodies.shapes import bounds
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.mirror_pairs import (
    MirrorPair,
    MirrorSide,
    outlier_first,
)
from terrainkit_robots.description.model import Geometry, Link
from terrainkit_robots.lint.rule import Part, Violation, Violations, findings_of, rule
from terrainkit_robots.text import names, numbers
from terrainkit_robots.transforms import Matrix

_MAX_SIZE_RATIO = 1.5
"""Allowed ratio of the sizes of two mirrored primitives."""

_MAX_SHAPE_ERROR, _SHAPE_MARGIN = 0.3, 0.01
"""Allowed distance between two mirrored bounding boxes: a share of the diagonal plus a constant
[m]."""


@rule("SYM013", "collision-asymmetry", "warning")
def collision_asymmetry(robot: Facts) -> Violations:
    """The collision shapes of a body differ from its mirror image, or are missing.

    A shape is turned, shifted or scaled on one side only, or has the mesh of another part. The legs
    collide at different positions, and one foot may reach deeper than the other. The sizes of
    primitives are compared on all pairs, arms included. A link of a leg without collision shapes
    passes through the ground; it is reported if the link of the other leg, or of most legs, has
    some.

    Fix:
        Mirror the <origin> and the size of the collision shapes.

    Source:
        Bounding boxes at position 0. On published robots they agree to 30 % of their diagonal.
    """
    # Bodies behind a misaligned joint are elsewhere; SYM006 reports the joint.
    _, displaced = robot.misalignments
    missing = dict(_missing(robot))
    yield from missing.values()
    for pair in robot.uncopied_pairs:
        left, right = pair.left, pair.right
        if not missing.keys().isdisjoint(pair.indices):
            continue
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
            return None if body.joint is None else bounds(body.collisions, robot.meshes)

        odd, other, reason = outlier_first(robot, pair, extent, partial(_visual_offset, robot))
        yield Violation(
            element=Part(odd.body.name, odd.body.collisions[0].geometry.source),
            message=f"bounding box of the collision shapes of {odd.body.name}: got a face "
            f"{1000 * error:.3g} mm from its mirror image {other.body.name}; expected at most "
            f"{1000 * limit:.3g} mm; {reason}",
            measured={"difference": error, "mirror_image": other.body.name},
        )


def _missing(robot: Facts) -> Iterator[tuple[int, Violation]]:
    """Yield the violations of links without collision shapes where other legs have some.

    Links are compared with the links at the same place of other legs. Each comes with the index of
    its body. COL001 reports feet, whose shapes may be on another link.
    """
    bodies = [[robot.bodies[i] for i in leg.limb.chain] for leg in robot.legs]
    lengths = {tuple(len(body.links) for body in chain) for chain in bodies}
    if len(lengths) != 1 or next(findings_of(robot, "COL001"), None):
        return
    for column in zip(*bodies, strict=True):
        counts = [sum(map(_collides, body.links)) for body in column]
        for links in zip(*(body.links for body in column), strict=True):
            without = [
                (body, link)
                for body, link, count in zip(column, links, counts, strict=True)
                # With as many links in another order, nothing is missing.
                if not _collides(link) and count < max(counts)
            ]
            others = [link.name for link in links if _collides(link)]
            if 2 * len(without) > max(len(links) - 1, 2):
                continue  # a choice for all front legs, for example
            for body, link in without:
                message = f"collision shapes of {link.name}: got none; expected some, as in "
                yield body.index, Violation(element=link, message=message + names(others))


def _collides(link: Link) -> bool:
    return any(shape.contacts for shape in link.collisions)


def _resized(robot: Facts, pair: MirrorPair) -> Violation | None:
    """Return the violation of a pair whose primitives have different sizes, or None."""
    shapes = _primitives(pair.left.body), _primitives(pair.right.body)
    if [primitive.shape for primitive in shapes[0]] != [primitive.shape for primitive in shapes[1]]:
        return None
    for left, right in zip(*shapes, strict=True):
        sizes = np.array(left.size), np.array(right.size)
        ratio = float(max((sizes[0] / sizes[1]).max(), (sizes[1] / sizes[0]).max()))
        if ratio <= _MAX_SIZE_RATIO:
            continue

        def size(body: Body, index: int = shapes[0].index(left)) -> Matrix | None:
            siblings = _primitives(body)
            return np.array(siblings[index].size) if len(siblings) == len(shapes[0]) else None

        odd, other, reason = outlier_first(robot, pair, size)
        own, mirrored = (left, right) if odd is pair.left else (right, left)
        return Violation(
            element=Part(odd.body.name, own.size_source or own.source),
            message=f"size of the collision {own.shape} of {odd.body.name}: got "
            f"{numbers(own.size)} m, and {numbers(mirrored.size)} m for its mirror image "
            f"{other.body.name} (radii and half lengths); expected at most a factor of "
            f"{_MAX_SIZE_RATIO:g}; {reason}",
            measured={"ratio": ratio, "mirror_image": other.body.name},
        )
    return None


def _primitives(body: Body) -> list[Geometry]:
    """Return the collision primitives of a body, by shape and size."""
    found = [s.geometry for s in body.collisions if s.geometry.size and min(s.geometry.size) > 0]
    return sorted(found, key=lambda primitive: (primitive.shape, primitive.size))


def _box(robot: Facts, side: MirrorSide) -> Matrix | None:
    """Return the bounding box of collision shapes from the axis, in the axes of the trunk [m]."""
    box = box_at_zero(side.body, side.body.collisions, robot.meshes)
    # Exporters place a joint anywhere on its axis, so the point nearest to the trunk is used.
    along = side.point - robot.mirror.offset * robot.mirror.normal
    return None if box is None else box - (side.point - (along @ side.axis) * side.axis)


def _visual_offset(robot: Facts, body: Body) -> float | None:
    """Return the distance between the middles of the collision and the visual shapes [m]."""
    boxes = [box_at_zero(body, shapes, robot.meshes) for shapes in (body.collisions, body.visuals)]
    a, b = boxes
    return None if a is None or b is None else float(np.linalg.norm((a - b).mean(axis=0)))
