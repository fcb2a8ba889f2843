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


HALF = np.full((ROWS, COLS), 0.5)


def assert_same_state(state, other):
    assert state.keys() == other.keys()
    for name, value in state.items():
        np.testing.assert_array_equal(value, other[name], name)


def test_every_name_has_a_sampler():
    assert {*get_args(SamplerName), None} == set(SAMPLERS)


@every_sampler
def test_resumed_sampler_is_identical(kind):
    whole, resumed = train(make(kind), HALF), make(kind)
    state = whole.state_dict()
    copies = {name: np.copy(value) for name, value in state.items()}
    resumed.load_state_dict(state)
    assert_same_state(*(train(each, HALF, seed=1).state_dict() for each in (whole, resumed)))
    assert_same_state(state, copies)


@every_sampler
def test_seed_alone_determines_the_patches(kind):
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    assert_same_state(*(train(make(kind), HALF).state_dict() for _ in range(2)))
    assert (make(kind, 100, seed=1).levels != make(kind, 100, seed=2).levels).any()
    np.testing.assert_array_equal(np.random.get_state()[1], before)  # noqa: NPY002


@every_sampler
@pytest.mark.parametrize(("ids", "progress"), [([2, 5], [1.0, 0.0]), ([], [])])
def test_only_ended_episodes_get_another_patch(kind, ids, progress):
    sampler = make(kind)
    before = np.stack([sampler.levels, sampler.columns])
    given = sampler.update(ids, progress)
    after = np.stack([sampler.levels, sampler.columns])
    assert np.delete(after, ids, axis=1).tolist() == np.delete(before, ids, axis=1).tolist()
    assert [each.tolist() for each in given] == after[:, ids].tolist()
    assert sampler.statistics.visits.sum() == len(ids)
    assert sampler.state_dict()["updates"] == (len(ids) > 0)


@every_sampler
def test_tensors_give_tensors_with_the_same_patches(kind):
    ids, progress = np.arange(5), np.array([1, 0, 0.5, np.nan, 1])
    expected = make(kind).update(ids, progress, progress)
    values = torch.tensor(progress, dtype=torch.float32, requires_grad=True)
    given = make(kind).update(torch.from_numpy(ids), values, values)
    for mine, theirs in zip(expected, given, strict=True):
        assert (type(mine), type(theirs), theirs.dtype) == (np.ndarray, torch.Tensor, torch.int64)
        assert mine.tolist() == theirs.tolist()


def test_samplers_do_not_import_torch():
    code = (
        "import sys, numpy as np; from terrainkit.curriculum import SAMPLERS\n"
        "for kind in SAMPLERS.values(): kind(3, 3, 4).update(np.arange(4), np.ones(4))\n"
        "print('torch' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "False\n"


@pytest.mark.parametrize(
    ("ids", "progress", "returns", "message"),
    [
        ([12], [1.0], None, "env_ids: got 12 to 12; expected 0 to 11"),
        ([0], [1.2], None, "progress: got 1.2; expected numbers from 0 to 1, or NaN"),
        ([0, 1], [1.0, 1.0], [1.0], r"returns: got shape \(1,\); expected \(2,\)"),
        ([0], [1.0], ["a"], "returns: got values of <U1; expected numbers"),
    ],
)
def test_update_rejects_invalid_values(ids, progress, returns, message):
    sampler = make(LearningProgressSampler)
    before = sampler.state_dict()
    with pytest.raises(ConfigError, match=message):
        sampler.update(ids, progress, returns)
    assert_same_state(sampler.state_dict(), before)


@every_sampler
def test_other_num_envs_keep_levels_and_statistics(kind):
    before = make(kind)
    before.levels[:] = 1 + before.columns
    before.statistics.visits[2, 1] = 7
    after = make(kind, num_envs=30)
    after.load_state_dict(before.state_dict())
    assert (after.levels == 1 + after.columns).all()
    assert after.statistics.visits[2, 1] == 7


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"visits": np.zeros((5, 3))}, "curriculum: got 5 x 3 patches; expected 4 x 3$"),
        (
            {"fast": np.zeros((4, 2))},
            r"fast of the curriculum: got shape \(4, 2\); expected \(4, 3",
        ),
        (
            {"fast": None},
            "curriculum: got no fast; expected the state of a LearningProgressSampler",
        ),
        ({"updates": None}, "curriculum: got no updates; expected the state of a Lea"),
        ({"levels": np.full(NUM_ENVS, 4)}, "levels: got 4 to 4; expected 0 to 3"),
        ({"columns": np.full(NUM_ENVS, 3)}, "columns: got 3 to 3; expected 0 to 2"),
        ({"columns": np.zeros(1, int)}, r"columns: got shape \(1,\); expected \(12,\)"),
    ],
)
def test_load_rejects_another_state(changed, message):
    sampler = make(LearningProgressSampler)
    state = {**sampler.state_dict(), **changed}
    with pytest.raises(ConfigError, match=message):
        sampler.load_state_dict({name: each for name, each in state.items() if each is not None})


def test_none_keeps_every_patch():
    sampler, new = train(make(SAMPLERS[None]), HALF), make(SAMPLERS[None])
    assert (sampler.levels == new.levels).all()
    assert (sampler.columns == new.columns).all()
    assert sampler.statistics.visits.sum() > 0


def test_learning_progress_is_the_difference_of_two_means():
    sampler = LearningProgressSampler(4, 1, 4, max_init_level=0)
    assert sampler.probs().ravel().tolist() == [0.25] * 4
    sampler.update([0], [1.0])
    # The means of level 0 are 0.5 and 0.2. Level 1 gets a quarter of the difference, and level 0
    # keeps the quarter of a level below, which does not exist.
    expected = 0.2 / 4 + 0.8 * np.array([3 / 4, 1 / 4, 0, 0])
    assert sampler.probs().ravel() == pytest.approx(expected)


def test_learning_progress_counts_forgetting():
    sampler = LearningProgressSampler(4, 1, 4)
    sampler.fast[2], sampler.slow[2] = 0.4, 0.9
    assert sampler.probs().argmax() == 2
    sampler.fast[0] = sampler.slow[0] = 1.0  # always solved
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
