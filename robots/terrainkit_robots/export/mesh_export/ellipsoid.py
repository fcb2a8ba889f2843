"""Ellipsoids as meshes, for formats that have none."""

import numpy as np

from terrainkit_robots.mesh.surface import Surface

_SUBDIVISIONS = 3
"""Of an icosahedron: 1,280 faces, which reach 99 % of the ellipsoid's volume."""


def ellipsoid(radii: tuple[float, ...]) -> Surface:
    """Return an ellipsoid.

    Args:
        radii: Along x, y and z [m].
    """
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=_SUBDIVISIONS)
    return Surface(points=np.asarray(ball.vertices) * np.array(radii), faces=np.asarray(ball.faces))
