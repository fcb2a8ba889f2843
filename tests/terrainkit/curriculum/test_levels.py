import numpy as np
import pytest

from terrainkit.curriculum import LevelSampler, assign_levels, update_levels
from terrainkit.errors import ConfigError
from tests.tables import read_table


def update(levels, progress, *, rows=10, seed=0, **options):
    return update_levels(levels, progress, rows=rows, seed=seed, **options)


def test_update_levels_moves_each_environment_up_or_down():
    before = np.array([5, 5, 5, 5, 4, 0, 5])
    after = update(before, [1.0, 0.99, 0.5, 0.49, 0.0, 0.0, np.nan])
    assert after.tolist() == [6, 5, 5, 4, 3, 0, 5]
    assert before.tolist() == [5, 5, 5, 5, 4, 0, 5]


def test_update_levels_spreads_solved_evenly_over_last_rows():
    solved = update(np.full(300, 9), 1.0)
    assert np.bincount(solved) == pytest.approx([*[0] * 7, 100, 100, 100], abs=30)


@pytest.mark.parametrize(
    ("rows", "top_levels", "levels"), [(10, 1, {9}), (2, 3, {0, 1}), (1, 3, {0})]
)
def test_update_levels_limits_top_levels_to_rows(rows, top_levels, levels):
    solved = update(np.full(100, rows - 1), 1.0, rows=rows, top_levels=top_levels)
    assert set(solved.tolist()) == levels


@pytest.mark.parametrize(("given", "message"), read_table(__file__, "update_levels_rejects"))
def test_update_levels_rejects_invalid_values(given, message):
    with pytest.raises(ConfigError, match=message):
        update(**({"levels": [0, 1], "progress": [0.0, 1.0]} | given))


@pytest.mark.parametrize(("highest_walkable", "reached"), [(9, {7, 8, 9}), (4, {4, 5}), (-1, {0})])
def test_level_sampler_settles_where_robots_can_walk(highest_walkable, reached):
    sampler = LevelSampler(10, 20, 200, max_init_level=5)
    for _ in range(120):
        sampler.update(np.arange(200), sampler.levels <= highest_walkable)
    assert set(sampler.levels.tolist()) == reached
    assert (sampler.columns == assign_levels(200, 10, 20, 5, seed=0)[1]).all()
