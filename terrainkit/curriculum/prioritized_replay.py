"""Prioritized replay of patches whose outcome is hard to predict."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.curriculum.sampler import FloatArray, IntArray
from terrainkit.curriculum.statistics import add_to_means
from terrainkit.curriculum.uniform import UniformSampler

DECAY = 0.8
"""Weight of the previous means when an episode ends."""

# Chosen, with `DECAY`, on the simulated learners of benchmarks/run.py curriculum.
TEMPERATURE = 0.5
"""Exponent: the weight of a patch is (1 / rank)^(1 / temperature)."""

STALENESS = 0.1
"""Share of the patches that are sampled in proportion to the time since their last episode."""


class PrioritizedReplaySampler(UniformSampler):
    """Sample patches by the rank of their score and by the time since their last episode.

    The method is from M. Jiang et al., Prioritized Level Replay, 2021 (arXiv:2010.03934). Patches
    without an episode are sampled uniformly; their total probability is their share of the map. The
    other patches are sampled with a probability proportional to (1 - s) P_score + s P_staleness,
    where P_score is proportional to (1 / rank)^(1 / temperature). The paper scores a level by the
    magnitude of the error of the value function. This sampler has no value function, and uses the
    error of the running mean of the success on the patch, |success - mean|, which is 0 on patches
    that always or never succeed.
    """

    def __init__(self, rows: int, cols: int, num_envs: int, **options: Any) -> None:
        """Assign the first patches; see `PatchSampler`."""
        super().__init__(rows, cols, num_envs, **options)
        self.value = np.full((rows, cols), 0.5)
        self.score = np.full((rows, cols), np.nan)
        self.last_visit = np.zeros((rows, cols))  # update of the last episode

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that change, by name."""
        own = {"value": self.value, "score": self.score, "last_visit": self.last_visit}
        return {**super().arrays(), **own}

    def record(self, patches: IntArray, success: FloatArray) -> None:
        """Update the scores with the success of episodes.

        Args:
            patches: Patch of each episode, row times columns plus column, shape (k,).
            success: 1 for a success, otherwise 0, shape (k,).
        """
        error = np.abs(success - self.value.ravel()[patches])
        add_to_means(self.score, patches, error, DECAY)
        add_to_means(self.value, patches, success, DECAY)
        self.last_visit.ravel()[patches] = self._updates

    def probs(self) -> FloatArray:
        """Return the probability of each patch.

        Returns:
            Probabilities with a sum of 1, shape (rows, cols).
        """
        seen = ~np.isnan(self.score)
        probs: FloatArray = (~seen) / seen.size
        score = self.score[seen]
        order = np.sort(-self.score[seen])
        # Patches with the same score share their mean rank.
        first, last = (np.searchsorted(order, -score, side) for side in ("left", "right"))
        weight = ((1 + first + last) / 2) ** (-1 / TEMPERATURE)
        age = self._updates - self.last_visit[seen] + 1
        probs[seen] = seen.mean() * (
            (1 - STALENESS) * weight / weight.sum() + STALENESS * age / age.sum()
        )
        return probs
