"""The triangle mesh of solids."""

import itertools
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ExportError
from terrainkit.geometry.mesh.row_buffer import RowBuffer
from terrainkit.geometry.mesh.tri_mesh import TriMesh
from terrainkit.geometry.solids import Solids, convex_hull, rotation_matrices

Surface = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Vertices and faces in double precision, shapes (nv, 3) and (nf, 3)."""

MAX_CHORD_ERROR = 5e-4
"""Largest distance between a cylinder and its mesh, half of it inside and half outside [m]."""

_BOXES_PER_BLOCK = 1 << 14

_BOX = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
_BOX_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5],
        [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
        [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


def solid_meshes(solids: Solids) -> Iterator[TriMesh]:
    """Yield the mesh of each solid, closed, in the order of the solids."""
    return itertools.starmap(_mesh, solid_surfaces(solids, MAX_CHORD_ERROR))


def solid_surfaces(solids: Solids, chord_error: float) -> Iterator[Surface]:
    """Yield vertices and faces of each solid in double precision, in the order of the solids.

    Args:
        solids: The solids.
        chord_error: Largest distance between a cylinder and its faces, half of it inside [m].
    """
    for start in range(0, len(solids.boxes), _BOXES_PER_BLOCK):
        boxes = solids.boxes[start : start + _BOXES_PER_BLOCK]
        for vertices in _transform(_BOX * boxes[:, None, 3:6], boxes):
            yield vertices, _BOX_FACES
    for cylinder in solids.cylinders:
        vertices, faces = _cylinder(float(cylinder[3]), float(cylinder[5]), chord_error)
        yield _transform(vertices[None], cylinder[None])[0], faces
    yield from map(_hull, solids.hulls())


def concatenate_meshes(meshes: Iterable[TriMesh]) -> TriMesh:
    """Return one mesh with the faces of all `meshes`."""
    vertices, triangles = RowBuffer(np.float32), RowBuffer(np.int32)
    for mesh in meshes:
        triangles.append(mesh.triangles, offset=len(vertices))
        vertices.append(mesh.vertices)
    return TriMesh(vertices=vertices.array(), triangles=triangles.array())


def union(meshes: list[TriMesh]) -> TriMesh:
    """Return the union of closed meshes as one watertight mesh, computed by manifold3d.

    Args:
        meshes: Closed meshes, at least one.

    Raises:
        ExportError: if the union fails.
    """
    if len(meshes) == 1:
        return meshes[0]
    import manifold3d

    parts = [manifold(mesh.vertices, mesh.triangles) for mesh in meshes]
    whole = manifold3d.Manifold.batch_boolean(parts, manifold3d.OpType.Add)
    if whole.status() != manifold3d.Error.NoError:
        raise ExportError(f"union of ground and solids: manifold3d reports {whole.status().name}")
    result = whole.to_mesh64()
    return _mesh(result.vert_properties[:, :3], result.tri_verts)


def manifold(vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> Any:
    """Return a closed mesh as a `manifold3d.Manifold`.

    Args:
        vertices: Vertices [m], shape (nv, 3).
        faces: Triangles, shape (nf, 3).
    """
    import manifold3d

    return manifold3d.Manifold(manifold3d.Mesh64(vertices.astype(float), faces.astype(np.uint64)))


def _transform(vertices: NDArray[np.float64], shapes: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return `vertices`, shape (n, k, 3), in the frames of `shapes`, in the frame of the map."""
    turned = np.einsum("nij,nkj->nki", rotation_matrices(shapes[:, 6:]), vertices)
    return np.asarray(turned + shapes[:, None, :3])


def _mesh(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> TriMesh:
    return TriMesh(vertices=vertices.astype(np.float32), triangles=faces.astype(np.int32))


def _cylinder(radius: float, half_length: float, chord_error: float) -> Surface:
    """Return the vertices and faces of a prism that approximates an upright cylinder."""
    # The sides of a regular polygon are radius (1 - cos(pi / n)) inside of its circle.
    n = max(8, int(np.ceil(np.pi / np.arccos(max(0.0, 1 - chord_error / radius)))))
    angle = np.arange(n) * (2 * np.pi / n)
    # The mean of corners and sides is on the circle: half of the error is outside, half inside.
    around = radius * 2 / (1 + np.cos(np.pi / n))
    circle = around * np.column_stack([np.cos(angle), np.sin(angle)])
    ends = [np.column_stack([circle, np.full(n, z)]) for z in (-half_length, half_length)]
    centers = np.array([[0, 0, -half_length], [0, 0, half_length]])
    a, b = np.arange(n), (np.arange(n) + 1) % n
    bottom, top = np.full(n, 2 * n), np.full(n, 2 * n + 1)
    faces = [[a, b, b + n], [a, b + n, a + n], [b, a, bottom], [a + n, b + n, top]]
    return np.concatenate([*ends, centers]), np.concatenate([np.column_stack(f) for f in faces])


def _hull(vertices: NDArray[np.float32]) -> Surface:
    hull = convex_hull(vertices)
    faces = hull.simplices
    corners = vertices[faces].astype(float)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # Qhull's normals point outward, but its triangles have any orientation.
    inward = (normal * hull.equations[:, :3]).sum(axis=1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return vertices.astype(float), faces
