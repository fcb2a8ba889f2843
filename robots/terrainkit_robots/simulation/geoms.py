"""Geoms of a MuJoCo model: which collide, and how high they are."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.surface import HeightfieldSurface
from terrainkit_robots.quiet_mujoco import quiet_mujoco

MIN_NORMAL_Z = 0.1
"""Smallest vertical component of a plane's normal that makes it ground, and not a wall."""


def collides(model: Any) -> NDArray[np.bool_]:
    """Return which geoms of a MuJoCo model collide, shape (ngeom,)."""
    return np.asarray((model.geom_contype != 0) | (model.geom_conaffinity != 0))


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


def measure_surface(path: Path, cell: float, half_size: float) -> HeightfieldSurface:
    """Measure the surface of a static MuJoCo model by rays from above.

    Args:
        path: The model's file.
        cell: Distance between samples [m].
        half_size: Half the side of the square around the origin that is measured [m].

    Raises:
        ConfigError: If MuJoCo cannot read the model, or there is no ground at the origin.
    """
    import mujoco

    try:
        with quiet_mujoco():
            model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise ConfigError(f"MuJoCo cannot read {path}: {reason}") from None
    if model.nv:
        raise ConfigError(f"{path}: got {model.nv} degrees of freedom; expected a static model")
    n = 2 * round(half_size / cell) + 1
    axis = ((np.arange(n) - n // 2) * cell).astype(np.float32)
    heights = _measure_heights(model, axis)
    if np.isnan(heights[n // 2, n // 2]):
        raise ConfigError(f"{path}: no ground at the origin, where robots spawn")
    # Where there is no ground, robots fall: any height far below will do.
    filled = np.where(np.isnan(heights), np.nanmin(heights) - 10, heights).astype(np.float32)
    corner = (float(axis[0]), float(axis[0]))
    return HeightfieldSurface(heights=filled, first_sample=corner, cell=cell)


def _measure_heights(model: Any, axis: NDArray[np.float32]) -> NDArray[np.float64]:
    """Measure the height of a static model by rays from above, shape (n, n); NaN without ground.

    `axis` has the coordinates of the grid along x and along y [m], shape (n,).
    """
    import mujoco

    # Rays hit visible geoms; robots touch colliding ones.
    model.geom_group[:] = np.where(collides(model), 0, 1)
    model.geom_matid[:], model.geom_rgba[:, 3] = -1, 1
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    top = float((data.geom_xpos[:, 2] + model.geom_rbound).max(initial=0.0)) + 1
    # A plane has no bounding radius: add its rise within the square.
    normal = data.geom_xmat.reshape(-1, 3, 3)[:, :, 2]
    planes = (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE) & (normal[:, 2] > MIN_NORMAL_Z)
    slope = -normal[planes, :2] / normal[planes, 2:]
    rise = np.abs(slope).sum(axis=1) * float(axis[-1])
    top += float((rise - (slope * data.geom_xpos[planes, :2]).sum(axis=1)).max(initial=0.0))
    down, geom = np.array([0.0, 0.0, -1.0]), np.zeros(1, np.int32)
    groups = np.array([1, 0, 0, 0, 0, 0], np.uint8)
    heights = np.full((len(axis), len(axis)), np.nan)
    for i, x in enumerate(axis):
        for j, y in enumerate(axis):
            start = np.array([x, y, top], float)
            distance = mujoco.mj_ray(model, data, start, down, groups, 1, -1, geom, None)
            if distance >= 0:
                heights[i, j] = top - distance
    return heights
