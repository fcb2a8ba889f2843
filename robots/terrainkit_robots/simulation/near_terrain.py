"""The geoms of a map near each robot, in place of all its geoms.

The time of a MuJoCo step grows with the number of geoms of a map. Here, all simulations have the
same few geoms, which take the types, shapes and poses of the geoms near their robot.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.ground_surface import HeightfieldSurface
from terrainkit_robots.simulation.geoms import collides
from terrainkit_robots.transforms import FloatArray

WINDOW = 0.25
"""Side of the squares in which all positions of a base have the same geoms [m]."""

MAX_SPEED = 10.0
"""Speed that a robot does not exceed within a policy step [m/s]."""

MIN_GEOMS = 64
"""Number of geoms up to which a map has all of them in every simulation."""

# Geoms that move are not in MuJoCo's bounding volume hierarchy, so each one takes time in every
# step. Steps with 124 of 3,200 boxes were 1.4 times as fast, and with 67 of 10,400 4 times.
MIN_RATIO = 8
"""Smallest number of all geoms of a map over those near a robot from which only these are used."""

_FIELDS = (
    "geom_type",
    "geom_dataid",
    "geom_pos",
    "geom_quat",
    "geom_size",
    "geom_rbound",
    "geom_aabb",
)
"""The fields of a model that differ between geoms near a robot."""

FAR = -1e3
"""Height of the geoms that are not near a robot [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class NearTerrain:
    """The geoms of a map, and which of them are near each square: n geoms and m squares."""

    fields: dict[str, NDArray[Any]]  # `_FIELDS` of each geom, by name
    lower: FloatArray  # lower corner of the squares, x and y [m]
    shape: tuple[int, int]  # number of squares along x and y
    starts: NDArray[np.int64]  # first entry of each square in `near`, shape (m + 1,)
    near: NDArray[np.int64]  # geoms near each square, in order

    def squares(self, position: FloatArray) -> NDArray[np.int64]:
        """Return the square of each position, the nearest one outside of the map.

        Args:
            position: x and y [m], shape (k, 2).
        """
        index = np.floor((position - self.lower) / WINDOW).astype(np.int64)
        i, j = np.clip(index, 0, np.subtract(self.shape, 1)).T
        square: NDArray[np.int64] = i * self.shape[1] + j
        return square

    @property
    def num_near(self) -> int:
        """The largest number of geoms near a square."""
        return int(np.diff(self.starts).max())


def find_near_terrain(
    model: Any, base: int, surface: HeightfieldSurface, policy_dt: float
) -> NearTerrain | None:
    """Return the geoms of a map near each square, or None if all geoms are as fast.

    Args:
        model: Model of a robot on the map.
        base: Body of the robot's base.
        surface: Surface of the map.
        policy_dt: Time in which a robot moves between two choices of geoms [s].
    """
    world = np.flatnonzero(collides(model) & (model.geom_bodyid == 0))
    fields = model.geom_friction, model.geom_priority, model.geom_solref, model.geom_solimp
    is_alike = all(len(np.unique(field[world], axis=0)) == 1 for field in fields)
    if len(world) <= MIN_GEOMS or not is_alike:
        return None
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    rotation = data.geom_xmat[world].reshape(-1, 3, 3)
    center = data.geom_xpos[world] + np.einsum("nij,nj->ni", rotation, model.geom_aabb[world, :3])
    half = np.einsum("nij,nj->ni", np.abs(rotation), model.geom_aabb[world, 3:])
    distance = _reach(model, base) + MAX_SPEED * policy_dt
    first, last = (center - half)[:, :2] - distance, (center + half)[:, :2] + distance
    lowest, lower = _lowest_ground(surface, distance)
    limit = lowest.shape
    start = np.clip(np.floor((first - lower) / WINDOW).astype(int), 0, limit)
    stop = np.clip(np.ceil((last - lower) / WINDOW).astype(int), 0, limit)
    top = (center + half)[:, 2] + 1e-4  # of rounding
    squares = []
    for number, (i0, j0), (i1, j1) in zip(range(len(world)), start, stop, strict=True):
        # A geom below all ground near a square is out of reach.
        i, j = np.nonzero(top[number] >= lowest[i0:i1, j0:j1])
        squares.append((i + i0) * limit[1] + j + j0)
    geoms = np.repeat(np.arange(len(world)), [len(square) for square in squares])
    every = np.concatenate(squares)
    order = np.argsort(every, kind="stable")
    starts = np.searchsorted(every[order], np.arange(lowest.size + 1))
    near = NearTerrain(
        fields={name: getattr(model, name)[world].copy() for name in _FIELDS},
        lower=lower,
        shape=limit,
        starts=starts,
        near=geoms[order],
    )
    return near if near.num_near * MIN_RATIO <= len(world) else None


def _reach(model: Any, base: int) -> float:
    """Return an upper bound of the distance from the base to any point of the robot [m]."""
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


def _lowest_ground(
    surface: HeightfieldSurface, distance: float
) -> tuple[NDArray[np.float32], FloatArray]:
    """Return the lowest ground within a distance of each square [m], and their lower corner."""
    heights, cell = surface.heights, surface.cell
    if surface.box_top is not None:  # the heights below boxes do not count
        heights = np.where(np.isfinite(surface.box_top), surface.box_top, heights)
    size = 2 * int(np.ceil((WINDOW / 2 + distance) / cell)) + 3
    lowest = cv2.erode(np.ascontiguousarray(heights), np.ones((size, size), np.uint8))
    lower = np.subtract(surface.first_sample, cell / 2)
    shape = np.ceil(np.multiply(heights.shape, cell) / WINDOW).astype(int)
    at = [
        np.minimum(((np.arange(n) + 0.5) * WINDOW / cell).astype(int), limit - 1)
        for n, limit in zip(shape, heights.shape, strict=True)
    ]
    return lowest[np.ix_(*at)], lower


def add_near_geoms(mjspec: Any, terrain: NearTerrain) -> None:
    """Replace the geoms of a map by as many as are near a robot.

    Args:
        mjspec: Model of a robot on the map.
        terrain: The geoms of the map.
    """
    geoms = [geom for geom in mjspec.worldbody.find_all("geom") if geom.parent.name == "world"]
    geoms = [geom for geom in geoms if geom.contype or geom.conaffinity]
    names = "contype conaffinity condim priority friction solmix solref solimp margin gap"
    attributes = {name: getattr(geoms[0], name) for name in names.split()}
    # Deleting a geom takes a time that grows with their number: 45 s for 10,000 boxes, one by one.
    frame = mjspec.worldbody.add_frame()
    for geom in geoms:
        geom.set_frame(frame)
    mjspec.delete(frame)
    for number in range(terrain.num_near):
        # MuJoCo ignores the orientation of a geom that is compiled without one.
        pose = {"pos": [0, 0, FAR], "quat": [0.8, 0.6, 0, 0], "size": [0.1, 0.1, 0.1]}
        box = mujoco.mjtGeom.mjGEOM_BOX
        mjspec.worldbody.add_geom(name=f"near_{number}", type=box, **pose, **attributes)
    # The geoms move, which the bounding volume hierarchy does not know.
    mjspec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)


class NearGeoms:
    """Makes the geoms of a batch of simulations the geoms of the map near their robots."""

    def __init__(self, batch: Any, model: Any, terrain: NearTerrain, num_envs: int) -> None:
        self._slots = np.flatnonzero(collides(model) & (model.geom_bodyid == 0))
        self._fields = {
            name: batch.expand(name).reshape(num_envs, model.ngeom, -1) for name in _FIELDS
        }
        self._terrain, self._squares = terrain, np.full(num_envs, -1)

    def update(self, position: FloatArray) -> None:
        """Replace the geoms of the robots that reached another square.

        Args:
            position: Position of each robot, x and y [m], shape (n, 2).
        """
        terrain, squares = self._terrain, self._terrain.squares(position)
        for env in np.flatnonzero(squares != self._squares).tolist():
            near = terrain.near[slice(*terrain.starts[squares[env] : squares[env] + 2])]
            for name, values in self._fields.items():
                values[env, self._slots[: len(near)]] = terrain.fields[name][near].reshape(
                    len(near), -1
                )
            self._fields["geom_pos"][env, self._slots[len(near) :], 2] = FAR
        self._squares = squares
