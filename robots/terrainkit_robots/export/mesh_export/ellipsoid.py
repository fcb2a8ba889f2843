"""Create meshes of ellipsoids for formats without ellipsoids."""

import numpy as np

from terrainkit_robots.mesh.surface import Surface

_SUBDIVISIONS = 3
"""Subdivisions of an icosahedron: 1,280 faces, with 99 % of the volume of the ellipsoid."""


def ellipsoid(radii: tuple[float, ...]) -> Surface:
    """Return the surface of an ellipsoid.

    Args:
        radii: Radii along x, y and z [m].
    """
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=_SUBDIVISIONS)
    return Surface(points=np.asarray(ball.vertices) * np.array(radii), faces=np.asarray(ball.faces))
