"""What is seen of a robot in MuJoCo: which of its shapes, and how far they reach."""

from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    import mujoco

_DRAWN_GROUPS = 3
"""Groups of shapes below this number are drawn by MuJoCo unless it is told otherwise."""

UNPAINTED = np.array([0.5, 0.5, 0.5, 1], dtype=np.float32)
"""Color of shapes that were given none: MuJoCo takes their material's, where they have one."""

_TURNS = 32
"""So many points stand for the round of a shape: they miss it by 0.5 % of the radius."""


def visible_shapes(model: "mujoco.MjModel") -> list[int]:
    """Return the indices of the shapes to be drawn.

    Those that MuJoCo draws unasked; of a robot that has none of them, all. Shapes that collide are
    not mixed with those: of a link without visuals there is then nothing to be seen. Floors are no
    part of a robot, and what is wholly transparent is not seen, unless there is nothing else.
    """
    solid = [i for i in range(model.ngeom) if not _is_ground(model, i)]
    seen = [i for i in solid if model.geom_group[i] >= 0 and _opacity(model, i) > 0]
    drawn = [i for i in seen if model.geom_group[i] < _DRAWN_GROUPS]
    return drawn or seen or solid


def clear_shapes(model: "mujoco.MjModel") -> list[int]:
    """Return the indices of the shapes that are wholly transparent."""
    return [i for i in range(model.ngeom) if _opacity(model, i) == 0]


def _is_ground(model: "mujoco.MjModel", geom: int) -> bool:
    import mujoco

    return int(model.geom_type[geom]) in (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)


def _opacity(model: "mujoco.MjModel", geom: int) -> float:
    material = int(model.geom_matid[geom])
    if material >= 0 and (model.geom_rgba[geom] == UNPAINTED).all():
        return float(model.mat_rgba[material, 3])
    return float(model.geom_rgba[geom, 3])


def outline(model: "mujoco.MjModel", data: "mujoco.MjData", geoms: list[int]) -> Matrix:
    """Return points that shapes lie between, in the world's frame, shape (n, 3) [m]."""
    parts = [
        _points(model, geom) @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        for geom in geoms
    ]
    return np.concatenate(parts) if parts else np.zeros((0, 3))


def _points(model: "mujoco.MjModel", geom: int) -> Matrix:
    """Return points of a shape in its own frame, shape (n, 3) [m]."""
    import mujoco

    kind, size = int(model.geom_type[geom]), np.asarray(model.geom_size[geom], dtype=np.float64)
    types = mujoco.mjtGeom
    if kind in (types.mjGEOM_MESH, types.mjGEOM_SDF):
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        vertices = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
        return np.asarray(vertices, dtype=np.float64)
    if kind == types.mjGEOM_BOX:
        return _CORNERS * size
    if kind in (types.mjGEOM_CYLINDER, types.mjGEOM_CAPSULE):
        end = size[0] * (_ball() if kind == types.mjGEOM_CAPSULE else _ring())
        above = np.array([0.0, 0.0, size[1]])
        return np.concatenate([end + above, end - above])
    return _ball() * (size if kind == types.mjGEOM_ELLIPSOID else size[0])


_CORNERS = np.array([[x, y, z] for x in (-1.0, 1) for y in (-1.0, 1) for z in (-1.0, 1)])


def _ring() -> Matrix:
    angles = np.linspace(0, 2 * np.pi, _TURNS, endpoint=False)
    return np.column_stack([np.cos(angles), np.sin(angles), np.zeros(_TURNS)])


def _ball() -> Matrix:
    rings = [
        _ring() * [np.cos(tilt), np.cos(tilt), 0] + [0, 0, np.sin(tilt)]
        for tilt in np.linspace(-np.pi / 2, np.pi / 2, _TURNS // 2 + 1)
    ]
    return np.concatenate(rings)
