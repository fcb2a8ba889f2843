"""A task with gait commands, as in Walk These Ways: the policy trots, paces, bounds or pronks.

Install: pip install '.[train]' (in a clone of terrainkit)
Run: terrainkit train --task gait_commands.py
A command has a frequency and the phase of each foot: Margolis and Agrawal, Walk These Ways, 2022.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from terrainkit_robots.rl.commands import CommandTerm
from terrainkit_robots.rl.config import Commands, Rewards, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.events import EventTerm
from terrainkit_robots.rl.observations import ObservationTerm
from terrainkit_robots.rl.tasks import get_task, register_task

GAITS = np.array([[0, 0.5, 0.5, 0], [0, 0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 0]])
"""Phases of the feet FL, FR, RL, RR in a trot, a pace, a bound and a pronk."""


def sample_gaits(rng, count):
    """Return a frequency from 1.5 to 3 Hz and the phases of a gait, shape (count, 5)."""
    gaits = rng.integers(len(GAITS), size=count)
    return np.column_stack([rng.uniform(1.5, 3.0, count), GAITS[gaits]])


def advance(env):
    """Advance the clock of each robot by one step."""
    env.buffers["clock"] += env.active_commands["gait"].values[:, 0] * env.cfg.dt


def foot_phase(env):
    """Return the phase of each foot, 0 to 1: it is on the ground below 0.5."""
    return (env.buffers["clock"][:, None] + env.active_commands["gait"].values[:, 1:]) % 1


def gait_contact(env):
    """Return the share of the feet whose contact agrees with the gait."""
    return (env.state.foot_contact == (foot_phase(env) < 0.5)).mean(axis=1)


class GaitEnv(LeggedEnv):
    """Each robot has a clock, and is rewarded for contacts that agree with its gait."""

    def command_terms(self):
        """Return the velocity and the gait, which changes every 5 s."""
        gait = CommandTerm(sample_gaits, self.num_envs, 5.0, self.cfg.dt)
        self.buffers["clock"] = np.zeros(self.num_envs, np.float32)
        return super().command_terms() | {"gait": gait}

    def observation_terms(self):
        """Add the frequency and a clock for each foot; left and right feet swap in the mirror."""
        frequency = ObservationTerm(lambda env: env.active_commands["gait"].values[:, :1])
        sine = ObservationTerm(lambda env: np.sin(2 * np.pi * foot_phase(env)), "contacts")
        cosine = ObservationTerm(lambda env: np.cos(2 * np.pi * foot_phase(env)), "contacts")
        own = {"frequency": frequency, "sine": sine, "cosine": cosine}
        return {name: terms | own for name, terms in super().observation_terms().items()}

    def reward_terms(self):
        """Add the share of the feet whose contact agrees with the gait."""
        return super().reward_terms() | {"gait_contact": gait_contact}

    def event_terms(self):
        """Add the clocks."""
        return super().event_terms() | {"clock": EventTerm(step=advance)}


@dataclass(frozen=True, kw_only=True)
class GaitRewards(Rewards):
    """The rewards of the default task without its own gait."""

    feet_gait: float = 0.0
    foot_swing_height: float = 0.0
    gait_contact: float = 1.0
    """Feet whose contact agrees with the commanded gait."""


@dataclass(frozen=True, kw_only=True)
class GaitTask(Task):
    """Velocity and gait commands for the bundled quadruped."""

    env_class: ClassVar = GaitEnv
    rewards: GaitRewards = field(default_factory=GaitRewards)
    commands: Commands = field(default_factory=lambda: Commands(gait_period=0.0))


register_task("quadruped_gaits", get_task("quadruped").folder, GaitTask())
