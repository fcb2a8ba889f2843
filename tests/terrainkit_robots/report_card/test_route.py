import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, make_patch
from terrainkit_robots.report_card.route import Routes, patch_routes
from terrainkit_robots.rl.config import Commands

COMMANDS = Commands(lin_vel_x=(-1, 1), ang_vel_yaw=(-0.8, 0.8))


def make(terrain, size=(8.0, 8.0), **parameters):
    sub_terrain = SubTerrain(terrain=terrain, parameters=parameters)
    config = MapConfig(rows=1, cols=1, patch_size=size, border=0, terrains=(sub_terrain,))
    return make_patch(config, 0, 0)


def test_routes_lead_to_all_sides_from_the_center():
    routes = np.concatenate(patch_routes(make("pyramid_slope")))
    assert routes[np.lexsort(routes.T)].round(3).tolist() == [[4, 0], [0, 4], [8, 4], [4, 8]]


def test_routes_lead_to_the_end_of_a_lane():
    (route,) = patch_routes(make("stairs", size=(8.0, 4.0)))
    assert route.round(3).tolist() == [[8, 2]]


def test_routes_follow_goals():
    patch = make("hurdles")
    (route,) = patch_routes(patch)
    np.testing.assert_allclose(route, patch.goals[:, :2])


@pytest.mark.parametrize(
    ("yaw", "command"),
    [
        (0.0, (0.75, 0, 0)),  # ahead
        (0.5, (0.75 * np.cos(0.5), 0, -0.5)),  # a little to the right
        (np.pi / 2, (0, 0, -0.8)),  # to the right: it turns first
        (np.pi - 0.1, (0, 0, -0.8)),  # behind
    ],
)
def test_commands_turn_to_the_goal_and_walk_ahead(yaw, command):
    routes = Routes(goals=np.array([[[5.0, 1.0]]]), index=np.zeros(1, np.int64))
    got = routes.commands(np.array([[2.0, 1.0]]), np.array([yaw]), COMMANDS)
    np.testing.assert_allclose(got[0], command, atol=1e-6)


def test_goals_are_reached_in_their_order():
    nan = np.nan
    goals = np.array([[[1.0, 0.0], [2.0, 0.0]], [[1.0, 0.0], [nan, nan]]])
    routes = Routes(goals=goals, index=np.zeros(2, np.int64))
    assert routes.lengths(np.array([[0.0, 0.0], [1.0, 1.0]])).tolist() == [2.0, 1.0]
    assert routes.update(np.array([[2.0, 0.0], [0.5, 0.0]])).tolist() == [False, False]
    assert routes.update(np.array([[0.7, 0.0], [0.7, 0.0]])).tolist() == [False, True]
    assert routes.update(np.array([[1.61, 0.0], [9.0, 0.0]])).tolist() == [True, True]
