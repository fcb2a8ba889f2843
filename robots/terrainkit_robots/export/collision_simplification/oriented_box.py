"""Compute the smallest enclosing box of points."""

import numpy as np

from terrainkit_robots.transforms import Matrix

_MAX_VOLUME_RATIO = 0.99
"""A rotated box must have less than this share of the volume of the axis-aligned box."""


def oriented_box(points: Matrix) -> tuple[Matrix, Matrix]:
    """Return a small enclosing box of points, axis-aligned unless a rotated box is smaller.

    Args:
        points: Points, which may lie in a plane, shape (n, 3) [m].

    Returns:
        Pose of the box, shape (4, 4) [m], and its half lengths, shape (3,) [m].
    """
    import trimesh

    lower, upper = points.min(axis=0), points.max(axis=0)
    pose, extents = trimesh.transformations.translation_matrix((lower + upper) / 2), upper - lower
    _, spread, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    if spread[1] <= 1e-9 * spread[0]:  # points on a line
        pose[:3, :3] = trimesh.geometry.align_vectors([1, 0, 0], axes[0])[:3, :3]
        return pose, np.array([np.linalg.norm(extents), 0, 0]) / 2
    with np.errstate(divide="ignore", invalid="ignore"):  # flat points have no volume
        to_box, rotated = trimesh.bounds.oriented_bounds(points)
    if _volume(rotated) < _MAX_VOLUME_RATIO * _volume(extents):
        pose, extents = np.linalg.inv(to_box), rotated
    return np.asarray(pose), np.asarray(extents) / 2


def _volume(extents: Matrix) -> float:
    """Return the volume of a box, where a flat box has a thickness, so that areas compare."""
    return float(np.maximum(extents, 1e-6 * extents.max()).prod())
