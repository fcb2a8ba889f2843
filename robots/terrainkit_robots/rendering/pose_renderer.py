"""Pictures of a robot while its simulation runs."""

from collections.abc import Iterator
from functools import partial
from itertools import repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rendering import appearance
from terrainkit_robots.rendering.child_process import Frame, RenderError, stream_frames
from terrainkit_robots.rendering.video import (
    AZIMUTH,
    DEFAULT_SIZE,
    ELEVATION,
    cut_heightfields,
    prepare_model,
    visible_area,
)

RELATIVE_DISTANCE = 0.6  # of the camera, relative to videos, which also show other robots
MARGIN = 2.0  # how far a robot walks before the heightfields around it are cut again [m]


class PoseRenderer:
    """Renders poses of a robot, in a child process that starts with the first one."""

    def __init__(self, model: Any, size: tuple[int, int] = DEFAULT_SIZE) -> None:
        """Store the `mujoco.MjModel` of the scene, and width and height of the frames."""
        self._render = partial(pose_frames, model, size)
        self._qpos = np.zeros(model.nq)
        self._frames: Any = None

    def render(self, qpos: NDArray[np.floating[Any]]) -> Frame:
        """Return an image of the robot in a pose, shape (height, width, 3).

        Args:
            qpos: Position of the base and the joints, shape (nq,).

        Raises:
            RenderError: If MuJoCo cannot render on this machine.
        """
        self._qpos[:] = qpos
        self._frames = self._frames or stream_frames(self._render, repeat(self._qpos))
        try:
            frame: Frame = next(self._frames)
        except RenderError:
            self._frames = None  # the next call starts another process
            raise
        return frame

    def close(self) -> None:
        """End the child process; another call of `render` starts a new one."""
        if self._frames is not None:
            self._frames.close()
        self._frames = None


def pose_frames(
    model: Any, size: tuple[int, int], poses: Iterator[NDArray[np.float64]]
) -> Iterator[Frame]:
    """Yield a frame for each pose, shape (nq,), seen by a camera that follows the robot."""
    import mujoco

    distance = RELATIVE_DISTANCE * prepare_model(model)
    renderer = None
    area = np.zeros((2, 2))
    for qpos in poses:
        lower, upper = visible_area(qpos[None, :3], distance, size)
        if renderer is None or (lower < area[0]).any() or (upper > area[1]).any():
            if renderer is not None:
                renderer.close()
            area = np.array([lower - MARGIN, upper + MARGIN])
            part = cut_heightfields(model, *area)
            data, renderer = mujoco.MjData(part), appearance.make_renderer(part, size, distance)
        data.qpos[:] = qpos
        mujoco.mj_kinematics(part, data)
        mujoco.mj_camlight(part, data)
        appearance.update_scene(renderer, data, qpos[:3], distance, AZIMUTH, ELEVATION)
        yield renderer.render()
