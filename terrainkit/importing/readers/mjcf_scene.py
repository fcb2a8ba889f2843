"""Read the ground from an MJCF scene or a Gazebo world: the geoms that are fixed to the world.

Unlike MuJoCo's rays, faces have every surface below each other, and closed bodies for solids.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import HeightFileError, listing
from terrainkit.files.child_process import ProcessLimits
from terrainkit.importing.readers.height_source import Array, decode, warn
from terrainkit.importing.readers.image import read_pixels
from terrainkit.importing.readers.import_options import ReadOptions
from terrainkit.importing.readers.mesh_source import MeshSource, make_mesh_source, read_arrays
from terrainkit.importing.readers.mjcf_text import MjcfText, read_text
from terrainkit.importing.readers.scene_mesh import SceneMesh, unit_shapes

SUFFIXES = (".xml", ".sdf", ".world")

_BYTES_PER_STEP = 1 << 20
"""Size of files for which MuJoCo may take 10 s and a quarter of a gigabyte more."""

_MANY_GEOMS = (1000, 5000)
"""Numbers of geoms beyond which curved ones get half as many sides, and half as many again."""


def read(path: Path, options: ReadOptions) -> MeshSource:
    """Return the fixed geoms that collide as a mesh, with z up and in meters.

    Bodies with joints, such as robots, are removed. Planes end 2 m beyond the other geoms.

    Args:
        path: The scene, or a world or model of Gazebo; MuJoCo opens the files that it refers to.
        options: How to read the file.

    Warns:
        TerrainkitWarning: if bodies were removed.

    Raises:
        HeightFileError: if MuJoCo cannot compile the scene, or nothing in it is fixed.
    """
    scene = read_text(path)
    steps = scene.num_bytes // _BYTES_PER_STEP
    limits = ProcessLimits(seconds=min(20.0 + 10 * steps, 120.0), memory=min(4 + steps, 32) << 28)
    arrays = decode(_read_scene, path, scene, limits=limits)
    if not len(arrays["faces"]):
        raise HeightFileError(
            f"{path}: got a scene without ground; expected geoms that collide in the world body, "
            "or static models"
        )
    moving = [str(name) or "one without name" for name in [*scene.moving, *arrays["moving"]]]
    if moving:
        warn(f"{path}: bodies that move are left out: {listing(moving)}")
    up = "z" if options.up == "auto" else options.up
    return make_mesh_source(path, arrays, replace(options, up=up))


def _read_scene(_: Path, scene: MjcfText) -> dict[str, Any]:
    import mujoco

    mujoco.set_mju_user_warning(lambda _: None)  # it would write MUJOCO_LOG.TXT
    spec = mujoco.MjSpec.from_string(scene.text, include=scene.models or None)
    _read_files(spec, scene)
    world = spec.worldbody

    @cache
    def root(body: Any) -> Any:
        return body if body == world or body.parent == world else root(body.parent)

    moving = {root(joint.parent): None for joint in spec.joints}
    for joint in spec.joints:  # what they weigh may be left out
        joint.parent.mass, joint.parent.inertia = 1.0, np.ones(3)
        joint.parent.explicitinertial = True
    used = set()
    for geom in spec.geoms:
        is_ground = (geom.contype or geom.conaffinity) and root(geom.parent) not in moving
        geom.group = int(is_ground)
        geom.contype = geom.conaffinity = 0  # no convex hulls
        if is_ground:
            used |= {geom.meshname, geom.hfieldname}
        else:  # its files may be missing
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_SPHERE, np.ones(3)
            geom.fromto = np.full(6, np.nan)  # of a capsule
            geom.meshname = geom.hfieldname = ""
    for asset in [*spec.meshes, *spec.hfields]:
        if asset.name not in used:
            spec.delete(asset)
    for mesh in spec.meshes:
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # also of what is not closed
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    moving_names = np.array([body.name for body in moving], dtype=str)
    arrays = geom_mesh(model, data, np.flatnonzero(model.geom_group == 1)).arrays()
    return {**arrays, "moving": moving_names, "unit": 1.0}


def _read_files(spec: Any, scene: MjcfText) -> None:
    """Read the meshes and heightmaps of a Gazebo world, some of which MuJoCo cannot read."""
    for name, file in scene.meshes.items():
        arrays, mesh = read_arrays(file), spec.mesh(name)
        mesh.uservert = (arrays["vertices"] * arrays.get("unit", 1.0)).ravel()
        mesh.userface = arrays["faces"].ravel()
    for name, file in scene.images.items():
        pixels = read_pixels(file)["pixels"].astype(float)
        if pixels.ndim > 2:
            pixels = pixels[..., 2]  # Gazebo takes red
        field, low, top = spec.hfield(name), pixels.min(), max(pixels.max(), 1.0)
        # The largest value has the upper height; MuJoCo also has the smallest one at 0.
        lift = field.size[2] * low / top
        field.nrow, field.ncol = pixels.shape
        field.userdata = pixels[::-1].ravel()
        field.size[2] = max(field.size[2] - lift, 1e-6)
        for geom in spec.geoms:
            if geom.hfieldname == name:
                geom.pos[2] += lift


def geom_mesh(model: Any, data: Any, geoms: NDArray[np.int64]) -> SceneMesh:
    """Return some geoms of a MuJoCo model in the frame of the world.

    Args:
        model: The compiled model.
        data: Its data with the positions of the geoms.
        geoms: Numbers of the geoms, shape (n,).
    """
    from mujoco import mjtGeom as Geom

    scene = SceneMesh()
    shapes = unit_shapes(level=4 - sum(model.ngeom > number for number in _MANY_GEOMS))
    for k in geoms.tolist():
        kind = Geom(model.geom_type[k])
        size = model.geom_size[k]
        asset = model.geom_dataid[k]
        place, axes = data.geom_xpos[k], data.geom_xmat[k].reshape(3, 3)
        if kind == Geom.mjGEOM_PLANE:
            scene.add_plane(place, axes[:, 2], size)
            continue
        if kind == Geom.mjGEOM_HFIELD:
            vertices, faces = _hfield(model, asset)
        elif asset >= 0:
            start, first = model.mesh_vertadr[asset], model.mesh_faceadr[asset]
            vertices = model.mesh_vert[start : start + model.mesh_vertnum[asset]].astype(float)
            faces = model.mesh_face[first : first + model.mesh_facenum[asset]]
        else:
            name, radii = _SHAPES[kind.name]
            vertices, faces = shapes[name]
            vertices = vertices * size[radii]
            if kind == Geom.mjGEOM_CAPSULE:
                vertices[:, 2] += size[1] * np.sign(vertices[:, 2].round(9))
        scene.add(vertices @ axes.T + place, faces)
    return scene


_SHAPES = {
    "mjGEOM_BOX": ("box", [0, 1, 2]),
    "mjGEOM_CYLINDER": ("cylinder", [0, 0, 1]),
    "mjGEOM_ELLIPSOID": ("sphere", [0, 1, 2]),
    "mjGEOM_SPHERE": ("sphere", [0, 0, 0]),
    "mjGEOM_CAPSULE": ("sphere", [0, 0, 0]),
}
"""Unit shape of a type of geom, and its elements of `size` along x, y and z."""


def _hfield(model: Any, asset: int) -> tuple[Array, Any]:
    """Return the surface of a heightfield, each cell with the diagonal that MuJoCo uses."""
    rows, cols = model.hfield_nrow[asset], model.hfield_ncol[asset]
    start, size = model.hfield_adr[asset], model.hfield_size[asset]
    z = model.hfield_data[start : start + rows * cols] * size[2]
    y, x = np.meshgrid(
        np.linspace(-size[1], size[1], rows), np.linspace(-size[0], size[0], cols), indexing="ij"
    )
    a = (np.arange(rows - 1)[:, None] * cols + np.arange(cols - 1)).ravel().astype(np.int32)
    b, c, d = a + 1, a + cols + 1, a + cols
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return np.column_stack([x.ravel(), y.ravel(), z]), faces
