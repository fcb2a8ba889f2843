"""Write the map as a USD stage with colliders, friction, spawn positions and goals.

The ground is a mesh without simplification, and each solid a cube, a cylinder or a convex mesh.
"""

import errno
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ExportError, install_command
from terrainkit.export.requirements import require_one_ground_friction
from terrainkit.geometry.mesh.solid_mesh import solid_meshes
from terrainkit.geometry.mesh.tri_mesh import TriMesh
from terrainkit.geometry.solids import Solids

if TYPE_CHECKING:
    from terrainkit.map.terrain_map import TerrainMap

SUFFIXES = (".usd", ".usda", ".usdc")
BYTES_PER_SAMPLE = 46


def export(terrain_map: "TerrainMap", path: Path) -> None:
    """Write the map in meters with z up. The prim `/terrain` is the default prim.

    `/terrain/ground` is a static collider, `/terrain/solids` has the solids, and `/terrain/spawns`
    and `/terrain/goals` are points.

    Args:
        terrain_map: The map.
        path: Target; .usda is text, and the others are binary.

    Raises:
        ExportError: if usd-core is not installed, or the ground has several friction coefficients.
        OSError: if the file cannot be written.
    """
    try:
        from pxr import Kind, Tf, Usd, UsdGeom
    except ModuleNotFoundError:
        raise ExportError(
            f"{path.suffix} requires usd-core; install it with: {install_command('usd')}"
        ) from None
    require_one_ground_friction(terrain_map, "a USD mesh")
    config = terrain_map.config
    usd_stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(usd_stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(usd_stage, 1.0)
    root = UsdGeom.Xform.Define(usd_stage, "/terrain")
    usd_stage.SetDefaultPrim(root.GetPrim())
    Usd.ModelAPI(root).SetKind(Kind.Tokens.component)
    ground = _add_mesh(usd_stage, "/terrain/ground", terrain_map.ground_mesh())
    _set_collider(ground, "none", _material(usd_stage, "ground_material", config.contact))
    _add_solids(usd_stage, terrain_map.solids, config.contact)
    _add_points(usd_stage, "/terrain/spawns", terrain_map.spawns)
    _add_points(usd_stage, "/terrain/goals", terrain_map.goals)
    try:
        usd_stage.GetRootLayer().Export(str(path))
    except Tf.ErrorException as error:  # its text has the path of the temporary file
        raise OSError(errno.EIO, "usd-core failed; the disk may be full") from error


def _add_mesh(usd_stage: Any, path: str, mesh: TriMesh) -> Any:
    from pxr import UsdGeom, Vt

    prim = UsdGeom.Mesh.Define(usd_stage, path)
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(mesh.vertices)))
    prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(mesh.triangles.ravel()))
    counts = np.full(len(mesh.triangles), 3, dtype=np.int32)
    prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(counts))
    # USD's default, Catmull-Clark, would round the edges.
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    prim.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(prim.GetPointsAttr().Get()))
    return prim


def _material(usd_stage: Any, name: str, contact: dict[str, float]) -> Any:
    """Return the material `name`, which is added to the stage if there is none."""
    from pxr import UsdPhysics, UsdShade

    material = UsdShade.Material.Define(usd_stage, f"/terrain/materials/{name}")
    physics = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
    physics.CreateStaticFrictionAttr(contact["static_friction"])
    physics.CreateDynamicFrictionAttr(contact["dynamic_friction"])
    physics.CreateRestitutionAttr(contact["restitution"])
    return material


def _set_collider(prim: Any, approximation: str, material: Any) -> None:
    """Make `prim` a static collider."""
    from pxr import UsdGeom, UsdPhysics, UsdShade

    UsdPhysics.CollisionAPI.Apply(prim.GetPrim())
    if prim.GetPrim().IsA(UsdGeom.Mesh):
        mesh = UsdPhysics.MeshCollisionAPI.Apply(prim.GetPrim())
        mesh.CreateApproximationAttr(approximation)
    binding = UsdShade.MaterialBindingAPI.Apply(prim.GetPrim())
    binding.Bind(material, UsdShade.Tokens.weakerThanDescendants, "physics")


def _add_solids(usd_stage: Any, solids: Solids, contact: dict[str, float]) -> None:
    """Add a prim for each solid. Invisible solids are drawn only as guides."""
    from pxr import Gf, Sdf, UsdGeom

    shapes = np.concatenate([solids.boxes, solids.cylinders])
    hulls = solid_meshes(solids.select(np.arange(len(solids)) >= len(shapes)))
    # Each change of a stage visits all siblings, so the prims are created in one change.
    with Sdf.ChangeBlock():
        for k in range(len(solids)):
            spec = Sdf.CreatePrimInLayer(usd_stage.GetRootLayer(), f"/terrain/solids/solid_{k}")
            spec.specifier = Sdf.SpecifierDef
    materials: dict[str, Any] = {}
    for k, friction in enumerate(solids.friction.tolist()):
        path = f"/terrain/solids/solid_{k}"
        if k < len(solids.boxes):
            prim = UsdGeom.Cube.Define(usd_stage, path)
            prim.CreateExtentAttr([Gf.Vec3f(-1.0), Gf.Vec3f(1.0)])
            prim.CreateSizeAttr(2.0)
        elif k < len(shapes):
            # Colliders do not support a cylinder with another scale along its axis.
            half_size = Gf.Vec3f(*shapes[k, 3:6].tolist())
            prim = UsdGeom.Cylinder.Define(usd_stage, path)
            prim.CreateExtentAttr([-half_size, half_size])
            prim.CreateRadiusAttr(half_size[0])
            prim.CreateHeightAttr(2 * half_size[2])
        else:
            prim = _add_mesh(usd_stage, path, next(hulls))
        if k < len(shapes):
            pose = shapes[k].tolist()
            prim.AddTranslateOp().Set(Gf.Vec3d(*pose[:3]))
            prim.AddOrientOp().Set(Gf.Quatf(*pose[6:]))
            if k < len(solids.boxes):
                prim.AddScaleOp().Set(Gf.Vec3f(*pose[3:6]))
        if not solids.visible[k]:
            prim.CreatePurposeAttr(UsdGeom.Tokens.guide)
        if solids.collides[k]:
            key = str(friction)  # NaN, the friction of the ground, is not equal to itself
            if key not in materials:
                materials[key] = _solid_material(usd_stage, friction, contact)
            _set_collider(prim, "convexHull", materials[key])


def _solid_material(usd_stage: Any, friction: float, contact: dict[str, float]) -> Any:
    """Return the material of solids with this friction; NaN is the friction of the ground."""
    if np.isnan(friction):
        return _material(usd_stage, "ground_material", contact)
    name = f"friction_{friction:g}".replace(".", "_").replace("-", "_")
    values = contact | {"static_friction": friction, "dynamic_friction": friction}
    return _material(usd_stage, name, values)


def _add_points(usd_stage: Any, path: str, points: NDArray[np.float32]) -> None:
    """Add the positions of all patches in the order of the rows, if there are any."""
    from pxr import UsdGeom, Vt

    positions = points[..., :3].reshape(-1, 3)
    positions = np.ascontiguousarray(positions[~np.isnan(positions).any(axis=1)])
    if len(positions):
        prim = UsdGeom.Points.Define(usd_stage, path)
        prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(positions))
        prim.CreateWidthsAttr(Vt.FloatArray.FromNumpy(np.full(len(positions), 0.1, np.float32)))
        prim.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(prim.GetPointsAttr().Get()))
        prim.CreatePurposeAttr(UsdGeom.Tokens.guide)
