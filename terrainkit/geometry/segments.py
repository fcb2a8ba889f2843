"""Indices of consecutive segments of different lengths."""

import numpy as np
from numpy.typing import NDArray


def segment_indices(lengths: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the owners of the items of consecutive segments.

    Args:
        lengths: Number of items of each segment, shape (n,).

    Returns:
        Segment of each item, and index of the item within its segment, each of shape
        (sum of lengths,).
    """
    owner = np.repeat(np.arange(len(lengths)), lengths)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
