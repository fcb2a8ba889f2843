"""The closed mesh: a surface with sides and a bottom."""

import numpy as np

from terrainkit.geometry.mesh.tri_mesh import TriMesh

THICKNESS = 1.0
"""Thickness of solids below the lowest point of the surface [m]."""


def closed_mesh(surface: TriMesh, thickness: float = THICKNESS) -> TriMesh:
    """Return `surface` with vertical sides and a flat bottom.

    Args:
        surface: A mesh of this package of a rectangular map.
        thickness: Distance of the bottom below the lowest point of the surface [m].

    Returns:
        A mesh in which every edge is shared by two faces, once in each direction.
    """
    vertices, triangles = surface.vertices, surface.triangles
    start, end = surface.boundary().T
    vertical = (vertices[start, :2] == vertices[end, :2]).all(axis=1)
    # Walls that end at the edge of the map have vertical boundary edges. The side face next to the
    # upper end also includes the lower end.
    below = np.arange(len(vertices))
    for a, b in ((start[vertical], end[vertical]), (end[vertical], start[vertical])):
        falls = vertices[a, 2] > vertices[b, 2]
        below[a[falls]] = b[falls]
    start, end = start[~vertical], end[~vertical]

    rim, foot = np.unique(vertices[np.concatenate([start, end]), :2], axis=0, return_inverse=True)
    foot = foot.reshape(-1) + len(vertices)
    start_foot, end_foot = foot[: len(start)], foot[len(start) :]
    middle = np.full(len(start), len(vertices) + len(rim))
    # An edge has a wall at one end at most. The fan starts at the other end, which is a sample.
    bent = below[start] != start
    straight = ~bent
    at_end = straight & (below[end] != end)
    plain_end = np.where(at_end, below[end], end)
    plain_start = np.where(bent, below[start], start)
    sides = [
        np.column_stack([start, plain_start, end])[bent],
        np.column_stack([plain_start, start_foot, end])[bent],
        np.column_stack([end, start_foot, end_foot])[bent],
        np.column_stack([start, plain_end, end])[at_end],
        np.column_stack([start, end_foot, plain_end])[straight],
        np.column_stack([start, start_foot, end_foot])[straight],
        np.column_stack([start_foot, end_foot, middle])[:, ::-1],
    ]
    bottom = float(vertices[:, 2].min()) - thickness
    center = (rim.min(axis=0) + rim.max(axis=0)) / 2
    extra = np.column_stack([np.vstack([rim, center]), np.full(len(rim) + 1, bottom)])
    return TriMesh(
        vertices=np.concatenate([vertices, extra.astype(np.float32)]),
        triangles=np.concatenate([triangles, *sides]).astype(np.int32),
    )
