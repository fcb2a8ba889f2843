"""The scene of a robot: a frame for each body, with its visual and collision shapes."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import BodyShape
from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.bodies.shapes import has_bounds, min_height
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Geometry
from terrainkit_robots.mesh.surface import Surface
from terrainkit_robots.transforms import matrix_to_quat

if TYPE_CHECKING:
    import viser

    from terrainkit_robots.mesh.mesh_cache import Meshes

ROOT = "/robot"
"""Name of the node of the base."""

_VISUAL_COLOR, _COLLISION_COLOR = (184, 189, 199), (230, 120, 40)
_COLLISION_OPACITY = 0.5


class RobotScene:
    """A robot in the scene of a viser server."""

    def __init__(self, server: "viser.ViserServer", facts: Facts) -> None:
        """Add the robot in its default pose, standing on the plane z = 0.

        A body without visual shapes is shown by its collision shapes.
        """
        self.facts = facts
        self._server = server
        self.base = server.scene.add_frame(ROOT, show_axes=False)
        self.bodies = [
            server.scene.add_frame(body_node(k), show_axes=False) for k in range(len(facts.bodies))
        ]
        """The frame of each body."""

        self.visuals: list[Any] = []
        """The meshes of the visual shapes."""

        self.collisions: list[Any] = []
        """The meshes of the collision shapes, which are hidden at first."""

        for k, body in enumerate(facts.bodies):
            self.visuals += self._add_shapes(k, "visual", body.visuals or body.collisions)
            self.collisions += self._add_shapes(k, "collision", body.collisions)
        self.set_positions(facts.default_pose)
        self.set_base((0.0, 0.0, default_height(facts)), (1.0, 0.0, 0.0, 0.0))

    def set_positions(self, positions: Mapping[str, float]) -> None:
        """Move the bodies to joint positions [rad] or [m], by name."""
        poses = body_poses(self.facts.bodies, positions)
        with self._server.atomic():
            for frame, pose in zip(self.bodies, poses, strict=True):
                frame.position, frame.wxyz = pose[:3, 3], matrix_to_quat(pose[:3, :3])

    def set_base(self, position: Any, wxyz: Any) -> None:
        """Move the base to a position [m], shape (3,), and a quaternion (w, x, y, z)."""
        self.base.position, self.base.wxyz = position, wxyz

    def _add_shapes(self, body: int, kind: str, shapes: Sequence[BodyShape]) -> list[Any]:
        is_visual = kind == "visual"
        meshes = self.facts.meshes
        handles = []
        for k, shape in enumerate(shapes):
            geometry = shape.geometry
            if not has_bounds(geometry, meshes):
                continue  # unreadable or unbounded: a finding says so
            surface = shape_surface(geometry, meshes)
            color = np.array(geometry.color[:3]) * 255 if geometry.color else _VISUAL_COLOR
            handles.append(
                self._server.scene.add_mesh_simple(
                    f"{body_node(body)}/{kind}_{k}",
                    surface.points,
                    surface.faces,
                    color=tuple(np.clip(color, 0, 255).astype(int))
                    if is_visual
                    else _COLLISION_COLOR,
                    opacity=None if is_visual else _COLLISION_OPACITY,
                    flat_shading=True,
                    side="double",  # a mirrored mesh is inside out
                    position=shape.pose[:3, 3],
                    wxyz=matrix_to_quat(shape.pose[:3, :3]),
                    visible=is_visual,
                )
            )
        return handles


def body_node(index: int) -> str:
    """Return the name of the node of a body."""
    return f"{ROOT}/body_{index}"


def default_height(facts: Facts) -> float:
    """Return the height of the trunk [m] at which the default pose touches the plane z = 0."""
    poses = body_poses(facts.bodies, facts.default_pose)
    heights = [
        min_height(shape, pose, facts.meshes)
        for body, pose in zip(facts.bodies, poses, strict=True)
        for shape in body.collisions or body.visuals
    ]
    return -min(heights, default=0.0)


def shape_surface(geometry: Geometry, meshes: "Meshes") -> Surface:
    """Return the triangles of a shape with bounds, in its own frame [m]."""
    from trimesh import creation

    size = geometry.size
    match geometry.shape:
        case "mesh" if geometry.mesh is not None:
            faces = meshes.surface(geometry.mesh.path).faces
            return Surface(points=meshes.vertices(geometry.mesh), faces=faces)
        case "box":
            mesh = creation.box(extents=2 * np.array(size))
        case "cylinder":
            mesh = creation.cylinder(radius=size[0], height=2 * size[1])
        case "capsule":
            mesh = creation.capsule(radius=size[0], height=2 * size[1])
        case _:  # sphere or ellipsoid
            mesh = creation.icosphere()
            mesh.apply_scale(size[0] if len(size) == 1 else size)
    return Surface(points=mesh.vertices, faces=mesh.faces)
