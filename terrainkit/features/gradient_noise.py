"""Gradient noise: smooth random heights with a wavelength, and sums of it."""

import math

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.grid import Grid

_DIAGONAL = math.sqrt(0.5)
# Eight directions of equal length suffice in the plane, as in "Improving Noise", which uses the
# edges of a cube in space.
_GRADIENTS = np.array(
    [
        [1.0, 0.0],
        [0.0, 1.0],
        [-1.0, 0.0],
        [0.0, -1.0],
        [_DIAGONAL, _DIAGONAL],
        [-_DIAGONAL, _DIAGONAL],
        [-_DIAGONAL, -_DIAGONAL],
        [_DIAGONAL, -_DIAGONAL],
    ]
)


def perlin_noise(grid: Grid, wavelength: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return Perlin's gradient noise, between -1 and 1, shape `grid.shape`.

    A gradient is sampled at each node of a square lattice. The heights in between are interpolated
    with the polynomial 6 t^5 - 15 t^4 + 10 t^3 (Perlin, "Improving Noise", 2002).

    Args:
        grid: Grid of the patch.
        wavelength: Distance between two nodes [m], at least a cell.
        rng: Generator of the random numbers.
    """
    wavelength = max(wavelength, grid.cell)
    # Noise is 0 at its nodes. A random offset keeps them from being at the same place in all
    # patches.
    offset = rng.random(2)
    x, y = (
        (np.arange(n) + 0.5) * (grid.cell / wavelength) + start
        for n, start in zip(grid.shape, offset, strict=True)
    )
    i, j = x.astype(np.int64), y.astype(np.int64)
    gradient = _GRADIENTS[rng.integers(len(_GRADIENTS), size=(i[-1] + 2, j[-1] + 2))]
    tx, ty = (x - i)[:, None], (y - j)[None, :]

    def dot(dx: int, dy: int) -> NDArray[np.float64]:
        slope = gradient[np.ix_(i + dx, j + dy)]
        return np.asarray(slope[..., 0] * (tx - dx) + slope[..., 1] * (ty - dy))

    wx, wy = (t * t * t * (t * (6 * t - 15) + 10) for t in (tx, ty))
    low = dot(0, 0) + wx * (dot(1, 0) - dot(0, 0))
    high = dot(0, 1) + wx * (dot(1, 1) - dot(0, 1))
    return np.asarray(low + wy * (high - low))


def fractal_noise(
    grid: Grid, wavelength: float, octaves: int, rng: np.random.Generator, *, gain: float = 0.5
) -> NDArray[np.float64]:
    """Return a sum of gradient noises, each with half the wavelength of the previous one.

    Args:
        grid: Grid of the patch.
        wavelength: Wavelength of the first octave [m]. Octaves with a wavelength below two cells
            are left out.
        octaves: Number of octaves.
        rng: Generator of the random numbers.
        gain: Ratio of the amplitudes of an octave and the previous octave.
    """
    total = perlin_noise(grid, wavelength, rng)
    for k in range(1, octaves):
        # Shorter waves than two cells cannot be sampled.
        if wavelength * 0.5**k < 2 * grid.cell:
            break
        total += gain**k * perlin_noise(grid, wavelength * 0.5**k, rng)
    return total


def unit_heights(
    grid: Grid, heights: NDArray[np.float64], platform: float, blend: float
) -> NDArray[np.float64]:
    """Return `fade_heights` with the largest absolute value scaled to 1."""
    faded = fade_heights(grid, heights, platform, blend)
    return np.asarray(faded / max(np.abs(faded).max(), 1e-12))


def fade_heights(
    grid: Grid, heights: NDArray[np.float64], platform: float, blend: float
) -> NDArray[np.float64]:
    """Return heights faded to 0 at the platform and at the outermost cells.

    Args:
        grid: Grid of the patch.
        heights: Heights, shape `grid.shape`.
        platform: Side of the flat square at the center [m].
        blend: Distance over which the heights fade [m].
    """
    x, y = (np.minimum(np.arange(n), np.arange(n)[::-1]) for n in grid.shape)
    from_edge = np.minimum.outer(x, y) * (grid.cell / max(blend, grid.cell))
    edge_weights = np.minimum(from_edge, 1.0)
    return np.asarray(heights * edge_weights * grid.fade(grid.centered(platform), blend))
