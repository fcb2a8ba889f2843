"""Measure how deep collision shapes of different bodies overlap, with MuJoCo.

The bodies are placed by our own kinematics in a model without joints, so that this also works for
a robot whose masses MuJoCo rejects. Meshes are replaced by their convex hulls, as in a simulation.
"""

from collections.abc import Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from terrainkit.errors import one_line
from terrainkit_robots.analysis.bodies.bodies import Body, BodyShape, physical_parent
from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.bodies.shapes import bounds, has_bounds
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.mesh.mesh_cache import MeshError, Meshes
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.transforms import Matrix, matrix_to_quat, quat_to_matrix

_MAX_SHAPES = 400
"""A robot with more collision shapes is not checked, because the number of pairs is quadratic."""

MAX_PAIRS = 10_000
"""Number of pairs that are measured in one sweep; if there are more, the closest ones."""

_MIN_THICKNESS = 1e-6
"""A primitive that is thinner than this has no volume [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Overlap:
    """Two shapes that overlap."""

    first: BodyShape
    second: BodyShape

    depth: float
    """Penetration depth [m]."""

    @property
    def has_mesh(self) -> bool:
        """Whether one shape is a mesh, whose hull may overlap although the mesh does not."""
        return "mesh" in (self.first.geometry.shape, self.second.geometry.shape)


class OverlapScene:
    """The collision shapes of a robot, which can be tested for overlaps at any joint positions.

    Raises:
        CannotCheckError: if the robot has too many collision shapes.
    """

    def __init__(
        self,
        bodies: Sequence[Body],
        meshes: Meshes,
        excluded: AbstractSet[frozenset[str]] = frozenset(),
    ) -> None:
        """Collect the solid shapes.

        Args:
            bodies: The bodies, parents first.
            meshes: Mesh files.
            excluded: Pairs of link names whose contacts are disabled.
        """
        self._bodies, self._meshes, self._excluded = bodies, meshes, excluded
        self._shapes = [
            (body, shape)
            for body in bodies
            for shape in body.collisions
            if _is_solid(shape, meshes)
        ]
        if len(self._shapes) > _MAX_SHAPES:
            raise CannotCheckError(
                f"number of collision shapes: got {len(self._shapes)}; expected at most "
                f"{_MAX_SHAPES} to compare them"
            )

    def detect(self, positions: Mapping[str, float]) -> list[Overlap]:
        """Return the overlaps of bodies that are not neighbors, the deepest first.

        Args:
            positions: Joint positions [rad] or [m] by name. Joints without a position are at 0.
        """
        return next(self.sweep({name: np.array([q]) for name, q in positions.items()}, 1))

    def sweep(self, positions: Mapping[str, Matrix], count: int) -> Iterator[list[Overlap]]:
        """Yield the result of `detect` for several joint positions.

        Args:
            positions: Positions by joint [rad] or [m], each of shape (count,).
            count: Number of positions.

        Raises:
            CannotCheckError: if MuJoCo rejects a shape, such as a mesh without a volume.
        """
        if not len(self._pairs):
            yield from ([] for _ in range(count))
            return
        import mujoco

        model, data = self._model_and_data
        body = body_poses(self._bodies, positions)
        shape_poses = [np.broadcast_to(body[b.index], (count, 4, 4)) for b, _ in self._shapes]
        for poses in np.stack(shape_poses, axis=1):
            world = poses @ self._geom_poses
            data.geom_xpos[:] = world[:, :3, 3]
            data.geom_xmat[:] = world[:, :3, :3].reshape(-1, 9)
            found = []
            for a, b in self._close_pairs(poses, MAX_PAIRS // count):
                depth = -mujoco.mj_geomDistance(model, data, a, b, 0.0, None)
                if depth > 0:
                    first, second = self._shapes[a][1], self._shapes[b][1]
                    found.append(Overlap(first=first, second=second, depth=depth))
            yield sorted(found, key=lambda overlap: -overlap.depth)

    @cached_property
    def _pairs(self) -> Matrix:
        """Pairs of shapes that can collide in a simulator, shape (n, 2)."""
        found = [
            (a, b)
            for b, other in enumerate(self._shapes)
            for a, one in enumerate(self._shapes[:b])
            if self._can_collide(one, other)
        ]
        return np.array(found, dtype=int).reshape(-1, 2)

    @cached_property
    def _bounding_spheres(self) -> tuple[Matrix, Matrix]:
        """Center in the frame of the body, and radius, of a sphere around each shape [m]."""
        boxes = [bounds([shape], self._meshes) for _, shape in self._shapes]
        centers = np.array([box.mean(axis=0) for box in boxes if box is not None])
        sizes = np.array([np.linalg.norm(np.ptp(box, axis=0)) for box in boxes if box is not None])
        return centers, sizes / 2

    def _close_pairs(self, poses: Matrix, limit: int) -> Iterator[tuple[int, int]]:
        """Yield at most `limit` pairs whose bounding spheres overlap, the closest first."""
        centers, radii = self._bounding_spheres
        world = (poses[:, :3, :3] @ centers[..., None])[..., 0] + poses[:, :3, 3]
        a, b = self._pairs.T
        distance = np.linalg.norm(world[a] - world[b], axis=1) - radii[a] - radii[b]
        closest = np.argsort(distance, kind="stable")[:limit]
        yield from ((int(i), int(j)) for i, j in self._pairs[closest[distance[closest] < 0]])

    @cached_property
    def _model_and_data(self) -> tuple[Any, Any]:
        import mujoco

        spec = mujoco.MjSpec()
        for index, (_, shape) in enumerate(self._shapes):
            pose = {"pos": shape.pose[:3, 3], "quat": matrix_to_quat(shape.pose[:3, :3])}
            kind = shape.geometry.shape
            if kind == "mesh":
                assert shape.geometry.mesh is not None
                path = shape.geometry.mesh.path
                mesh = spec.add_mesh(name=f"{path.name} of link {shape.link}, shape {index}")
                hull = self._meshes.hull(path)
                mesh.uservert = (hull.points * shape.geometry.mesh.scale).ravel()
                # MuJoCo computes the hull from the vertices. All faces cost four times the memory.
                mesh.userface = hull.faces[0]
                mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
                geom_type = mujoco.mjtGeom.mjGEOM_MESH
                spec.worldbody.add_geom(type=geom_type, meshname=mesh.name, **pose)
            else:
                geom_type = getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}")
                size = np.zeros(3)
                size[: len(shape.geometry.size)] = shape.geometry.size
                spec.worldbody.add_geom(type=geom_type, size=size, **pose)
        try:
            with quiet_mujoco():
                model = spec.compile()
        except (ValueError, mujoco.FatalError) as error:
            reason = one_line(str(error).partition("\n")[0].removeprefix("Error: "))
            raise CannotCheckError(f"MuJoCo rejects a collision shape: {reason}") from None
        return model, mujoco.MjData(model)

    @cached_property
    def _geom_poses(self) -> Matrix:
        """Pose of each geom in the frame of its body, shape (shapes, 4, 4).

        For a mesh this is not the pose we set: MuJoCo moves its origin to the center of mass.
        """
        model, _ = self._model_and_data
        poses = np.tile(np.eye(4), (len(self._shapes), 1, 1))
        poses[:, :3, 3] = model.geom_pos
        poses[:, :3, :3] = [quat_to_matrix(quat) for quat in model.geom_quat]
        return poses

    def _can_collide(self, one: tuple[Body, BodyShape], other: tuple[Body, BodyShape]) -> bool:
        """Return whether two shapes can collide in a simulator."""
        (a, first), (b, second) = one, other
        neighbors = physical_parent(self._bodies, a) is b or physical_parent(self._bodies, b) is a
        if a is b or neighbors or frozenset((first.link, second.link)) in self._excluded:
            return False
        g, h = first.geometry, second.geometry
        return bool((g.contype & h.conaffinity) or (h.contype & g.conaffinity))


def _is_solid(shape: BodyShape, meshes: Meshes) -> bool:
    """Return whether a shape has a volume and can have contacts."""
    geometry = shape.geometry
    if not has_bounds(geometry, meshes) or not geometry.contacts:
        return False
    if geometry.shape != "mesh":
        return min(geometry.size) > _MIN_THICKNESS
    assert geometry.mesh is not None
    try:
        meshes.hull(geometry.mesh.path)
    except MeshError:
        return False  # MSH010 reports a mesh without a hull
    return True
