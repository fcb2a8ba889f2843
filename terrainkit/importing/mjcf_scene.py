"""Read the ground from an MJCF scene: the geoms that are fixed to the world.

Unlike MuJoCo's rays, faces have every surface below each other, and closed bodies for solids.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from terrainkit.errors import HeightFileError, listing
from terrainkit.importing.mesh_file import MeshSource, make_mesh_source
from terrainkit.importing.options import ReadOptions
from terrainkit.importing.source import Array, decode, warn

SUFFIXES = (".xml",)

PLANE_MARGIN = 2.0
"""Width of an infinite plane around the other geoms [m]."""

_UNUSED = (
    *("keys", "sensors", "actuators", "equalities", "tendons", "pairs", "excludes", "tuples"),
    *("skins", "lights", "cameras", "sites", "materials", "textures"),
)
"""Elements other than ground, which may refer to removed bodies or missing files."""

_SECTIONS = 128
"""Sides of a cylinder of n sides: for a radius of 1 m, the error is 0.3 mm."""


def read(path: Path, options: ReadOptions) -> MeshSource:
    """Return the fixed geoms that collide as a mesh, with z up and in meters.

    Bodies with joints, such as robots, are removed. Planes end `PLANE_MARGIN` beyond the other
    geoms.

    Args:
        path: The scene; MuJoCo opens the files that it refers to.
        options: How to read the file.

    Warns:
        TerrainkitWarning: if bodies were removed.

    Raises:
        HeightFileError: if MuJoCo cannot compile the scene, or nothing in it is fixed.
    """
    arrays = decode(_read_scene, path)
    if not len(arrays["faces"]):
        raise HeightFileError(
            f"{path}: got a scene without ground; expected geoms that collide in the world body"
        )
    moving = [str(name) or "one without name" for name in arrays["moving"]]
    if moving:
        warn(f"{path}: bodies with joints are left out: {listing(moving)}")
    return make_mesh_source(path, arrays, options)


def _read_scene(path: Path) -> dict[str, Any]:
    import mujoco
    import trimesh

    mujoco.set_mju_user_warning(lambda _: None)  # it would write MUJOCO_LOG.TXT
    spec = mujoco.MjSpec.from_file(str(path))
    moving = [
        body
        for body in spec.worldbody.bodies
        if any(each.joints for each in (body, *body.find_all("body")))
    ]
    geoms = [geom for geom in spec.geoms if not (geom.contype or geom.conaffinity)]
    for each in (*moving, *geoms):
        spec.delete(each)
    # What only robots and pictures need, which may be missing.
    for geom in spec.geoms:
        geom.material = ""
    for kind in _UNUSED:
        for each in list(getattr(spec, kind)):
            spec.delete(each)
    used = {name for geom in spec.geoms for name in (geom.meshname, geom.hfieldname)}
    for asset in [*spec.meshes, *spec.hfields]:
        if asset.name not in used:
            spec.delete(asset)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    meshes = [(np.empty((0, 3)), np.empty((0, 3), np.int64)), *_geom_meshes(model, data)]
    vertices, faces = trimesh.util.append_faces(*zip(*meshes, strict=True))
    moving_names = np.array([body.name for body in moving], dtype=str)
    return {"vertices": vertices, "faces": faces, "moving": moving_names, "unit": 1.0}


def _geom_meshes(model: Any, data: Any) -> Iterator[tuple[Array, Any]]:
    """Yield the vertices and faces of each geom in the frame of the world, planes last."""
    from mujoco import mjtGeom as Geom

    shapes = _unit_shapes()
    lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
    for k in np.argsort(model.geom_type == Geom.mjGEOM_PLANE, kind="stable").tolist():
        kind, size, asset = Geom(model.geom_type[k]), model.geom_size[k], model.geom_dataid[k]
        place, axes = data.geom_xpos[k], data.geom_xmat[k].reshape(3, 3)
        if kind == Geom.mjGEOM_PLANE:
            if lower[0] > upper[0]:
                lower, upper = place - size, place + size
            yield _plane(place, axes[:, 2], lower[:2] - PLANE_MARGIN, upper[:2] + PLANE_MARGIN)
            continue
        if kind == Geom.mjGEOM_HFIELD:
            vertices, faces = _hfield(model, asset)
        elif asset >= 0:
            start, first = model.mesh_vertadr[asset], model.mesh_faceadr[asset]
            vertices = model.mesh_vert[start : start + model.mesh_vertnum[asset]].astype(float)
            faces = model.mesh_face[first : first + model.mesh_facenum[asset]].astype(np.int64)
        else:
            name, radii = _SHAPES[kind.name]
            vertices, faces = shapes[name]
            vertices = vertices * size[radii]
            if kind == Geom.mjGEOM_CAPSULE:
                vertices[:, 2] += size[1] * np.sign(vertices[:, 2].round(9))
        vertices = vertices @ axes.T + place
        lower = np.minimum(lower, vertices.min(axis=0))
        upper = np.maximum(upper, vertices.max(axis=0))
        yield vertices, faces


_SHAPES = {
    "mjGEOM_BOX": ("box", [0, 1, 2]),
    "mjGEOM_CYLINDER": ("cylinder", [0, 0, 1]),
    "mjGEOM_ELLIPSOID": ("sphere", [0, 1, 2]),
    "mjGEOM_SPHERE": ("sphere", [0, 0, 0]),
    "mjGEOM_CAPSULE": ("sphere", [0, 0, 0]),
}
"""Unit shape of a type of geom, and its elements of `size` along x, y and z."""


def _unit_shapes() -> dict[str, tuple[Array, Any]]:
    """Return the vertices and faces of shapes with half size 1."""
    from trimesh import creation

    meshes = {
        "box": creation.box((2.0, 2.0, 2.0)),
        "cylinder": creation.cylinder(1.0, 2.0, sections=_SECTIONS),
        "sphere": creation.icosphere(4),
    }
    return {name: (mesh.vertices, np.asarray(mesh.faces)) for name, mesh in meshes.items()}


def _plane(place: Array, normal: Array, lower: Array, upper: Array) -> tuple[Array, Any]:
    """Return the rectangle of a plane above the square from `lower` to `upper`."""
    if abs(normal[2]) < 0.1:
        raise ValueError(f"got a plane with normal {normal.round(3)}; expected one that faces up")
    x, y = np.array([[lower[0], upper[0], upper[0], lower[0]], np.repeat([lower[1], upper[1]], 2)])
    z = place[2] - ((x - place[0]) * normal[0] + (y - place[1]) * normal[1]) / normal[2]
    return np.column_stack([x, y, z]), np.array([[0, 1, 2], [0, 2, 3]])


def _hfield(model: Any, asset: int) -> tuple[Array, Any]:
    """Return the surface of a heightfield, each cell with the diagonal that MuJoCo uses."""
    rows, cols = model.hfield_nrow[asset], model.hfield_ncol[asset]
    start, size = model.hfield_adr[asset], model.hfield_size[asset]
    z = model.hfield_data[start : start + rows * cols] * size[2]
    y, x = np.meshgrid(
        np.linspace(-size[1], size[1], rows), np.linspace(-size[0], size[0], cols), indexing="ij"
    )
    a = (np.arange(rows - 1)[:, None] * cols + np.arange(cols - 1)).ravel()
    b, c, d = a + 1, a + cols + 1, a + cols
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return np.column_stack([x.ravel(), y.ravel(), z]), faces
