"""Heights in 16-bit integers, the format of Isaac Gym and legged_gym."""

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, ExportError


def int16_heights(heights: NDArray[np.floating], vertical_scale: float) -> NDArray[np.int16]:
    """Return heights as 16-bit integers.

    Args:
        heights: Heights [m].
        vertical_scale: Height of one unit [m].

    Returns:
        Heights in units of `vertical_scale`, of the same shape.

    Raises:
        ConfigError: if `vertical_scale` is not above 0.
        ExportError: if a height does not fit in 16 bits.
    """
    if not 0 < vertical_scale < np.inf:
        raise ConfigError(f"vertical_scale: got {vertical_scale:g}; expected a number > 0")
    units = np.rint(heights / vertical_scale)
    limit = np.iinfo(np.int16)
    low, high = float(units.min()), float(units.max())
    if not (limit.min <= low and high <= limit.max):
        # 1 % more, so that the rounded value in the message is sufficient.
        minimum = max(high / limit.max, low / limit.min) * vertical_scale * 1.01
        raise ExportError(
            f"heights from {heights.min():g} to {heights.max():g} m do not fit in "
            f"int16 at vertical_scale {vertical_scale:g}; expected at least {minimum:.3g}"
        )
    return np.asarray(units.astype(np.int16))
