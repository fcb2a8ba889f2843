"""The control: from actions to what the physics' motors are told; see `scene` for their gains."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rl.robot import Robot
from terrainkit_robots.rl.task import Task

FloatArray = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True, eq=False)
class Control:
    """What an action means: of each joint `middle + scale * action`."""

    scale: FloatArray
    """Change for an action of 1 [rad], [rad/s] or [N m], shape (j,)."""

    middle: FloatArray
    """What an action of 0 asks for, in the same unit, shape (j,)."""

    positional: NDArray[np.bool_]
    """Joints that are told positions, shape (j,)."""

    def told(self, actions: FloatArray, joint_offset: FloatArray) -> FloatArray:
        """Return what the motors are told, shape (n, j).

        Args:
            actions: Actions, shape (n, j).
            joint_offset: Error of the zero of each joint [rad], shape (n, j).
        """
        return self.middle + self.scale * actions - joint_offset * self.positional


def control_of(robot: Robot, task: Task) -> Control:
    """Return the control of a robot in a task."""
    kind, scale = task.control.control_type, task.control.action_scale
    stiff = np.array(list(robot.spec.per_joint("stiffness").values())) > 0
    if task.control.stiffness is not None:
        stiff &= task.control.stiffness > 0
    positional = stiff & (kind == "P")
    own = {
        "P": np.array(list(robot.spec.per_joint("action_scale").values())),
        "V": robot.velocity,
        "T": robot.effort,
    }[kind]
    scales = own if scale is None else np.full(len(own), scale)
    return Control(
        scale=scales.astype(np.float32),
        middle=np.where(positional, robot.default_pose, 0).astype(np.float32),
        positional=positional,
    )
