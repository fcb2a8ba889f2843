"""Shapes and poses of MJCF: what MuJoCo's parser has read, in the frame of the body."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.description.mjcf.document import Node
from terrainkit_robots.description.mjcf.inertia import Solid
from terrainkit_robots.description.model import Geometry, MeshFile, ShapeKind
from terrainkit_robots.description.package_resolver import resolve_in
from terrainkit_robots.transforms import Matrix, quat_to_matrix

if TYPE_CHECKING:
    import mujoco

SIZES: Mapping[ShapeKind, int] = {
    "sphere": 1,
    "capsule": 2,
    "cylinder": 2,
    "ellipsoid": 3,
    "box": 3,
}
"""How many size numbers a primitive has."""


@dataclass(frozen=True, kw_only=True)
class Scale:
    """What the frames around an element do to its size; MuJoCo from 3.16 on."""

    length: float = 1.0
    mass: float = 1.0

    force: float = 1.0
    """Factor on forces, which some frames leave alone."""

    torque: float = 1.0
    """Factor on torques."""

    rotor: float = 1.0
    """Factor on damping and armature of a joint that slides."""

    even: bool = True
    """Whether all axes are scaled alike; if not, `length` is a mean."""

    def __matmul__(self, inner: "Scale") -> "Scale":
        """Return the scale of a frame in a frame."""
        return Scale(
            length=self.length * inner.length,
            mass=self.mass * inner.mass,
            force=self.force * inner.force,
            torque=self.torque * inner.torque,
            rotor=self.rotor * inner.rotor,
            even=self.even and inner.even,
        )


def local_pose(element: Any, spec: "mujoco.MjSpec") -> Matrix:
    """Return the pose of an element in what it is written in, shape (4, 4) [m].

    Raises:
        ValueError: if the orientation is none, such as one by an axis of length zero.
    """
    pose = np.eye(4)
    pose[:3, :3] = turn_of(element.quat, element.alt, element.compiler, spec)
    pose[:3, 3] = element.pos
    return pose


def turn_of(quat: Matrix, alternative: Any, compiler: Any, spec: "mujoco.MjSpec") -> Matrix:
    """Return the rotation of a quaternion, or of what was written instead, shape (3, 3).

    Raises:
        ValueError: if it is none.
    """
    import mujoco

    if alternative.type != mujoco.mjtOrientation.mjORIENTATION_QUAT:
        quat = np.array(
            spec.resolve_orientation(
                degree=bool(compiler.degree), sequence=compiler.eulerseq, orientation=alternative
            )
        )
    return quat_to_matrix(quat)


def frame_scale(frame: Any) -> Scale:
    """Return what a frame does to the size of its contents."""
    import mujoco

    written = getattr(frame, "scale", None)
    if written is None:  # MuJoCo before 3.16
        return Scale()
    factors = np.abs(np.asarray(written, dtype=np.float64))
    if (factors == 1).all() and frame.massscale <= 0:
        return Scale()
    length, volume = float(np.cbrt(factors.prod())), float(factors.prod())
    mass = float(frame.massscale) if frame.massscale > 0 else volume
    similar = frame.scaling == mujoco.mjtScaling.mjSCALING_SIMILAR
    return Scale(
        length=length,
        mass=mass,
        force=mass * length if similar else 1.0,
        torque=mass * length**2 if similar else 1.0,
        rotor=mass if similar else 1.0,
        even=bool((factors == factors[0]).all()),
    )


def scaled(weight: Solid, scale: Scale) -> Solid:
    """Return a solid of which the pose is scaled already."""
    return replace(
        weight,
        mass=weight.mass * scale.mass,
        moments=weight.moments * (scale.mass * scale.length**2),
    )


def placed(element: Any, outer: Scale, spec: "mujoco.MjSpec") -> tuple[Matrix, Scale]:
    """Return the pose of an element in its body, shape (4, 4) [m], and the scale of its insides.

    Args:
        element: A body, geom or anything else with a pose, which frames may be around.
        outer: Scale of the body that it is in.
        spec: The model.

    Raises:
        ValueError: if an orientation is none.
    """
    return in_frames(local_pose(element, spec), element.frame, outer, spec)


def in_frames(
    pose: Matrix, frame: Any, outer: Scale, spec: "mujoco.MjSpec"
) -> tuple[Matrix, Scale]:
    """Return a pose in a frame as one in the body that the frame is in, and the whole scale."""
    inner = Scale()
    while frame is not None:
        scale = frame_scale(frame)
        pose[:3, 3] *= scale.length
        pose, inner = local_pose(frame, spec) @ pose, scale @ inner
        frame = frame.frame
    pose[:3, 3] *= outer.length
    return pose, outer @ inner


def between(ends: Matrix) -> tuple[Matrix, float]:
    """Return the pose halfway between two points with z along them, and half their distance.

    Args:
        ends: The two points, shape (6,) [m].

    Raises:
        ValueError: if they are one point.
    """
    along = ends[:3] - ends[3:]
    length = float(np.linalg.norm(along))
    if not length > 1e-14:
        raise ValueError("the two points of fromto are one")
    x, y, z = along / length
    pose = np.eye(4)
    if x * x + y * y > 1e-28 or z < 0:
        axis = np.array([-y, x, 0.0])  # of the smallest turn from z to there
        norm = np.hypot(x, y)
        axis = axis / norm if norm > 1e-14 else np.array([1.0, 0, 0])
        half = np.arctan2(norm, z) / 2
        pose[:3, :3] = quat_to_matrix(np.array([np.cos(half), *(np.sin(half) * axis)]))
    pose[:3, 3] = (ends[:3] + ends[3:]) / 2
    return pose, length / 2


def shape_of(geom: Any) -> ShapeKind:
    """Return the kind of shape that a geom is."""
    import mujoco

    kinds: Mapping[Any, ShapeKind] = {
        mujoco.mjtGeom.mjGEOM_PLANE: "plane",
        mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
        mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
        mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
        mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
        mujoco.mjtGeom.mjGEOM_BOX: "box",
        mujoco.mjtGeom.mjGEOM_MESH: "mesh",
    }
    return kinds.get(geom.type, "unknown")


_PLAIN = np.array([0.5, 0.5, 0.5, 1], dtype=np.float32)
"""Color of a geom that nobody gave one: MuJoCo takes the material's instead, where there is one."""


def color_of(geom: Any, materials: Mapping[str, Any]) -> tuple[float, float, float, float] | None:
    """Return what a geom is drawn with: its own color, or that of its material.

    None if it has neither, or numbers beyond 0..1.
    """
    rgba = geom.rgba
    if (rgba == _PLAIN).all():
        if geom.material not in materials:
            return None
        rgba = materials[geom.material].rgba
    red, green, blue, opacity = (round(float(each), 6) for each in rgba)
    color = (red, green, blue, opacity)
    return color if all(0 <= each <= 1 for each in color) else None


def mesh_name(mesh: Any) -> str:
    """Return the name of a mesh asset, which is that of its file if it has none of its own."""
    return mesh.name or Path(str(mesh.file).replace("\\", "/")).stem


def mesh_file(mesh: Any, node: Node, strip: bool) -> MeshFile | None:
    """Return the file of a mesh asset; None for one that is written in the model itself.

    Args:
        mesh: The asset.
        node: The element that it is.
        strip: Whether MuJoCo drops the folders from file names.
    """
    name = node.written.get("file", "") or str(mesh.file)
    if not name:
        return None
    x, y, z = map(float, mesh.scale)
    folder = node.folder / str(mesh.compiler.meshdir or "")
    path, found_by = resolve_in((folder,), Path(name).name if strip else name)
    return MeshFile(
        source=node.source,
        filename=name,
        path=path,
        found_by=found_by,
        attribute="file",
        scale=(x, y, z),
    )


def mesh_geometry(geometry: Geometry, mesh: Any, file: MeshFile, scale: Scale) -> Geometry:
    """Return a geometry with the shape of a mesh, whose own frame may lie elsewhere.

    MuJoCo takes `refpos` from each vertex, turns by `refquat` back, and then scales.
    """
    factors = np.array(file.scale)
    turn = quat_to_matrix(np.asarray(mesh.refquat)).T
    if np.any(factors != factors[0]) and np.abs(turn - np.eye(3)).max() > 1e-9:
        return replace(geometry, shape="unknown", mesh=file)  # no scaled mesh in any pose
    moved = np.eye(4)
    moved[:3, :3] = turn
    moved[:3, 3] = -scale.length * factors * (turn @ np.asarray(mesh.refpos))
    x, y, z = map(float, scale.length * factors)
    return replace(
        geometry,
        shape="mesh",
        mesh=replace(file, scale=(x, y, z)),
        origin=geometry.origin @ moved,
    )
