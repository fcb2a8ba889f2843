"""Convert parsed MuJoCo geoms and meshes to shapes and poses in the body frame."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.description.mjcf.inertia import Solid
from terrainkit_robots.description.mjcf.tree import Node
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
"""Number of size parameters of each primitive."""


@dataclass(frozen=True, kw_only=True)
class Scale:
    """Scale factors of the frames around an element; MuJoCo 3.16 and newer."""

    length: float = 1.0
    mass: float = 1.0

    force: float = 1.0
    """Factor on forces."""

    torque: float = 1.0
    """Factor on torques."""

    rotor: float = 1.0
    """Factor on damping and armature of a slide joint."""

    uniform: bool = True
    """Whether all axes have the same factor; otherwise `length` is the mean."""

    def __matmul__(self, inner: "Scale") -> "Scale":
        """Return the scale of nested frames."""
        return Scale(
            length=self.length * inner.length,
            mass=self.mass * inner.mass,
            force=self.force * inner.force,
            torque=self.torque * inner.torque,
            rotor=self.rotor * inner.rotor,
            uniform=self.uniform and inner.uniform,
        )


def local_pose(element: Any, spec: "mujoco.MjSpec") -> Matrix:
    """Return the pose of an element in its parent, shape (4, 4) [m].

    Raises:
        ValueError: If the orientation is invalid, such as an axis of zero length.
    """
    pose = np.eye(4)
    pose[:3, :3] = resolve_orientation(element.quat, element.alt, element.compiler, spec)
    pose[:3, 3] = element.pos
    return pose


def resolve_orientation(quat: Matrix, alt: Any, compiler: Any, spec: "mujoco.MjSpec") -> Matrix:
    """Return the rotation of a quaternion or an alternative orientation, shape (3, 3).

    Raises:
        ValueError: If the orientation is invalid.
    """
    import mujoco

    if alt.type != mujoco.mjtOrientation.mjORIENTATION_QUAT:
        quat = np.array(
            spec.resolve_orientation(
                degree=bool(compiler.degree), sequence=compiler.eulerseq, orientation=alt
            )
        )
    return quat_to_matrix(quat)


def frame_scale(frame: Any) -> Scale:
    """Return the scale that a frame applies to its contents."""
    import mujoco

    written = getattr(frame, "scale", None)
    if written is None:  # MuJoCo before 3.16
        return Scale()
    scales = np.abs(np.asarray(written, dtype=np.float64))
    if (scales == 1).all() and frame.massscale <= 0:
        return Scale()
    length, volume = float(np.cbrt(scales.prod())), float(scales.prod())
    mass = float(frame.massscale) if frame.massscale > 0 else volume
    similar = frame.scaling == mujoco.mjtScaling.mjSCALING_SIMILAR
    return Scale(
        length=length,
        mass=mass,
        force=mass * length if similar else 1.0,
        torque=mass * length**2 if similar else 1.0,
        rotor=mass if similar else 1.0,
        uniform=bool((scales == scales[0]).all()),
    )


def scale_solid(solid: Solid, scale: Scale) -> Solid:
    """Return a solid with scaled mass and moments; its pose is scaled already."""
    return replace(
        solid,
        mass=solid.mass * scale.mass,
        moments=solid.moments * (scale.mass * scale.length**2),
    )


def pose_and_scale(element: Any, outer: Scale, spec: "mujoco.MjSpec") -> tuple[Matrix, Scale]:
    """Return the pose of an element in its body, shape (4, 4) [m], and the scale of its contents.

    Args:
        element: A MuJoCo element with a pose, possibly inside of frames.
        outer: Scale of the body that contains it.
        spec: The model.

    Raises:
        ValueError: If an orientation is invalid.
    """
    return apply_frames(local_pose(element, spec), element.frame, outer, spec)


def apply_frames(
    pose: Matrix, frame: Any, outer: Scale, spec: "mujoco.MjSpec"
) -> tuple[Matrix, Scale]:
    """Transform a pose from a frame to its body; return it with the total scale."""
    inner = Scale()
    while frame is not None:
        scale = frame_scale(frame)
        pose[:3, 3] *= scale.length
        pose, inner = local_pose(frame, spec) @ pose, scale @ inner
        frame = frame.frame
    pose[:3, 3] *= outer.length
    return pose, outer @ inner


def fromto_pose(ends: Matrix) -> tuple[Matrix, float]:
    """Return the pose and half length of a shape between two points.

    Args:
        ends: The two points, shape (6,) [m].

    Returns:
        Pose at the center with z along the points, shape (4, 4) [m], and half their distance [m].

    Raises:
        ValueError: If the points are equal.
    """
    along = ends[:3] - ends[3:]
    length = float(np.linalg.norm(along))
    if not length > 1e-14:
        raise ValueError("the two points of fromto are equal")
    x, y, z = along / length
    pose = np.eye(4)
    if x * x + y * y > 1e-28 or z < 0:
        axis = np.array([-y, x, 0.0])  # of the smallest rotation from z
        norm = np.hypot(x, y)
        axis = axis / norm if norm > 1e-14 else np.array([1.0, 0, 0])
        half = np.arctan2(norm, z) / 2
        pose[:3, :3] = quat_to_matrix(np.array([np.cos(half), *(np.sin(half) * axis)]))
    pose[:3, 3] = (ends[:3] + ends[3:]) / 2
    return pose, length / 2


def geom_shape(geom: Any) -> ShapeKind:
    """Return the shape of a geom."""
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
    red, green, blue, opacity = (round(float(each), 6) for each in rgba)
    color = (red, green, blue, opacity)
    return color if all(0 <= each <= 1 for each in color) else None


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
    """Return a geometry with the shape of a mesh, including the mesh's own reference frame.

    MuJoCo subtracts `refpos` from each vertex, applies the inverse of `refquat`, and then scales.
    """
    scales = np.array(file.scale)
    rotation = quat_to_matrix(np.asarray(mesh.refquat)).T
    if np.any(scales != scales[0]) and np.abs(rotation - np.eye(3)).max() > 1e-9:
        return replace(geometry, shape="unknown", mesh=file)  # not a scaled mesh in any pose
    mesh_pose = np.eye(4)
    mesh_pose[:3, :3] = rotation
    mesh_pose[:3, 3] = -scale.length * scales * (rotation @ np.asarray(mesh.refpos))
    x, y, z = map(float, scale.length * scales)
    return replace(
        geometry,
        shape="mesh",
        mesh=replace(file, scale=(x, y, z)),
        origin=geometry.origin @ mesh_pose,
    )
