"""Properties of every sampler, and what each one samples."""

import subprocess
import sys
from typing import get_args

import numpy as np
import pytest
import torch

from terrainkit.curriculum import (
    SAMPLERS,
    LearningProgressSampler,
    PrioritizedReplaySampler,
    SamplerName,
    UniformSampler,
)
from terrainkit.errors import ConfigError

ROWS, COLS, NUM_ENVS = 4, 3, 12

every_sampler = pytest.mark.parametrize("kind", SAMPLERS.values(), ids=str)


def make(kind, num_envs=NUM_ENVS, seed=3):
    return kind(ROWS, COLS, num_envs, seed=seed)


def train(sampler, chances, calls=60, seed=0):
    """End a third of the episodes at each call, with success by the chance of their patch."""
    rng, n = np.random.default_rng(seed), len(sampler.levels)
    for _ in range(calls):
        ids = rng.permutation(n)[: n // 3]
        chance = chances[sampler.levels[ids], sampler.columns[ids]]
        progress = np.where(rng.random(len(ids)) < chance, 1.0, 0.3)
        progress[rng.random(len(ids)) < 0.1] = np.nan
        sampler.update(ids, progress, rng.normal(size=len(ids)))
    return sampler


def half():
    return np.full((ROWS, COLS), 0.5)


def test_every_name_has_a_sampler():
    assert {*get_args(SamplerName), None} == set(SAMPLERS)


@every_sampler
def test_resumed_sampler_is_identical(kind):
    whole, first = train(make(kind), half()), train(make(kind), half())
    resumed = make(kind)
    resumed.load_state_dict(first.state_dict())
    for each in (whole, resumed):
        train(each, half(), seed=1)
    before, after = whole.state_dict(), resumed.state_dict()
    assert before.keys() == after.keys()
    for name in before:
        np.testing.assert_array_equal(before[name], after[name])


@every_sampler
def test_state_dict_is_a_copy(kind):
    sampler = train(make(kind), half())
    state = sampler.state_dict()
    copies = {name: np.copy(value) for name, value in state.items()}
    train(sampler, half())
    for name, value in state.items():
        np.testing.assert_array_equal(value, copies[name])


@every_sampler
def test_seed_determines_the_patches(kind):
    one, again = (train(make(kind), half()).state_dict() for _ in range(2))
    np.testing.assert_array_equal(one["levels"], again["levels"])
    np.testing.assert_array_equal(one["columns"], again["columns"])
    assert (make(kind, 100, seed=1).levels != make(kind, 100, seed=2).levels).any()


@every_sampler
def test_global_random_state_is_unchanged(kind):
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    train(make(kind), half())
    np.testing.assert_array_equal(np.random.get_state()[1], before)  # noqa: NPY002


@every_sampler
def test_only_ended_episodes_get_another_patch(kind):
    sampler = make(kind)
    levels, columns = sampler.levels.copy(), sampler.columns.copy()
    given = sampler.update(np.array([2, 5]), np.array([1.0, 0.0]))
    others = np.delete(np.arange(NUM_ENVS), [2, 5])
    assert (sampler.levels[others] == levels[others]).all()
    assert (sampler.columns[others] == columns[others]).all()
    assert given[0].tolist() == sampler.levels[[2, 5]].tolist()
    assert given[1].tolist() == sampler.columns[[2, 5]].tolist()


@every_sampler
def test_tensors_give_tensors_with_the_same_patches(kind):
    ids, progress = np.arange(5), np.array([1, 0, 0.5, np.nan, 1])
    sampler, other = make(kind), make(kind)
    expected = sampler.update(ids, progress, progress)
    values = torch.tensor(progress, dtype=torch.float32, requires_grad=True)
    given = other.update(torch.from_numpy(ids), values, values)
    for mine, theirs in zip(expected, given, strict=True):
        assert isinstance(mine, np.ndarray)
        assert isinstance(theirs, torch.Tensor)
        assert theirs.dtype == torch.int64
        assert mine.tolist() == theirs.tolist()
    other.update(ids.tolist(), progress.tolist())


def test_samplers_do_not_import_torch():
    code = (
        "import sys, numpy as np; from terrainkit.curriculum import SAMPLERS\n"
        "for kind in SAMPLERS.values(): kind(3, 3, 4).update(np.arange(4), np.ones(4))\n"
        "print('torch' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "False\n"


@every_sampler
def test_no_ended_episodes_change_nothing(kind):
    sampler = make(kind)
    before = sampler.state_dict()
    assert [len(each) for each in sampler.update([], [])] == [0, 0]
    for name, value in sampler.state_dict().items():
        np.testing.assert_array_equal(value, before[name])


@every_sampler
@pytest.mark.parametrize(
    ("ids", "progress", "returns", "message"),
    [
        ([12], [1.0], None, "env_ids: got 12 to 12; expected 0 to 11"),
        ([0], [1.2], None, "progress: got 1.2; expected numbers from 0 to 1, or NaN"),
        ([0, 1], [1.0], None, r"progress: got shape \(1,\); expected \(2,\)"),
        ([0, 1], [1.0, 1.0], [1.0], r"returns: got shape \(1,\); expected \(2,\)"),
        ([0], [1.0], ["a"], "returns: got values of <U1; expected numbers"),
    ],
)
def test_update_rejects_invalid_values(kind, ids, progress, returns, message):
    sampler = make(kind)
    before = sampler.state_dict()
    with pytest.raises(ConfigError, match=message):
        sampler.update(ids, progress, returns)
    for name, value in sampler.state_dict().items():
        np.testing.assert_array_equal(value, before[name])


@every_sampler
def test_other_num_envs_keep_levels_and_statistics(kind):
    before = make(kind)
    before.levels[:] = 1 + before.columns
    before.statistics.visits[2, 1] = 7
    after = make(kind, num_envs=30)
    after.load_state_dict(before.state_dict())
    assert (after.levels == 1 + after.columns).all()
    assert after.statistics.visits[2, 1] == 7


@every_sampler
def test_load_rejects_another_map(kind):
    state = kind(5, COLS, NUM_ENVS).state_dict()
    with pytest.raises(ConfigError, match=r"curriculum: got 5 x 3 patches; expected 4 x 3$"):
        make(kind).load_state_dict(state)


def test_load_rejects_another_sampler():
    state = make(UniformSampler).state_dict()
    with pytest.raises(ConfigError, match="curriculum: got no fast; expected the state of a Lea"):
        make(LearningProgressSampler).load_state_dict(state)


@pytest.mark.parametrize("name", [name for name in SAMPLERS if name not in ("levels", None)])
def test_probabilities_are_a_distribution(name):
    sampler = make(SAMPLERS[name])
    for _ in range(4):
        chances = sampler.probs()
        assert chances.shape == (ROWS, COLS)
        assert chances.min() >= 0
        assert chances.sum() == pytest.approx(1)
        train(sampler, half(), calls=5)


def test_none_keeps_every_patch():
    sampler = make(SAMPLERS[None])
    levels, columns = sampler.levels.copy(), sampler.columns.copy()
    train(sampler, half())
    assert (sampler.levels == levels).all()
    assert (sampler.columns == columns).all()
    assert sampler.statistics.visits.sum() > 0


def test_uniform_visits_every_patch_equally():
    sampler = train(make(UniformSampler, num_envs=300), half(), calls=40)
    expected = sampler.statistics.visits.sum() / (ROWS * COLS)
    assert sampler.statistics.visits == pytest.approx(expected, rel=0.25)


@pytest.mark.parametrize("kind", [LearningProgressSampler, PrioritizedReplaySampler])
def test_adaptive_samplers_avoid_what_cannot_be_learned(kind):
    """Column 0 never succeeds, column 1 always does, and column 2 sometimes."""
    chances = np.tile([0.0, 1.0, 0.5], (ROWS, 1))
    sampler = train(make(kind, num_envs=60), chances, calls=200)
    share = sampler.probs().sum(axis=0)
    assert share[0] < 0.15
    assert share[1] < 0.15
    assert share[2] > 0.7


def test_learning_progress_is_the_difference_of_two_means():
    sampler = LearningProgressSampler(4, 1, 4, max_init_level=0)
    sampler.update([0], [1.0])
    # The means of level 0 are 0.5 and 0.2. Level 1 gets a quarter of the difference, and level 0
    # keeps the quarter of a level below, which does not exist.
    expected = 0.2 / 4 + 0.8 * np.array([3 / 4, 1 / 4, 0, 0])
    assert sampler.probs().ravel() == pytest.approx(expected)


def test_learning_progress_counts_forgetting():
    sampler = LearningProgressSampler(4, 1, 4)
    sampler.fast[2], sampler.slow[2] = 0.4, 0.9
    assert sampler.probs().argmax() == 2


def test_prioritized_replay_ranks_scores_and_age():
    sampler = PrioritizedReplaySampler(1, 4, 4)
    sampler.score[:] = [0.1, 0.4, np.nan, 0.1]
    sampler.last_visit[:] = [3, 1, 0, 2]
    sampler._updates = 3
    weight = np.array([2.5, 1, 2.5]) ** -2.0  # two patches share the ranks 2 and 3
    seen = 0.9 * weight / weight.sum() + 0.1 * np.array([1, 3, 2]) / 6
    expected = [0.75 * seen[0], 0.75 * seen[1], 0.25, 0.75 * seen[2]]
    assert sampler.probs().ravel() == pytest.approx(expected)
