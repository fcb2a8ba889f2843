"""Convex solids of the parts of a mesh that hang over the ground."""

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import HeightFileError
from terrainkit.files.child_process import ProcessError
from terrainkit.geometry.convex_decomposition import SEARCH, convex_decomposition
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh import closed_mesh, merged_mesh
from terrainkit.geometry.mesh.solid_mesh import manifold
from terrainkit.geometry.solids import (
    MAX_HULL_VERTICES,
    MIN_SIZE,
    Solids,
    make_boxes,
    make_hulls,
)
from terrainkit.importing.readers.mesh_columns import MIN_GAP, Columns
from terrainkit.importing.readers.mesh_source import MeshSource

PARAMETERS = {**SEARCH, "threshold": 0.03, "max_convex_hull": 32}
"""Parameters of CoACD."""

MIN_VOLUME = 1e-6
"""Volume of the smallest solid [m3]."""

_TOLERANCE = 1e-4
"""Distance by which a solid may be simplified [m]."""

_THIN = 0.499
"""Least radius of a disk in the outline of a body that is not thin [cells]."""

_CONVEX = 0.99
"""Share of its convex hull that a body fills to be convex."""


_MAX_THIN_FACES = 10_000
"""Most faces of a body that is examined for being thin: the outline of more takes minutes."""


class Bodies(NamedTuple):
    """The connected parts of a mesh, in the frame of the map."""

    thin: list[Any]
    """Closed bodies narrower than a cell, as manifolds."""

    others: list[Any]
    """The other closed bodies, as manifolds."""

    thin_faces: NDArray[np.bool_]
    """Whether each face of the mesh belongs to a thin body."""

    num_open: int
    """Number of bodies that are not closed."""


def find_bodies(mesh: MeshSource, grid: Grid, origin: NDArray[np.float64]) -> Bodies:
    """Return the connected parts of a mesh within a map, with faces that point outward.

    A body is thin if no disk whose diameter is a cell fits in its outline seen from above: samples
    miss it or make it wider.

    Args:
        mesh: The mesh.
        grid: Grid of the map; bodies end at its edges.
        origin: Point of the file that is at (0, 0, 0) in the map, shape (3,) [m].
    """
    import manifold3d
    import trimesh

    whole = trimesh.Trimesh(vertices=mesh.vertices - origin, faces=mesh.faces, process=True)
    nodes, (low, high) = np.arange(len(whole.faces)), whole.bounds
    window = manifold3d.Manifold.cube((*grid.size, high[2] - low[2] + 2.0))
    window = window.translate((*grid.lower, low[2] - 1.0))
    groups = trimesh.graph.connected_components(whole.face_adjacency, min_len=1, nodes=nodes)
    bodies = Bodies([], [], np.zeros(len(nodes), dtype=bool), 0)
    num_closed = 0
    for faces, body in zip(groups, whole.submesh(groups, append=False), strict=True):
        if not body.is_watertight:
            continue
        if body.volume < 0:
            body.invert()
        solid = manifold(np.asarray(body.vertices), np.asarray(body.faces))
        if solid.status() != manifold3d.Error.NoError:
            continue
        num_closed += 1
        outline = solid.project() if len(faces) <= _MAX_THIN_FACES else None
        is_thin = outline is not None and outline.offset(-_THIN * grid.cell).is_empty()
        bodies.thin_faces[faces] |= is_thin
        (x0, y0), (x1, y1) = body.bounds[:, :2]
        if not (np.less_equal(grid.lower, (x0, y0)) & np.less_equal((x1, y1), grid.upper)).all():
            solid ^= window
        if solid.volume() >= MIN_VOLUME:
            (bodies.thin if is_thin else bodies.others).append(solid)
    return bodies._replace(num_open=len(groups) - num_closed)


def overhang_solids(
    path: Path, bodies: Bodies, columns: Columns, grid: Grid, threshold: float
) -> Solids:
    """Return thin bodies, and the parts of others above the lowest free space, as solids.

    The bodies are cut halfway up the free space, on the grid: each convex body for itself, and the
    union of the others. A part that is convex becomes one solid; CoACD decomposes the others.

    Args:
        path: The file, for errors.
        bodies: The parts of the mesh.
        columns: The columns of the mesh on the samples of `grid`, in the frame of the map, without
            the thin bodies.
        grid: Grid of the map.
        threshold: Difference between neighboring samples above which there is a wall [m].

    Raises:
        HeightFileError: if no body is closed, or one cannot be decomposed.
    """
    parts = list(bodies.thin)
    if not np.isnan(columns.ceiling).all():
        if not bodies.others:
            raise HeightFileError(f"{path}: solids: got a mesh without closed bodies that overhang")
        cut = _cut(columns)
        for body in _united(bodies.others):
            parts += _above(body, cut, grid, threshold)
    solids: list[Solids] = []
    for part in parts:
        if part.volume() < MIN_VOLUME:
            continue
        hulls = [_points(part.hull())] if _is_convex(part) else _decompose(path, part)
        solids += map(_make_solid, hulls)
    return Solids.concatenate(solids)


def _is_convex(body: Any) -> bool:
    hull = body.hull()
    return bool(body.volume() > _CONVEX * hull.volume() and hull.num_vert() <= MAX_HULL_VERTICES)


def _united(bodies: list[Any]) -> Iterator[Any]:
    """Yield the convex bodies, whose parts are convex as well, and the union of the others."""
    import manifold3d

    is_convex = [_is_convex(body) for body in bodies]
    yield from itertools.compress(bodies, is_convex)
    others = [body for body, skip in zip(bodies, is_convex, strict=True) if not skip]
    yield manifold3d.Manifold.batch_boolean(others, manifold3d.OpType.Add)


def _above(body: Any, cut: NDArray[np.float64], grid: Grid, threshold: float) -> list[Any]:
    """Return the parts of a body above the cut.

    Args:
        body: The body in the frame of the map.
        cut: Height of the cut at the samples [m], NaN where nothing is above it.
        grid: Grid of the map.
        threshold: Difference between neighboring samples above which there is a wall [m].
    """
    if body.is_empty():
        return []
    low, high = np.array(body.bounding_box()).reshape(2, 3)
    start = np.floor((low[:2] - grid.lower) / grid.cell).astype(int) - 1
    end = np.ceil((high[:2] - grid.lower) / grid.cell).astype(int) + 1
    start, end = (np.clip(index, 0, grid.shape) for index in (start, end))
    block = cut[start[0] : end[0], start[1] : end[1]]
    surface = np.where(np.isnan(block), high[2] + 1.0, block).astype(np.float32)
    if min(surface.shape) < 2 or surface.min() >= high[2]:
        return []
    if surface.max() <= low[2]:
        return [body]
    # A closed mesh extends downward, so the space is built upside down.
    part = grid.block((int(start[0]), int(start[1])), block.shape)
    mesh = closed_mesh(merged_mesh(-surface, part, threshold))
    space = manifold(mesh.vertices * np.array([1.0, 1.0, -1.0]), mesh.triangles[:, ::-1])
    # CoACD is exact only without the slivers that the cut leaves. As an original, coplanar faces of
    # different bodies merge.
    return list((body ^ space).as_original().simplify(_TOLERANCE).decompose())


def _make_solid(points: NDArray[np.float64]) -> Solids:
    """Return the box that has these corners, or else their convex hull."""
    # Of a box, the two shortest edges from a corner are along two of its axes.
    edges = points[1:] - points[0]
    lengths = np.linalg.norm(edges, axis=1)
    first, second = edges[np.argsort(lengths)[:2]]
    axes = np.array([first, second, np.cross(first, second)])
    axes /= np.maximum(np.linalg.norm(axes, axis=1, keepdims=True), MIN_SIZE)
    center = points.mean(axis=0)
    corners = np.abs((points - center) @ axes.T)
    if (
        len(points) == 8
        and np.ptp(corners, axis=0).max() < _TOLERANCE
        and abs(first @ second) < 1e-6
    ):
        size = 2 * corners.mean(axis=0)
        return make_boxes((0.0, 0.0, 0.0), size).transform(axes.T, center)
    return make_hulls([points])


def _cut(columns: Columns) -> NDArray[np.float64]:
    """Return the height halfway up the lowest free space, NaN where nothing hangs over it."""
    from scipy.ndimage import (
        binary_dilation,
        binary_fill_holes,
        distance_transform_edt,
        maximum_filter,
    )

    cut = (columns.ceiling + columns.floor) / 2
    has_ceiling = ~np.isnan(cut)
    nearest = distance_transform_edt(~has_ceiling, return_distances=False, return_indices=True)
    # Next to a support, the cut is at the ceiling. Higher up, a sheet of the support would remain,
    # since its sides are not at the borders of the cells. The top of a table stays whole.
    beneath = (columns.ceiling - MIN_GAP / 2)[tuple(nearest)]
    is_support = ~has_ceiling & (columns.top > beneath)
    is_beside = has_ceiling & binary_dilation(is_support, np.ones((3, 3)))
    beside = maximum_filter(np.where(has_ceiling, cut, -np.inf), size=3)
    cut[is_beside] = beneath[is_beside]
    # The samples next to an overhang belong to it if the sky is open there, so that the cut does
    # not shorten it by a part of a cell.
    is_open = ~has_ceiling & np.isfinite(beside) & ~(columns.top >= beside)
    cut[is_open] = beside[is_open]
    is_leg = is_support & binary_fill_holes(has_ceiling)
    cut[is_leg] = beneath[is_leg]
    return np.asarray(cut)


def _decompose(path: Path, part: Any) -> list[NDArray[np.float64]]:
    """Return the vertices of the convex parts of a manifold."""
    faces = part.to_mesh64().tri_verts.astype(np.int32)
    try:
        found = convex_decomposition(_points(part), faces, PARAMETERS)
    except ProcessError as error:
        raise HeightFileError(f"{path}: solids: CoACD failed: {error}") from None
    return [vertices for vertices, _ in found]


def _points(solid: Any) -> NDArray[np.float64]:
    return np.asarray(solid.to_mesh64().vert_properties[:, :3], float)
