from types import SimpleNamespace

import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit_robots.rl.actions import JointActions, checked_actions
from terrainkit_robots.rl.config import Control

ROBOT = SimpleNamespace(
    action_scale=np.float32([0.5, 0, 0.25]),
    velocity=np.float32([10, 20, 30]),
    effort=np.float32([3, 4, 5]),
    default_pose=np.float32([1, 2, 3]),
    spec=SimpleNamespace(name="hare"),
)


def make(control, is_position=(True, True, True)):
    bias = np.zeros((3, 10))
    bias[:, 1] = -7.0 * np.array(is_position)
    return JointActions(ROBOT, control, SimpleNamespace(actuator_biasprm=bias))


def test_targets_are_offset_plus_scale_times_action():
    actions = make(Control())
    assert actions.joints.tolist() == [0, 2]  # joint 1 has no scale, and so no action
    ctrl = actions.to_ctrl(np.float32([[2, -4]]), np.float32([[0.1, 0.2, 0]]))
    # 1 + 0.5 * 2 - 0.1, 2 - 0.2 and 3 - 0.25 * 4: a joint with a zero offset reads too much.
    np.testing.assert_allclose(ctrl, [[1.9, 1.8, 2.0]], rtol=1e-6)


@pytest.mark.parametrize(
    ("control", "scale"),
    [
        (Control(action_scale=2.0), [2, 0, 2]),
        (Control(control_type="V"), [10, 20, 30]),
        (Control(control_type="T"), [3, 4, 5]),
    ],
)
def test_scale_is_of_the_task_or_of_the_control_type(control, scale):
    assert make(control).scale.tolist() == scale


def test_joints_without_stiffness_have_no_offset():
    actions = make(Control(control_type="V"), is_position=(False, True, False))
    assert actions.offset.tolist() == [0, 2, 0]
    ctrl = actions.to_ctrl(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))
    assert ctrl.tolist() == [[0, 1, 0]]


def test_checked_actions_names_the_first_environment_that_diverged():
    actions = torch.zeros(3, 2)
    assert checked_actions(actions, (3, 2)).tolist() == [[0, 0]] * 3
    actions[1, 0], actions[2, 1] = float("nan"), float("inf")
    with pytest.raises(ConfigError, match="actions of environment 1 are not finite"):
        checked_actions(actions, (3, 2))
    with pytest.raises(ConfigError, match=r"got \(3, 2\); expected \(3, 4\)"):
        checked_actions(actions, (3, 4))
