import numpy as np
import pytest

from terrainkit.feasibility import assess_map
from terrainkit.terrains.street import Street
from tests.limits import LIMITS
from tests.terrains import GRID, goals_of, map_at, solids_of, tops


def test_street_leads_up_the_steps_to_the_door():
    size = {"curb": 0.1, "riser": 0.15, "going": 0.3, "steps": 3, "step_width": 1.4, "door": 1.0}
    terrain_map = map_at(1.0, "street", **size)
    goals = terrain_map.patch(0, 0).goals
    y = goals[1, 1]
    # The wall is 0.2 m thick, the landing 1 m long, and two treads of 0.3 m are in front of it.
    x = np.array([6.19, 6.21, 6.49, 6.51, 6.79, 6.81, 7.79])
    z = [0.1, 0.25, 0.25, 0.4, 0.4, 0.55, 0.55]
    for side in (-0.69, 0.0, 0.69):
        assert tops(terrain_map, x, y + side) == pytest.approx(z, abs=1e-4)
    assert goals[:, 2] == pytest.approx([0.1, 0.55])
    assert tops(terrain_map, 7.0, y + np.array([-0.71, 0.71])) == pytest.approx(0.1)
    inside = np.array([[7.9, y + 0.49, 1.0], [7.9, y + 0.51, 1.0]], float)
    assert terrain_map.scan(inside, "down")[0] == pytest.approx(0.55, abs=1e-4)
    assert terrain_map.scan(inside, "up")[0] == pytest.approx(2.55, abs=1e-4)
    assert tops(terrain_map, 7.9, y) == pytest.approx(3.05, abs=1e-4)


def test_street_boxes_stand_at_the_house_beside_the_steps():
    for seed in range(5):
        street = Street(trees=0.0)
        lower, upper = solids_of(street, seed).bounds()
        size, y = upper - lower, goals_of(street, seed)[1, 1]
        is_box = (upper[:, 0] < 7.801) & (size[:, :2] <= 0.801).all(axis=1) & (lower[:, 2] > 0.0)
        assert is_box.sum() == 3
        assert upper[is_box, 0] == pytest.approx(7.8)
        assert np.abs((lower + upper)[is_box, 1] / 2 - y).min() == pytest.approx(2.0)
    assert len(solids_of(Street.at(0.0, {"trees": 1.0}), 0, GRID)) <= 150


def test_street_is_passable_to_the_door():
    terrain_map = map_at(1.0, "street")
    (result,) = assess_map(terrain_map, LIMITS)
    assert result.demand == pytest.approx(0.178 / 0.2, abs=1e-3)
    assert result.path[-1, 2] == pytest.approx(0.15 + 3 * 0.178, abs=1e-4)
