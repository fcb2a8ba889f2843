"""Terminations: conditions that end an episode as a fall."""

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rl.config import Termination
from terrainkit_robots.rl.terrain import Ground
from terrainkit_robots.transforms import FloatArray


def illegal_contact(force: FloatArray, cfg: Termination) -> NDArray[np.bool_]:
    """Return which robots touch something with a termination body.

    Args:
        force: Contact force on each of the t termination bodies [N], shape (n, t, 3).
        cfg: The limits.
    """
    return (np.einsum("nti,nti->nt", force, force) > cfg.contact_force**2).any(axis=1)


def bad_orientation(projected_gravity: FloatArray, cfg: Termination) -> NDArray[np.bool_]:
    """Return which robots are tilted beyond the limit.

    Args:
        projected_gravity: Unit vector of gravity in the frame of the base, shape (n, 3).
        cfg: The limits.
    """
    # The z component of gravity in the base frame is minus the cosine of the tilt.
    return -projected_gravity[:, 2] < np.cos(cfg.tilt)


def terrain_out_of_bounds(base_pos: FloatArray, terrain: Ground) -> NDArray[np.bool_]:
    """Return which robots have left the map.

    Args:
        base_pos: Positions of the bases [m], shape (n, 3).
        terrain: The ground.
    """
    outside = (base_pos[:, :2] < terrain.lower) | (base_pos[:, :2] > terrain.upper)
    return np.asarray(outside.any(axis=1))
