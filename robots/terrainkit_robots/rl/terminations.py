"""The terminations: what ends an episode as a fall. Running out of time does not."""

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rl.ground import Ground
from terrainkit_robots.rl.task import Termination

FloatArray = NDArray[np.float32]


def touched(force: FloatArray, settings: Termination) -> NDArray[np.bool_]:
    """Return whose termination bodies touch something, shape (n,).

    Args:
        force: Force on each termination body [N], shape (n, t, 3).
        settings: How hard.
    """
    return (np.einsum("nti,nti->nt", force, force) > settings.contact_force**2).any(axis=1)


def tilted(projected_gravity: FloatArray, settings: Termination) -> NDArray[np.bool_]:
    """Return who is tilted too far, shape (n,); gravity as in the state, shape (n, 3)."""
    return -projected_gravity[:, 2] < np.cos(settings.tilt)


def outside(base_pos: FloatArray, ground: Ground) -> NDArray[np.bool_]:
    """Return who has left the map, shape (n,); positions in the world [m], shape (n, 3)."""
    beyond = (base_pos[:, :2] < ground.lower) | (base_pos[:, :2] > ground.upper)
    return np.asarray(beyond.any(axis=1))
