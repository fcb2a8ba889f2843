"""Density: whether a mass fits the room that its body takes."""

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.bounds import BodyExtents
from terrainkit_robots.analysis.bodies.shapes import has_extent, volume
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Geometry
from terrainkit_robots.mesh.mesh_cache import MeshError
from terrainkit_robots.transforms import Matrix

LIGHTEST, DENSEST = 10.0, 20_000.0
"""Density between the lightest packing foam and gold [kg/m3]; the collision shapes of drones, which
are mostly air, come down to 20."""


def is_derived(body: Body) -> bool:
    """Return whether MuJoCo makes the mass from the shapes, so that the two cannot disagree."""
    return all(link.inertial is None or link.inertial.source == link.source for link in body.links)


def too_dense(extents: BodyExtents, body: Body) -> tuple[float, float] | None:
    """Return the room around a body [m3] and the limit, if it is too heavy for that."""

    def wrong(box: Matrix) -> bool:
        return body.mass > DENSEST * room(box)

    box = extents.still(body, wrong)
    return None if box is None or room(box) <= 0 else (room(box), DENSEST)


def too_light(robot: Facts, extents: BodyExtents, body: Body) -> tuple[float, float] | None:
    """Return the volume of a body's largest shape [m3] and the limit, if it is too light."""

    def doubtful(length: float) -> bool:
        return body.mass < _LIGHT * length**3 / _SLENDER

    box = extents.own(body, doubtful)
    if box is None or body.mass >= _LIGHT * room(box):
        return None
    shapes = (*body.collisions, *body.visuals)
    largest = max(volume_of(robot, placed.geometry) for placed in shapes)
    return (largest, LIGHTEST) if body.mass < LIGHTEST * largest else None


_LIGHT = 200.0
"""Density of the box around a body from which on nobody asks for its volume [kg/m3]."""

_SLENDER = 20.0
"""The cube of its length over the volume of a limb that is rather slender."""


def room(box: Matrix) -> float:
    """Return the volume of a box [m3]."""
    return float(np.prod(box[1] - box[0]))


def volume_of(robot: Facts, shape: Geometry) -> float:
    """Return the volume of a shape [m3]; 0 where that is not known."""
    if not has_extent(shape, robot.meshes):
        return 0.0
    try:
        return max(0.0, volume(shape, robot.meshes))
    except (MeshError, ValueError):
        return 0.0
