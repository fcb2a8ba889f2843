"""Progress along commands, with robots whose paths are known."""

import numpy as np
import pytest
import torch

from terrainkit.curriculum import CommandProgress
from terrainkit.errors import ConfigError

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


AHEAD, BACK, STAND, LEFT = (1.0, 0.0), (-1.0, 0.0), (0.0, 0.0), (0.0, 1.0)


@pytest.mark.parametrize(
    ("legs", "share"),
    [
        pytest.param([(5, BACK)], 1, id="crossing as commanded"),
        pytest.param([(4.1, AHEAD)], 1, id="just crossing"),
        pytest.param([(3.9, AHEAD)], np.nan, id="commanded to stop short"),
        pytest.param([(5, AHEAD, (0.79, 0.0))], 0.79, id="just too slow"),
        pytest.param([(20, AHEAD, (0.21, 0.0))], 1, id="crossing slowly"),
        pytest.param([(12, (0.5, 0.0), (0.3, 0.0))], 0.6, id="slower than commanded"),
        pytest.param([(3, AHEAD), (17, AHEAD, STAND)], 3 / 20, id="standing at an obstacle"),
        pytest.param([(10, (0.5, 0.0), BACK)], 0, id="walking against the command"),
        pytest.param(2 * [(3, AHEAD), (3, BACK)], np.nan, id="back and forth as commanded"),
        pytest.param([(5, AHEAD), (5, BACK)], 1, id="crossing and back as commanded"),
        pytest.param([(20, STAND)], np.nan, id="standing as commanded"),
        pytest.param([(2, AHEAD, (0.51, 0.0))], np.nan, id="half of a short command"),
        pytest.param([(2, AHEAD, (0.49, 0.0))], 0.49, id="ignoring a short command"),
        pytest.param([(4 * np.pi, AHEAD, AHEAD, 1.0)], np.nan, id="circle as commanded"),
    ],
)
def test_share_of_a_walk(legs, share):
    walk = Walk(yaw=-2.0)
    for leg in legs:
        walk.go(*leg)
    assert walk.share() == pytest.approx(share, nan_ok=True)


@pytest.mark.parametrize(
    ("leg", "left_map", "share"),
    [
        ((3, AHEAD), False, 0),
        ((5, AHEAD), False, 1),
        ((20, STAND), False, 0),
        ((2, AHEAD), True, 1),
        ((2, AHEAD, (0.51, 0.0)), True, 1),
        ((2, AHEAD, (0.49, 0.0)), True, 0),
        ((2, AHEAD, LEFT), True, 0),
    ],
)
def test_fall_fails_before_crossing_or_leaving_the_map(leg, left_map, share):
    assert Walk().go(*leg).share(fallen=True, left_map=left_map) == share


def test_progress_of_straight_walk_is_integrated():
    progress = Walk(yaw=0.7).go(3, (0.6, 0.8)).progress
    angle = 0.7 + np.arctan2(0.8, 0.6)
    expected = {
        "start": [10, 20],
        "position": [10 + 3 * np.cos(angle), 20 + 3 * np.sin(angle)],
        "command": [0.6, 0.8],
        "yaw": 0.7,
        "target": [3 * np.cos(angle), 3 * np.sin(angle)],
        **dict.fromkeys(("along", "commanded", "max_distance", "target_max_distance"), 3),
    }
    found = progress.state_dict()
    assert found.keys() == expected.keys()
    for name, value in expected.items():
        assert found[name][0] == pytest.approx(value), name


def test_sliding_gains_no_more_than_the_command():
    walk = Walk().go(1, (0.5, 0.0), (9.0, 0.0))
    assert walk.progress.along == pytest.approx(0.5)
    assert walk.progress.max_distance == pytest.approx(0.5)


def test_uncommanded_circle_fails():
    """It follows the velocity command in its own frame, but not the straight line."""
    assert Walk().go(4 * np.pi, AHEAD, turn=1.0).share() < 0.1


def test_small_yaw_errors_do_not_add_up():
    """A new linear command starts at the yaw of the robot."""
    walk = Walk()
    for k in range(10):
        walk.go(2, (0.5 + 0.01 * k, 0.0), turn=0.1)
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
    one, same = (
        {name: array.tolist() for name, array in vars(each.progress).items()}
        for each in (walk.go(2, (0.5, 0.2), yaw_rate=0.3), other.go(2, (0.5, 0.2), yaw_rate=0.3))
    )
    assert one == same
    assert state["along"] != walk.progress.along


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"yaw": np.zeros(2)}, r"^yaw of the progress: got shape \(2,\); expected shape \(1,\)"),
        ({"yaw": None}, r"^yaw of the progress: got nothing; expected shape \(1,\)"),
    ],
)
def test_state_of_other_robots_is_rejected(changed, message):
    progress = CommandProgress.zeros(1)
    state = {**progress.state_dict(), "along": np.ones(1), **changed}
    with pytest.raises(ConfigError, match=message):
        progress.load_state_dict({name: each for name, each in state.items() if each is not None})
    assert progress.along.tolist() == [0]
