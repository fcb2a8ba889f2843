"""The samplers of `terrainkit.curriculum` with simulated learners.

A learner has a skill in each column of a map with 10 x 10 patches. It succeeds on a level below
its skill, and practice increases the skill of the column most where success is as likely as
failure. One column is impossible, one trivial, and one is learned only after the others. All
samplers get the same number of samples (environment steps). The values are means over `_SEEDS`.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.curriculum import SAMPLERS, PatchSampler

_ROWS, _COLS, _NUM_ENVS = 10, 10, 128
_IMPOSSIBLE, _TRIVIAL, _LATE = 0, 1, 2
_SEEDS = range(3)
_TICK = 100
"""Steps between two updates of a sampler."""

_SAMPLES = 10_000_000
_EPISODE = 1000
"""Steps of an episode in which the robot does not fall."""

_SOLVED = 0.8
"""Mean success on the patches, without the impossible ones, of a solved map."""


@dataclass(frozen=True, kw_only=True)
class Learner:
    """How skills, in levels, change."""

    gain: float = 0.02
    """Largest increase of the skill of a column by one episode."""
    transfer: float = 0.0
    """Share of an increase by which the other columns increase as well."""
    forgetting: float = 0.0
    """Decrease of each skill by an episode elsewhere."""
    width: float = 0.5
    """Difference of skill and level over which success changes."""


LEARNERS = {
    "independent": Learner(),
    "transfer": Learner(gain=0.01, transfer=0.1),
    "forgetting": Learner(gain=0.02, forgetting=2e-4),
}


class Simulation:
    """A learner that trains with a sampler."""

    def __init__(self, learner: Learner, sampler: PatchSampler, seed: int) -> None:
        self.learner, self.sampler = learner, sampler
        self.rng = np.random.default_rng(seed)
        self.skill = np.zeros(_COLS)
        self.samples = np.zeros((_ROWS, _COLS))

    def success(self) -> NDArray[np.float64]:
        """Return the probability of success on each patch, shape (rows, cols)."""
        margin = self.skill + 0.5 - np.arange(_ROWS)[:, None]
        chances = 1 / (1 + np.exp(-margin / self.learner.width))
        chances[:, _IMPOSSIBLE], chances[:, _TRIVIAL] = 0, 1
        return chances

    def run(self) -> tuple[float, float, float]:
        """Return the final success, the share of the impossible column, and samples to solve."""
        solved, time = np.inf, 0
        levels, columns = self.sampler.levels.copy(), self.sampler.columns.copy()
        succeeds, progress, length = self.outcomes(levels, columns)
        end = self.rng.integers(1, _EPISODE, _NUM_ENVS)  # as rsl-rl cuts the first episodes
        while time * _NUM_ENVS < _SAMPLES:
            time += _TICK
            ids = np.flatnonzero(end <= time)
            if not len(ids):
                continue
            np.add.at(self.samples, (levels[ids], columns[ids]), length[ids])
            self.practice(levels[ids], columns[ids])
            levels[ids], columns[ids] = self.sampler.update(ids, progress[ids])
            succeeds[ids], progress[ids], length[ids] = self.outcomes(levels[ids], columns[ids])
            end[ids] = time + length[ids]
            if solved == np.inf and time % 1000 == 0 and self.mean_success() >= _SOLVED:
                solved = time * _NUM_ENVS
        share = self.samples[:, _IMPOSSIBLE].sum() / self.samples.sum()
        return self.mean_success(), share, solved

    def mean_success(self) -> float:
        """Return the mean probability of success, without the impossible column."""
        return float(np.delete(self.success(), _IMPOSSIBLE, axis=1).mean())

    def outcomes(self, levels, columns):  # type: ignore[no-untyped-def]
        """Return success, progress and length of episodes that start."""
        n = len(levels)
        succeeds = self.rng.random(n) < self.success()[levels, columns]
        falls = ~succeeds & (self.rng.random(n) < 0.5) & (columns != _IMPOSSIBLE)
        progress = np.where(succeeds, 1.0, np.where(falls, 0, self.rng.uniform(0, 0.6, n)))
        length = np.where(falls, self.rng.integers(100, 600, n), _EPISODE)
        return succeeds, progress, length

    def practice(self, levels, columns):  # type: ignore[no-untyped-def]
        """Increase the skills by episodes that ended."""
        chance = self.success()[levels, columns]
        gain = self.learner.gain * 4 * chance * (1 - chance)
        total = np.bincount(columns, gain, minlength=_COLS)
        ready = np.delete(self.skill, [_IMPOSSIBLE, _TRIVIAL, _LATE]).mean() >= 4
        total[_LATE] *= ready
        total += self.learner.transfer * (total.sum() - total) * (np.arange(_COLS) != _LATE)
        elsewhere = len(columns) - np.bincount(columns, minlength=_COLS)
        self.skill += total - self.learner.forgetting * elsewhere
        self.skill = np.clip(self.skill, 0, _ROWS)


def run() -> Iterator[tuple[str, float]]:
    for learner_name, learner in LEARNERS.items():
        for name, kind in SAMPLERS.items():
            results = []
            for seed in _SEEDS:
                sampler = kind(_ROWS, _COLS, _NUM_ENVS, max_init_level=5, seed=seed)
                results.append(Simulation(learner, sampler, seed).run())
            success, share, solved = np.array(results).mean(axis=0)
            key = f"{learner_name}.{name or 'none'}"
            yield f"{key}.success", success
            yield f"{key}.share_of_impossible", share
            yield f"{key}.samples_to_solve_in_millions", solved / 1e6
