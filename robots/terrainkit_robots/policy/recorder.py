"""The recorder: notes where robots are while they walk, for a video of it."""

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rendering.video import Shot, VideoSpec
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.transforms import quat_to_yaw

FloatArray = NDArray[np.float32]

_FPS = 25.0
"""Frames per second, at most: one for every second step of the policy."""

_APART = 1.6
"""Distance in the formation, in standing heights of the base, and at least [m]."""


class Recorder:
    """What robots did, as it is filmed."""

    def __init__(self, env: LeggedEnv) -> None:
        self._env = env
        self._stride = max(1, round(1 / (env.cfg.dt * _FPS)))
        self._poses: list[FloatArray] = []
        self._commands: list[FloatArray] = []
        self._begun: list[NDArray[np.bool_]] = []
        self._steps = 0
        self._fell = np.zeros(env.num_envs, bool)
        self._starts = self._start()

    def _start(self) -> FloatArray:
        """Return where and in which direction each robot stands, shape (n, 3)."""
        qpos = self._env.sim.qpos
        yaw = quat_to_yaw(qpos[:, 3:7].astype(np.float32))
        return np.column_stack([qpos[:, :2], yaw]).astype(np.float32)

    def record(self) -> None:
        """Take down what is seen now."""
        env = self._env
        self._fell |= env.steps_since_reset == 0
        if self._env.terrain.is_flat:
            self._starts = np.where(
                (env.steps_since_reset == 0)[:, None], self._start(), self._starts
            )
        if self._steps % self._stride == 0:
            poses = env.sim.qpos.astype(np.float32)
            if env.terrain.is_flat:
                poses = self._marching(poses)
            self._poses.append(poses)
            self._commands.append(env.commands.copy())
            self._begun.append(self._fell.copy())
            self._fell[:] = False
        self._steps += 1

    def _marching(self, poses: FloatArray) -> FloatArray:
        """Return poses on a plane as if robots had started in formation, looking along x."""
        apart = _APART * max(0.5, float(self._env.robot.spec.base_height_target or 0.5))
        n = len(poses)
        side = int(np.ceil(np.sqrt(n)))
        k = np.arange(n)
        slots = np.stack([-(k // side), k % side - (side - 1) / 2], axis=1) * apart * 1.5
        yaw = -self._starts[:, 2]
        c, s = np.cos(yaw), np.sin(yaw)
        x, y = (poses[:, :2] - self._starts[:, :2]).T
        turned = poses.copy()
        turned[:, :2] = np.stack([c * x - s * y, s * x + c * y], axis=1) + slots
        turned[:, 3:7] = _turned(yaw, poses[:, 3:7])
        return turned

    def film(self, robots: int, size: tuple[int, int]) -> VideoSpec:
        """Return the film, which follows so many robots on a map."""
        env = self._env
        frames = len(self._poses)
        if env.terrain.is_flat:
            middle = env.num_envs // 2
            shots: tuple[Shot, ...] = (self._march(middle, frames),)
        else:
            chosen = visited(env, robots)
            each = max(1, frames // len(chosen))
            shots = tuple(self._visit(robot, each) for robot in chosen)
        return VideoSpec(
            model=env.scene.model,
            poses=np.stack(self._poses),
            shots=shots,
            fps=1 / (env.cfg.dt * self._stride),
            size=size,
        )

    def _march(self, robot: int, frames: int) -> Shot:
        """Return a shot of a robot on a plane, with what it is asked for."""
        told = tuple(_told(each[robot]) for each in self._commands)
        return Shot(robot=robot, start=0, stop=frames, captions=told)

    def _visit(self, robot: int, frames: int) -> Shot:
        """Return a shot of a robot from its start on, up to its first fall."""
        env = self._env
        fell = np.flatnonzero(np.stack([each[robot] for each in self._begun[:frames]]))
        stop = max(1, int(fell[0])) if len(fell) else frames
        level, column = int(env.curriculum.levels[robot]), int(env.curriculum.columns[robot])
        terrain = str(env.terrain.terrain_names[level, column])
        rows = len(env.terrain.env_origins)
        where = f"{terrain}, level {level} of {rows - 1}"
        caption = where if rows > 1 else terrain
        return Shot(robot=robot, start=0, stop=stop, captions=(caption,) * stop)


def visited(env: LeggedEnv, robots: int) -> list[int]:
    """Return whom a video follows: robots on different terrains, at the middle level or near it."""
    levels, every = env.curriculum.levels, env.terrain.terrain_names
    names = every[levels, env.curriculum.columns]
    middle = (len(every) - 1) / 2
    # The nearest to the middle of each terrain; then the second nearest of each, and so on.
    order = np.lexsort((np.arange(len(levels)), np.abs(levels - middle)))
    turn = {
        int(robot): int((names[order[:k]] == names[robot]).sum()) for k, robot in enumerate(order)
    }
    place = {name: k for k, name in enumerate(dict.fromkeys(every.ravel().tolist()))}
    # Terrains from end to end of the map, if there are more of them than robots.
    first = sorted(turn, key=lambda robot: (turn[robot], place[str(names[robot])]))
    kinds = len(set(names))
    if robots >= kinds:
        return first[:robots]
    return [first[round(k)] for k in np.linspace(0, kinds - 1, robots)]


def _turned(yaw: FloatArray, quat: FloatArray) -> FloatArray:
    """Return rotations after a turn around the vertical, shape (n, 4)."""
    c, s = np.cos(yaw / 2), np.sin(yaw / 2)
    w, x, y, z = quat.T
    return np.stack([c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w], axis=1)


def _told(command: FloatArray) -> str:
    """Return a command in words."""
    ahead, left, turn = (round(float(each), 2) + 0.0 for each in command)
    parts = []
    if ahead:
        parts.append(f"{'forward' if ahead > 0 else 'backward'} {abs(ahead):g} m/s")
    if left:
        parts.append(f"{'left' if left > 0 else 'right'} {abs(left):g} m/s")
    if turn:
        parts.append(f"turning {'left' if turn > 0 else 'right'} {abs(turn):g} rad/s")
    return ", ".join(parts) or "standing"
