"""The geoms of a map near each robot, in place of all its geoms.

The time of a MuJoCo step grows with the number of geoms of a map. Here, a model has only as many
as are near a robot, which take the types, shapes and poses of the geoms of the map.
"""

import warnings
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ExportError, TerrainkitWarning
from terrainkit.geometry.solids import Solids

if TYPE_CHECKING:
    import mujoco

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
        self, spec: "mujoco.MjSpec", *, base: str | None = None, max_move: float = 0.2
    ) -> None:
        """Find the geoms near each place, and replace those of `spec`.

        Args:
            spec: Robot on a map. The static geoms that collide alike are those of the map; planes
                and other ones stay.
            base: Body of the robot's base; by default the first one with a free joint.
            max_move: Distance that the base moves at most between two updates [m].

        Raises:
            ExportError: If `spec` has no free joint, or does not compile.
        """
        import mujoco

        try:
            model = spec.compile()
        except ValueError as error:
            raise ExportError(f"MuJoCo rejects the model: {' '.join(str(error).split())}") from None
        geoms = _map_geoms(model)
        self.num_geoms = self.num_near = len(geoms)
        self.shapes = {name: getattr(model, name)[geoms].copy() for name in _SHAPE}
        if len(geoms) <= _MIN_GEOMS:
            return
        free = model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]
        if base is None and not len(free):
            raise ExportError("robot: got no free joint; expected one, or the base")
        distance = reach(model, int(free[0]) if base is None else model.body(base).id) + max_move
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        rotation = data.geom_xmat[geoms].reshape(-1, 3, 3)[:, :2]
        boxes = model.geom_aabb[geoms]
        center = data.geom_xpos[geoms, :2] + np.einsum("nij,nj->ni", rotation, boxes[:, :3])
        half = np.einsum("nij,nj->ni", np.abs(rotation), boxes[:, 3:]) + distance
        self._lower = (center - half).min(axis=0)
        self._first, self._last = self.square(center - half), self.square(center + half)
        num_near = most_near(self._first, self._last)
        if num_near * _MIN_RATIO <= len(geoms):
            self.num_near = num_near
            _replace_geoms(spec, set(geoms.tolist()), num_near)

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
        self._center = center = np.full((n, 2), np.inf)  # of the square of each robot

        def update(position: NDArray[np.floating]) -> None:
            moved = np.abs(position - center) > _WINDOW / 2
            if not moved.any():
                return
            for robot in np.flatnonzero(moved.any(axis=1)).tolist():
                square = self.square(position[robot])
                shapes = self.near_shapes(robot, square)
                center[robot] = self._lower + (square + 0.5) * _WINDOW
                end = first + len(shapes["geom_type"])
                for name, values in shapes.items():
                    fields[name][robot][first:end] = values
                # MuJoCo compares each geom of a robot with this number of static geoms.
                fields["body_geomnum"][robot][0] = end

        return update

    @property
    def is_active(self) -> bool:
        """Whether the model has only geoms near a robot."""
        return self.num_near < self.num_geoms

    def square(self, position: NDArray[np.floating]) -> NDArray[np.int64]:
        """Return the square of positions x, y [m], shape (..., 2)."""
        square: NDArray[np.int64] = np.floor((position - self._lower) / _WINDOW).astype(np.int64)
        return square

    def near_shapes(self, robot: int, square: NDArray[np.int64]) -> dict[str, NDArray[Any]]:  # noqa: ARG002
        """Return the geoms near a square, which are the same for all robots."""
        near = self.near(square)
        return {name: shapes[near] for name, shapes in self.shapes.items()}

    def near(self, square: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return which geoms of the map are near a square, shape (k,)."""
        return np.flatnonzero(((self._first <= square) & (square <= self._last)).all(axis=1))


class PatchGeoms(NearGeoms):
    """The solids near each of n robots that stand on patches of their own.

    `bind` the compiled model, and `replace` the solids of a robot at its resets. It needs boxes and
    cylinders, whose shapes a compiled model can change.
    """

    def __init__(
        self,
        spec: "mujoco.MjSpec",
        geom: str,
        base: str,
        solids: Solids,
        num_robots: int,
        max_move: float = 0.2,
    ) -> None:
        """Add as many geoms to `spec` as may be near a robot.

        Args:
            spec: Robot on the ground, without solids.
            geom: Geom of the ground, whose contacts the solids have.
            base: Body of the robot's base.
            solids: Solids of many patches as a sample: near a robot may be 5/4 as many as near any
                place there.
            num_robots: Number of robots.
            max_move: Distance that the base moves at most between two updates [m].
        """
        model = spec.compile()
        self._distance = reach(model, model.body(base).id) + max_move
        self._lower = np.zeros(2)
        first, last = self._squares(solids, np.zeros(2))
        corner = first.min(axis=0, initial=0)
        self.num_near = -(-5 * most_near(first - corner, last - corner) // 4)
        none = solid_shapes(Solids.empty()), first[:0], last[:0]
        self._patches = [none] * num_robots
        _add_slots(spec, spec.geom(geom), self.num_near)

    def replace(self, robot: int, solids: Solids, offset: NDArray[np.float64]) -> None:
        """Replace the solids of a robot; only those that collide matter.

        Args:
            robot: The robot.
            solids: Boxes and cylinders of its patch.
            offset: Place of the origin of the patch, x and y [m], shape (2,).
        """
        solids = solids.select(solids.collides)
        shapes = solid_shapes(solids)
        shapes["geom_pos"][:, :2] += offset
        first, last = self._squares(solids, offset)
        self._patches[robot] = shapes, first, last
        self._center[robot] = np.inf

    def near_shapes(self, robot: int, square: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
        """Return the solids of a robot near a square."""
        shapes, first, last = self._patches[robot]
        near = np.flatnonzero(((first <= square) & (square <= last)).all(axis=1))
        if len(near) > self.num_near:
            text = f"{len(near)} solids near a robot; only the {self.num_near} nearest collide"
            warnings.warn(text, TerrainkitWarning, stacklevel=2)
            away = np.abs(first[near] + last[near] - 2 * square).max(axis=1)
            near = near[np.argsort(away, kind="stable")[: self.num_near]]
        return {name: values[near] for name, values in shapes.items()}

    @property
    def is_active(self) -> bool:
        """Whether the model has geoms for solids."""
        return self.num_near > 0

    def _squares(
        self, solids: Solids, offset: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], ...]:
        """Return the first and the last square near which each solid is, shape (n, 2) each."""
        lower, upper = solids.bounds()
        first = self.square(lower[:, :2] - self._distance + offset)
        return first, self.square(upper[:, :2] + self._distance + offset)


def solid_shapes(solids: Solids) -> dict[str, NDArray[Any]]:
    """Return boxes and cylinders as fields of geoms, by name."""
    import mujoco

    rows = np.concatenate([solids.boxes, solids.cylinders]).astype(float)
    is_box = np.arange(len(rows)) < len(solids.boxes)
    box, cylinder = int(mujoco.mjtGeom.mjGEOM_BOX), int(mujoco.mjtGeom.mjGEOM_CYLINDER)
    half = rows[:, 3:6]
    radius, length = half[:, 0], half[:, 2]
    size = np.column_stack([radius, length, np.zeros(len(rows))])
    return {
        "geom_type": np.where(is_box, box, cylinder),
        "geom_dataid": np.full(len(rows), -1),
        "geom_pos": rows[:, :3],
        "geom_quat": rows[:, 6:],
        "geom_size": np.where(is_box[:, None], half, size),
        "geom_rbound": np.where(is_box, np.linalg.norm(half, axis=1), np.hypot(radius, length)),
        "geom_aabb": np.hstack([np.zeros_like(half), half]),
    }


def most_near(first: NDArray[np.int64], last: NDArray[np.int64]) -> int:
    """Return the largest number of geoms near a square.

    Args:
        first: Square of the lower corner of each geom, from (0, 0), shape (n, 2).
        last: Square of its upper corner, shape (n, 2).
    """
    # A sum over both axes of +1 and -1 at the corners of each geom counts the geoms of squares.
    counts = np.zeros(last.max(axis=0, initial=0) + 2, np.int32)
    for i, i_sign in ((first[:, 0], 1), (last[:, 0] + 1, -1)):
        for j, j_sign in ((first[:, 1], 1), (last[:, 1] + 1, -1)):
            np.add.at(counts, (i, j), i_sign * j_sign)
    return int(counts.cumsum(axis=0).cumsum(axis=1).max())


def collides(model: Any) -> NDArray[np.bool_]:
    """Return which geoms of a MuJoCo model collide, shape (ngeom,)."""
    return np.asarray((model.geom_contype != 0) | (model.geom_conaffinity != 0))


def _map_geoms(model: Any) -> NDArray[np.int64]:
    """Return the static geoms that collide alike: the largest such group, without planes."""
    import mujoco

    is_plane = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    geoms = np.flatnonzero(collides(model) & ~is_plane & (model.geom_bodyid == 0))
    if not len(geoms):
        return geoms
    contact = np.column_stack([getattr(model, name)[geoms] for name in _CONTACT])
    _, group, sizes = np.unique(contact, axis=0, return_inverse=True, return_counts=True)
    return geoms[group.ravel() == sizes.argmax()]


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
    geoms = np.flatnonzero(collides(model) & (model.body_rootid[model.geom_bodyid] == base))
    extents = np.linalg.norm(model.geom_pos[geoms], axis=1) + model.geom_rbound[geoms]
    return float((distance[model.geom_bodyid[geoms]] + extents).max(initial=0))


def _replace_geoms(spec: Any, ids: set[int], num_near: int) -> None:
    """Replace the geoms of a map by as many as are near a robot, with the same contacts."""
    geoms = [geom for geom in spec.geoms if geom.id in ids]
    _add_slots(spec, geoms[0], num_near)
    # Deleting a geom takes a time that grows with their number: 45 s for 10,000 boxes, one by one.
    frame = spec.worldbody.add_frame()
    for geom in geoms:
        geom.set_frame(frame)
    spec.delete(frame)


def _add_slots(spec: Any, geom: Any, count: int) -> None:
    """Add geoms with the contacts of another, which take the shapes of those near a robot."""
    import mujoco

    names = [name.removeprefix("geom_") for name in _CONTACT] + ["group", "material", "rgba"]
    attributes = {name: getattr(geom, name) for name in names}
    for number in range(count):
        # MuJoCo ignores the orientation of a geom that is compiled without one.
        pose = {"pos": [0, 0, _BELOW], "quat": [0.8, 0.6, 0, 0], "size": [0.1, 0.1, 0.1]}
        box = mujoco.mjtGeom.mjGEOM_BOX
        spec.worldbody.add_geom(name=f"near_{number}", type=box, **pose, **attributes)
    # The geoms move, which the bounding volume hierarchy does not know.
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
