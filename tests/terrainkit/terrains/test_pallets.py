import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.features.blocks import SINK
from terrainkit.terrains.pallets import Pallets


def boxes_of(difficulty, grid, seed=0, **values):
    terrain = Pallets.at(difficulty, values)
    heights = np.zeros(grid.shape, np.float32)
    return terrain.solids(grid, heights, np.random.default_rng(seed)).boxes.astype(float)


@pytest.mark.parametrize(("half", "sides"), [(False, (1.2, 0.8, 0.144)), (True, (0.6, 0.4, 0.116))])
def test_pallets_are_a_deck_on_three_runners(half, sides, grid):
    boxes = boxes_of(0.0, grid, half=half, number=1)
    assert len(boxes) == 4
    length, width, height = sides
    runners, deck = boxes[:3], boxes[3]
    assert 2 * deck[3:5] == pytest.approx([length, width])
    assert deck[2] + deck[5] == pytest.approx(height)
    assert deck[2] - deck[5] == pytest.approx(0.7 * height)
    assert runners[:, 2] + runners[:, 5] == pytest.approx(0.7 * height)
    assert runners[:, 2] - runners[:, 5] == pytest.approx(-SINK)
    assert 2 * runners[:, 3] == pytest.approx(length)
    # The outer sides of the outer runners are flush with the deck.
    outer = np.linalg.norm(runners[0, :2] - runners[2, :2]) + 2 * runners[0, 4]
    assert outer == pytest.approx(width)
    assert runners[1, :2] == pytest.approx(deck[:2])


@pytest.mark.parametrize("seed", range(5))
def test_pallets_stacks_grow_at_the_same_places(seed, grid):
    easy, hard = (boxes_of(d, grid, seed) for d in (0.0, 1.0))
    stacks = np.unique(easy[:, :2].round(4), axis=0)
    assert len(easy) == 4 * 6
    assert {tuple(xy) for xy in hard[:, :2].round(4)} == {tuple(xy) for xy in stacks}
    levels = (hard[:, 2] + hard[:, 5]).round(4)
    assert set(levels) <= {round(0.144 * (n + part), 4) for n in range(3) for part in (0.7, 1.0)}


def test_pallets_openings_are_free_between_the_runners():
    config = MapConfig(
        rows=1,
        cols=1,
        mode="selected",
        selected_difficulty=0.0,
        border=0.0,
        terrains=(SubTerrain(terrain="pallets", parameters={"number": 1}),),
    )
    terrain_map = generate(config)
    first, middle, _ = terrain_map.solids.boxes[:3].astype(float)
    opening = (first[:2] + middle[:2]) / 2
    (intervals,) = terrain_map.intervals(opening[None])
    assert intervals == pytest.approx(np.array([[0.0, 0.1008], [0.144, np.inf]]), abs=1e-6)


def test_pallets_rejects_patch_without_space(grid):
    with pytest.raises(ConfigError, match="pallets: got a platform of 6 m"):
        boxes_of(0.0, grid, platform=6.0)
