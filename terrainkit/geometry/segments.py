"""Indices of consecutive segments of different lengths."""

import numpy as np
from numpy.typing import NDArray


def segment_indices(lengths: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return segment and index within the segment of the items of consecutive segments."""
    owner = np.repeat(np.arange(len(lengths)), lengths)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
