import dataclasses

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.feasibility import assess_map
from terrainkit.integrations.mujoco import make_spec
from terrainkit.map.validate import validate
from terrainkit.terrains.building import Building
from tests.limits import LIMITS
from tests.rays import cast_rays
from tests.terrains import GRID, goals_of, map_at, solids_of


def surfaces(terrain_map, point):
    """Return the first surface below and above a point, by rays and by the height scan."""
    model = make_spec(terrain_map).compile()
    rays = [cast_rays(model, [point], sign)[0][0] for sign in (-1, 1)]
    scan = [terrain_map.scan(np.array([point]), way)[0] for way in ("down", "up")]
    assert rays == pytest.approx(scan, abs=1e-4, nan_ok=True)
    return rays


def test_building_scans_answer_floor_by_floor():
    terrain_map = map_at(1.0, "building", storeys=3, riser=0.17)
    *_, (x, y, _, _) = terrain_map.patch(0, 0).goals.tolist()
    # A storey is 16 x 0.17 m = 2.72 m high, with floors of 0.2 m. The top one has no roof.
    assert surfaces(terrain_map, [x, y, 1.0]) == pytest.approx([0.0, 2.52], abs=1e-4)
    assert surfaces(terrain_map, [x, y, 3.5]) == pytest.approx([2.72, 5.24], abs=1e-4)
    floor, sky = surfaces(terrain_map, [x, y, 6.5])
    assert floor == pytest.approx(5.44, abs=1e-4)
    assert np.isnan(sky)
    assert terrain_map.clearance(np.array([[x, y]])) == pytest.approx(2.52, abs=1e-4)


def test_building_doors_have_lintels_and_sills():
    size = {"door": 0.9, "door_height": 1.9, "sill": 0.04, "thickness": 0.2}
    terrain_map = map_at(1.0, "building", **size)
    x, y = terrain_map.patch(0, 0).goals[0, :2].tolist()
    # The entrance is at x = 1.6 m, in a wall of 0.2 m.
    assert x == pytest.approx(1.8 + 0.35)
    assert surfaces(terrain_map, [1.7, y, 1.0]) == pytest.approx([0.04, 1.9], abs=1e-4)
    assert terrain_map.clearance([1.7, y]) == pytest.approx(1.86, abs=1e-4)
    for side in (-1, 1):
        assert surfaces(terrain_map, [1.7, y + side * 0.449, 1.0])[0] == pytest.approx(0.04)
        assert surfaces(terrain_map, [1.7, y + side * 0.451, 9.0])[0] > 4.0


@pytest.mark.parametrize("storeys", [1, 2, 3, 4])
def test_building_goals_lead_to_a_room_on_the_top_storey(storeys):
    for seed in range(20):
        goals = goals_of(Building(storeys=storeys, riser=0.17), seed)
        top = (storeys - 1) * 2.72
        assert goals[-1, 2] == pytest.approx(top) if storeys > 1 else np.isnan(goals[-1, 2])
        assert np.nan_to_num(goals[:, 2]).tolist() == sorted(np.nan_to_num(goals[:, 2]))


def test_building_is_passable_to_the_upper_floor():
    terrain_map = map_at(1.0, "building", riser=0.17)
    (result,) = assess_map(terrain_map, LIMITS)
    assert (result.limit, result.demand) == ("step_up", pytest.approx(0.17 / 0.2, abs=1e-3))
    assert result.path[-1, 2] == pytest.approx(2.72, abs=1e-4)


def test_building_layout_is_the_same_on_all_rows_of_a_column():
    config = MapConfig(rows=3, cols=3, border=0.0, terrains=(SubTerrain(terrain="building"),))
    goals = generate(config).goals
    number = (~np.isnan(goals[..., 0])).sum(axis=-1)
    assert (number == number[0]).all()
    # The rooms move with the width of the corridor and the stairs.
    moved = np.ptp(
        goals[..., :2] - 8.0 * np.array([[[1.0, 0.0]]]) * np.arange(3)[:, None, None, None], axis=0
    )
    assert np.nanmax(moved) < 1.0
    assert not np.allclose(goals[0, 0, -1], goals[0, 1, -1] - [0, 8, 0, 0], equal_nan=True)


def test_building_spawns_are_on_every_floor():
    config = MapConfig(
        rows=1, cols=2, patch_size=(12.0, 10.0), border=1.0, spawns_per_patch=16, spawn_radius=0.4,
        terrains=(SubTerrain(terrain="building", parameters={"storeys": 3, "riser": 0.17}),),
    )  # fmt: skip
    terrain_map = generate(config)
    assert not validate(terrain_map)
    for col in range(2):
        z = terrain_map.patch(0, col).spawns[:, 2]
        assert {round(float(each), 2) for each in z} == {0.0, 2.72, 5.44}
    # They stay there after an edit elsewhere.
    heights = terrain_map.heights.copy()
    heights[0, 0] += 1.0
    edited = terrain_map.edited(heights=heights)
    assert edited.spawns == pytest.approx(terrain_map.spawns, nan_ok=True)
    moved = dataclasses.replace(terrain_map, spawns=terrain_map.spawns + np.array([0, 0, 0.1, 0]))
    assert any("above the ground" in str(issue) for issue in validate(moved))


def test_building_describes_its_flights():
    flight = Building(storeys=3, riser=0.17).flight(GRID)
    # The upper stairs are a riser and 0.12 m thick.
    assert flight.headroom == pytest.approx(2.72 - 0.29)
    assert len(solids_of(Building.at(1.0))) <= 100
