"""Noise on the ground."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from terrainkit.features.gradient_noise import perlin_noise
from terrainkit.features.value_noise import ValueNoise
from terrainkit.geometry.free_space import CONTACT
from terrainkit.geometry.grid import Grid
from terrainkit.geometry.solid_index import SolidIndex
from terrainkit.terrain import parameter
from terrainkit.terrain.overlay import Overlay
from terrainkit.terrain.parameter import Value
from terrainkit.terrain.patch_geometry import PatchGeometry


@dataclass(frozen=True, kw_only=True)
class Noise(Overlay):
    """Random heights that are added to the ground.

    The ground around the spawn position and below solids that stand on it is unchanged.
    """

    amplitude: float = parameter.height(0.0, 0.05)
    """Largest change of the heights, up and down [m]."""

    pattern: str = parameter.choice("uniform", "perlin")
    """Independent heights at equidistant points, as in `rough`, or hills, as in `perlin`."""

    spacing: float = parameter.scalar(0.2, allow_zero=False)
    """Distance between two random heights or gradients [m]; about the diameter of a hill."""

    platform: float = parameter.scalar(2.0)
    """Side of the unchanged square around the spawn position [m]; at least the spawn disk."""

    def realized(self, grid: Grid) -> dict[str, Value]:
        """Return the realized parameters: whole intervals across the patch."""
        values = super().realized(grid)
        return values | self._uniform().realized(grid) if self.pattern == "uniform" else values

    def apply(self, patch: PatchGeometry, rng: np.random.Generator) -> PatchGeometry:
        """Add the noise, which fades to 0 at the platform over one spacing."""
        if self.pattern == "uniform":
            noise = self._uniform().heights(patch.grid, rng)
        else:
            noise = perlin_noise(patch.grid, self.spacing, rng)
            noise *= self.amplitude / max(float(np.abs(noise).max()), 1e-9)
        noise *= self._weights(patch)
        return replace(patch, heights=(patch.heights + noise).astype(np.float32))

    def _uniform(self) -> ValueNoise:
        return ValueNoise(amplitude=self.amplitude, step=0.0, spacing=self.spacing)

    def _weights(self, patch: PatchGeometry) -> NDArray[np.float64]:
        """Return the factor of the noise at each sample, 0 to 1."""
        grid = patch.grid
        x, y = (np.abs(grid.axis(k) - patch.spawn[k]) for k in (0, 1))
        side = max(self.platform / 2, patch.spawn_radius + 2 * grid.cell)
        fade = (np.maximum.outer(x, y) - side) / max(self.spacing, grid.cell)
        weights = np.asarray(np.clip(fade, 0.0, 1.0), dtype=np.float64)
        if len(patch.solids):
            points = np.stack(np.meshgrid(grid.axis(0), grid.axis(1), indexing="ij"), axis=-1)
            bounds = SolidIndex(patch.solids, radius=grid.cell).intervals(points.reshape(-1, 2))
            bottom, top = np.moveaxis(bounds.reshape(*grid.shape, -1, 2), -1, 0)
            z = patch.heights[..., None]
            weights[((bottom < z + CONTACT) & (top > z - CONTACT)).any(axis=-1)] = 0.0
        return weights
