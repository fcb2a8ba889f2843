"""The geoms of a map near each robot, in place of all its geoms.

The time of a MuJoCo step grows with the number of geoms of a map. Here, a model has only as many
as are near a robot, which take the types, shapes and poses of the geoms of the map.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ExportError
from terrainkit.export import mjcf_map
from terrainkit.geometry.ground_surface import HeightfieldSurface
from terrainkit.integrations import load_map

if TYPE_CHECKING:
    from pathlib import Path

    import mujoco

    from terrainkit.map.terrain_map import TerrainMap

_WINDOW = 0.25
"""Side of the squares in which all positions of a base have the same geoms [m]."""

_MIN_GEOMS = 64
"""Number of geoms up to which a map keeps all of them."""

# Geoms that move are not in MuJoCo's bounding volume hierarchy, so each one takes time in every
# step. Steps with 124 of 3,200 boxes were 1.4 times as fast, and with 67 of 10,400 4 times.
_MIN_RATIO = 8
"""Smallest number of all geoms of a map over those near a robot from which only these are used."""

_SHAPE = (
    "geom_type",
    "geom_dataid",
    "geom_pos",
    "geom_quat",
    "geom_size",
    "geom_rbound",
    "geom_aabb",
)
"""The fields of a model that differ between the geoms of a map."""

_CONTACT = (
    "geom_contype",
    "geom_conaffinity",
    "geom_condim",
    "geom_priority",
    "geom_friction",
    "geom_solmix",
    "geom_solref",
    "geom_solimp",
    "geom_margin",
    "geom_gap",
)
"""The fields that all geoms of a map share."""

_BELOW = -1e3
"""Height of the geoms before the first update [m]."""


class NearGeoms:
    """The geoms of a map near each of n robots, one robot per model or simulation.

    Create it from the specification of a robot on a map, compile the specification, and `bind` the
    model, which returns the function to call before steps.

    Attributes:
        num_geoms: Number of static geoms of the map that collide.
        num_near: Number of geoms in the model in their place: the largest number near a robot. If
            that would not make steps faster, the model keeps all geoms, and nothing is replaced.
        shapes: Fields of the model that differ between the geoms of the map, by name.
    """

    def __init__(
        self,
        spec: "mujoco.MjSpec",
        source: "TerrainMap | HeightfieldSurface | str | Path",
        *,
        base: str | None = None,
        max_move: float = 0.2,
        collision: mjcf_map.Collision = "auto",
    ) -> None:
        """Find the geoms near each place of the map, and replace those of `spec`.

        Args:
            spec: Robot on the map, which `add_map` or an exported MJCF file adds. Its static geoms
                that collide alike are those of the map; planes and other ones stay.
            source: The map, its path, or the surface that the robot collides with.
            base: Body of the robot's base; by default the first one with a free joint.
            max_move: Distance that the base moves at most between two updates [m].
            collision: Geometry with which `spec` has the map.

        Raises:
            ExportError: If the robot has no such base, or `spec` does not compile.
        """
        import mujoco

        if isinstance(source, HeightfieldSurface):
            surface = source
        else:
            surface = mjcf_map.collision_surface(load_map(source), collision)
        try:
            model = spec.compile()
        except ValueError as error:
            raise ExportError(f"MuJoCo rejects the model: {' '.join(str(error).split())}") from None
        geoms = _map_geoms(model)
        self.num_geoms = self.num_near = len(geoms)
        self.shapes = {name: getattr(model, name)[geoms].copy() for name in _SHAPE}
        if len(geoms) <= _MIN_GEOMS:
            return
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        rotation = data.geom_xmat[geoms].reshape(-1, 3, 3)
        center = data.geom_xpos[geoms] + np.einsum(
            "nij,nj->ni", rotation, model.geom_aabb[geoms, :3]
        )
        half = np.einsum("nij,nj->ni", np.abs(rotation), model.geom_aabb[geoms, 3:])
        distance = reach(model, _base(model, base)) + max_move
        self._find_near(center - half, center + half, surface, distance)
        num_near = int(np.diff(self._starts).max())
        if num_near * _MIN_RATIO <= len(geoms):
            self.num_near = num_near
            _replace_geoms(spec, set(geoms.tolist()), num_near)

    def _find_near(
        self,
        lower: NDArray[np.float64],
        upper: NDArray[np.float64],
        surface: HeightfieldSurface,
        distance: float,
    ) -> None:
        """Find the geoms, with these corners, within a distance of each square of the map."""
        lowest, self._lower = _lowest_ground(surface, distance)
        self._num_squares = lowest.shape
        first, last = (lower - distance)[:, :2], (upper + distance)[:, :2]
        start = np.clip(np.floor((first - self._lower) / _WINDOW).astype(int), 0, lowest.shape)
        stop = np.clip(np.ceil((last - self._lower) / _WINDOW).astype(int), 0, lowest.shape)
        top = upper[:, 2] + 1e-4  # of rounding
        squares = []
        for number, (i0, j0), (i1, j1) in zip(range(len(top)), start, stop, strict=True):
            # A geom below all ground near a square is out of reach.
            i, j = np.nonzero(top[number] >= lowest[i0:i1, j0:j1])
            squares.append((i + i0) * lowest.shape[1] + j + j0)
        geoms = np.repeat(np.arange(len(top)), [len(square) for square in squares])
        squares_of_geoms = np.concatenate(squares)
        order = np.argsort(squares_of_geoms, kind="stable")
        self._near = geoms[order]  # of all squares in order; `_starts` has the first of each
        self._starts = np.searchsorted(squares_of_geoms[order], np.arange(lowest.size + 1))

    def bind(self, target: Any) -> Callable[[NDArray[np.floating]], None]:
        """Return the function that replaces the geoms of the robots that reached another square.

        Call it with the position of each robot's base, x and y [m], shape (n, 2), before the first
        step, and whenever a robot may have moved by `max_move`.

        Args:
            target: The compiled model, one per robot, or a `mujoco.batch.Batch` of n simulations.
        """
        if not self.is_active:
            return lambda _: None
        names = (*_SHAPE, "body_geomnum")
        fields: dict[str, Sequence[NDArray[Any]]]
        if hasattr(target, "expand"):
            model, n = target.model, target.nsim
            fields = {name: target.expand(name) for name in names}
        else:
            models = [target] if hasattr(target, "geom_pos") else list(target)
            model, n = models[0], len(models)
            fields = {name: [getattr(model, name) for model in models] for name in names}
        first = model.geom("near_0").id
        if first + self.num_near != model.body_geomnum[0]:
            raise ExportError("static geoms of the model: expected those of NearGeoms last")
        center = np.full((n, 2), np.inf)  # of the square of each robot

        def update(position: NDArray[np.floating]) -> None:
            moved = np.abs(position - center) > _WINDOW / 2
            if not moved.any():
                return
            for robot in np.flatnonzero(moved.any(axis=1)).tolist():
                i, j = self.square(position[robot])
                near = self.near(i, j)
                center[robot] = self._lower + (np.array([i, j]) + 0.5) * _WINDOW
                slots = slice(first, first + len(near))
                for name, shapes in self.shapes.items():
                    fields[name][robot][slots] = shapes[near]
                # MuJoCo compares each geom of a robot with this number of static geoms.
                fields["body_geomnum"][robot][0] = first + len(near)

        return update

    @property
    def is_active(self) -> bool:
        """Whether the model has only geoms near a robot."""
        return self.num_near < self.num_geoms

    def square(self, position: NDArray[np.floating]) -> tuple[int, int]:
        """Return the square of a position x, y [m]: the nearest one outside of the map."""
        i, j = np.floor((position - self._lower) / _WINDOW).tolist()
        rows, cols = self._num_squares
        return min(max(int(i), 0), rows - 1), min(max(int(j), 0), cols - 1)

    def near(self, i: int, j: int) -> NDArray[np.int64]:
        """Return which geoms of the map are near a square, shape (k,)."""
        square = i * self._num_squares[1] + j
        return self._near[self._starts[square] : self._starts[square + 1]]


def _map_geoms(model: Any) -> NDArray[np.int64]:
    """Return the static geoms that collide alike: the largest such group, without planes."""
    import mujoco

    collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    is_plane = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    geoms = np.flatnonzero(collides & ~is_plane & (model.geom_bodyid == 0))
    if not len(geoms):
        return geoms
    contact = np.column_stack([getattr(model, name)[geoms] for name in _CONTACT])
    _, group, sizes = np.unique(contact, axis=0, return_inverse=True, return_counts=True)
    return geoms[group.ravel() == sizes.argmax()]


def _base(model: Any, name: str | None) -> int:
    """Return the body of the base."""
    import mujoco

    free = model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE].tolist()
    names = {model.body(body).name: body for body in free}
    if (name is None and not free) or (name is not None and name not in names):
        expected = f"one of: {', '.join(names)}" if names else "a body with a free joint"
        raise ExportError(f"base of the robot: got {name!r}; expected {expected}")
    return int(free[0] if name is None else names[name])


def reach(model: Any, base: int) -> float:
    """Return an upper bound of the distance from the base to any point of the robot [m]."""
    import mujoco

    distance = np.zeros(model.nbody)
    bodies = np.flatnonzero(model.body_rootid == base)
    for body in bodies[bodies != base]:  # parents come first
        joints = np.flatnonzero(model.jnt_bodyid == body)
        slides = model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_SLIDE
        # A rotation about an anchor moves a body by at most twice the distance of the anchor.
        moved = np.abs(model.jnt_range[joints]).max(axis=1, initial=0) * slides
        moved = moved + 2 * np.linalg.norm(model.jnt_pos[joints], axis=1)
        own = np.linalg.norm(model.body_pos[body]) + moved.sum()
        distance[body] = distance[model.body_parentid[body]] + own
    collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    geoms = np.flatnonzero(collides & (model.body_rootid[model.geom_bodyid] == base))
    extents = np.linalg.norm(model.geom_pos[geoms], axis=1) + model.geom_rbound[geoms]
    return float((distance[model.geom_bodyid[geoms]] + extents).max(initial=0))


def _lowest_ground(
    surface: HeightfieldSurface, distance: float
) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Return the lowest ground within a distance of each square [m], and their lower corner."""
    import cv2

    heights, cell = surface.heights, surface.cell
    if surface.box_top is not None:  # the heights below boxes do not count
        heights = np.where(np.isfinite(surface.box_top), surface.box_top, heights)
    size = 2 * int(np.ceil((_WINDOW / 2 + distance) / cell)) + 3
    lowest = cv2.erode(np.ascontiguousarray(heights), np.ones((size, size), np.uint8))
    lower = np.subtract(surface.first_sample, cell / 2)
    shape = np.ceil(np.multiply(heights.shape, cell) / _WINDOW).astype(int)
    at = [
        np.minimum(((np.arange(n) + 0.5) * _WINDOW / cell).astype(int), limit - 1)
        for n, limit in zip(shape, heights.shape, strict=True)
    ]
    return lowest[np.ix_(*at)], lower


def _replace_geoms(spec: Any, ids: set[int], num_near: int) -> None:
    """Replace the geoms of a map by as many as are near a robot, with the same contacts."""
    import mujoco

    geoms = [geom for geom in spec.geoms if geom.id in ids]
    names = [name.removeprefix("geom_") for name in _CONTACT] + ["group", "material", "rgba"]
    attributes = {name: getattr(geoms[0], name) for name in names}
    # Deleting a geom takes a time that grows with their number: 45 s for 10,000 boxes, one by one.
    frame = spec.worldbody.add_frame()
    for geom in geoms:
        geom.set_frame(frame)
    spec.delete(frame)
    for number in range(num_near):
        # MuJoCo ignores the orientation of a geom that is compiled without one.
        pose = {"pos": [0, 0, _BELOW], "quat": [0.8, 0.6, 0, 0], "size": [0.1, 0.1, 0.1]}
        box = mujoco.mjtGeom.mjGEOM_BOX
        spec.worldbody.add_geom(name=f"near_{number}", type=box, **pose, **attributes)
    # The geoms move, which the bounding volume hierarchy does not know.
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
