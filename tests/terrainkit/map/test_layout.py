import math
from collections import Counter
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError, TerrainkitWarning
from terrainkit.map.layout import allocate_columns, column_types, terrain_and_difficulty

FLAT, GAP, PIT = (SubTerrain(terrain=name) for name in ("flat", "gap", "pit"))


def mix(**proportions):
    return tuple(SubTerrain(terrain=name, proportion=p) for name, p in proportions.items())


def difficulties(config, col=0):
    columns = column_types(config)
    return [terrain_and_difficulty(config, columns, row, col)[1] for row in range(config.rows)]


def drawn(config):
    columns = column_types(config)
    return [
        terrain_and_difficulty(config, columns, row, col)
        for row in range(config.rows)
        for col in range(config.cols)
    ]


@pytest.mark.parametrize(
    ("proportions", "num_columns", "counts"),
    [
        # Shares 4.7, 1.6, 1.58, 1.2, 0.61, 0.31: seven whole ones, then 0.7, 0.61 and 0.6 win.
        ([47, 16, 15.8, 12, 6.1, 3.1], 10, [5, 2, 1, 1, 1, 0]),
        # legged_gym's own: shares 2, 2, 7, 5, 4.
        ([0.1, 0.1, 0.35, 0.25, 0.2], 20, [2, 2, 7, 5, 4]),
        # Shares 1, 1, 3.5, 2.5, 2: the tie goes to the earlier.
        ([0.1, 0.1, 0.35, 0.25, 0.2], 10, [1, 1, 4, 2, 2]),
        ([1, 1, 1], 10, [4, 3, 3]),
        ([0.1, 0.1, 0.1], 10, [4, 3, 3]),
        # Shares 1/3, 1/3, 7/3 tie on paper, though not in floats.
        ([0.1, 0.1, 0.7], 3, [1, 0, 2]),
        ([0.1, 0.4, 0.4], 6, [1, 3, 2]),
        ([1, 1], 3, [2, 1]),
        ([0.2, 0.2], 4, [2, 2]),
        ([1, 0, 1], 3, [2, 0, 1]),
        ([3, 1], 1, [1, 0]),
        ([1], 7, [7]),
    ],
)
def test_allocate_columns_uses_largest_remainder(proportions, num_columns, counts):
    assert allocate_columns(proportions, num_columns) == counts


@settings(deadline=None, derandomize=True)
@given(
    weights=st.lists(st.integers(0, 100), min_size=1, max_size=12), num_columns=st.integers(1, 200)
)
def test_allocate_columns_rounds_exact_shares(weights, num_columns):
    weights[0] += 1
    counts = allocate_columns([float(w) for w in weights], num_columns)
    assert sum(counts) == num_columns
    for weight, n in zip(weights, counts, strict=True):
        share = Fraction(weight * num_columns, sum(weights))
        assert math.floor(share) <= n <= math.ceil(share)


def test_column_types_are_in_order():
    config = MapConfig(cols=6, terrains=mix(gap=3, flat=1, pit=2))
    assert column_types(config) == [0, 0, 0, 1, 2, 2]


def test_column_types_of_legged_gym():
    assert column_types(MapConfig()) == [0, 1, 2, 3, 3, 4, 5, 6, 7, 8]


def test_column_types_reject_missing_custom_sub_terrain():
    with pytest.raises(
        ConfigError, match=r"cols: got 2, too few for 3 sub-terrains .*: no column for pit$"
    ):
        column_types(MapConfig(cols=2, terrains=(FLAT, GAP, PIT)))


def test_column_types_warn_of_missing_preset_sub_terrain():
    with pytest.warns(
        TerrainkitWarning,
        match=r"cols: got 4, too few for 5 sub-terrains .*: no column for wave \(preset rough\)",
    ):
        columns = column_types(MapConfig(cols=4, preset="rough"))
    assert columns == [0, 1, 2, 3]


def test_column_types_allow_zero_proportion():
    assert column_types(MapConfig(cols=2, terrains=mix(flat=1, gap=0, pit=1))) == [0, 2]


@pytest.mark.parametrize("rows", [2, 3, 7, 10, 49])
@pytest.mark.parametrize("jitter", [0.0, 1.0])
def test_terrain_and_difficulty_first_and_last_difficulty_are_exact(rows, jitter):
    levels = difficulties(MapConfig(rows=rows, difficulty_jitter=jitter))
    assert levels[0] == 0.0
    assert levels[-1] == 1.0


def test_terrain_and_difficulty_uses_difficulty_range():
    levels = difficulties(MapConfig(rows=4, difficulty_range=(0.1, 0.7)))
    assert levels == pytest.approx([0.1, 0.3, 0.5, 0.7])
    assert (levels[0], levels[-1]) == (0.1, 0.7)


def test_terrain_and_difficulty_difficulty_is_linear():
    assert difficulties(MapConfig(rows=5)) == [0.0, 0.25, 0.5, 0.75, 1.0]


def test_terrain_and_difficulty_single_row_is_easy():
    assert difficulties(MapConfig(rows=1)) == [0.0]
    assert difficulties(MapConfig(rows=1, difficulty_range=(0.4, 0.9))) == [0.4]


def test_terrain_and_difficulty_jitter_is_limited():
    config = MapConfig(rows=5, cols=40, difficulty_jitter=0.5)
    second = [difficulties(config, col)[1] for col in range(40)]
    assert len(set(second)) == 40
    # The row is at 0.25, a step is 0.25, half of it 0.125.
    assert all(0.125 <= level <= 0.375 for level in second)
    assert min(second) < 0.2
    assert max(second) > 0.3


def test_terrain_and_difficulty_jitter_stays_in_range():
    config = MapConfig(rows=3, cols=60, difficulty_jitter=1.0, difficulty_range=(0.2, 0.4))
    assert all(0.2 <= difficulties(config, col)[1] <= 0.4 for col in range(60))


def test_terrain_and_difficulty_jitter_is_seeded():
    one, other = (MapConfig(seed=seed, difficulty_jitter=0.5) for seed in (1, 2))
    assert difficulties(one) == difficulties(one)
    assert difficulties(one) != difficulties(other)


def test_terrain_and_difficulty_randomized_follows_proportions():
    config = MapConfig(mode="randomized", rows=40, cols=40, terrains=mix(flat=3, gap=1, pit=0))
    kinds = Counter(kind for kind, _ in drawn(config))
    # 1600 draws at 3/4: 1200, with a standard deviation of 17.
    assert 1130 < kinds[0] < 1270
    assert kinds[2] == 0


def test_terrain_and_difficulty_randomized_uses_given_difficulties():
    config = MapConfig(mode="randomized", random_difficulties=(0.1, 0.6), terrains=(FLAT,))
    levels = Counter(level for _, level in drawn(config))
    assert set(levels) == {0.1, 0.6}
    assert min(levels.values()) > 25


def test_terrain_and_difficulty_randomized_is_seeded():
    one, other = (MapConfig(mode="randomized", seed=seed) for seed in (1, 2))
    assert drawn(one) == drawn(one)
    assert drawn(one) != drawn(other)


def test_randomized_mode_needs_no_columns():
    config = MapConfig(mode="randomized", rows=20, cols=1, border=0.0, terrains=(FLAT, GAP))
    assert set(generate(config).terrain_types.flat) == {0, 1}


def test_randomized_mode_does_not_warn():
    terrain_map = generate(MapConfig(mode="randomized", rows=20, cols=2, border=0.0))
    assert len(set(terrain_map.terrain_types.flat)) > 2


def test_selected_mode_is_constant():
    config = MapConfig(mode="selected", selected_difficulty=0.3, terrains=(PIT,))
    assert set(drawn(config)) == {(0, 0.3)}
