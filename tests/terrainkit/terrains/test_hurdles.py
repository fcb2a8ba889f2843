import numpy as np
import pytest

import terrainkit
from terrainkit.errors import ConfigError
from terrainkit.terrains.hurdles import Hurdles


def edges_of(is_hurdle):
    """Return the first cell of each hurdle, and the first cell behind it."""
    padded = np.concatenate([[False], is_hurdle, [False]]).astype(int)
    return np.flatnonzero(np.diff(padded) == 1), np.flatnonzero(np.diff(padded) == -1)


@pytest.mark.parametrize("seed", range(5))
def test_hurdles_have_random_thickness_and_spacing(grid, seed):
    ground = Hurdles.at(0.5).build(grid, np.random.default_rng(seed))
    assert (ground == ground[:, :1]).all()
    assert set(ground.ravel().tolist()) == {0.0, np.float32(0.275)}
    first, last = edges_of(ground[:, 0] > 0)
    # Slots of 1.7 m: three behind a start of 2 m.
    assert len(first) == 3
    assert first[0] >= 20
    assert set((last - first).tolist()) <= {1, 2, 3, 4}
    spacing = np.diff((first + last) / 2) * grid.cell
    assert ((spacing > 1.2 - grid.cell) & (spacing < 2.2 + grid.cell)).all()


def test_hurdles_are_the_same_at_every_difficulty(grid):
    low, high = (Hurdles.at(d).build(grid, np.random.default_rng(0)) for d in (0.0, 1.0))
    assert (high == low * 10).all()


@pytest.mark.parametrize("seed", range(5))
def test_hurdles_goals_lie_behind_the_hurdles(grid, seed):
    terrain = Hurdles.at(1.0)
    ground = terrain.build(grid, np.random.default_rng(seed))
    goals = terrain.goals(grid, ground, np.random.default_rng(0))
    first, last = edges_of(ground[:, 0] > 0)
    assert (goals[:, 0] > last * grid.cell).all()
    assert (goals[:-1, 0] < first[1:] * grid.cell).all()
    assert (goals[:, 1] == 4.0).all()


def test_hurdles_rejects_hurdles_that_touch(grid, rng):
    with pytest.raises(ConfigError, match=r"hurdles: got hurdles 1.3 m long"):
        Hurdles.at(0.5, {"max_thickness": 1.3}).build(grid, rng)


@pytest.mark.parametrize("seed", range(5))
def test_round_hurdles_are_walls_below_pipes(grid, seed):
    terrain = Hurdles.at(1.0, {"top": "round"})
    flat = Hurdles.at(1.0).build(grid, np.random.default_rng(seed))
    ground = terrain.build(grid, np.random.default_rng(seed))
    first, last = edges_of(flat[:, 0] > 0)
    radius = (last - first) * grid.cell / 2
    np.testing.assert_allclose(ground[first, 0], 0.5 - radius, atol=1e-6)
    assert ((ground > 0) == (flat > 0)).all()
    pipes = terrain.solids(grid, ground, np.random.default_rng(0))
    assert len(pipes) == len(pipes.cylinders) == len(first)
    center, half_size = pipes.cylinders[:, :3], pipes.cylinders[:, 3:6]
    np.testing.assert_allclose(center[:, 0], (first + last) * grid.cell / 2, atol=1e-6)
    np.testing.assert_allclose(center[:, 2] + radius, 0.5, atol=1e-6)
    np.testing.assert_allclose(half_size.T, [radius, radius, 4.0 + 0 * radius], atol=1e-6)


def test_surface_of_a_round_hurdle_by_hand():
    values = {"height": 0.5, "min_thickness": 0.4, "max_thickness": 0.4, "top": "round"}
    terrain = terrainkit.SubTerrain(terrain="hurdles", parameters=values)
    config = terrainkit.MapConfig(rows=1, cols=1, border=0.0, cell=0.1, terrains=(terrain,))
    terrain_map = terrainkit.generate(config)
    x = float(terrain_map.solids.cylinders[0, 0])
    # A circle of radius 0.2 m around (x, 0.3 m), above a wall 0.3 m high.
    rays = np.array([(x + dx, y, 5.0) for dx in (0.0, 0.12, -0.16) for y in (0.05, 7.95)])
    expected = np.repeat([0.5, 0.46, 0.42], 2)
    np.testing.assert_allclose(terrain_map.scan(rays), expected, atol=1e-5)


def test_round_hurdles_reject_pipes_that_are_too_thick(grid, rng):
    with pytest.raises(ConfigError, match=r"got a height of 0.05 m; expected more than half"):
        Hurdles.at(0.0, {"top": "round", "min_thickness": 0.4}).build(grid, rng)
