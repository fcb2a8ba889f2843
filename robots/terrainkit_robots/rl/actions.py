"""Actions: what the motors receive for the output of a policy."""

from typing import Any

import numpy as np
import torch

from terrainkit.errors import ConfigError
from terrainkit_robots.rl.config import Control
from terrainkit_robots.spec.robot_arrays import Robot
from terrainkit_robots.transforms import FloatArray


class JointActions:
    """Targets of the motors: offset + scale * action; without a scale, a joint has no action.

    Attributes:
        scale: Factor from an action to the target of each joint, shape (j,).
        joints: Joints with an action, indices in the robot's order, shape (a,).
        offset: Target of the action 0, shape (j,).
    """

    def __init__(self, robot: Robot, control: Control, model: Any) -> None:
        defaults = {"P": robot.action_scale, "V": robot.velocity, "T": robot.effort}
        default, scale = defaults[control.control_type], control.action_scale
        scales = default if scale is None else np.where(default == 0, 0, scale)
        self.scale = scales.astype(np.float32)
        self.joints = np.flatnonzero(self.scale)
        if not len(self.joints):
            raise ConfigError(f"action_scale of {robot.spec.name}: got 0 for every joint")
        self._is_position_controlled = model.actuator_biasprm[:, 1] != 0
        self.offset = np.where(self._is_position_controlled, robot.default_pose, 0)

    def to_ctrl(self, actions: FloatArray, joint_offset: FloatArray) -> FloatArray:
        """Return the controls of all actuators, shape (n, j).

        Args:
            actions: Actions of the policy, shape (n, a).
            joint_offset: Zero offset of each joint [rad], shape (n, j).
        """
        target = np.tile(self.offset, (len(actions), 1))
        target[:, self.joints] += self.scale[self.joints] * actions
        # A joint with a zero offset reads too much, so its motor stops short by the same angle.
        return target - joint_offset * self._is_position_controlled


def checked_actions(actions: torch.Tensor, shape: tuple[int, int]) -> FloatArray:
    """Return the actions of a policy as an array.

    Args:
        actions: Actions, on any device.
        shape: Numbers of robots and of actions, (n, a).

    Raises:
        ConfigError: If they have another shape, or are not finite.
    """
    array: FloatArray = actions.detach().to("cpu", torch.float32).numpy()
    if array.shape != shape:
        raise ConfigError(f"shape of the actions: got {array.shape}; expected {shape}")
    if not np.isfinite(array).all():
        first = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise ConfigError(f"actions of environment {first} are not finite: the policy diverged")
    return array
