"""Isometric pictures of patches for the documentation, in the colors of the preview."""

import cv2
import numpy as np
from numpy.typing import NDArray

from terrainkit.grid import Grid
from terrainkit.mesh import full_mesh
from terrainkit.preview import height_colors

PAPER = (250, 249, 246)
MIN_HEIGHT = -1.5
"""Deeper holes are cut off at this height [m]."""

_LIGHT = np.array([-0.35, -0.55, 0.75])
_SUBPIXEL = 4


def isometric(heights: NDArray[np.float32], cell: float, scale: float) -> NDArray[np.uint8]:
    """Return a picture of a patch seen from low x and low y, shape (height, width, 3).

    Faces are painted from back to front at twice the resolution.

    Args:
        heights: Heights of the patch [m].
        cell: Grid spacing [m].
        scale: Pixels per meter.
    """
    grid = Grid(shape=heights.shape, cell=cell)
    mesh = full_mesh(np.maximum(heights, MIN_HEIGHT), grid, threshold=0.75 * cell)
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    shade = 0.45 + 0.6 * np.clip(normal @ (_LIGHT / np.linalg.norm(_LIGHT)), 0, 1)
    color = np.clip(height_colors(corners[..., 2].mean(axis=1)) * shade[:, None], 0, 255)

    across = (corners[..., 0] - corners[..., 1]) * np.cos(np.pi / 6)
    up = (corners[..., 0] + corners[..., 1]) / 2 + corners[..., 2]
    screen = np.stack([across, -up], axis=-1) * 2 * scale
    margin = 12
    low = screen.reshape(-1, 2).min(axis=0) - margin
    size = np.ceil(screen.reshape(-1, 2).max(axis=0) + margin - low).astype(int)
    points = np.rint((screen - low) * 2**_SUBPIXEL).astype(np.int32)
    sheet = np.full((size[1], size[0], 3), PAPER, dtype=np.uint8)
    depth = (corners[..., 0] + corners[..., 1]).mean(axis=1) - 0.01 * corners[..., 2].mean(axis=1)
    for k in np.argsort(-depth):
        cv2.fillConvexPoly(sheet, points[k], color[k].tolist(), cv2.LINE_AA, _SUBPIXEL)
    return cv2.resize(sheet, (size[0] // 2, size[1] // 2), interpolation=cv2.INTER_AREA)


def side_by_side(pictures: list[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Return pictures in a row, aligned at the bottom."""
    height = max(len(picture) for picture in pictures)
    padded = [
        np.pad(p, ((height - len(p), 0), (0, 0), (0, 0)), constant_values=PAPER[0])
        for p in pictures
    ]
    return np.concatenate(padded, axis=1)
