"""Sampling in proportion to the learning progress on each patch."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.curriculum.sampler import FloatArray, IntArray
from terrainkit.curriculum.statistics import add_to_means
from terrainkit.curriculum.uniform import UniformSampler

# Chosen on the simulated learners with independent columns of benchmarks/run.py curriculum.
FAST_DECAY, SLOW_DECAY = 0.5, 0.8
"""Weights of the previous means when an episode ends."""

EXPLORATION = 0.2
"""Share of the patches that are sampled uniformly, as in ALP-GMM."""


class LearningProgressSampler(UniformSampler):
    """Sample patches on which the rate of success changes, up or down.

    The learning progress of a patch is the absolute difference of a fast and a slow running mean of
    success. It is 0 on patches that always or never succeed. Half of it is assigned to the adjacent
    levels, where the next progress is likely. The method is from I. Kanitscheider et al.,
    Multi-task curriculum learning in a complex, visual, hard-exploration domain: Minecraft, 2021
    (arXiv:2106.14876). The absolute value and the share of uniform samples are from R. Portelas et
    al., Teacher algorithms for curriculum learning of Deep RL in continuously parameterized
    environments, 2019 (arXiv:1910.07224).
    """

    def __init__(self, rows: int, cols: int, num_envs: int, **options: Any) -> None:
        """Assign the first patches; see `PatchSampler`."""
        super().__init__(rows, cols, num_envs, **options)
        self.fast, self.slow = np.zeros((2, rows, cols))

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that change, by name."""
        return {**super().arrays(), "fast": self.fast, "slow": self.slow}

    def record(self, patches: IntArray, success: FloatArray) -> None:
        """Add the success of episodes to both means.

        Args:
            patches: Patch of each episode, row times columns plus column, shape (k,).
            success: 1 for a success, otherwise 0, shape (k,).
        """
        for means, decay in ((self.fast, FAST_DECAY), (self.slow, SLOW_DECAY)):
            add_to_means(means, patches, success, decay)

    def probs(self) -> FloatArray:
        """Return the probability of each patch.

        Returns:
            Probabilities with a sum of 1, shape (rows, cols).
        """
        change, uniform = np.abs(self.fast - self.slow), super().probs()
        if not change.any():
            return uniform
        # At both ends of a column, the missing neighbor's share goes to the patch itself.
        padded = np.pad(change, ((1, 1), (0, 0)), mode="edge")
        change = change / 2 + (padded[:-2] + padded[2:]) / 4
        return np.asarray(EXPLORATION * uniform + (1 - EXPLORATION) * change / change.sum())
