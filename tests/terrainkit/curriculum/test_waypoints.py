import numpy as np
import pytest

from terrainkit.curriculum.waypoints import PROMOTION, Waypoints, route_lengths
from tests.tables import read_table

NONE = [np.nan, np.nan]


def make(*goals, radius=0.4):
    return Waypoints(goals=np.array(goals, float), index=np.zeros(len(goals), int), radius=radius)


@pytest.mark.parametrize(("yaw", "command"), read_table(__file__, "waypoints_commands_turn"))
def test_waypoints_commands_turn_to_the_goal_and_walk_ahead(yaw, command):
    got = make([[5.0, 1.0]]).commands(
        np.array([[2.0, 1.0]]), np.array([yaw]), 0.75, 1.0, (-0.8, 0.8)
    )
    np.testing.assert_allclose(got[0], command, atol=1e-6)


def test_waypoints_goals_are_reached_in_their_order():
    waypoints = make([[1.0, 0.0], [2.0, 0.0]], [[1.0, 0.0], NONE])
    assert waypoints.update(np.array([[2.0, 0.0], [0.5, 0.0]])).tolist() == [False, False]
    assert waypoints.progress.tolist() == [0.0, 0.0]
    assert waypoints.update(np.array([[0.7, 0.0], [0.7, 0.0]])).tolist() == [False, True]
    assert waypoints.progress.tolist() == [0.5, 1.0]
    assert waypoints.update(np.array([[1.61, 0.0], [9.0, 0.0]])).tolist() == [True, True]
    waypoints.reset(np.array([0]), np.array([[[5.0, 5.0], NONE]]))
    assert waypoints.index.tolist() == [0, 1]


def test_waypoints_robot_without_goals_never_arrives():
    waypoints = Waypoints.make(1, 2, 0.4)
    assert (waypoints.goals.shape, waypoints.radius) == ((1, 2, 2), 0.4)
    assert not waypoints.update(np.zeros((1, 2))).any()
    assert np.isnan(waypoints.progress).all()
    got = waypoints.commands(np.zeros((1, 2)), np.zeros(1), 1.0, 1.0, (-1.0, 1.0))
    assert np.isnan(got).all()


@pytest.mark.parametrize(
    ("reached", "fallen", "commanded", "progress"),
    read_table(__file__, "waypoints_progress_of_episodes"),
)
def test_waypoints_progress_of_episodes(reached, fallen, commanded, progress):
    waypoints = make([[2.0 * k, 0.0] for k in range(1, 6)], [NONE] * 5)
    waypoints.index[0] = reached
    got = waypoints.of_episodes(
        np.arange(2), np.array([fallen, False]), np.zeros((2, 2)), np.full(2, commanded)
    )
    assert PROMOTION == 0.8
    assert got.tolist() == pytest.approx([progress, np.nan], nan_ok=True)


def test_route_lengths_start_at_the_robot():
    goals = np.array([[[1.0, 0.0], [2.0, 0.0]], [[1.0, 0.0], [np.nan, np.nan]]])
    lengths = route_lengths(np.array([[0.0, 0.0], [1.0, 1.0]]), goals)
    assert np.nanmax(lengths, axis=1).tolist() == [2.0, 1.0]
