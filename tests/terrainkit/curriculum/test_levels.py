import numpy as np
import pytest

from terrainkit.curriculum import LevelSampler, assign_levels, update_levels
from terrainkit.errors import ConfigError


def update(levels, progress, *, rows=10, seed=0, **options):
    return update_levels(levels, progress, rows=rows, seed=seed, **options)


@pytest.mark.parametrize(
    ("progress", "level"), [(1.0, 6), (0.99, 5), (0.5, 5), (0.49, 4), (0.0, 4), (np.nan, 5)]
)
def test_update_levels_moves_up_and_down(progress, level):
    assert update([5], [progress]).tolist() == [level]


def test_update_levels_is_per_environment():
    assert update([1, 2, 3], [1.0, 0.0, 0.7]).tolist() == [2, 1, 3]


def test_update_levels_stops_at_zero():
    assert update([0], [0.0]).tolist() == [0]


def test_update_levels_spreads_solved_over_last_rows():
    solved = update(np.full(300, 9), 1.0)
    assert np.bincount(solved, minlength=10)[7:].min() > 60
    assert solved.min() == 7


@pytest.mark.parametrize(
    ("rows", "top_levels", "levels"), [(10, 1, {9}), (2, 3, {0, 1}), (1, 3, {0})]
)
def test_update_levels_limits_top_levels_to_rows(rows, top_levels, levels):
    solved = update(np.full(100, rows - 1), 1.0, rows=rows, top_levels=top_levels)
    assert set(solved.tolist()) == levels


def test_update_levels_accepts_seed_sequences():
    last = np.full(100, 9)
    assert (update(last, 1.0, seed=(0, 1)) == update(last, 1.0, seed=(0, 1))).all()
    assert (update(last, 1.0, seed=(0, 1)) != update(last, 1.0, seed=(0, 2))).any()


def test_update_levels_keeps_its_input():
    before = np.array([1, 2, 3])
    update(before, 1.0)
    assert before.tolist() == [1, 2, 3]


def test_update_levels_of_no_environments():
    assert update([], []).shape == (0,)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"levels": [0, 10]}, "levels: got 0 to 10; expected 0 to 9"),
        ({"levels": [-1, 3]}, "levels: got -1 to 3"),
        ({"levels": [0.5, 1.0]}, "levels: got values of float64; expected integers"),
        ({"levels": 3}, r"levels: got shape \(\); expected \(n,\)"),
        ({"levels": [[1], [2, 3]]}, "levels: got lists of different lengths; expected one list"),
        ({"progress": [1.0]}, r"progress: got shape \(1,\); expected \(2,\)"),
        ({"progress": ["a", "b"]}, "progress: got values of <U1; expected numbers"),
        ({"progress": [0.5, 1.5]}, "progress: got 1.5; expected numbers from 0 to 1, or NaN"),
        ({"progress": [-0.1, 1]}, "progress: got -0.1; expected numbers from 0 to 1, or NaN"),
        ({"seed": -1}, "seed: got -1; expected integers >= 0"),
        ({"top_levels": 0}, "top_levels: got 0; expected an integer >= 1"),
    ],
)
def test_update_levels_rejects_invalid_values(given, message):
    with pytest.raises(ConfigError, match=message):
        update(**({"levels": [0, 1], "progress": [0.0, 1.0]} | given))


def train(can_walk, episodes=120, num_envs=200):
    """Return the levels of environments that succeed where `can_walk` returns True."""
    sampler = LevelSampler(10, 20, num_envs, max_init_level=5)
    rng = np.random.default_rng(0)
    for _ in range(episodes):
        sampler.update(np.arange(num_envs), np.where(can_walk(sampler.levels, rng), 1.0, 0.0))
    assert (sampler.columns == assign_levels(num_envs, 10, 20, 5, seed=0)[1]).all()
    return sampler.levels


def test_level_sampler_perfect_robots_reach_the_top():
    assert set(train(lambda levels, _: levels < 10).tolist()) == {7, 8, 9}


def test_level_sampler_imperfect_robots_stay_near_the_top():
    assert train(lambda levels, rng: rng.random(levels.size) < 0.85).mean() > 7.5


def test_level_sampler_settles_at_walkable_level():
    assert set(train(lambda levels, _: levels <= 4).tolist()) <= {4, 5}


def test_level_sampler_failing_robots_end_at_zero():
    assert not train(lambda levels, _: levels < 0).any()
