"""Where the geoms of a MuJoCo model are."""

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.integrations.near_geoms import collides


def only_visual(model: Any) -> NDArray[np.bool_]:
    """Return which geoms belong to bodies without colliding geoms, shape (ngeom,).

    In many files for training, only the feet collide.
    """
    solid = np.unique(model.geom_bodyid[collides(model)])
    return np.isin(model.geom_bodyid, solid, invert=True)


def box_corners(model: Any, data: Any, geoms: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the corners of the bounding boxes of geoms.

    Args:
        model: The MuJoCo model.
        data: Its state, with computed kinematics.
        geoms: Ids of the geoms, shape (k,).

    Returns:
        Corners in the world frame [m], shape (8 k, 3).
    """
    corners, boxes = np.array(list(product((-1.0, 1.0), repeat=3))), model.geom_aabb[geoms, None]
    local = boxes[..., :3] + corners * boxes[..., 3:]
    axes = data.geom_xmat[geoms].reshape(-1, 3, 3).transpose(0, 2, 1)
    return np.concatenate(local @ axes + data.geom_xpos[geoms, None])


def lowest_point(model: Any, data: Any, geom: int) -> float:
    """Return the height of a geom's lowest point in the world [m]."""
    import mujoco

    types, size = mujoco.mjtGeom, model.geom_size[geom]
    axes = data.geom_xmat[geom].reshape(3, 3)[2]  # vertical component of each axis
    up = np.abs(axes)
    match model.geom_type[geom]:
        case types.mjGEOM_SPHERE:
            extent = size[0]
        case types.mjGEOM_CAPSULE:
            extent = size[0] + size[1] * up[2]
        case types.mjGEOM_CYLINDER:
            extent = size[0] * np.hypot(up[0], up[1]) + size[1] * up[2]
        case types.mjGEOM_ELLIPSOID:
            extent = np.linalg.norm(size * up)
        case types.mjGEOM_MESH:
            mesh = model.mesh(int(model.geom_dataid[geom]))
            start, count = int(mesh.vertadr[0]), int(mesh.vertnum[0])
            extent = -(model.mesh_vert[start : start + count] @ axes).min()
        case _:
            extent = size @ up
    return float(data.geom_xpos[geom][2] - extent)
