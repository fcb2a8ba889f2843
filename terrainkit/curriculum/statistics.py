"""Statistics of the patches of a map: visits, success and return."""

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

# A mean over about 1 / (1 - 0.95) = 20 episodes.
DECAY = 0.95
"""Weight of the previous mean when an episode ends."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchStatistics:
    """What the episodes on each patch came to. The shape of all arrays is (rows, cols)."""

    visits: NDArray[np.float64]
    """Number of episodes."""
    success: NDArray[np.float64]
    """Share of the episodes with a progress of 1, as a running mean; NaN before the first."""
    returns: NDArray[np.float64]
    """Sum of the rewards of an episode, as a running mean; NaN before the first."""

    @classmethod
    def empty(cls, rows: int, cols: int) -> Self:
        """Return the statistics of a map without episodes."""
        blank = {field.name: np.full((rows, cols), np.nan) for field in fields(cls)}
        return cls(**(blank | {"visits": np.zeros((rows, cols))}))

    def record(
        self, patches: NDArray[np.int64], progress: NDArray[np.float64], returns: Any = None
    ) -> None:
        """Add episodes.

        Args:
            patches: Patch of each episode, row times columns plus column, shape (k,).
            progress: Progress of each episode, 0 to 1, shape (k,). NaN counts as a visit only.
            returns: Sum of the rewards of each episode, shape (k,); None if unknown.
        """
        self.visits[:] += np.bincount(patches, minlength=self.visits.size).reshape(
            self.visits.shape
        )
        known = ~np.isnan(progress)
        add_to_means(self.success, patches[known], progress[known] >= 1, DECAY)
        if returns is not None:
            add_to_means(self.returns, patches, returns, DECAY)


def add_to_means(
    means: NDArray[np.float64], patches: NDArray[np.int64], values: Any, decay: float
) -> None:
    """Add values to running means, in place; where a mean is NaN, they are the first.

    Args:
        means: Running mean of each patch, shape (rows, cols).
        patches: Patch of each value, row times columns plus column, shape (k,).
        values: Values, shape (k,). Values of the same patch are averaged first.
        decay: Weight of the previous mean for each value.
    """
    count = np.bincount(patches, minlength=means.size).reshape(means.shape)
    total = np.bincount(patches, values, minlength=means.size).reshape(means.shape)
    weight = np.where(np.isnan(means), 0, decay**count)
    seen = count > 0
    means[seen] = (weight * np.nan_to_num(means) + (1 - weight) * total / np.maximum(count, 1))[
        seen
    ]
