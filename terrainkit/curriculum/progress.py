"""Progress of robots along their velocity commands."""

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.curriculum.arrays import Array, like, to_numpy
from terrainkit.errors import ConfigError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class CommandProgress:
    """The progress of n robots along their velocity commands, since the start of each episode.

    The reference is a robot that follows the commands exactly: it turns at the commanded yaw rate,
    and walks at the commanded velocity in its own frame. The progress of a robot is the integral of
    its velocity component along the velocity of the reference. It never exceeds the distance
    commanded so far, so that sliding down a slope gains nothing. At the start and with each new
    linear velocity command, the yaw of the reference is set to the yaw of the robot, so that small
    errors of the yaw rate do not add up.

    legged_gym compares the distance from the spawn origin with the commanded speed times the length
    of the episode. By this measure, a robot that drifts sideways succeeds, and so does a robot that
    slides down a slope that it is commanded to climb. A robot that walks back and forth as
    commanded fails. Measuring the velocity in the frame of the robot itself would be no better: a
    robot that keeps turning would succeed by walking in a circle.
    """

    start: FloatArray
    """Position at the start of the episode, world frame [m], shape (n, 2)."""
    position: FloatArray
    """Position at the last update, world frame [m], shape (n, 2)."""
    command: FloatArray
    """Linear velocity command at the last update, shape (n, 2) [m/s]."""
    yaw: FloatArray
    """Yaw of the reference [rad], shape (n,)."""
    target: FloatArray
    """Displacement of the reference, world frame [m], shape (n, 2)."""
    along: FloatArray
    """Progress along the commands [m], shape (n,)."""
    commanded: FloatArray
    """Length of the path of the reference [m], shape (n,)."""
    max_distance: FloatArray
    """Largest distance from the start that was also progress along the commands [m], shape (n,)."""
    target_max_distance: FloatArray
    """Largest distance of the reference from its start [m], shape (n,)."""

    @classmethod
    def zeros(cls, num_envs: int) -> Self:
        """Return the progress of robots that have not moved."""
        vectors = ("start", "position", "command", "target")
        shapes = {f.name: (num_envs, 2)[: 1 + (f.name in vectors)] for f in fields(cls)}
        return cls(**{name: np.zeros(shape) for name, shape in shapes.items()})

    def reset(self, env_ids: Any, position: Any, yaw: Any) -> None:
        """Start new episodes.

        Args:
            env_ids: Environments, shape (k,).
            position: Position of each robot, x and y [m], shape (k, 2) or more columns.
            yaw: Heading of each robot [rad], shape (k,).
        """
        ids = to_numpy("env_ids", env_ids)
        for array in vars(self).values():
            array[ids] = 0
        self.start[ids] = self.position[ids] = to_numpy("position", position)[:, :2]
        self.yaw[ids] = to_numpy("yaw", yaw)

    def update(self, position: Any, yaw: Any, command: Any, yaw_rate: Any, dt: float) -> None:
        """Add a step.

        Args:
            position: Position of each robot after the step, x and y [m], shape (n, 2) or more
                columns.
            yaw: Heading of each robot after the step [rad], shape (n,).
            command: Commanded velocity of the step, forward and left [m/s], shape (n, 2) or more
                columns.
            yaw_rate: Commanded yaw rate of the step [rad/s], shape (n,). If headings are commanded,
                the yaw rate of the reference: compute it from the attribute `yaw`.
            dt: Length of the step [s].
        """
        new = to_numpy("command", command)[:, :2].astype(np.float64)
        is_new = (new != self.command).any(axis=1)
        self.yaw[is_new] = to_numpy("yaw", yaw)[is_new]
        self.command[:] = new
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        velocity = np.stack([c * new[:, 0] - s * new[:, 1], s * new[:, 0] + c * new[:, 1]], axis=1)
        speed = np.linalg.norm(new, axis=1)
        moved = to_numpy("position", position)[:, :2] - self.position
        # The displacement projected onto the direction of the reference's velocity.
        along = (moved * velocity).sum(axis=1) / np.maximum(speed, 1e-9)
        self.position[:] += moved
        self.commanded[:] += speed * dt
        # Limited at every step, not only at the end: a robot cannot save up progress by sliding
        # ahead.
        self.along[:] = np.minimum(self.along + along, self.commanded)
        self.target[:] += velocity * dt
        self.target_max_distance[:] = np.maximum(
            self.target_max_distance, np.linalg.norm(self.target, axis=1)
        )
        distance = np.linalg.norm(self.position - self.start, axis=1)
        self.max_distance[:] = np.maximum(self.max_distance, np.minimum(self.along, distance))
        self.yaw[:] += to_numpy("yaw_rate", yaw_rate) * dt

    def of_episodes(
        self, env_ids: Array, fallen: ArrayLike, distance: float, *, left_map: ArrayLike = False
    ) -> Array:
        """Return the progress of episodes that end, as the samplers expect it.

        - 1 if the robot crossed: its progress and its distance from the start were both at least
          `distance` at some time, or it left the map after at least half of the commanded distance.
        - 0 if it fell before that.
        - NaN if it followed commands that lead nowhere: its progress is at least half of the
          commanded distance, but the reference itself did not get `distance` away from its start.
          Such an episode says nothing about the terrain. Examples are commands to stand, to walk
          back and forth, and to walk in a circle on the spawn platform.
        - Otherwise, its progress as a share of the commanded distance.

        Args:
            env_ids: Environments, shape (k,).
            fallen: Whether each robot fell, shape (k,).
            distance: Distance at which a patch counts as crossed [m]: half of its length in
                legged_gym.
            left_map: Whether each robot left the map, shape (k,).

        Returns:
            Progress, 0 to 1 or NaN, shape (k,).
        """
        ids = to_numpy("env_ids", env_ids)
        commanded = self.commanded[ids]
        share = np.clip(self.along[ids] / np.maximum(commanded, 1e-9), 0, 1)
        followed = share >= 0.5
        crossed = (self.max_distance[ids] >= distance) | (to_numpy("left_map", left_map) & followed)
        followed |= commanded == 0
        outcomes = [
            (crossed, 1.0),
            (to_numpy("fallen", fallen), 0.0),
            (followed & (self.target_max_distance[ids] < distance), np.nan),
        ]
        conditions, values = zip(*outcomes, strict=True)
        return like(np.select(conditions, values, share), env_ids)

    def state_dict(self) -> dict[str, FloatArray]:
        """Return a copy of all arrays, for a checkpoint."""
        return {name: array.copy() for name, array in vars(self).items()}

    def load_state_dict(self, state: Any) -> None:
        """Restore the arrays of `state_dict`.

        Args:
            state: Arrays or tensors by name.

        Raises:
            ConfigError: if an array is missing, or for another number of robots.
        """
        arrays = {name: to_numpy(name, state[name]) for name in vars(self) if name in state}
        for name, array in vars(self).items():
            got = f"shape {arrays[name].shape}" if name in arrays else "nothing"
            if got != f"shape {array.shape}":
                raise ConfigError(
                    f"{name} of the progress: got {got}; expected shape {array.shape}"
                )
        for name, array in vars(self).items():
            array[:] = arrays[name]
