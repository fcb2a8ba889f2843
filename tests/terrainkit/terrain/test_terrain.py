import math
from dataclasses import dataclass

import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrain import FlatTerrain, Terrain, parameter
from tests.tables import read_table
from tests.terrains import goals_of, heights_of, solids_of


@dataclass(frozen=True, kw_only=True)
class Mesa(Terrain):
    height: float = parameter.height(0.5, 1.0)
    platform: float = parameter.platform(2.0)

    def heights(self, grid, rng):  # noqa: ARG002
        return np.full(grid.shape, self.height)


GRID = Grid(shape=(40, 20), cell=0.1, lower=(3.0, -1.0))


@pytest.mark.parametrize(
    ("shape", "side", "problem"), read_table(__file__, "block_that_does_not_fit_is_rejected")
)
def test_block_that_does_not_fit_is_rejected(shape, side, problem):
    grid, mesa = Grid(shape=tuple(shape), cell=0.1), Mesa(platform=side)
    if not problem:
        assert (heights_of(mesa, grid=grid) == 1.0).all()
    else:
        with pytest.raises(ConfigError, match=f"^mesa: platform {side:g} m {problem}$"):
            heights_of(mesa, grid=grid)


@pytest.mark.parametrize("difficulty", [-0.01, 1.01, math.nan])
def test_difficulty_out_of_range_is_rejected(difficulty):
    message = rf"^mesa\.difficulty: got {difficulty:g}; expected a number from 0 to 1$"
    with pytest.raises(ConfigError, match=message):
        Mesa.at(difficulty)


def test_terrain_takes_values_and_ranges():
    values = {"height": (2.0, 4.0), "platform": 3}
    assert Mesa.at(0.5, values) == Mesa(height=3.0, platform=3.0)
    assert Mesa.at(0.0) == Mesa(height=0.5)
    with pytest.raises(ConfigError, match=r"^mesa has no parameter 'hight'; did you mean 'he"):
        Mesa.at(0.0, {"hight": 1.0})


def test_heights_of_wrong_shape_are_rejected():
    @dataclass(frozen=True, kw_only=True)
    class Turned(Mesa):
        def heights(self, grid, rng):
            return super().heights(grid, rng).T

    message = r"^turned: heights\(\): got shape \(20, 40\); expected \(40, 20\) with values up to"
    with pytest.raises(ConfigError, match=message):
        heights_of(Turned(), grid=GRID)


def test_terrain_has_no_solids_and_no_goals_and_spawns_in_the_center_by_default():
    assert (len(solids_of(Mesa())), goals_of(Mesa()).shape) == (0, (0, 4))
    assert Mesa().spawn(GRID) == pytest.approx((5.0, 0.0))
    assert (Mesa.has_random_heights, FlatTerrain.has_random_heights) == (True, False)
    assert (Mesa.has_column_seed, FlatTerrain.has_column_seed) == (False, False)
