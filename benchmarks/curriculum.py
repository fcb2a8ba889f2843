"""The samplers of `terrainkit.curriculum` with simulated learners.

A learner has a skill in each column of a map of 10 x 10 patches: the level on which it succeeds in
half of the episodes. An episode increases the skill in its column most where success and failure
are equally likely. Some columns are impossible, one is trivial, and one is learned only after the
others. Skills are means over the columns that can be learned, and all values are means over the
seeds.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from terrainkit.curriculum import SAMPLERS, PatchSampler, SamplerName

_ROWS, _COLS, _NUM_ENVS = 10, 10, 128
_TRIVIAL, _LATE, _LATE_SKILL = 9, 8, 4.0
_SOLVED = 8.0
_SEEDS = range(3)
_EARLY_SAMPLES, _SAMPLES = 5_000_000, 10_000_000
_EPISODE, _TICK = 1000, 100
"""Steps of an episode without a fall, and between two updates of a sampler."""


@dataclass(frozen=True, kw_only=True)
class Learner:
    """How the skills change."""

    gain: float = 0.02
    """Largest increase of a skill by an episode in its column, in levels."""
    transfer: float = 0.0
    """Share of the increase by which the skills in the other columns increase."""
    forgetting: float = 0.0
    """Decrease of a skill by an episode in another column, in levels."""
    impossible: int = 1
    """Number of columns on which every episode fails."""


LEARNERS = {
    "independent": Learner(),
    "transfer": Learner(gain=0.01, transfer=0.1),
    "forgetting": Learner(forgetting=2e-4),
    "half_impossible": Learner(impossible=5),
}


class Training:
    """The training of a learner with a sampler."""

    def __init__(self, learner: Learner, sampler: PatchSampler, seed: int) -> None:
        self.learner, self.sampler, self.skill = learner, sampler, np.zeros(_COLS)
        self.rng = np.random.default_rng(seed)
        self.learnable = (np.arange(_COLS) >= learner.impossible) & (np.arange(_COLS) != _TRIVIAL)

    def run(self) -> tuple[float, float, float]:
        """Return the skill after `_EARLY_SAMPLES`, and two values until the map is solved.

        They are the share of the samples in impossible columns, and the number of samples.
        """
        early, wasted, total = np.nan, 0, 0
        levels, columns = self.sampler.levels.copy(), self.sampler.columns.copy()
        progress, length = self._outcomes(levels, columns)
        end = self.rng.integers(1, _EPISODE, _NUM_ENVS)  # as rsl-rl cuts the first episodes
        for time in range(0, _SAMPLES // _NUM_ENVS, _TICK):
            if np.isnan(early) and time * _NUM_ENVS >= _EARLY_SAMPLES:
                early = self._mean_skill()
            if self._mean_skill() >= _SOLVED and not np.isnan(early):
                break
            ids = np.flatnonzero(end <= time)
            if not len(ids):
                continue
            if self._mean_skill() < _SOLVED:
                total += length[ids].sum()
                wasted += length[ids][columns[ids] < self.learner.impossible].sum()
                solved = time * _NUM_ENVS
            self._practice(levels[ids], columns[ids])
            levels[ids], columns[ids] = self.sampler.update(ids, progress[ids])
            progress[ids], length[ids] = self._outcomes(levels[ids], columns[ids])
            end[ids] = time + length[ids]
        is_solved = self._mean_skill() >= _SOLVED
        return early, wasted / total, solved if is_solved else np.inf

    def _mean_skill(self) -> float:
        return float(self.skill[self.learnable].mean())

    def _success(
        self, levels: NDArray[np.int64], columns: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Return the probability of success on patches, shape (k,)."""
        chance = 1 / (1 + np.exp(2 * (levels - self.skill[columns])))
        chance[columns == _TRIVIAL] = 1
        chance[columns < self.learner.impossible] = 0
        return chance

    def _outcomes(
        self, levels: NDArray[np.int64], columns: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return progress and length of episodes: half of the failures are falls, and short."""
        n = len(levels)
        succeeds = self.rng.random(n) < self._success(levels, columns)
        falls = ~succeeds & (self.rng.random(n) < 0.5)
        progress = np.where(falls, 0, self.rng.uniform(0, 0.6, n))
        length = np.where(falls, self.rng.integers(100, 600, n), _EPISODE)
        return np.where(succeeds, 1, progress), length

    def _practice(self, levels: NDArray[np.int64], columns: NDArray[np.int64]) -> None:
        """Change the skills by episodes that ended."""
        chance = self._success(levels, columns)
        gain = 4 * self.learner.gain * chance * (1 - chance)
        own = np.bincount(columns, gain, minlength=_COLS)
        change = own + self.learner.transfer * (own.sum() - own)
        others = np.delete(self.skill, _LATE)[self.learnable[np.arange(_COLS) != _LATE]]
        if others.mean() < _LATE_SKILL:
            change[_LATE] = 0
        elsewhere = len(columns) - np.bincount(columns, minlength=_COLS)
        change -= self.learner.forgetting * elsewhere
        self.skill = np.clip(self.skill + change, 0, _ROWS)


def run() -> Iterator[tuple[str, float]]:
    names = ("skill_after_5M_samples", "share_in_impossible_columns", "million_samples_to_solve")
    for learner_name, learner in LEARNERS.items():
        for sampler_name in get_args(SamplerName):
            kind = partial(SAMPLERS[sampler_name], _ROWS, _COLS, _NUM_ENVS, max_init_level=5)
            results = [Training(learner, kind(seed=seed), seed).run() for seed in _SEEDS]
            means = np.mean(results, axis=0) / (1, 1, 1e6)
            for name, value in zip(names, means.tolist(), strict=True):
                yield f"{learner_name}.{sampler_name}.{name}", value
