"""The side of a street: a gutter with a drain, and a curb with curb ramps, poles and trees."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.features.blocks import make_blocks, make_ramps, max_number
from terrainkit.features.frame import frame_rectangles
from terrainkit.features.lane import Lane
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solids import Solids, make_cylinders
from terrainkit.terrain import parameter

BAR = 0.03
"""Width and depth of the bars of a grating [m]; the width is rounded, the slots are exact."""

_SINK = 0.02
"""Depth of the sidewalk below the gutter [m]."""

_DRAIN = 0.3
"""Depth of the drain below the gutter [m]."""

_MARGIN = 0.2
"""Distance of tree grates from the curb, and of curb ramps from the edges of their slots [m]."""

_SLIVER = 1e-3
"""Width of the blocks of the sidewalk that are left out [m]."""

_POLE = (0.08, 3.0)
"""Radius and height of poles [m]."""

_TRUNK = (0.12, 2.5)
"""Radius and height of trunks [m]."""


@dataclass(frozen=True, kw_only=True)
class Curbside(Lane):
    """The parent class of lanes that lead from a road across a curb to a sidewalk."""

    # Second-hand: curbs of 80 to 120 or 100 to 140 mm (RASt 06, Germany) and of 120 to 150 mm (UK,
    # US); ramps of 1:12, and of 1:8 for a rise of 75 mm on existing sites (ADA Standards 2010,
    # 405.2), 0.915 m wide (ADA) or 1.2 m (PROWAG); gutters 25 to 76 mm deep and 0.38 m wide
    # (HEC-22) or more; slots of 13 mm across the direction of travel (ADA 302.3). The hardest
    # ramp, of 1:8 over 0.2 m, and slots of 30 mm are beyond them. ADA has flares of at most 1:10;
    # these are steep, as at returned curbs.
    curb: float = parameter.size(0.08, 0.15)
    """Height of the sidewalk above the road [m]."""

    grade: float = parameter.scalar(0.083, 0.125, allow_zero=False)
    """Rise over run of the curb ramps."""

    ramp_width: float = parameter.size(1.2, 0.915)
    """Width of the curb ramps without their flares [m]."""

    flare: float = parameter.size(0.2)
    """Width of the flared sides of the curb ramps [m]."""

    gutter: float = parameter.height(0.02, 0.05)
    """Depth of the gutter below the road [m]."""

    gutter_width: float = parameter.length(0.3)
    """Width of the gutter [m]."""

    slot: float = parameter.size(0.013, 0.03)
    """Width of the slots of the gratings [m]."""

    tree_grate: float = parameter.size(1.0)
    """Side of the square gratings around trees [m]."""

    trees: float = parameter.scalar(0.5)
    """Probability of a tree instead of a pole."""

    spacing: float = parameter.size(2.0)
    """Smallest distance along the curb between two trees, poles or curb ramps [m]."""

    def curb_cell(self, grid: Grid) -> int:
        """Return the first cell along x of the sidewalk."""
        return grid.cells(self.start) + grid.cells(self.gutter_width)

    def slot_edges(self, grid: Grid) -> NDArray[np.float64]:
        """Return the edges along y of the slots of trees, poles and curb ramps [m].

        Raises:
            ConfigError: if there is no slot, or a curb ramp or tree grate does not fit in a slot.
        """
        number = max_number(self.kind(), self.spacing, grid.size[1])
        widest = max(self.ramp_width + 2 * self.flare, self.tree_grate) + _MARGIN
        if number < 1 or widest > self.spacing:
            raise ConfigError(
                f"{self._got('spacing')}; expected at least {widest:g} m, for the curb ramps and "
                f"tree grates, and at most the width of the patch, {grid.size[1]:g} m"
            )
        return np.linspace(grid.lower[1], grid.upper[1], number + 1)

    @property
    def strip(self) -> float:
        """Length along x of the part of the sidewalk with the curb ramps, trees and poles [m]."""
        return max((self.curb + self.gutter) / self.grade, self.tree_grate + 2 * _MARGIN)

    def curb_ground(self, grid: Grid, end: int) -> NDArray[np.floating]:
        """Return 0, the drain, and the gutter, which continues below the sidewalk to cell `end`."""
        ground = np.zeros(grid.shape)
        ground[grid.cells(self.start) : end, 1:-1] = -self.gutter
        ground[grid.cells(self.start) : self.curb_cell(grid), 1:-1] -= _DRAIN
        return ground

    def drain(self, grid: Grid) -> Solids:
        """Return the grating of the drain, which is the bottom of the gutter."""
        first, last = grid.cells(self.start), self.curb_cell(grid)
        lower = (grid.lower[0] + grid.length(first), grid.lower[1] + grid.cell)
        upper = (grid.lower[0] + grid.length(last), grid.upper[1] - grid.cell)
        return self._grating(lower, upper, -self.gutter)

    def curb_strip(self, grid: Grid, rng: np.random.Generator) -> Solids:
        """Return the strip at the curb with a curb ramp, and a tree or a pole in each other slot.

        It begins with the curb at x = 0.

        Args:
            grid: Grid of the patch.
            rng: Generator of the random numbers.

        Raises:
            ConfigError: if they do not fit.
        """
        edges, length = self.slot_edges(grid), self.strip
        ramp = rng.integers(len(edges) - 1)
        is_tree = rng.random(len(edges) - 1) < self.trees
        parts, blocks = [], []
        for k, (y0, y1) in enumerate(itertools.pairwise(edges)):
            y = (y0 + y1) / 2
            if k == ramp:
                inner = self.ramp_width / 2
                outer, run = inner + self.flare, (self.curb + self.gutter) / self.grade
                blocks += [(0.0, y0, length, y - outer), (0.0, y + outer, length, y1)]
                blocks.append((run, y - outer, length, y + outer))
                parts.append(self._curb_ramp(y, inner, outer, run))
            elif is_tree[k]:
                half, x = self.tree_grate / 2, _MARGIN + self.tree_grate / 2
                center, size = frame_rectangles((x, y), 2 * [2 * half], (2 * x, y1 - y0))
                blocks += np.hstack([center - size / 2, center + size / 2]).tolist()
                blocks.append((2 * x, y0, length, y1))
                parts.append(self._grating((x - half, y - half), (x + half, y + half), self.curb))
                parts.append(self._post(x, y, *_TRUNK))
            else:
                blocks.append((0.0, y0, length, y1))
                parts.append(self._post(_MARGIN + _POLE[0], y, *_POLE))
        return Solids.concatenate([self.pavement(blocks), *parts])

    def pavement(self, rectangles: Sequence[tuple[float, ...]]) -> Solids:
        """Return blocks of the sidewalk; rectangles are x and y of two opposite corners [m]."""
        corners = np.array(rectangles).reshape(-1, 2, 2)
        corners = corners[(np.diff(corners, axis=1) > _SLIVER).all(axis=(1, 2))]
        z = np.broadcast_to([[-self.gutter - _SINK], [self.curb]], (len(corners), 2, 1))
        return make_blocks(*np.concatenate([corners, z], axis=2).transpose(1, 0, 2))

    def _curb_ramp(self, y: float, inner: float, outer: float, run: float) -> Solids:
        """Return a ramp from the gutter to the sidewalk with flares, around `y` [m]."""
        across = y + np.array([-outer, -inner, inner, outer])
        low, top = -self.gutter, self.curb
        return make_ramps(
            [(0.0, y) for y in across[:-1]],
            [(run, y) for y in across[1:]],
            [(top, top, top, low), (low, top, top, low), (low, top, top, top)],
            floor=low,
        )

    def _post(self, x: float, y: float, radius: float, height: float) -> Solids:
        """Return an upright cylinder on the ground below the sidewalk."""
        low, high = -self.gutter - _SINK, self.curb + height
        return make_cylinders([(x, y, (low + high) / 2)], radius, high - low)

    def _grating(self, lower: tuple[float, ...], upper: tuple[float, ...], top: float) -> Solids:
        """Return bars along y between two corners, with slots between them and at both ends."""
        length = upper[0] - lower[0]
        number = max(1, round((length - self.slot) / (self.slot + BAR)))
        width = (length - self.slot) / number - self.slot
        if width < BAR / 2:
            raise ConfigError(
                f"{self.kind()}: got slots of {self.slot:g} m in a grating {length:g} m long; "
                f"expected bars at least {BAR / 2:g} m wide between them"
            )
        x = lower[0] + self.slot + np.arange(number) * (self.slot + width)
        ones = np.ones(number)
        return make_blocks(
            np.column_stack([x, lower[1] * ones, (top - BAR) * ones]),
            np.column_stack([x + width, upper[1] * ones, top * ones]),
        )
