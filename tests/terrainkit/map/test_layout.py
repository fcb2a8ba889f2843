from collections import Counter

import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError, TerrainkitWarning
from terrainkit.map.layout import allocate_columns, column_types, terrain_and_difficulty
from tests.tables import read_table


def mix(**proportions):
    return tuple(SubTerrain(terrain=name, proportion=p) for name, p in proportions.items())


def drawn(config):
    """Return terrain type and difficulty of each patch, by row."""
    columns = column_types(config)
    return [
        [terrain_and_difficulty(config, columns, row, col) for col in range(config.cols)]
        for row in range(config.rows)
    ]


def difficulties(**config):
    return [row[0][1] for row in drawn(MapConfig(**config))]


@pytest.mark.parametrize(
    ("proportions", "num_columns", "counts"),
    read_table(__file__, "allocate_columns_uses_largest_remainder"),
)
def test_allocate_columns_uses_largest_remainder(proportions, num_columns, counts):
    assert allocate_columns(proportions, num_columns) == counts


@pytest.mark.parametrize(
    ("config", "types"),
    [
        ({"cols": 6, "terrains": mix(gap=3, flat=1, pit=2)}, [0, 0, 0, 1, 2, 2]),
        ({"cols": 2, "terrains": mix(flat=1, gap=0, pit=1)}, [0, 2]),
        ({}, [0, 1, 2, 3, 3, 4, 5, 6, 7, 8]),  # legged_gym
    ],
)
def test_column_types_are_in_order(config, types):
    assert column_types(MapConfig(**config)) == types


def test_column_types_reject_missing_custom_sub_terrain():
    message = r"^cols: got 2, too few for 3 sub-terrains at these proportions: no column for pit$"
    with pytest.raises(ConfigError, match=message):
        column_types(MapConfig(cols=2, terrains=mix(flat=1, gap=1, pit=1)))


def test_column_types_warn_of_missing_preset_sub_terrain():
    message = r"cols: got 4, too few for 5 sub-terrains .*: no column for wave \(preset rough\)"
    with pytest.warns(TerrainkitWarning, match=message):
        assert column_types(MapConfig(cols=4, preset="rough")) == [0, 1, 2, 3]


@pytest.mark.parametrize("rows", [2, 3, 7, 10, 49])
@pytest.mark.parametrize("jitter", [0.0, 1.0])
def test_difficulty_of_first_and_last_row_is_exact(rows, jitter):
    levels = difficulties(rows=rows, difficulty_jitter=jitter, difficulty_range=(0.1, 0.7))
    assert (levels[0], levels[-1]) == (0.1, 0.7)


def test_difficulty_is_linear_in_the_row():
    assert difficulties(rows=5) == [0.0, 0.25, 0.5, 0.75, 1.0]
    levels = difficulties(rows=4, difficulty_range=(0.1, 0.7))
    assert levels == pytest.approx([0.1, 0.3, 0.5, 0.7])
    assert difficulties(rows=1, difficulty_range=(0.4, 0.9)) == [0.4]


def test_difficulty_jitter_is_a_fraction_of_the_difference_between_rows():
    # The second row is at 0.2 + 0.05, a step is 0.05, half of it 0.025.
    config = {"rows": 5, "cols": 40, "difficulty_range": (0.2, 0.4)}
    second = [level for _, level in drawn(MapConfig(difficulty_jitter=0.5, **config))[1]]
    assert len(set(second)) == 40
    assert 0.225 <= min(second) < 0.23
    assert 0.27 < max(second) <= 0.275
    # The same numbers are drawn, and scaled afterward.
    whole = [level for _, level in drawn(MapConfig(difficulty_jitter=1.0, **config))[1]]
    assert [2 * (level - 0.25) for level in second] == pytest.approx([n - 0.25 for n in whole])


@pytest.mark.parametrize("config", [{"difficulty_jitter": 0.5}, {"mode": "randomized"}])
def test_random_layout_is_seeded(config):
    one, other = (MapConfig(seed=seed, **config) for seed in (1, 2))
    assert drawn(one) == drawn(one)
    assert drawn(one) != drawn(other)


def test_randomized_mode_follows_proportions_and_difficulties():
    config = MapConfig(
        mode="randomized",
        rows=40,
        cols=40,
        random_difficulties=(0.1, 0.6),
        terrains=mix(flat=3, gap=1, pit=0),
    )
    patches = [patch for row in drawn(config) for patch in row]
    kinds, levels = (Counter(values) for values in zip(*patches, strict=True))
    # 1600 draws at 3/4: 1200, with a standard deviation of 17.
    assert 1130 < kinds[0] < 1270
    assert kinds[2] == 0
    assert set(levels) == {0.1, 0.6}
    assert min(levels.values()) > 700


def test_randomized_mode_needs_no_columns():
    """Neither custom terrains nor those of a preset are an error or a warning."""
    small = {"mode": "randomized", "rows": 20, "cols": 1, "border": 0.0}
    terrain_map = generate(MapConfig(terrains=mix(flat=1, gap=1), **small))
    assert set(terrain_map.terrain_types.flat) == {0, 1}
    assert len(set(generate(MapConfig(**small)).terrain_types.flat)) > 2


def test_selected_mode_is_constant():
    config = MapConfig(mode="selected", selected_difficulty=0.3, terrains=mix(pit=1))
    assert drawn(config) == [[(0, 0.3)] * 10] * 10
