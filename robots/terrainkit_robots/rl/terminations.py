"""Terminations: conditions that end an episode as a fall.

Each takes the environment and returns which robots have fallen, shape (n,).
"""

from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.transforms import BoolArray

if TYPE_CHECKING:
    from terrainkit_robots.rl.env import LeggedEnv


def illegal_contact(env: "LeggedEnv") -> BoolArray:
    """Return which robots touch something with a termination body."""
    force = env.sim.sensor("termination_force")
    return (np.einsum("nti,nti->nt", force, force) > env.cfg.termination.contact_force**2).any(1)


def bad_orientation(env: "LeggedEnv") -> BoolArray:
    """Return which robots are tilted beyond the limit."""
    # The z component of gravity in the base frame is minus the cosine of the tilt.
    return -env.state.projected_gravity[:, 2] < np.cos(env.cfg.termination.tilt)


def terrain_out_of_bounds(env: "LeggedEnv") -> BoolArray:
    """Return which robots have left the map."""
    xy, terrain = env.state.base_pos[:, :2], env.terrain
    return np.asarray(((xy < terrain.lower) | (xy > terrain.upper)).any(axis=1))


TERMINATIONS = {
    each.__name__: each for each in (illegal_contact, bad_orientation, terrain_out_of_bounds)
}
"""Every termination of this module by name."""
