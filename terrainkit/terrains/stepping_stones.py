"""Stepping stones over deep holes."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.grid import Grid
from terrainkit.terrain import Terrain, parameter


@dataclass(frozen=True, kw_only=True)
class SteppingStones(Terrain):
    """Square stones in rows along y with random offsets, around a flat platform.

    Stones are truncated at the edge of the patch. The offsets are such that the holes have the same
    share of the area as on an endless field of these stones, within half a stone, so that smaller
    stones are never easier. In mode curriculum, the rows of a column have the same random numbers.
    """

    has_column_seed: ClassVar[bool] = True

    # legged_gym: stones of 1.5 (1.05 - d), holes 10 m deep, a platform of 4 m.
    stone: float = parameter.length(1.575, 0.075)
    """Side of a stone [m]."""

    distance: float = parameter.length(0.1)
    """Gap between neighboring stones [m]."""

    variation: float = parameter.height(0.0)
    """Maximum height of a stone above or below 0 [m]."""

    depth: float = parameter.height(10.0)
    """Depth of the holes [m]."""

    platform: float = parameter.platform(4.0)
    """Side of the flat square at the center [m]."""

    def heights(self, grid: Grid, rng: np.random.Generator) -> NDArray[np.floating]:
        """Return the stones; rows are `stone` wide along x, with gaps of `distance`."""
        # A stone or gap that covers the patch may as well be the size of the patch.
        longest = max(grid.shape)
        stone, distance = (min(grid.cells(v), longest) for v in (self.stone, self.distance))
        pitch, (nx, ny) = stone + distance, grid.shape
        samples = rng.random(nx)
        tops = (2 * rng.random(grid.shape) - 1) * self.variation
        # In each row along x, the platform covers the cells in `across`.
        along, across = grid.centered_slices(grid.centered(self.platform))
        is_covered = np.zeros(nx, dtype=bool)
        is_covered[along] = True
        num_covered = across.stop - across.start
        free = nx * ny - int(is_covered.sum()) * num_covered
        gaps_x = _gaps(nx, stone, pitch)
        area = gaps_x @ (ny - num_covered * is_covered)
        start = int(np.argmin(np.abs(area - free * distance / pitch)))
        stone_row, phase_x = np.divmod(np.arange(nx) + start, pitch)
        # The area of the holes along y in each row of stones, for each offset of its stones.
        counts = [
            np.bincount(stone_row, weights=mask, minlength=stone_row[-1] + 1)
            for mask in (phase_x < stone, (phase_x < stone) & is_covered)
        ]
        gaps_y = _gaps(ny, stone, pitch)
        covered_gaps = gaps_y[:, across].sum(axis=1)
        areas = np.outer(counts[0], gaps_y.sum(axis=1)) - np.outer(counts[1], covered_gaps)
        sizes = counts[0] * ny - counts[1] * num_covered
        missing = free * (1 - (stone / pitch) ** 2) - area[start]
        shifts = _offsets(areas, missing * sizes / max(1, sizes.sum()), samples)
        # Each row of stones has its own offset along y.
        stone_column, phase_y = np.divmod(np.arange(ny) + shifts[stone_row, None], pitch)
        top = tops[stone_row[:, None] % nx, stone_column % ny]
        is_stone = (phase_x[:, None] < stone) & (phase_y < stone)
        ground = np.where(is_stone, top, -self.depth)
        ground[along, across] = 0.0
        return ground


def _gaps(number: int, stone: int, pitch: int) -> NDArray[np.bool_]:
    """Return whether each of `number` cells is in a gap, for each offset, (pitch, number)."""
    return (np.arange(number) + np.arange(pitch)[:, None]) % pitch >= stone


def _offsets(
    areas: NDArray[np.float64], expected: NDArray[np.float64], samples: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Return a random offset for each row of stones, such that the areas of their holes add up.

    Otherwise, holes beyond the patch and below the platform would decide whether a patch with
    smaller stones is harder.

    Args:
        areas: Area of the holes of each row for each offset [cells], shape (rows, pitch).
        expected: Area of the holes of each row on an endless field [cells], shape (rows,).
        samples: Random numbers from 0 to 1.
    """
    shifts = []
    missing = 0.0
    # Lists, since a row has few offsets.
    for k, (area, share) in enumerate(zip(areas.tolist(), expected.tolist(), strict=True)):
        missing += share
        error = [abs(value - missing) for value in area]
        limit = min(error) + 1e-9
        nearest = [offset for offset, value in enumerate(error) if value <= limit]
        shifts.append(nearest[int(samples[k % len(samples)] * len(nearest))])
        missing -= area[shifts[k]]
    return np.array(shifts)
