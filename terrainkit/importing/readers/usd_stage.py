"""Read the ground from a USD stage: its colliding shapes, or all visible ones if none collides."""

import os
import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from terrainkit.errors import HeightFileError, listing
from terrainkit.files import sandbox
from terrainkit.files.child_process import ProcessLimits
from terrainkit.importing.readers.height_source import Array, decode, require, warn, with_z_up
from terrainkit.importing.readers.import_options import ReadOptions
from terrainkit.importing.readers.mesh_source import MeshSource, make_mesh_source
from terrainkit.importing.readers.scene_mesh import Faces, SceneMesh, triangulate, unit_shapes

SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")

MAX_VERTICES = 10_000_000
"""Most vertices of a stage, copies included."""

_LIMITS = ProcessLimits(memory=2 << 30)
"""USD allocates what a file claims to hold; 2 million faces take half a gigabyte."""

_AXES = {"X": [2, 0, 1], "Y": [1, 2, 0], "Z": [0, 1, 2]}
"""Columns of a shape along z whose axis is another one."""

_SOLIDS = {"Cube": "box", "Sphere": "sphere", "Capsule": "sphere"}
_SOLIDS |= {"Cylinder": "cylinder", "Cone": "cylinder"}
"""Unit shape of a type of prim; Capsule_1 and Cylinder_1 have two radii."""


def read(path: Path, options: ReadOptions) -> MeshSource:
    """Return the shapes of a stage as a mesh, with z up and in meters.

    Rigid bodies are left out. The process that opens the stage can neither change files nor
    connect.

    Args:
        path: The stage; USD opens the files that it refers to.
        options: How to read the file.

    Warns:
        TerrainkitWarning: if shapes are left out, or the stage does not state its unit.

    Raises:
        HeightFileError: if usd-core is not installed, the stage cannot be read, a file that it
            refers to is missing, or it has no ground.
    """
    require(path, "pxr", "usd")
    arrays = decode(_read_stage, path, options.up, options.scale, limits=_LIMITS)
    for note in arrays["notes"].tolist():
        warn(f"{path}: {note}")
    if not len(arrays["faces"]):
        raise HeightFileError(f"{path}: got a stage without ground; expected meshes or shapes")
    return make_mesh_source(path, arrays, replace(options, up="z", scale=None))


class _Shape(NamedTuple):
    prim: Any

    placements: Array
    """Transforms of its copies to the world, for rows of vertices, shape (n, 4, 4)."""

    collides: bool

    is_visible: bool


def _read_stage(path: Path, up: str, scale: float | None) -> dict[str, Any]:
    os.environ["PXR_WORK_THREAD_LIMIT"] = "1"  # the process cannot start threads
    from pxr import Tf, Usd, UsdGeom

    sandbox.forbid_changes()
    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:  # its text begins with places in the code of USD
        raise ValueError(error.args[0].commentary) from None
    for problem in map(str, stage.GetCompositionErrors()):
        asset = re.search("asset @([^@]*)@", problem)
        name = asset[1] if asset else problem
        if not name.endswith(".mtlx"):  # materials, for which usd-core has no plugin
            raise ValueError(f"a part cannot be opened, and may be ground: {name}")
    has_unit = UsdGeom.StageHasAuthoredMetersPerUnit(stage)
    unit = scale or (UsdGeom.GetStageMetersPerUnit(stage) if has_unit else 1.0)
    axis = UsdGeom.GetStageUpAxis(stage).lower() if up == "auto" else up
    if axis == "x":
        raise ValueError("got the vertical axis x; expected y or z")
    frame = np.diag([unit, unit, unit, 1.0])
    frame[:, :3] = with_z_up(frame[:, :3], axis)
    left_out: dict[str, list[Any]] = defaultdict(list)
    shapes = [*_find_shapes(stage.GetPseudoRoot(), frame[None], left_out)]
    has_colliders = any(shape.collides for shape in shapes)
    scene = SceneMesh(max_vertices=MAX_VERTICES)
    for shape in shapes:
        if shape.collides if has_colliders else shape.is_visible:
            _add_shape(scene, shape)
        elif has_colliders and shape.is_visible:
            left_out["visible shapes that do not collide"].append(shape.prim.GetPath())
    notes = [f"{kind} are left out: {listing(map(str, paths))}" for kind, paths in left_out.items()]
    if not has_unit and not scale:
        notes.append("states no metersPerUnit: taken as meters; `scale=0.01` for centimeters")
    stated = {"unit": 1.0} if has_unit or scale else {}
    return {**scene.arrays(), "notes": np.array(notes, str), **stated}


def _find_shapes(root: Any, placements: Array, left_out: dict[str, list[Any]]) -> Iterator[_Shape]:
    """Yield the shapes of a prim and below it, without those of bodies that move.

    Args:
        root: The root of the stage, or a prototype of copies.
        placements: Transforms of the root to the world, shape (n, 4, 4).
        left_out: Paths of what is left out by its kind, to which this function adds.
    """
    from pxr import Usd, UsdGeom, UsdPhysics

    predicate = Usd.PrimDefaultPredicate if root.IsPseudoRoot() else Usd.PrimIsActive
    transforms = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
    colliding = set()
    prims = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies(predicate)))
    for prim in prims:
        path, kind = prim.GetPath(), prim.GetTypeName().removesuffix("_1")
        if prim.HasAPI(UsdPhysics.RigidBodyAPI) and (
            _value(prim, "physics:rigidBodyEnabled", True)
            and not _value(prim, "physics:kinematicEnabled", False)
        ):
            left_out["bodies that move"].append(path)
            prims.PruneChildren()
            continue
        is_collider = path.GetParentPath() in colliding or prim.HasAPI(UsdPhysics.CollisionAPI)
        if is_collider and _value(prim, "physics:collisionEnabled", True):
            colliding.add(path)
        if not prim.IsA(UsdGeom.Gprim) and kind != "PointInstancer":
            continue
        image = UsdGeom.Imageable(prim)
        is_visible = image.ComputePurpose() in ("default", "render") and (
            image.ComputeVisibility(Usd.TimeCode.EarliestTime()) != "invisible"
        )
        inner = np.array(transforms.ComputeRelativeTransform(prim, root)[0]) @ placements
        if kind == "PointInstancer":
            prims.PruneChildren()
            for prototype, copies in _copies(prim, inner):
                for shape in _find_shapes(prototype, copies, left_out):
                    collides, is_drawn = shape.collides or path in colliding, shape.is_visible
                    yield shape._replace(collides=collides, is_visible=is_drawn and is_visible)
        elif kind in (*_SOLIDS, "Mesh", "Plane"):
            yield _Shape(prim, inner, path in colliding, is_visible)
        elif is_visible:
            left_out[f"shapes of type {kind}"].append(path)


def _value(prim: Any, name: str, default: Any) -> Any:
    """Return the first value of an attribute; `default` if it has none."""
    from pxr import Usd

    attribute = prim.GetAttribute(name)
    value = attribute.Get(Usd.TimeCode.EarliestTime()) if attribute else None
    return default if value is None else value


def _copies(prim: Any, placements: Array) -> Iterator[tuple[Any, Array]]:
    """Yield each prototype of a point instancer, and the transforms of its copies to the world."""
    from pxr import Usd, UsdGeom

    instancer, time = UsdGeom.PointInstancer(prim), Usd.TimeCode.EarliestTime()
    copies = np.array(instancer.ComputeInstanceTransformsAtTime(time, time)).reshape(-1, 4, 4)
    numbers = np.array(instancer.GetProtoIndicesAttr().Get(time), dtype=int)
    mask = np.array(instancer.ComputeMaskAtTime(time), dtype=bool)
    numbers = numbers[mask] if len(mask) else numbers
    for number, path in enumerate(instancer.GetPrototypesRel().GetForwardedTargets()):
        world = copies[numbers == number][:, None] @ placements
        yield prim.GetStage().GetPrimAtPath(path), world.reshape(-1, 4, 4)


def _add_shape(scene: SceneMesh, shape: _Shape) -> None:
    """Add the copies of a shape to a scene."""
    prim = shape.prim
    if prim.GetTypeName() == "Plane":
        size = np.array([_value(prim, name, 2.0) / 2 for name in ("width", "length")] * 2)[:3]
        for placement in shape.placements:
            normal = np.linalg.inv(placement[:3, :3])[:, "XYZ".index(_value(prim, "axis", "Z"))]
            scene.add_plane(placement[3, :3], normal, size * np.abs(placement[:3, :3]).max())
        return
    vertices, faces = _mesh(prim) if prim.GetTypeName() == "Mesh" else _solid(prim)
    for placement in shape.placements:
        is_mirrored = np.linalg.det(placement[:3, :3]) < 0
        placed = vertices @ placement[:3, :3] + placement[3, :3]
        scene.add(placed, faces[:, ::-1] if is_mirrored else faces)


def _solid(prim: Any) -> tuple[Array, Faces]:
    """Return the vertices and faces of a cube, a sphere, a capsule, a cylinder or a cone."""
    kind = prim.GetTypeName().removesuffix("_1")
    vertices, faces = unit_shapes()[_SOLIDS[kind]]
    if kind == "Cube":
        return vertices * _value(prim, "size", 2.0) / 2, faces
    radius, height = _value(prim, "radius", 1.0), _value(prim, "height", 2.0)
    bottom = _value(prim, "radiusBottom", radius)
    top = 0.0 if kind == "Cone" else _value(prim, "radiusTop", radius)
    side = np.sign(vertices[:, 2].round(9))
    radii = (bottom + top + side * (top - bottom)) / 2
    along = vertices[:, 2] * radii if _SOLIDS[kind] == "sphere" else 0.0
    along = along + (0.0 if kind == "Sphere" else side * height / 2)
    vertices = np.column_stack([vertices[:, :2] * radii[:, None], along])
    return vertices[:, _AXES[_value(prim, "axis", "Z")]], faces


def _mesh(prim: Any) -> tuple[Array, Faces]:
    """Return the points and triangles of a mesh; subdivision is not applied."""
    points = np.array(_value(prim, "points", ()), dtype=float).reshape(-1, 3)
    counts = np.array(_value(prim, "faceVertexCounts", ()), dtype=int)
    index = np.array(_value(prim, "faceVertexIndices", ()), dtype=np.int32)
    if not np.isfinite(points).all():
        raise ValueError(f"got points of {prim.GetPath()} that are not finite")
    is_valid = (counts >= 0).all() and counts.sum() == len(index)
    if not is_valid or (len(index) and not 0 <= index.min() <= index.max() < len(points)):
        raise ValueError(f"got faces of {prim.GetPath()} with vertices that do not exist")
    is_hole = np.isin(np.arange(len(counts)), np.array(_value(prim, "holeIndices", ()), int))
    starts = np.cumsum(counts) - counts
    faces = [np.empty((0, 3), np.int32)]
    for size in np.unique(counts[counts > 2]).tolist():
        corners = index[starts[(counts == size) & ~is_hole][:, None] + np.arange(size)]
        faces.append(triangulate(points, corners))
    triangles = np.concatenate(faces)
    is_left = _value(prim, "orientation", "rightHanded") == "leftHanded"
    return points, triangles[:, ::-1] if is_left else triangles
