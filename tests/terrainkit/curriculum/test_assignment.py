import numpy as np
import pytest

from terrainkit.curriculum import assign_levels, assign_spawns, resample_columns
from terrainkit.errors import ConfigError


def test_assign_levels_shares_columns_in_order():
    _, columns = assign_levels(8, 10, 4, None, seed=0)
    assert columns.tolist() == [0, 0, 1, 1, 2, 2, 3, 3]


def test_assign_levels_spreads_few_environments():
    _, columns = assign_levels(5, 10, 10, None, seed=0)
    assert columns.tolist() == [0, 2, 4, 6, 8]


@pytest.mark.parametrize("num_envs", [1, 7, 19, 20, 21, 4096])
def test_assign_levels_is_even_for_any_number(num_envs):
    levels, columns = assign_levels(num_envs, 10, 20, None, seed=0)
    assert levels.shape == columns.shape == (num_envs,)
    assert (np.diff(columns) >= 0).all()
    shares = np.bincount(columns, minlength=20)
    assert len(shares) == 20
    assert np.ptp(shares) <= 1


def test_assign_levels_of_no_environments():
    levels, columns = assign_levels(0, 10, 20, None, seed=0)
    assert levels.shape == columns.shape == (0,)


@pytest.mark.parametrize(
    ("highest", "levels"), [(0, {0}), (5, set(range(6))), (None, set(range(10)))]
)
def test_assign_levels_respects_max_init_level(highest, levels):
    assert set(assign_levels(1000, 10, 20, highest, seed=0)[0].tolist()) == levels


def test_assign_levels_is_seeded():
    one, again, other = (assign_levels(100, 10, 20, None, seed)[0] for seed in (1, 1, 2))
    assert (one == again).all()
    assert (one != other).any()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"num_envs": -1}, "num_envs: got -1; expected an integer >= 0"),
        ({"num_envs": "a"}, "num_envs: got 'a'; expected an integer >= 0"),
        ({"num_envs": 2.5}, "num_envs: got 2.5; expected an integer >= 0"),
        ({"max_init_level": -1}, "max_init_level: got -1; expected an integer from 0 to 9"),
        ({"max_init_level": 10}, "max_init_level: got 10; expected an integer from 0 to 9"),
        ({"seed": -1}, "seed: got -1; expected integers >= 0"),
        ({"seed": "a"}, "seed: got 'a'; expected integers >= 0"),
        ({"seed": None}, "seed: got None; expected integers >= 0"),
        ({"seed": (1, -1)}, r"seed: got \[1, -1\]; expected integers >= 0"),
        ({"seed": 0.5}, "seed: got 0.5; expected integers >= 0"),
    ],
)
def test_assign_levels_rejects_invalid_value(given, message):
    valid = {"num_envs": 8, "rows": 10, "cols": 20, "max_init_level": None, "seed": 0}
    with pytest.raises(ConfigError, match=f"^{message}$"):
        assign_levels(**(valid | given))


def spawn_sets():
    """Return the spawns of 2 x 2 patches: patch (r, c) has 2 r + c + 1 of 4, at x = 1, 2, ..."""
    spawns = np.full((2, 2, 4, 4), np.nan, np.float32)
    for number, spawn_set in enumerate(spawns.reshape(4, 4, 4), start=1):
        spawn_set[:number] = [[k + 1, 10 * number, 0.5, 0.25] for k in range(number)]
    return spawns


def test_assign_spawns_takes_positions_in_turn():
    levels, columns = [1, 0, 1, 1, 0, 1], [0, 1, 0, 1, 1, 0]
    spawns, num_shared = assign_spawns(spawn_sets(), levels, columns)
    assert spawns[:, 0].tolist() == [1, 1, 2, 1, 2, 3]
    assert spawns[:, 1].tolist() == [30, 20, 30, 40, 20, 30]
    assert spawns[:, 2:].tolist() == [[0.5, 0.25]] * 6
    assert num_shared == 0


def test_assign_spawns_counts_shared_positions():
    spawns, num_shared = assign_spawns(spawn_sets(), [0] * 5, [1] * 5)
    assert spawns[:, 0].tolist() == [1, 2, 1, 2, 1]
    assert num_shared == 3


def test_assign_spawns_of_no_environments():
    spawns, num_shared = assign_spawns(spawn_sets(), [], [])
    assert spawns.shape == (0, 4)
    assert num_shared == 0


TYPES = np.array([[0, 0, 1, 0, 2], [1, 1, 1, 2, 2]], np.int32)
"""Terrain types of 2 x 5 patches."""


def test_resample_columns_keeps_the_terrain_type():
    levels, columns = np.repeat([0, 1], 500), np.tile(np.arange(5), 200)
    after = resample_columns(levels, columns, TYPES, seed=0)
    assert (TYPES[levels, after] == TYPES[levels, columns]).all()


def test_resample_columns_is_uniform_over_variants():
    after = resample_columns(np.zeros(3000, int), np.ones(3000, int), TYPES, seed=0)
    assert np.bincount(after, minlength=5)[[2, 4]].tolist() == [0, 0]
    assert np.bincount(after)[[0, 1, 3]] == pytest.approx([1000] * 3, abs=100)


def test_resample_columns_is_seeded():
    levels, columns = np.zeros(100, int), np.zeros(100, int)
    one, again, other = (
        resample_columns(levels, columns, TYPES, seed=(0, reset)) for reset in (1, 1, 2)
    )
    assert one.tolist() == again.tolist() != other.tolist()


def test_resample_columns_without_variants_changes_nothing():
    assert resample_columns([0, 0], [2, 4], TYPES, seed=0).tolist() == [2, 4]
    assert resample_columns([], [], TYPES, seed=0).shape == (0,)


@pytest.mark.parametrize(
    ("level", "column", "message"),
    [(2, 0, "levels: got 2 to 2; expected 0 to 1"), (0, -1, "columns: got -1 to -1; expected 0 ")],
)
def test_resample_columns_rejects_unknown_patches(level, column, message):
    with pytest.raises(ConfigError, match=message):
        resample_columns([level], [column], TYPES, seed=0)


@pytest.mark.parametrize(
    ("levels", "columns", "seed", "message"),
    [
        ([0], [0.5], 0, "columns: got values of float64; expected integers"),
        ([0, 0], [0], 0, r"columns: got shape \(1,\); expected \(2,\)"),
        ([0], [0], -1, "seed: got -1; expected integers >= 0"),
    ],
)
def test_resample_columns_rejects_invalid_values(levels, columns, seed, message):
    with pytest.raises(ConfigError, match=message):
        resample_columns(levels, columns, TYPES, seed=seed)


def test_resample_columns_of_no_environments():
    assert resample_columns([], [], TYPES, seed=0).tolist() == []
