import numpy as np
import pytest

from terrainkit.integrations.mujoco import make_spec
from terrainkit.terrains.staircase import Staircase
from tests.rays import cast_rays
from tests.terrains import GRID, goals_of, map_at, solids_of


def profile_of(terrain_map, x, y):
    """Return the highest surface at points along x [m], by rays of MuJoCo."""
    starts = np.column_stack([x, np.full(len(x), y), np.full(len(x), 9.0)])
    return cast_rays(make_spec(terrain_map).compile(), starts)[0]


@pytest.mark.parametrize("risers", ["closed", "open"])
@pytest.mark.parametrize("difference", [0.0, 0.03])
def test_staircase_rays_measure_its_description(risers, difference):
    parameters = {"riser": 0.19, "going": 0.257, "risers": risers, "riser_difference": difference}
    terrain_map = map_at(1.0, "staircase", number=5, handrail=0.92, **parameters)
    x = np.arange(1.9, 7.0, 0.001)
    z = profile_of(terrain_map, x, 4.0)
    change = np.flatnonzero(np.abs(np.diff(z)) > 0.01)
    up, down = np.split(np.diff(z)[change], 2)
    assert len(up) == 6
    assert np.ptp(up) == pytest.approx(difference, abs=1e-4)
    assert down == pytest.approx(-up[::-1], abs=1e-4)
    edges = 2.0 + 0.257 * np.arange(6)
    assert x[change[:6]] == pytest.approx(edges, abs=0.0011)
    flight = Staircase(number=5, **parameters).flight(GRID)
    assert (flight.riser, flight.going, flight.number) == (0.19, 0.257, 5)
    assert flight.opening == pytest.approx(0.15 if risers == "open" else 0.0)
    # The handrail is above the edge of the steps, over the line of the nosings.
    rail = profile_of(terrain_map, 2.0 + 0.257 * np.array([1.0, 2.5]), 4.0 - 1.16 / 2)
    expected = 0.19 * np.array([2.0, 3.5]) + 0.92
    assert rail == pytest.approx(expected, abs=1e-3 + difference / 2)


@pytest.mark.parametrize(
    ("shape", "treads", "heading"),
    [("half_turn", 8, np.pi), ("quarter_turn", 8, np.pi / 2), ("winders", 11, np.pi / 2)],
)
def test_staircase_ends_on_a_landing_at_its_top(shape, treads, heading):
    stairs = Staircase(riser=0.2, going=0.25, number=4, shape=shape)
    goals = goals_of(stairs)
    landings = treads // 4 if shape != "winders" else 1
    assert len(goals) == landings
    assert goals[-1, 2:] == pytest.approx([0.2 * (treads + landings), heading])
    lower, upper = solids_of(stairs).bounds()
    assert ((lower[:, :2] >= 0.0) & (upper[:, :2] <= 8.0)).all()


def test_staircase_curve_has_its_going_in_the_middle():
    stairs = Staircase(riser=0.2, going=0.3, number=5, shape="curved", width=1.0, inner_radius=0.98)
    terrain_map = map_at(1.0, "staircase", **stairs.requested())
    # With handrails the steps are 1.04 m wide, so a tread is 0.3 m / 1.5 m = 0.2 rad.
    angle = 0.2 * (np.arange(5) + 0.5) - np.pi / 2
    center = stairs.spawn(GRID)[1] + 1.5
    xy = np.column_stack([2.0 + 1.5 * np.cos(angle), center + 1.5 * np.sin(angle)])
    points = np.column_stack([xy, np.full(5, 9.0)])
    assert terrain_map.scan(points, "down") == pytest.approx(0.2 * np.arange(1, 6), abs=1e-4)


def test_staircase_walls_leave_the_width_free():
    terrain_map = map_at(1.0, "staircase", width=1.0, wall=1.0, number=3)
    y = np.array([4 - 0.499, 4 - 0.501, 4 + 0.499, 4 + 0.501])
    z = terrain_map.scan(np.column_stack([np.full(4, 2.2), y, np.full(4, 9.0)]), "down")
    assert (z > 1.0).tolist() == [False, True, False, True]


def test_staircase_has_as_many_treads_as_fit():
    # A start of 2 m, a landing of 1 m, and the handrails' margin of 0.1 m leave 4.9 m of 8 m.
    fits = {"going": 0.3, "landing": 1.0}
    assert Staircase(number=30, **fits).flight(GRID).number == 8
    assert Staircase(number=3, **fits).flight(GRID).number == 3
