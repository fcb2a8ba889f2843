import mujoco
import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.geometry.grid import Grid
from terrainkit.terrains.ladder import Ladder


@pytest.mark.parametrize(
    ("difficulty", "rungs", "run"), [(0.0, 6, 1.5 / np.tan(1.222)), (1.0, 4, 1.5 / np.tan(1.57))]
)
def test_ladder_rungs_by_hand(difficulty, rungs, run, grid, rng):
    terrain = Ladder.at(difficulty)
    solids = terrain.solids(grid, terrain.build(grid, rng), rng)
    first, second = np.split(solids.cylinders[:, :3].astype(float), 2)
    spacing = 0.25 + 0.1 * difficulty
    assert first[:, 2] == pytest.approx(spacing * np.arange(1, rungs + 1))
    assert first[:, 1] == pytest.approx(4.0)
    # The deck begins at 3 m, and the top of the ladder is 0.15 m in front of it.
    assert first[:, 0] == pytest.approx(2.85 - run * (1 - first[:, 2] / 1.5))
    assert second == pytest.approx(first * [-1, 1, 1] + [8, 0, 0], abs=1e-5)
    assert len(solids.boxes) == 4


def test_ladder_rails_stand_on_the_ground_and_reach_the_deck(tmp_path):
    config = MapConfig(rows=2, cols=1, border=0.0, terrains=(SubTerrain(terrain="ladder"),))
    terrain_map = generate(config)
    for row, run in ((0, 1.5 / np.tan(1.222)), (1, 1.5 / np.tan(1.57))):
        x = 8.0 * row + np.array([2.85 - run * 0.9, 2.85 - run * 0.1])
        for y in (4.0 - 0.325, 4.0 + 0.325):
            # Rays along x meet the rail at the height of its axis.
            model = mujoco.MjModel.from_xml_path(str(terrain_map.save(tmp_path / f"{row}{y}.xml")))
            data, geom = mujoco.MjData(model), np.zeros(1, np.int32)
            mujoco.mj_forward(model, data)
            for z, expected in zip((0.15, 1.35), x, strict=True):
                start = np.array([8.0 * row + 0.5, y, z])
                distance = mujoco.mj_ray(
                    model, data, start, [1.0, 0.0, 0.0], None, 1, -1, geom, np.zeros(3)
                )
                assert start[0] + distance == pytest.approx(expected, abs=0.04)


def test_ladder_goals_are_on_the_deck_and_behind_it():
    config = MapConfig(rows=1, cols=1, border=0.0, terrains=(SubTerrain(terrain="ladder"),))
    goals = generate(config).patch(0, 0).goals
    assert goals == pytest.approx(np.array([[4.0, 4.0, 1.5, 0.0], [6.5, 4.0, 0.0, 0.0]]))


@pytest.mark.parametrize(
    "values",
    [{"angle": 1.6}, {"angle": 5e-324}, {"angle": 0.4}, {"rung_spacing": 1.6}, {"distance": 3.0}],
)
def test_ladder_rejects_ladder_that_does_not_fit(values, grid, rng):
    with pytest.raises(
        ConfigError, match=r"ladder: got angle .* expected an angle of 0.5 rad to 1.57 rad"
    ):
        Ladder.at(0.0, values).solids(grid, np.zeros(grid.shape, np.float32), rng)


def test_ladder_rejects_patch_without_deck(rng):
    with pytest.raises(ConfigError, match="two landings of 3 m leave no deck in a patch 6 m long"):
        Ladder.at(0.0).build(Grid(shape=(60, 60), cell=0.1), rng)
