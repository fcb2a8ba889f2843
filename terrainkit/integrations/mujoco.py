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

    from terrainkit.importing.readers.mjcf_scene import geom_mesh

    geoms = np.flatnonzero(model.body_weldid[model.geom_bodyid] == 0)
    if not len(geoms):
        raise ExportError("static geoms: got none; expected a terrain")
    for geom in geoms.tolist():
        kind = mujoco.mjtGeom(model.geom_type[geom])
        if kind in (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_SDF):
            name = kind.name.removeprefix("mjGEOM_").lower()
            raise ExportError(f"static geom {geom}: got a {name}; expected a shape with a mesh")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return trimesh.Trimesh(**geom_mesh(model, data, geoms).arrays(), process=False)
