"""Terminations: conditions that end an episode as a fall.

Each takes the environment and returns which robots have fallen, shape (n,).
"""

from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.transforms import BoolArray

if TYPE_CHECKING:
    from terrainkit_robots.rl.env import LeggedEnv


STUCK = 0.2
"""Progress as a fraction of the command below which a robot is stuck."""


def illegal_contact(env: "LeggedEnv") -> BoolArray:
    """Return which robots touch something with a termination body."""
    force = env.sim.sensor("termination_force")
    return (np.einsum("nti,nti->nt", force, force) > env.cfg.termination.contact_force**2).any(1)


def bad_orientation(env: "LeggedEnv") -> BoolArray:
    """Return which robots are tilted beyond the limit."""
    # The z component of gravity in the base frame is minus the cosine of the tilt.
    return -env.state.projected_gravity[:, 2] < np.cos(env.cfg.termination.tilt)


def left_terrain(env: "LeggedEnv") -> BoolArray:
    """Return which robots have left the map, or their patch of a stream."""
    xy = env.state.base_pos[:, :2]
    terrain = env.terrain
    return np.asarray(((xy < terrain.lower) | (xy > terrain.upper)).any(axis=1))


def terrain_out_of_bounds(env: "LeggedEnv") -> BoolArray:
    """Return which robots have left the map; to leave a patch of a stream is no fall."""
    return left_terrain(env) & ~np.bool_(env.terrain.ends_at_bounds)


def stuck(env: "LeggedEnv") -> BoolArray:
    """Return which robots make no progress along their linear velocity command.

    The progress is a moving average over `stuck_time`, which is 1 after a reset.
    """
    limit = env.cfg.termination.stuck_time
    if limit is None:
        return np.zeros(env.num_envs, bool)
    progress = env.buffers.setdefault("progress", np.ones(env.num_envs, np.float32))
    commands, velocity = env.state.commands[:, :2], env.state.base_lin_vel[:, :2]
    squares = np.square(commands).sum(axis=1)
    # A robot that is commanded to stand makes all the progress.
    fraction = np.where(
        squares > 0, (commands * velocity).sum(axis=1) / np.maximum(squares, 1e-9), 1
    )
    progress[env.steps_since_reset <= 1] = 1
    progress += np.float32(env.cfg.dt / limit) * (np.clip(fraction, -1, 1) - progress)
    return progress < STUCK


TERMINATIONS = {
    function.__name__: function
    for function in (illegal_contact, bad_orientation, terrain_out_of_bounds, stuck)
}
"""Every termination of this module by name."""
