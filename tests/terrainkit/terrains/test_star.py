import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrains.star import Star


@pytest.mark.parametrize(
    ("difficulty", "number", "width"), [(0.0, 12, 0.7), (0.5, 6, 0.55), (1.0, 1, 0.4)]
)
@pytest.mark.parametrize("shape", [(80, 80), (80, 40), (73, 51)])
def test_star_beams_reach_from_platform_to_rim(difficulty, number, width, shape):
    cell = 0.1
    config = MapConfig(
        rows=1,
        cols=1,
        patch_size=(shape[0] * cell, shape[1] * cell),
        mode="selected",
        selected_difficulty=difficulty,
        border=0.0,
        terrains=(SubTerrain(terrain="star"),),
    )
    terrain_map = generate(config)
    boxes = terrain_map.solids.boxes.astype(float)
    assert len(boxes) == number
    assert 2 * boxes[:, 4] == pytest.approx(width)
    yaw = 2 * np.arctan2(boxes[:, 9], boxes[:, 6])
    center = np.array(terrain_map.grid.center)
    for angle in yaw:
        # A walk along the beam meets no pit, also along its sides where the patch is square.
        along, across = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        half = np.array(terrain_map.grid.size) / 2 - 0.05
        for side in (-1, 0, 1) if shape[0] == shape[1] else (0,):
            start = center + side * (width / 2 - 0.01) * across
            reach = ((half - np.sign(along) * (start - center)) / np.abs(along)).min()
            xy = start + np.linspace(0.0, reach, 200)[:, None] * along
            top = terrain_map.scan(np.column_stack([xy, np.full(200, 2.0)]), "down")
            assert top == pytest.approx(0.0, abs=1e-6)


def test_star_pit_by_hand(grid, rng):
    ground = Star.at(1.0).build(grid, rng)
    expected = np.zeros(grid.shape)
    expected[5:-5, 5:-5] = -1.0
    expected[30:50, 30:50] = 0.0
    assert (ground == expected).all()


def test_star_rejects_beams_wider_than_the_rim(grid, rng):
    with pytest.raises(ConfigError, match=r"star: got width 0.8 m; expected at most 0.707 m"):
        Star.at(0.0, {"width": 0.8}).solids(grid, np.zeros(grid.shape, np.float32), rng)


def test_star_rejects_patch_without_pit(rng):
    with pytest.raises(ConfigError, match=r"star: got a rim of 0.5 m .* a patch of 8 m x 3 m"):
        Star.at(0.0).build(Grid(shape=(80, 30), cell=0.1), rng)
