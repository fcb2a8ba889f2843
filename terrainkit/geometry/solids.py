"""Solids: convex shapes that stand on the ground of a map or hang above it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.errors import ConfigError
from terrainkit.settings.text import short_repr
from terrainkit.settings.type_hint import MAX_VALUE

if TYPE_CHECKING:
    from scipy.spatial import ConvexHull

MIN_SIZE = 1e-4
"""Smallest size of a box, diameter or length of a cylinder, and cube root of the volume of a hull
[m]. MuJoCo rejects hulls of less than 1e-15 m^3, and an MJCF file has six decimals."""

MAX_HULL_VERTICES = 1000
"""Largest number of vertices of a convex hull."""

_PER_SOLID = ("friction", "collides", "visible", "patch")
"""The arrays of `Solids` with one item for each solid."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Solids:
    """Boxes, cylinders and convex hulls in the frame of the map.

    Arrays over all n solids list the boxes first, then the cylinders, then the hulls. Use
    `make_boxes`, `make_cylinders` and `make_hulls` to create solids.
    """

    __repr__ = short_repr

    boxes: NDArray[np.float32]
    """Center [m], half size along the axes of the box [m], quaternion (w, x, y, z); (nb, 10)."""

    cylinders: NDArray[np.float32]
    """Center [m], (radius, radius, half length) [m], quaternion (w, x, y, z); (nc, 10). The axis
    is the local z axis."""

    hull_vertices: NDArray[np.float32]
    """Vertices of all hulls, one hull after the other [m], shape (nv, 3)."""

    hull_counts: NDArray[np.int32]
    """Number of vertices of each hull, shape (nh,)."""

    friction: NDArray[np.float32]
    """Sliding friction, shape (n,); NaN for the friction of the ground."""

    collides: NDArray[np.bool_]
    """Whether robots collide with the solid, shape (n,)."""

    visible: NDArray[np.bool_]
    """Whether height scans and cameras see the solid, shape (n,)."""

    patch: NDArray[np.int32]
    """Row and column of the patch of the solid, shape (n, 2)."""

    def __len__(self) -> int:
        return len(self.friction)

    @classmethod
    def empty(cls) -> Self:
        """Return no solids."""
        return cls(
            boxes=np.empty((0, 10), np.float32),
            cylinders=np.empty((0, 10), np.float32),
            hull_vertices=np.empty((0, 3), np.float32),
            hull_counts=np.empty(0, np.int32),
            friction=np.empty(0, np.float32),
            collides=np.empty(0, bool),
            visible=np.empty(0, bool),
            patch=np.empty((0, 2), np.int32),
        )

    @classmethod
    def concatenate(cls, parts: Iterable["Solids"]) -> Self:
        """Return all solids of `parts`: all boxes, then all cylinders, then all hulls."""
        parts = [part for part in parts if len(part)]
        if not parts:
            return cls.empty()
        kind = np.concatenate([part.types for part in parts])
        order = np.argsort(kind, kind="stable")
        arrays: dict[str, Any] = {
            name: np.concatenate([getattr(part, name) for part in parts]) for name in vars(parts[0])
        }
        return cls(**arrays | {name: arrays[name][order] for name in _PER_SOLID})

    def select(self, mask: NDArray[np.bool_]) -> Self:
        """Return some of the solids.

        Args:
            mask: Which solids to keep, shape (n,).
        """
        if mask.all():
            return self
        ends = np.cumsum([len(self.boxes), len(self.cylinders)])
        boxes, cylinders, hulls = np.split(mask, ends)
        return replace(
            self,
            boxes=self.boxes[boxes],
            cylinders=self.cylinders[cylinders],
            hull_vertices=self.hull_vertices[np.repeat(hulls, self.hull_counts)],
            hull_counts=self.hull_counts[hulls],
            **{name: getattr(self, name)[mask] for name in _PER_SOLID},
        )

    def diff(self, other: "Solids", tolerance: float) -> list[str]:
        """Return the names of the arrays that differ in shape, or by more than `tolerance`."""
        pairs = [(name, array, getattr(other, name)) for name, array in vars(self).items()]
        return [
            name
            for name, a, b in pairs
            if a.shape != b.shape or not np.allclose(a, b, rtol=0, atol=tolerance, equal_nan=True)
        ]

    def transform(self, rotation: ArrayLike, translation: ArrayLike = (0.0, 0.0, 0.0)) -> Self:
        """Return the solids moved by p -> rotation @ p + translation.

        Args:
            rotation: Rotation or reflection, shape (3, 3). A box or a cylinder is its own mirror
                image, so a reflection only reflects its pose.
            translation: Translation [m], shape (3,).
        """
        matrix, offset = np.asarray(rotation, float), np.asarray(translation, float)

        def transform_shapes(shapes: NDArray[np.float32]) -> NDArray[np.float32]:
            axes = matrix @ rotation_matrices(shapes[:, 6:])
            axes[..., 2] *= np.sign(np.linalg.det(axes))[:, None]  # z is as good as -z
            centers = shapes[:, :3] @ matrix.T + offset
            return np.hstack([centers, shapes[:, 3:6], quaternions(axes)]).astype(np.float32)

        vertices = (self.hull_vertices @ matrix.T + offset).astype(np.float32)
        return replace(
            self,
            boxes=transform_shapes(self.boxes),
            cylinders=transform_shapes(self.cylinders),
            hull_vertices=vertices,
        )

    @property
    def types(self) -> NDArray[np.int8]:
        """Type of each solid, shape (n,): 0 for a box, 1 for a cylinder, 2 for a hull."""
        counts = [len(self.boxes), len(self.cylinders), len(self.hull_counts)]
        return np.repeat(np.arange(3, dtype=np.int8), counts)

    def hulls(self) -> list[NDArray[np.float32]]:
        """Return the vertices of each hull [m], shapes (k, 3)."""
        return np.split(self.hull_vertices, np.cumsum(self.hull_counts))[:-1]

    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the axis-aligned bounding boxes of the solids.

        Returns:
            Lower and upper corners [m], each of shape (n, 3).
        """
        shapes = np.concatenate([self.boxes, self.cylinders]).astype(float)
        axes = rotation_matrices(shapes[:, 6:])
        half = np.einsum("nij,nj->ni", np.abs(axes), shapes[:, 3:6])
        if len(self.cylinders):
            axis = axes[len(self.boxes) :, :, 2]
            radius, _, length = np.split(shapes[len(self.boxes) :, 3:6], 3, axis=1)
            # The extent of a disk with unit normal a along x is radius sqrt(a_y^2 + a_z^2).
            across = np.hypot(np.roll(axis, 1, axis=1), np.roll(axis, 2, axis=1))
            half[len(self.boxes) :] = radius * across + length * np.abs(axis)
        lower, upper = shapes[:, :3] - half, shapes[:, :3] + half
        if len(self.hull_counts):
            starts = np.concatenate([[0], np.cumsum(self.hull_counts)[:-1]])
            vertices = self.hull_vertices.astype(float)
            lower = np.concatenate([lower, np.minimum.reduceat(vertices, starts)])
            upper = np.concatenate([upper, np.maximum.reduceat(vertices, starts)])
        return lower, upper


def check_solids(solids: object) -> None:
    """Check the types, shapes and values of solids that other code made.

    Raises:
        ConfigError: if they are not `Solids`, or an array is invalid.
    """
    if not isinstance(solids, Solids):
        raise ConfigError(f"solids: got {type(solids).__name__}; expected Solids")
    for name, like in vars(Solids.empty()).items():
        array = np.asarray(getattr(solids, name))
        kinds = [(values.dtype, values.ndim, values.shape[1:]) for values in (array, like)]
        if kinds[0] != kinds[1]:
            got, expected = (f"{values.dtype} {values.shape}" for values in (array, like))
            raise ConfigError(f"solids.{name}: got {got}; expected {expected} with any first size")
    shapes, counts = np.concatenate([solids.boxes, solids.cylinders]), solids.hull_counts
    lengths = {len(getattr(solids, name)) for name in _PER_SOLID}
    is_valid = {
        "solids": lengths == {len(shapes) + len(counts)},
        "boxes and cylinders": (np.abs(shapes) <= MAX_VALUE).all()
        and (shapes[:, 3:6] >= np.float32(MIN_SIZE / 2)).all()
        and (np.abs(np.linalg.norm(shapes[:, 6:], axis=1) - 1) < 1e-3).all(),
        "hulls": (np.abs(solids.hull_vertices) <= MAX_VALUE).all()
        and ((counts >= 4) & (counts <= MAX_HULL_VERTICES)).all()
        and counts.sum(dtype=np.int64) == len(solids.hull_vertices),
        "solid_friction": not ((solids.friction < 0) | np.isinf(solids.friction)).any(),
    }
    for key, valid in is_valid.items():
        if not valid:
            raise ConfigError(f"{key}: got invalid values or sizes")
    for hull in solids.hulls():
        convex_hull(hull)


def make_boxes(
    center: ArrayLike,
    size: ArrayLike,
    *,
    rpy: ArrayLike = (0.0, 0.0, 0.0),
    friction: ArrayLike = np.nan,
    collides: ArrayLike = True,
    visible: ArrayLike = True,
) -> Solids:
    """Return n boxes. All arguments are broadcast against each other.

    Args:
        center: Centers [m], shape (n, 3) or (3,).
        size: Full sizes along the axes of the box [m], shape (n, 3) or (3,).
        rpy: Roll, pitch and yaw [rad], shape (n, 3) or (3,): rotations around the fixed axes x, y
            and z, in this order, as in URDF.
        friction: Sliding friction, shape (n,) or (); NaN for the friction of the ground.
        collides: Whether robots collide with the box, shape (n,) or ().
        visible: Whether height scans see the box, shape (n,) or ().

    Raises:
        ConfigError: if shapes do not match, a value is not finite, or a size is below `MIN_SIZE`.
    """
    half_size = np.asarray(size, float) / 2
    return _make("boxes", (center, half_size, rpy), (friction, collides, visible))


def make_cylinders(
    center: ArrayLike,
    radius: ArrayLike,
    length: ArrayLike,
    *,
    rpy: ArrayLike = (0.0, 0.0, 0.0),
    friction: ArrayLike = np.nan,
    collides: ArrayLike = True,
    visible: ArrayLike = True,
) -> Solids:
    """Return n cylinders, upright where `rpy` is 0. All arguments are broadcast.

    Args:
        center: Centers [m], shape (n, 3) or (3,).
        radius: Radii [m], shape (n,) or ().
        length: Lengths along the axis [m], shape (n,) or ().
        rpy: Roll, pitch and yaw [rad]; see `make_boxes`.
        friction: See `make_boxes`.
        collides: See `make_boxes`.
        visible: See `make_boxes`.

    Raises:
        ConfigError: if shapes do not match, a value is not finite, or a diameter or length is below
            `MIN_SIZE`.
    """
    radius, length = np.broadcast_arrays(np.asarray(radius, float), np.asarray(length, float))
    half_size = np.stack([radius, radius, length / 2], axis=-1)
    return _make("cylinders", (center, half_size, rpy), (friction, collides, visible))


def make_hulls(
    points: Sequence[ArrayLike],
    *,
    friction: ArrayLike = np.nan,
    collides: ArrayLike = True,
    visible: ArrayLike = True,
) -> Solids:
    """Return the convex hull of each set of points.

    Args:
        points: Points of each hull [m], shapes (k, 3).
        friction: See `make_boxes`.
        collides: See `make_boxes`.
        visible: See `make_boxes`.

    Raises:
        ConfigError: if a hull has no volume, has too many vertices, or a value is not finite.
    """
    if not len(points):
        return Solids.empty()
    hulls = [_hull_vertices(np.asarray(hull, dtype=np.float32)) for hull in points]
    flags = _flags(len(hulls), friction, collides, visible)
    return replace(
        Solids.empty(),
        hull_vertices=np.concatenate(hulls),
        hull_counts=np.array([len(hull) for hull in hulls], dtype=np.int32),
        **flags,
    )


def convex_hull(vertices: NDArray[np.float32]) -> "ConvexHull":
    """Return the convex hull of points.

    Args:
        vertices: Points [m], shape (k, 3).

    Raises:
        ConfigError: if its volume is too small.
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(vertices.astype(float))
    except (QhullError, ValueError):  # ValueError without points
        raise ConfigError("hull: got points in one plane; expected points with a volume") from None
    if hull.volume < MIN_SIZE**3:
        raise ConfigError(
            f"hull: got a volume of {hull.volume:g} m^3; expected at least {MIN_SIZE**3:g} m^3"
        )
    return hull


def rotation_matrices(quaternion: ArrayLike) -> NDArray[np.float64]:
    """Return the rotation matrices of unit quaternions.

    Args:
        quaternion: Quaternions (w, x, y, z), shape (n, 4).

    Returns:
        Rotation matrices, shape (n, 3, 3).
    """
    w, x, y, z = np.asarray(quaternion, float).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def quaternions(rotation: ArrayLike) -> NDArray[np.float64]:
    """Return the unit quaternions of rotation matrices.

    Args:
        rotation: Rotation matrices, shape (n, 3, 3).

    Returns:
        Quaternions (w, x, y, z), shape (n, 4).
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = np.moveaxis(np.asarray(rotation, float), 0, -1)
    products = np.array(  # of the components of 2 q
        [
            [1 + xx + yy + zz, zy - yz, xz - zx, yx - xy],
            [zy - yz, 1 + xx - yy - zz, xy + yx, xz + zx],
            [xz - zx, xy + yx, 1 - xx + yy - zz, yz + zy],
            [yx - xy, xz + zx, yz + zy, 1 - xx - yy + zz],
        ]
    )
    # Each row is a multiple of q; the largest is the most exact.
    largest = np.argmax(np.diagonal(products), axis=-1)
    rows = products[largest, :, np.arange(len(largest))]
    return np.asarray(rows / np.linalg.norm(rows, axis=-1, keepdims=True))


def _make(kind: str, pose: Sequence[ArrayLike], flags: Sequence[ArrayLike]) -> Solids:
    """Return shapes of one kind, given center, half size and rpy, and the flags of `_flags`."""
    vectors = [np.asarray(values, float) for values in pose]
    vectors = [vector if vector.size else vector.reshape(-1, 3) for vector in vectors]
    numbers = [(np.size(values), 1) for values in flags]
    try:
        n, _ = np.broadcast_shapes((1, 3), *(vector.shape for vector in vectors), *numbers)
    except ValueError:
        given = ", ".join(str(vector.shape) for vector in vectors)
        raise ConfigError(
            f"center, size and rpy of {kind}: got shapes {given}; expected (3,) or the same (n, 3)"
        ) from None
    center, half_size, rpy = (np.broadcast_to(vector, (n, 3)) for vector in vectors)
    for name, values in (("center", center), ("size", half_size), ("rpy", rpy)):
        if not (np.abs(values) <= MAX_VALUE).all():
            raise ConfigError(f"{name} of {kind}: expected finite values up to {MAX_VALUE:g}")
    if n and not 2 * half_size.min() >= MIN_SIZE:
        raise ConfigError(
            f"size of {kind}: got {2 * half_size.min():g} m; expected at least {MIN_SIZE:g} m"
        )
    shapes = np.hstack([center, half_size, _rpy_quaternions(rpy)]).astype(np.float32)
    arrays = _flags(n, *flags) | {kind: shapes}
    return replace(Solids.empty(), **arrays)


def _rpy_quaternions(rpy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the quaternions (w, x, y, z), shape (n, 4), of roll, pitch and yaw [rad]."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy.T / 2), np.sin(rpy.T / 2)
    return np.column_stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def _flags(
    n: int, friction: ArrayLike, collides: ArrayLike, visible: ArrayLike
) -> dict[str, NDArray[Any]]:
    values = np.asarray(friction, float)
    if ((values < 0) | (values > MAX_VALUE)).any():
        raise ConfigError(
            f"friction of solids: got {np.nanmin(values):g} to {np.nanmax(values):g}; expected "
            f"0 to {MAX_VALUE:g}, or NaN for the friction of the ground"
        )
    return {
        "friction": np.broadcast_to(values, n).astype(np.float32),
        "collides": np.broadcast_to(np.asarray(collides, bool), n).copy(),
        "visible": np.broadcast_to(np.asarray(visible, bool), n).copy(),
        "patch": np.zeros((n, 2), np.int32),
    }


def _hull_vertices(points: NDArray[np.float32]) -> NDArray[np.float32]:
    if points.ndim != 2 or points.shape[1] != 3 or not (np.abs(points) <= MAX_VALUE).all():
        raise ConfigError(f"hull: got shape {points.shape}; expected finite points (k, 3)")
    used = convex_hull(points).vertices
    if len(used) > MAX_HULL_VERTICES:
        raise ConfigError(f"hull: got {len(used)} vertices; expected at most {MAX_HULL_VERTICES}")
    return np.asarray(points[np.sort(used)])
