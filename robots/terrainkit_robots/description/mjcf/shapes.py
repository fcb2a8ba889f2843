"""Convert parsed MuJoCo geoms and meshes to shapes, colors and mesh files."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import mujoco
import numpy as np

from terrainkit_robots.description.mjcf.tree import Node
from terrainkit_robots.description.model import Geometry, MeshFile, ShapeKind
from terrainkit_robots.description.package_resolver import resolve_in
from terrainkit_robots.transforms import quat_to_matrix

SIZES: Mapping[ShapeKind, int] = {
    "sphere": 1,
    "capsule": 2,
    "cylinder": 2,
    "ellipsoid": 3,
    "box": 3,
}
"""Number of size parameters of each primitive."""


_KINDS: Mapping[str, ShapeKind] = {f"mjGEOM_{kind.upper()}": kind for kind in get_args(ShapeKind)}


def shape_kind(shape: Any) -> ShapeKind:
    """Return the kind of a geom or site."""
    return _KINDS.get(mujoco.mjtGeom(shape.type).name, "unknown")


_DEFAULT_COLOR = np.array([0.5, 0.5, 0.5, 1], dtype=np.float32)
"""MuJoCo's default color; it uses the color of the material instead, if there is one."""


def color_of(geom: Any, materials: Mapping[str, Any]) -> tuple[float, float, float, float] | None:
    """Return the RGBA color of a geom or of its material.

    Returns None if there is neither, or if a value is outside of [0, 1].
    """
    rgba = geom.rgba
    if (rgba == _DEFAULT_COLOR).all():
        if geom.material not in materials:
            return None
        rgba = materials[geom.material].rgba
    red, green, blue, opacity = (round(float(value), 6) for value in rgba)
    color = (red, green, blue, opacity)
    return color if all(0 <= value <= 1 for value in color) else None


def mesh_name(mesh: Any) -> str:
    """Return the name of a mesh asset, which defaults to the name of its file."""
    return mesh.name or Path(str(mesh.file).replace("\\", "/")).stem


def mesh_file(mesh: Any, node: Node, strip: bool) -> MeshFile | None:
    """Return the file of a mesh asset; None if the mesh is defined in the model.

    Args:
        mesh: The MuJoCo mesh.
        node: Its node.
        strip: Whether MuJoCo removes the folders of file names.
    """
    name = node.written.get("file", "") or str(mesh.file)
    if not name:
        return None
    x, y, z = map(float, mesh.scale)
    folder = node.folder / str(mesh.compiler.meshdir or "")
    path, found_by = resolve_in(folder, Path(name).name if strip else name)
    return MeshFile(
        source=node.source,
        filename=name,
        path=path,
        found_by=found_by,
        attribute="file",
        scale=(x, y, z),
        implied_name="" if "name" in node.written else mesh_name(mesh),
    )


def mesh_geometry(geometry: Geometry, mesh: Any, file: MeshFile, scale: float) -> Geometry:
    """Return a geometry with the shape of a mesh, including the mesh's own reference frame.

    MuJoCo subtracts `refpos` from each vertex, applies the inverse of `refquat`, and then scales.
    The frames around the geom apply the factor `scale`.
    """
    scales = np.array(file.scale)
    rotation = quat_to_matrix(np.asarray(mesh.refquat)).T
    if np.any(scales != scales[0]) and np.abs(rotation - np.eye(3)).max() > 1e-9:
        return replace(geometry, shape="unknown", mesh=file)  # not a scaled mesh in any pose
    mesh_pose = np.eye(4)
    mesh_pose[:3, :3] = rotation
    mesh_pose[:3, 3] = -scale * scales * (rotation @ np.asarray(mesh.refpos))
    x, y, z = map(float, scale * scales)
    return replace(
        geometry,
        shape="mesh",
        mesh=replace(file, scale=(x, y, z)),
        origin=geometry.origin @ mesh_pose,
    )
