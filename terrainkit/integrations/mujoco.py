"""Maps in MuJoCo models."""

from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit.errors import ExportError
from terrainkit.export import mjcf_map
from terrainkit.files.memory import check_memory
from terrainkit.integrations import load_map
from terrainkit.integrations.near_geoms import NearGeoms as NearGeoms

if TYPE_CHECKING:
    from pathlib import Path

    import mujoco
    import trimesh

    from terrainkit.map.terrain_map import TerrainMap

_BYTES_PER_SAMPLE = 24
"""Peak memory per sample of a heightfield, also when it is compiled [bytes]; measured: 17 to 24."""


def make_spec(
    source: "TerrainMap | str | Path", *, collision: mjcf_map.Collision = "auto"
) -> "mujoco.MjSpec":
    """Return the map as a MuJoCo model specification.

    Args:
        source: Map, or path of a .npz file.
        collision: Geometry that robots collide with; see `terrainkit.export.mjcf_map.export`.
    """
    import mujoco

    terrain_map = load_map(source)
    samples = terrain_map.heights.size
    check_memory(samples * _BYTES_PER_SAMPLE, f"a MuJoCo model of {samples} samples")
    model = mjcf_map.make_model(terrain_map, collision)
    spec = mujoco.MjSpec()
    spec.modelname = "terrain"
    for name, value in terrain_map.config.contact.items():
        spec.add_numeric(name=f"terrain_{name}", data=[value])
    default = spec.add_default("terrain", spec.default)
    for name, value in _fields(model.geom_defaults).items():
        setattr(default.geom, name, value)
    for name, value in _fields(mjcf_map.SITE_DEFAULTS).items():
        setattr(default.site, name, value)
    for name, vertices in model.hulls().items():
        convex = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        spec.add_mesh(name=name, uservert=vertices.ravel(), inertia=convex)
    for name, (part, _) in model.hfields.items():
        elevation = mjcf_map.hfield_elevation(model.heights, part)
        nrow, ncol = elevation.shape
        size = mjcf_map.hfield_size(model.heights, part, terrain_map.grid.cell)
        # MuJoCo reads a memoryview twice as fast as an array.
        data = elevation.astype(np.float32).ravel().data
        spec.add_hfield(name=name, nrow=nrow, ncol=ncol, size=size, userdata=data)
    for geom in model.geoms():
        spec.worldbody.add_geom(default, **_fields(geom))
    for site in model.sites():
        spec.worldbody.add_site(default, **_fields(site))
    return spec


def _fields(attributes: dict[str, Any]) -> dict[str, Any]:
    """Return attributes of MJCF as fields of a specification."""
    import mujoco

    fields = dict(attributes)
    for kind in fields.keys() & {"mesh", "hfield"}:
        fields[f"{kind}name"] = fields.pop(kind)
    if "type" in fields:
        fields["type"] = getattr(mujoco.mjtGeom, f"mjGEOM_{fields['type'].upper()}")
    return fields


def add_map(
    spec: "mujoco.MjSpec",
    source: "TerrainMap | str | Path",
    *,
    collision: mjcf_map.Collision = "auto",
) -> None:
    """Add the map to the world body of `spec`, in world coordinates.

    Args:
        spec: Specification of a robot or scene.
        source: Map, or path of a .npz file.
        collision: Geometry that robots collide with; see `terrainkit.export.mjcf_map.export`.
    """
    frame = spec.worldbody.add_frame()
    spec.attach(make_spec(source, collision=collision), frame=frame, prefix="terrain/")


def static_mesh(model: "mujoco.MjModel") -> "trimesh.Trimesh":
    """Return the static geoms of a model as one mesh, in world coordinates [m].

    Args:
        model: The compiled model.

    Raises:
        ExportError: if a static geom is a plane or an SDF.
    """
    import mujoco
    import trimesh

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    meshes = []
    for geom in np.flatnonzero(model.body_weldid[model.geom_bodyid] == 0):
        mesh = _geom_mesh(model, int(geom))
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
        meshes.append(mesh.apply_transform(pose))
    if not meshes:
        raise ExportError("static geoms: got none; expected a terrain")
    return trimesh.util.concatenate(meshes)


def _geom_mesh(model: "mujoco.MjModel", geom: int) -> "trimesh.Trimesh":
    """Return the mesh of a geom in its own frame."""
    import mujoco
    import trimesh
    from trimesh import creation

    size, kind, number = model.geom_size[geom], model.geom_type[geom], model.geom_dataid[geom]
    match mujoco.mjtGeom(kind):
        case mujoco.mjtGeom.mjGEOM_BOX:
            return creation.box(extents=2 * size)
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            return creation.cylinder(radius=size[0], height=2 * size[1])
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            return creation.capsule(radius=size[0], height=2 * size[1])
        case mujoco.mjtGeom.mjGEOM_SPHERE | mujoco.mjtGeom.mjGEOM_ELLIPSOID as shape:
            is_sphere = shape == mujoco.mjtGeom.mjGEOM_SPHERE
            return creation.icosphere().apply_scale(size[0] if is_sphere else size)
        case mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.mesh(number)
            vertices = model.mesh_vert[mesh.vertadr[0] :][: mesh.vertnum[0]]
            faces = model.mesh_face[mesh.faceadr[0] :][: mesh.facenum[0]]
            return trimesh.Trimesh(vertices, faces, process=False)
        case mujoco.mjtGeom.mjGEOM_HFIELD:
            return _hfield_mesh(model.hfield(number))
        case other:
            name = other.name.removeprefix("mjGEOM_").lower()
            raise ExportError(f"static geom {geom}: got a {name}; expected a shape with a mesh")


def _hfield_mesh(field: Any) -> "trimesh.Trimesh":
    """Return the upper surface of a heightfield, whose rows are along y."""
    import trimesh

    rows, columns = int(field.nrow[0]), int(field.ncol[0])
    half_x, half_y, height, _ = field.size
    y, x = np.meshgrid(
        np.linspace(-half_y, half_y, rows), np.linspace(-half_x, half_x, columns), indexing="ij"
    )
    vertices = np.stack([x, y, height * field.data.reshape(rows, columns)], axis=-1)
    k = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = k[:-1, :-1], k[:-1, 1:], k[1:, 1:], k[1:, :-1]
    halves = ((a, b, c), (a, c, d))
    faces = np.concatenate([np.stack(corners, -1).reshape(-1, 3) for corners in halves])
    return trimesh.Trimesh(vertices.reshape(-1, 3), faces, process=False)
