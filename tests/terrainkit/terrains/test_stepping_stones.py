import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.map.measured_difficulty import measured_difficulty
from terrainkit.terrains.stepping_stones import SteppingStones


def runs(line):
    """Return the lengths of the runs of True in `line` that do not touch its ends, in cells."""
    edges = np.flatnonzero(np.diff(line.astype(int)))
    lengths = np.diff(edges)
    return lengths[::2] if not line[0] else lengths[1::2]


def build(grid, seed=0, **parameters):
    return SteppingStones(**parameters).build(grid, np.random.default_rng(seed))


def test_stepping_stones_rows_are_equidistant(grid):
    heights = build(grid, stone=0.5, distance=0.3)
    holes = (heights[:, :20] < 0).all(axis=1)  # beside the platform, from 2.0 to 6.0 m
    assert np.flatnonzero(~holes).tolist() == [k for k in range(80) if k % 8 < 5]


def test_stepping_stones_have_requested_width_and_distance(grid):
    stones = build(grid, stone=0.5, distance=0.3)[:20] == 0
    for row in (0, 8, 16):
        assert set(runs(stones[row])) == {5}
        assert set(runs(~stones[row])) == {3}


def test_stepping_stones_are_square(grid):
    stones = build(grid, stone=0.5, distance=0.3)[:20] == 0
    assert all((stones[k] == stones[0]).all() for k in range(5))
    assert all((stones[8 + k] == stones[8]).all() for k in range(5))


def test_stepping_stones_rows_have_random_offsets(grid):
    stones = build(grid, stone=0.5, distance=0.3, platform=0.2) == 0
    assert len({stones[8 * row].tobytes() for row in range(10)}) > 3


def test_stepping_stones_heights_by_hand(grid):
    assert np.unique(build(grid, stone=0.5, distance=0.3)).tolist() == [-10.0, 0.0]
    assert np.unique(build(grid, stone=0.5, distance=0.3, depth=2.5)).tolist() == [-2.5, 0.0]


def test_stepping_stones_variation_differs_by_stone(grid):
    heights = build(grid, stone=0.5, distance=0.3, variation=0.1, platform=0.2)
    tops = heights[heights > -1]
    assert np.abs(tops).max() <= 0.1
    assert np.ptp(tops) > 0.1
    first = heights[:5][:, heights[0] > -1]
    assert np.ptp(first, axis=0).max() == 0.0
    # Ten rows of ten stones or eleven, and the platform.
    assert 100 <= len(np.unique(tops)) <= 111


@pytest.mark.parametrize(("shape", "sides"), [((80, 80), (40, 40)), ((73, 51), (41, 41))])
def test_stepping_stones_platform_is_level_and_centered(shape, sides):
    heights = build(Grid(shape=shape, cell=0.1), stone=0.3, distance=0.4, variation=0.05)
    x, y = ((n - side) // 2 for n, side in zip(shape, sides, strict=True))
    assert not heights[x : x + sides[0], y : y + sides[1]].any()
    assert (heights[x - 1] != 0).all()
    assert (heights[:, y - 1] != 0).all()


def test_stepping_stones_platform_as_wide_as_patch():
    heights = build(Grid(shape=(80, 40), cell=0.1), platform=4.0)
    assert not heights[20:60].any()
    assert heights[:20].min() == -10.0


@pytest.mark.parametrize(
    ("difficulty", "asked", "built"),
    [
        # Stones of 1.575 to 0.075 m.
        (0.0, (1.575, 0.1), (1.6, 0.1)),
        (0.5, (0.825, 0.1), (0.8, 0.1)),
        (1.0, (0.075, 0.1), (0.1, 0.1)),
    ],
)
def test_stepping_stones_shrink_with_difficulty(difficulty, asked, built, grid):
    terrain = SteppingStones.at(difficulty)
    assert (terrain.stone, terrain.distance) == pytest.approx(asked)
    realized = terrain.realized(grid)
    assert (realized["stone"], realized["distance"]) == built
    pitch = round((built[0] + built[1]) / 0.1)
    rows = (terrain.build(grid, np.random.default_rng(0))[:20, :20] == 0).any(axis=1)
    first, *_ = holes = np.flatnonzero(~rows).tolist()
    assert first < pitch
    assert holes == list(range(first, 20, pitch))


@pytest.mark.parametrize("cell", [0.05, 0.1, 0.2])
@pytest.mark.parametrize("size", [(8.0, 8.0), (8.0, 4.0), (7.3, 5.1), (10.0, 6.0)])
@pytest.mark.parametrize("platform", [2.0, 3.0])
def test_stepping_stones_are_never_easier_than_before(cell, size, platform):
    grid = Grid(shape=tuple(round(side / cell) for side in size), cell=cell)
    levels = [SteppingStones.at(row / 9, {"platform": platform}) for row in range(10)]
    for seed in range(3):  # of a column
        grounds = [each.build(grid, np.random.default_rng(seed)) for each in levels]
        hard = [measured_difficulty(ground, cell, 0.0) for ground in grounds]
        assert np.diff(hard).min() >= 0
        assert hard[-1] > 2 * hard[0]


def test_stepping_stones_have_the_holes_of_an_endless_field(grid):
    free = 80 * 80 - 40 * 40
    for seed in range(20):
        holes = (build(grid, seed=seed, stone=0.6, distance=0.3) < 0).sum()
        assert abs(holes - free * (1 - (6 / 9) ** 2)) <= 6 * 3 / 2


@pytest.mark.parametrize(("stone", "distance"), [(0.01, 0.3), (0.5, 0.01)])
def test_stepping_stones_short_length_is_one_cell(stone, distance, grid):
    terrain = SteppingStones(stone=stone, distance=distance)
    realized = terrain.realized(grid)
    assert (realized["stone"], realized["distance"]) == (max(stone, 0.1), max(distance, 0.1))
    stones = build(grid, stone=stone, distance=distance)[:20] == 0
    assert set(runs(stones[0])) == {round(max(stone, 0.1) / 0.1)}
    assert set(runs(~stones[0])) == {round(max(distance, 0.1) / 0.1)}


def test_stepping_stones_platform_larger_than_patch_is_rejected(grid):
    with pytest.raises(ConfigError, match="stepping_stones: platform 9 m does not fit"):
        build(grid, platform=9.0)
