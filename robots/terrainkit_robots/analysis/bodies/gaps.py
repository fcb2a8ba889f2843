"""Compute the gaps between bodies from bounding boxes in the frame of the trunk at position 0.

The boxes are larger than the shapes, so a gap between them is one between the shapes as well.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body, BodyShape
from terrainkit_robots.analysis.bodies.shapes import bounds, has_bounds
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.transforms import Matrix


def shapes_of(body: Body) -> tuple[BodyShape, ...]:
    """Return the collision and visual shapes of a body."""
    return (*body.collisions, *body.visuals)


def box_at_zero(body: Body, shapes: Sequence[BodyShape], meshes: Meshes) -> Matrix | None:
    """Return the bounding box of shapes of a body, shape (2, 3) [m].

    None without shapes, or if a mesh is unreadable.
    """
    if not all(has_bounds(shape.geometry, meshes) for shape in shapes):
        return None
    return bounds((replace(shape, pose=body.zero_pose @ shape.pose) for shape in shapes), meshes)


def box_distance(a: Matrix, b: Matrix) -> float:
    """Return the distance between two boxes; 0 if they overlap [m].

    Args:
        a: Corners of a box, shape (2, 3), or a point, shape (1, 3) [m].
        b: The other box or point.
    """
    return float(np.linalg.norm(np.maximum(0, np.maximum(a[0] - b[-1], b[0] - a[-1]))))
