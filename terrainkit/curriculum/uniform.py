"""Sampling from probabilities of the patches, which are equal unless a subclass changes them."""

import numpy as np

from terrainkit.curriculum.arrays import make_rng
from terrainkit.curriculum.sampler import FloatArray, IntArray, PatchSampler


class UniformSampler(PatchSampler):
    """Sample every patch with the same probability, as domain randomization does."""

    def probs(self) -> FloatArray:
        """Return the probability of each patch.

        Returns:
            Probabilities with a sum of 1, shape (rows, cols).
        """
        visits = self.statistics.visits
        return np.full(visits.shape, 1 / visits.size)

    def record(self, patches: IntArray, success: FloatArray) -> None:
        """Update what the probabilities depend on.

        Args:
            patches: Patch of each episode, row times columns plus column, shape (k,).
            success: 1 for a success, otherwise 0, shape (k,).
        """

    def next_patches(
        self, levels: IntArray, columns: IntArray, progress: FloatArray, seed: tuple[int, int]
    ) -> tuple[IntArray, IntArray]:
        """Record the episodes and sample; see `PatchSampler.next_patches`."""
        rows, cols = self.statistics.visits.shape
        known = ~np.isnan(progress)
        self.record((levels * cols + columns)[known], (progress[known] >= 1).astype(np.float64))
        probs = self.probs().ravel()
        patches = make_rng(seed).choice(rows * cols, size=len(levels), p=probs)
        return np.divmod(patches, cols)
