"""Rooms with doors."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import make_walls, max_number
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids
from terrainkit.terrain import FlatTerrain, Goals, parameter


@dataclass(frozen=True, kw_only=True)
class Rooms(FlatTerrain):
    """Square rooms with a door at a random place in each wall.

    As many rooms as fit are centered in the patch. The robot is spawned in a room near the center,
    and the goals lead through the doors toward high x. The walls are solids; the ground is flat.
    """

    has_column_seed: ClassVar[bool] = True

    # As wide as the corridors of `maze`.
    door: float = parameter.size(1.5, 0.8)
    """Width of a door [m]."""

    side: float = parameter.size(2.3)
    """Side of a room [m]."""

    thickness: float = parameter.size(0.2)
    """Thickness of the walls [m]."""

    height: float = parameter.size(1.0)
    """Height of the walls [m]."""

    def spawn(self, grid: Grid) -> tuple[float, float]:
        """Return the center of the room nearest to the center of the patch."""
        pitch = self.side + self.thickness
        counts = (max(1, n) for n in self._counts(grid))
        x, y = (c + (n % 2 - 1) * pitch / 2 for c, n in zip(grid.center, counts, strict=True))
        return x, y

    def solids(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Solids:
        """Return the walls, two boxes beside each door."""
        parts = []
        size = (self.thickness, self.height)
        for axis, (line, first, door) in enumerate(self._lines(grid, rng)):
            last = first + self.side + 2 * self.thickness
            middle = (line + self.thickness / 2).ravel()
            for start, end in ((first, door), (door + self.door, last)):
                parts.append(make_walls(axis, middle, start.ravel(), end.ravel(), size))
        return Solids.concatenate(parts)

    def goals(self, grid: Grid, heights: NDArray[np.float32], rng: np.random.Generator) -> Goals:
        """Return a goal in each door from the room of the spawn toward high x."""
        (line, _, door), _ = self._lines(grid, rng)
        row = (door.shape[1] - 1) // 2
        x = line[(len(line) - 2) // 2 + 1 :, row] + self.thickness / 2
        y = door[(len(line) - 2) // 2 + 1 :, row] + self.door / 2
        return np.column_stack([x, y, np.full(len(x), np.nan), np.zeros(len(x))])

    def _counts(self, grid: Grid) -> tuple[int, int]:
        """Return the number of rooms along x and y."""
        pitch = self.side + self.thickness
        x, y = (max_number("rooms", pitch, n - self.thickness) for n in grid.size)
        return x, y

    def _lines(
        self, grid: Grid, rng: np.random.Generator
    ) -> list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]]:
        """Return the walls across x and the walls across y.

        Returns:
            For each axis, the lower side of each wall across the axis, its start along the other
            axis, and the start of its door [m], shape (lines, rooms).
        """
        counts, pitch = self._counts(grid), self.side + self.thickness
        if min(counts) < 1 or self.door >= self.side:
            raise ConfigError(
                f"{self._got('door', 'side', 'thickness')}; expected door < side, and a room that "
                f"fits in a patch of {grid.extent}"
            )
        layout = []
        for axis in (0, 1):
            n, m = counts[axis], counts[1 - axis]
            line = grid.center[axis] + (np.arange(n + 1) - n / 2) * pitch - self.thickness / 2
            first = grid.center[1 - axis] + (np.arange(m) - m / 2) * pitch - self.thickness / 2
            both = np.meshgrid(line, first, indexing="ij")
            free = self.side - self.door
            layout.append((*both, both[1] + self.thickness + free * rng.random(both[0].shape)))
        return layout
