"""Progress along commands, with robots whose paths are known."""

import numpy as np
import pytest
import torch

from terrainkit.curriculum import CommandProgress

DT = 0.1
"""Length of a step [s]."""

DISTANCE = 4.0
"""Distance that crosses a patch [m]."""


class Walk:
    """A robot that starts at (10, 20) with a heading, and walks as told."""

    def __init__(self, yaw=0.0):
        self.progress = CommandProgress.zeros(1)
        self.pos, self.yaw = np.array([[10.0, 20.0]]), np.array([yaw])
        self.progress.reset([0], self.pos, self.yaw)

    def go(self, seconds, command, velocity=None, yaw_rate=0.0, turn=None):
        """Walk at `velocity` and `turn`, in the frame of the robot; by default as commanded."""
        velocity = command if velocity is None else velocity
        for _ in range(round(seconds / DT)):
            c, s = np.cos(self.yaw[0]), np.sin(self.yaw[0])
            self.pos = self.pos + DT * np.array([[c, -s], [s, c]]) @ velocity
            self.yaw = self.yaw + DT * (yaw_rate if turn is None else turn)
            rate = np.array([yaw_rate])
            self.progress.update(self.pos, self.yaw, np.array([command]), rate, DT)
        return self

    def share(self, *, fallen=False, left_map=False):
        ended = self.progress.of_episodes([0], [fallen], DISTANCE, left_map=[left_map])
        return float(ended[0])


def test_progress_of_straight_walk_is_integrated():
    walk = Walk(yaw=0.7).go(3, (0.6, 0.8))
    assert walk.progress.along == pytest.approx(3)
    assert walk.progress.commanded == pytest.approx(3)
    assert walk.progress.max_distance == pytest.approx(3)
    assert walk.progress.target_max_distance == pytest.approx(3)
    expected = [3 * np.cos(0.7 + np.arctan2(0.8, 0.6)), 3 * np.sin(0.7 + np.arctan2(0.8, 0.6))]
    assert walk.progress.target[0] == pytest.approx(expected)


def test_crossing_as_commanded_succeeds():
    assert Walk(yaw=-2.0).go(5, (-1.0, 0.0)).share() == 1


def test_slow_crossing_succeeds():
    assert Walk().go(20, (1.0, 0.0), (0.21, 0.0)).share() == 1


def test_slower_walk_is_a_share():
    assert Walk().go(12, (0.5, 0.0), (0.3, 0.0)).share() == pytest.approx(0.6)


def test_standing_before_an_obstacle_fails():
    walk = Walk().go(3, (1.0, 0.0)).go(17, (1.0, 0.0), (0.0, 0.0))
    assert walk.share() == pytest.approx(3 / 20)


def test_drifting_sideways_fails():
    assert Walk().go(10, (0.5, 0.0), (0.0, 1.0)).share() == 0


def test_walking_against_the_command_fails():
    assert Walk().go(10, (0.5, 0.0), (-1.0, 0.0)).share() == 0


def test_sliding_gains_no_more_than_the_command():
    walk = Walk().go(1, (0.5, 0.0), (9.0, 0.0))
    assert walk.progress.along == pytest.approx(0.5)
    assert walk.progress.max_distance == pytest.approx(0.5)


def test_swaying_loses_nothing():
    walk = Walk()
    for _ in range(50):
        walk.go(0.1, (0.2, 0.0), (0.5, 0.0)).go(0.1, (0.2, 0.0), (-0.1, 0.0))
    assert walk.progress.along == pytest.approx(2.0, abs=0.06)


def test_uncommanded_circle_fails():
    """It follows the velocity command in its own frame, but not the straight line."""
    walk = Walk().go(4 * np.pi, (1.0, 0.0), yaw_rate=0.0, turn=1.0)
    assert walk.share() < 0.1


def test_commanded_circle_says_nothing():
    walk = Walk().go(4 * np.pi, (1.0, 0.0), yaw_rate=1.0)
    assert walk.progress.along == pytest.approx(4 * np.pi, rel=0.01)
    assert np.isnan(walk.share())


def test_back_and_forth_as_commanded_says_nothing():
    walk = Walk().go(3, (1.0, 0.0)).go(3, (-1.0, 0.0)).go(3, (1.0, 0.0)).go(3, (-1.0, 0.0))
    assert np.isnan(walk.share())


def test_crossing_and_back_as_commanded_succeeds():
    assert Walk().go(5, (1.0, 0.0)).go(5, (-1.0, 0.0)).share() == 1


def test_standing_as_commanded_says_nothing():
    assert np.isnan(Walk().go(20, (0.0, 0.0)).share())


def test_ignoring_a_short_command_fails():
    assert Walk().go(2, (1.0, 0.0), (0.1, 0.0)).share() == pytest.approx(0.1)


@pytest.mark.parametrize(("seconds", "share"), [(3, 0), (5, 1)])
def test_fall_fails_before_crossing(seconds, share):
    assert Walk().go(seconds, (1.0, 0.0)).share(fallen=True) == share


def test_fall_while_standing_fails():
    assert Walk().go(20, (0.0, 0.0)).share(fallen=True) == 0


@pytest.mark.parametrize(("velocity", "share"), [((1.0, 0.0), 1), ((0.0, 1.0), 0)])
def test_leaving_the_map_as_commanded_succeeds(velocity, share):
    walk = Walk().go(2, (1.0, 0.0), velocity)
    assert walk.share(fallen=True, left_map=True) == share


def test_small_yaw_errors_do_not_add_up():
    """A new linear command starts at the yaw of the robot."""
    walk = Walk()
    for k in range(10):
        walk.go(2, (0.5 + 0.01 * k, 0.0), yaw_rate=0.0, turn=0.1)
    assert walk.progress.along / walk.progress.commanded > 0.95


def test_reset_clears_environments():
    progress = CommandProgress.zeros(3)
    for step in (1.0, 2.0):
        pos = np.column_stack([np.full(3, step), np.zeros(3)])
        progress.update(pos, np.zeros(3), np.tile([1.0, 0.0], (3, 1)), np.zeros(3), 1.0)
    progress.reset([1], [[5.0, 6.0]], [0.5])
    assert progress.along.tolist() == progress.max_distance.tolist() == [2, 0, 2]
    assert progress.start[1].tolist() == progress.position[1].tolist() == [5, 6]
    assert progress.yaw[1] == 0.5


def test_progress_accepts_tensors():
    progress = CommandProgress.zeros(2)
    progress.reset(torch.arange(2), torch.zeros(2, 3), torch.zeros(2))
    command = torch.tensor([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    progress.update(5 * command, torch.zeros(2), command, torch.zeros(2), 5.0)
    fallen = torch.tensor([False, True])
    ended = progress.of_episodes(torch.arange(2), fallen, DISTANCE, left_map=fallen)
    assert isinstance(ended, torch.Tensor)
    assert ended.tolist() == [1, 1]


def test_state_round_trip():
    walk, other = Walk().go(3, (1.0, 0.2), yaw_rate=0.3), Walk(yaw=1.0)
    state = walk.progress.state_dict()
    other.progress.load_state_dict(state)
    other.pos, other.yaw = walk.pos, walk.yaw
    for each in (walk, other):
        each.go(2, (0.5, 0.2), yaw_rate=0.3)
    assert {k: v.tolist() for k, v in vars(walk.progress).items()} == {
        k: v.tolist() for k, v in vars(other.progress).items()
    }
    assert state["along"] != walk.progress.along
