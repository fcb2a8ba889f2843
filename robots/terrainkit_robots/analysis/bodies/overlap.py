"""Overlap: how deep collision shapes of different bodies are inside each other, by MuJoCo.

The bodies are put where kinematics says, without joints, so that this also works for a robot whose
masses MuJoCo would refuse. Meshes take part with their convex hull, as they do in a simulation.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body, Placed
from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.bodies.shapes import bounds, has_extent
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.mesh.mesh_cache import MeshError
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

_MOST_SHAPES = 400
"""A robot with more collision shapes is not looked at; pairs grow with the square."""

_MOST_PAIRS = 10_000
"""So many pairs are measured in one sweep; of a robot that is a heap of shapes, the closest."""

_THINNEST = 1e-6
"""A primitive thinner than this has no inside [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Overlap:
    """Two shapes that are inside each other."""

    first: Placed
    second: Placed

    depth: float
    """How far one would have to move to be free [m]."""

    @property
    def hulls(self) -> bool:
        """Whether a mesh takes part, whose hull may overlap where the mesh does not."""
        return "mesh" in (self.first.geometry.shape, self.second.geometry.shape)


class OverlapScene:
    """The collision shapes of a robot, ready to be placed."""

    def __init__(self, facts: "Facts") -> None:
        self._facts = facts
        self._shapes = [
            (body, placed)
            for body in facts.bodies
            for placed in body.collisions
            if _solid(placed, facts)
        ]
        if len(self._shapes) > _MOST_SHAPES:
            raise CannotCheckError(
                f"there are {len(self._shapes)} collision shapes, and more than {_MOST_SHAPES} "
                "are not compared"
            )

    def overlaps(self, positions: Mapping[str, float]) -> list[Overlap]:
        """Return the overlaps of bodies that are not neighbours, the deepest first.

        Args:
            positions: Joint positions [rad] or [m]; joints that are not named are at 0.
        """
        return next(self.sweep({name: np.array([q]) for name, q in positions.items()}, 1))

    def sweep(self, positions: Mapping[str, Matrix], count: int) -> Iterator[list[Overlap]]:
        """Yield what `overlaps` returns, for positions of shape (count,)."""
        if not len(self._pairs):
            yield from ([] for _ in range(count))
            return
        import mujoco

        model, data = self._compiled
        places = self._places(positions, count)
        for place in places:
            world = place @ self._local
            data.geom_xpos[:] = world[:, :3, 3]
            data.geom_xmat[:] = world[:, :3, :3].reshape(-1, 9)
            found = []
            for a, b in self._close(place, _MOST_PAIRS // count):
                depth = -mujoco.mj_geomDistance(model, data, a, b, 0.0, None)
                if depth > 0:
                    first, second = self._shapes[a][1], self._shapes[b][1]
                    found.append(Overlap(first=first, second=second, depth=depth))
            yield sorted(found, key=lambda overlap: -overlap.depth)

    def _places(self, positions: Mapping[str, Matrix], count: int) -> Matrix:
        """Return the pose of the body of each shape, shape (count, shapes, 4, 4)."""
        poses = body_poses(self._facts.bodies, positions)
        each = [np.broadcast_to(poses[body.index], (count, 4, 4)) for body, _ in self._shapes]
        return np.stack(each, axis=1)

    @cached_property
    def _pairs(self) -> Matrix:
        """Pairs of shapes that a simulator would let collide, shape (n, 2)."""
        found = [
            (a, b)
            for b, other in enumerate(self._shapes)
            for a, one in enumerate(self._shapes[:b])
            if self._apart(one, other)
        ]
        return np.array(found, dtype=int).reshape(-1, 2)

    @cached_property
    def _balls(self) -> tuple[Matrix, Matrix]:
        """Centre in the body's frame and radius of a ball around each shape [m]."""
        boxes = [bounds([placed], self._facts.meshes) for _, placed in self._shapes]
        centers = np.array([box.mean(axis=0) for box in boxes if box is not None])
        sizes = np.array([np.linalg.norm(np.ptp(box, axis=0)) for box in boxes if box is not None])
        return centers, sizes / 2

    def _close(self, place: Matrix, most: int) -> Iterator[tuple[int, int]]:
        """Yield the pairs whose balls touch, the closest if there are more than `most`."""
        centers, radii = self._balls
        world = (place[:, :3, :3] @ centers[..., None])[..., 0] + place[:, :3, 3]
        a, b = self._pairs.T
        apart = np.linalg.norm(world[a] - world[b], axis=1) - radii[a] - radii[b]
        closest = np.argsort(apart, kind="stable")[:most]
        yield from ((int(i), int(j)) for i, j in self._pairs[closest[apart[closest] < 0]])

    @cached_property
    def _compiled(self) -> tuple[Any, Any]:
        import mujoco

        spec = mujoco.MjSpec()
        for index, (_, placed) in enumerate(self._shapes):
            quaternion = np.zeros(4)
            mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(placed.pose[:3, :3]).ravel())
            where = {"pos": placed.pose[:3, 3], "quat": quaternion}
            shape = placed.geometry.shape
            if shape == "mesh":
                assert placed.geometry.mesh is not None
                mesh = spec.add_mesh(name=f"mesh{index}")
                hull = self._facts.meshes.hull(placed.geometry.mesh.path)
                mesh.uservert = (hull.points * placed.geometry.mesh.scale).ravel()
                mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
                kind = mujoco.mjtGeom.mjGEOM_MESH
                spec.worldbody.add_geom(type=kind, meshname=mesh.name, **where)
            else:
                kind = getattr(mujoco.mjtGeom, f"mjGEOM_{shape.upper()}")
                size = np.zeros(3)
                size[: len(placed.geometry.size)] = placed.geometry.size
                spec.worldbody.add_geom(type=kind, size=size, **where)
        with quiet_mujoco():
            model = spec.compile()
        return model, mujoco.MjData(model)

    @cached_property
    def _local(self) -> Matrix:
        """Pose of each geom in the frame of its body, shape (shapes, 4, 4).

        Of a mesh it is not ours: MuJoCo moves its origin to the centre of mass.
        """
        import mujoco

        model, _ = self._compiled
        local = np.tile(np.eye(4), (len(self._shapes), 1, 1))
        local[:, :3, 3] = model.geom_pos
        turn = np.zeros(9)
        for index in range(len(self._shapes)):
            mujoco.mju_quat2Mat(turn, model.geom_quat[index])
            local[index, :3, :3] = turn.reshape(3, 3)
        return local

    def _apart(self, one: tuple[Body, Placed], other: tuple[Body, Placed]) -> bool:
        """Return whether a simulator would let two shapes collide."""
        (a, first), (b, second) = one, other
        if a is b or self._neighbors(a, b):
            return False
        if frozenset((first.link, second.link)) in self._facts.model.excluded:
            return False
        g, h = first.geometry, second.geometry
        return bool((g.contype & h.conaffinity) or (h.contype & g.conaffinity))

    def _neighbors(self, a: Body, b: Body) -> bool:
        return self._facts.carrier_of(a) is b or self._facts.carrier_of(b) is a


def _solid(placed: Placed, facts: "Facts") -> bool:
    """Return whether a shape has room inside, and may touch anything."""
    geometry = placed.geometry
    if not has_extent(geometry, facts.meshes) or not geometry.contacts:
        return False
    if geometry.shape != "mesh":
        return min(geometry.size) > _THINNEST
    assert geometry.mesh is not None
    try:
        facts.meshes.hull(geometry.mesh.path)
    except MeshError:
        return False  # MSH010 tells of a mesh without a hull
    return True
