"""The mean level of robots that follow their commands exactly, by the rules of two curricula.

No ground stops these robots: what keeps them from the last level is the rule alone. The rule of
legged_gym, Isaac Lab and mjlab moves a robot up if it is more than half of a patch from its origin
when the episode ends, and down if it is nearer than half of the way on which its last command would
lead in a whole episode. A robot that moves up from the last level starts on a random one. The other
rule is `LevelSampler` with `CommandProgress`.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from terrainkit.curriculum import CommandProgress, LevelSampler

ROWS, NUM_ENVS, NUM_EPISODES, LAST_EPISODES = 10, 250, 80, 30
"""Levels, robots of each task, episodes, and those at the end that count."""
PATCH_LENGTH = 8.0  # [m]
EPISODE_LENGTH, DT = 20.0, 0.25
"""Length of an episode and of a step [s]."""

FloatArray = NDArray[np.float64]
UNIT = (-1.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class Commands:
    """The velocity commands of a task: ranges [m/s, rad/s], and shares of the robots."""

    forward: tuple[float, float] = UNIT
    left: tuple[float, float] = UNIT
    yaw_rate: tuple[float, float] = UNIT
    interval: tuple[float, float] = (10.0, 10.0)
    """Range of the time between two commands [s]."""
    headings: float = 0.0
    """Share with a commanded heading, which gives the yaw rate; the others keep turning."""
    standing: float = 0.0
    straight: float = 0.0
    """Share that only walks ahead."""
    smallest: float = 0.0
    """Speed up to which a command is replaced by 0 [m/s]."""


SMALL = (-0.1, 0.1)
GO2 = Commands(left=(-0.4, 0.4), standing=0.1)
TASKS = {
    "legged_gym": Commands(headings=1.0, smallest=0.2),
    "isaaclab": Commands(headings=1.0, standing=0.02),
    "isaaclab_without_headings": Commands(standing=0.02),
    "mjlab": Commands(
        yaw_rate=(-0.5, 0.5), interval=(3.0, 8.0), headings=0.3, standing=0.1, straight=0.2
    ),
    "unitree_rl_lab_go2_at_the_start": replace(GO2, forward=SMALL, left=SMALL),
    "unitree_rl_lab_go2": GO2,
    "unitree_rl_lab_go2_at_nine_tenths": replace(GO2, forward=(-0.9, 0.9), left=(-0.36, 0.36)),
    "unitree_rl_lab_go2_with_headings": replace(GO2, headings=1.0),
}


class Robots:
    """Robots of all tasks that follow their commands exactly, from near their origin."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng, self._num = rng, NUM_ENVS * len(TASKS)
        self._cfg = {
            field.name: np.repeat([vars(task)[field.name] for task in TASKS.values()], NUM_ENVS, 0)
            for field in fields(Commands)
        }
        self.position = rng.uniform(-0.5, 0.5, (self._num, 2))
        self.yaw = rng.uniform(-np.pi, np.pi, self._num)
        self.command = np.zeros((self._num, 3))
        self._heading = np.zeros(self._num)
        self._has_heading = np.zeros(self._num, dtype=bool)
        self._time_left = np.zeros(self._num)

    def step(self) -> None:
        """Sample the commands that are due, and walk."""
        self.sample_commands()
        error = (self._heading - self.yaw + np.pi) % (2 * np.pi) - np.pi
        turn = np.clip(0.5 * error, *self._cfg["yaw_rate"].T)
        self.command[:, 2] = np.where(self._has_heading, turn, self.command[:, 2])
        forward, left, yaw_rate = self.command.T
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        velocity = np.stack([cos * forward - sin * left, sin * forward + cos * left], axis=1)
        self.position += DT * velocity
        self.yaw += DT * yaw_rate
        self._time_left -= DT

    def sample_commands(self) -> None:
        """Sample the commands that are due."""
        due = np.flatnonzero(self._time_left < DT / 2)
        cfg = {name: values[due] for name, values in self._cfg.items()}
        ranges = (cfg["forward"], cfg["left"], cfg["yaw_rate"])
        command = np.stack([self._rng.uniform(*limits.T) for limits in ranges], axis=1)
        chance = self._rng.random((3, len(due)))
        straight, standing, heading = chance < [cfg["straight"], cfg["standing"], cfg["headings"]]
        command[straight] = np.abs(command[straight]) * [1, 0, 0]
        command[np.linalg.norm(command[:, :2], axis=1) <= cfg["smallest"], :2] = 0
        command[standing] = 0
        self.command[due] = command
        self._has_heading[due] = heading & ~straight & ~standing
        self._heading[due] = self._rng.uniform(-np.pi, np.pi, len(due))
        self._time_left[due] = self._rng.uniform(*cfg["interval"].T)


def stock_levels(
    levels: NDArray[np.int64], robots: Robots, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Return the levels after an episode by the rule of legged_gym, Isaac Lab and mjlab."""
    distance = np.linalg.norm(robots.position, axis=1)
    up = distance > PATCH_LENGTH / 2
    needed = 0.5 * np.linalg.norm(robots.command[:, :2], axis=1) * EPISODE_LENGTH
    after = levels + up - (~up & (distance < needed))
    return np.where(after >= ROWS, rng.integers(ROWS, size=len(levels)), np.maximum(after, 0))


def mean_levels() -> FloatArray:
    """Return the mean level by the stock rule and by `LevelSampler`, shape (2, tasks)."""
    rng, ids = np.random.default_rng(0), np.arange(NUM_ENVS * len(TASKS))
    sampler = LevelSampler(ROWS, len(TASKS), len(ids), max_init_level=5)  # a column for each task
    levels, fallen = sampler.levels.copy(), np.zeros(len(ids), dtype=bool)
    progress, means = CommandProgress.zeros(len(ids)), []
    for _ in range(NUM_EPISODES):
        robots = Robots(rng)
        progress.reset(ids, robots.position, robots.yaw)
        for _ in range(round(EPISODE_LENGTH / DT)):
            robots.step()
            command = robots.command
            progress.update(robots.position, robots.yaw, command, command[:, 2], DT)
        robots.sample_commands()  # legged_gym and Isaac Lab do so a step before the time limit
        levels = stock_levels(levels, robots, rng)
        sampler.update(ids, progress.of_episodes(ids, fallen, PATCH_LENGTH / 2))
        both = np.stack([levels, sampler.levels])
        means.append(both.reshape(2, len(TASKS), NUM_ENVS).mean(axis=2))
    return np.asarray(np.mean(means[-LAST_EPISODES:], axis=0))


def run() -> Iterator[tuple[str, float]]:
    """Yield the mean levels of each task, of 9."""
    for name, stock, ours in zip(TASKS, *mean_levels(), strict=True):
        yield f"{name}.stock", stock
        yield f"{name}.terrainkit", ours
