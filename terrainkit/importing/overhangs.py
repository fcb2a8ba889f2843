"""Convex solids of the parts of a mesh that hang over the ground."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import HeightFileError
from terrainkit.files.child_process import ProcessError
from terrainkit.geometry.convex_decomposition import SEARCH, convex_decomposition
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.mesh import closed_mesh, merged_mesh
from terrainkit.geometry.mesh.solid_mesh import manifold
from terrainkit.geometry.solids import MAX_HULL_VERTICES, Solids, make_hulls
from terrainkit.importing.columns import MIN_GAP, Columns

PARAMETERS = {**SEARCH, "threshold": 0.03, "max_convex_hull": 32}
"""Parameters of CoACD."""

MIN_VOLUME = 1e-6
"""Volume of the smallest solid [m3]."""

_TOLERANCE = 1e-4
"""Distance by which a solid may be simplified [m]."""

_CONVEX = 0.99
"""Share of its convex hull that a body fills to be convex."""


def overhang_solids(
    path: Path,
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    columns: Columns,
    grid: Grid,
    threshold: float,
) -> Solids:
    """Return the parts of the closed bodies of a mesh above the lowest free space as solids.

    The union of the bodies is cut halfway up the free space, on the grid. A part that is convex
    becomes one solid; CoACD decomposes the others.

    Args:
        path: The file, for errors.
        vertices: Vertices in the frame of the map [m].
        faces: Triangles, counterclockwise seen from outside.
        columns: The columns of the mesh on the samples of `grid`.
        grid: Grid of the map.
        threshold: Difference between neighboring samples above which there is a wall [m].

    Raises:
        HeightFileError: if no body is closed, or one cannot be decomposed.
    """
    import manifold3d

    if np.isnan(columns.ceiling).all():
        return Solids.empty()
    bodies = list(_closed_bodies(vertices, faces))
    if not bodies:
        raise HeightFileError(f"{path}: solids: got a mesh without closed bodies that overhang")
    whole = manifold3d.Manifold.batch_boolean(bodies, manifold3d.OpType.Add)
    parts = whole ^ _upper_space(columns, grid, threshold, vertices[:, 2].max())
    # CoACD is exact only without the slivers that the cut leaves. As an original, coplanar faces of
    # different bodies merge.
    parts = parts.as_original().simplify(_TOLERANCE).decompose()
    hulls: list[NDArray[np.float64]] = []
    for part in parts:
        if part.volume() < MIN_VOLUME:
            continue
        hull = part.hull()
        is_convex = part.volume() > _CONVEX * hull.volume() and hull.num_vert() <= MAX_HULL_VERTICES
        hulls += [_points(hull)] if is_convex else _decompose(path, part)
    return make_hulls(hulls)


def _closed_bodies(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Iterator[Any]:
    """Yield the closed connected parts of a mesh as manifolds, with faces that point outward."""
    import manifold3d
    import trimesh

    mesh = trimesh.Trimesh(vertices=vertices, faces=faces, process=True)
    for body in mesh.split(only_watertight=True):
        if body.volume < 0:
            body.invert()
        solid = manifold(np.asarray(body.vertices), np.asarray(body.faces))
        if solid.status() == manifold3d.Error.NoError:
            yield solid


def _upper_space(columns: Columns, grid: Grid, threshold: float, max_z: float) -> Any:
    """Return the space above the cut as a manifold; elsewhere the cut is above the mesh."""
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
    surface = np.where(np.isnan(cut), max_z + 1.0, cut).astype(np.float32)
    # A closed mesh extends downward, so the space is built upside down.
    mesh = closed_mesh(merged_mesh(-surface, grid, threshold))
    return manifold(mesh.vertices * np.array([1.0, 1.0, -1.0]), mesh.triangles[:, ::-1])


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
