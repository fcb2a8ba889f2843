import numpy as np
import pytest

from terrainkit.curriculum import assign_levels, assign_spawns, resample_columns
from terrainkit.errors import ConfigError
from tests.tables import read_table


@pytest.mark.parametrize(
    ("num_envs", "cols", "columns"),
    [(8, 4, [0, 0, 1, 1, 2, 2, 3, 3]), (5, 10, [0, 2, 4, 6, 8]), (1, 10, [0]), (0, 10, [])],
)
def test_assign_levels_distributes_environments_over_columns_in_order(num_envs, cols, columns):
    levels, found = assign_levels(num_envs, 10, cols, None, seed=0)
    assert found.tolist() == columns
    assert levels.shape == (num_envs,)


@pytest.mark.parametrize(
    ("highest", "levels"), [(0, {0}), (5, set(range(6))), (None, set(range(10)))]
)
def test_assign_levels_respects_max_init_level(highest, levels):
    assert set(assign_levels(1000, 10, 20, highest, seed=0)[0].tolist()) == levels


@pytest.mark.parametrize(("given", "message"), read_table(__file__, "assign_levels_rejects"))
def test_assign_levels_rejects_invalid_value(given, message):
    valid = {"num_envs": 8, "rows": 10, "cols": 20, "max_init_level": None, "seed": 0}
    with pytest.raises(ConfigError, match=f"^{message}$"):
        assign_levels(**(valid | given))


@pytest.mark.parametrize(
    ("levels", "columns", "turns", "num_shared"),
    [
        ([1, 0, 1, 1, 0, 1], [0, 1, 0, 1, 1, 0], [1, 1, 2, 1, 2, 3], 0),
        ([0] * 5, [1] * 5, [1, 2, 1, 2, 1], 3),
        ([], [], [], 0),
    ],
)
def test_assign_spawns_takes_positions_in_turn(levels, columns, turns, num_shared):
    # Patch (r, c) has 2 r + c + 1 of 4 positions, at x = 1, 2, ...
    spawns = np.full((2, 2, 4, 4), np.nan, np.float32)
    for number, spawn_set in enumerate(spawns.reshape(4, 4, 4), start=1):
        spawn_set[:number] = [[k + 1, 10 * number, 0.5, 0.25] for k in range(number)]
    found, shared = assign_spawns(spawns, levels, columns)
    expected = [
        [turn, 10 * (2 * row + column + 1), 0.5, 0.25]
        for row, column, turn in zip(levels, columns, turns, strict=True)
    ]
    assert found.tolist() == expected
    assert found.shape == (len(levels), 4)
    assert shared == num_shared


TYPES = np.array([[0, 0, 1, 0, 2], [1, 1, 1, 2, 2]], np.int32)
"""Terrain types of 2 x 5 patches."""


def test_resample_columns_is_uniform_over_variants():
    after = resample_columns(np.zeros(3000, int), np.ones(3000, int), TYPES, seed=0)
    assert np.bincount(after, minlength=5) == pytest.approx([1000, 1000, 0, 1000, 0], abs=100)


def test_resample_columns_is_seeded():
    levels, columns = np.zeros(100, int), np.zeros(100, int)
    one, again, other = (
        resample_columns(levels, columns, TYPES, seed=(0, reset)) for reset in (1, 1, 2)
    )
    assert one.tolist() == again.tolist() != other.tolist()


@pytest.mark.parametrize("columns", [[2, 4], []])
def test_resample_columns_without_variants_changes_nothing(columns):
    levels = [0] * len(columns)
    assert resample_columns(levels, columns, TYPES, seed=0).tolist() == columns


@pytest.mark.parametrize(
    ("levels", "columns", "seed", "message"),
    read_table(__file__, "resample_columns_rejects_invalid_values"),
)
def test_resample_columns_rejects_invalid_values(levels, columns, seed, message):
    with pytest.raises(ConfigError, match=message):
        resample_columns(levels, columns, TYPES, seed=seed)
