"""Playing: a policy is rolled on some ground, measured as in an evaluation, and filmed.

On a map there is a robot on each patch, and the video visits some of them, on different terrains.
On a plane robots march in formation through a tour of commands.
"""

import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.evaluation import Asked, Evaluation, prepared, roll_out, summed_up
from terrainkit_robots.rl.rotation import yaw_of
from terrainkit_robots.rl.task import Commands
from terrainkit_robots.rl.video import SIZE, Film, Shot

if TYPE_CHECKING:
    from terrainkit_robots.rl.run_folder import Run

FloatArray = NDArray[np.float32]

SECONDS = 12.0
"""How long robots walk unless told [s]."""

ROBOTS = 4
"""Robots that a video follows on a map unless told."""

_FPS = 25.0
"""Frames per second, at most: one for every second step of the policy."""

_MARCHING = 9
"""Robots on a plane unless told."""

_APART = 1.6
"""Distance in the formation, in standing heights of the base, and at least [m]."""


@dataclass(frozen=True, kw_only=True)
class Played:
    """What came of it."""

    evaluation: Evaluation
    """How the robots did."""

    film: Film | None
    """What is to be drawn; None if no film was wanted."""


def play(
    run: "Run",
    asked: Asked | None = None,
    *,
    filmed: bool = True,
    robots: int = ROBOTS,
    size: tuple[int, int] = SIZE,
    progress: Callable[[float], None] = lambda _: None,
) -> Played:
    """Roll the policy of a run.

    Args:
        run: The run.
        asked: What is to be shown; on a plane, a tour of commands unless told.
        filmed: Whether there is to be a video.
        robots: How many robots it follows, one after the other; on a map.
        size: Width and height of the video [pixels].
        progress: Is told the part that is done, 0 to 1.

    Raises:
        ConfigError: if the run has no policy, or one of another robot; or if an option is wrong.
    """
    from terrainkit_robots.rl.runner import policy_of

    if robots < 1:
        raise ConfigError(f"robots is {robots}; wanted 1 or more")
    asked = asked or Asked(seconds=SECONDS)
    env, commands = _prepared(run, asked)
    recorder = Recorder(env) if filmed else None

    def watch(done: float) -> None:
        progress(done)
        if recorder is not None:
            recorder.record()

    policy = policy_of(run, env)
    outcome = roll_out(env, policy, asked.seconds, commands, watch, to_the_end=filmed)
    evaluation = summed_up(run, asked, env, outcome)
    film = None if recorder is None else recorder.film(robots, size)
    return Played(evaluation=evaluation, film=film)


def _prepared(run: "Run", asked: Asked) -> tuple[LeggedEnv, FloatArray | None]:
    """Return the environment, and the commands of each robot, one after the other."""
    plane = (asked.terrain or run.terrain) == "plane"
    if plane:
        asked = replace(asked, num_envs=asked.num_envs or _MARCHING)
        if asked.command is None and not asked.random_commands:
            tour = tour_of(run.task.commands)
            env, _ = prepared(run, replace(asked, command=(0.0, 0.0, 0.0)))
            return env, np.repeat(tour[:, None], env.num_envs, axis=1)
    return prepared(run, asked, each=1)


def tour_of(settings: Commands) -> FloatArray:
    """Return commands that show what a policy can do, shape (4, 3).

    Forward, forward in a bend, to the side, and turning on the spot; as fast as the task goes, but
    for a quarter.
    """
    ahead, left, turn = (
        0.75 * span[1] for span in (settings.lin_vel_x, settings.lin_vel_y, settings.ang_vel_yaw)
    )
    return np.array([[ahead, 0, 0], [ahead, 0, turn], [0, left, 0], [0, 0, -turn]], np.float32)


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
        qpos = self._env.physics.qpos
        yaw = yaw_of(qpos[:, 3:7].astype(np.float32))
        return np.column_stack([qpos[:, :2], yaw]).astype(np.float32)

    def record(self) -> None:
        """Take down what is seen now."""
        env = self._env
        self._fell |= env.steps == 0
        if self._env.ground.level:
            self._starts = np.where((env.steps == 0)[:, None], self._start(), self._starts)
        if self._steps % self._stride == 0:
            poses = env.physics.qpos.astype(np.float32)
            if env.ground.level:
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

    def film(self, robots: int, size: tuple[int, int]) -> Film:
        """Return the film, which follows so many robots on a map."""
        env = self._env
        frames = len(self._poses)
        if env.ground.level:
            middle = env.num_envs // 2
            shots: tuple[Shot, ...] = (self._march(middle, frames),)
        else:
            chosen = visited(env, robots)
            each = max(1, frames // len(chosen))
            shots = tuple(self._visit(robot, each) for robot in chosen)
        return Film(
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
        level, column = int(env.careers.levels[robot]), int(env.careers.columns[robot])
        terrain = str(env.ground.terrain_names[level, column])
        rows = len(env.ground.env_origins)
        where = f"{terrain}, level {level} of {rows - 1}"
        caption = where if rows > 1 else terrain
        return Shot(robot=robot, start=0, stop=stop, captions=(caption,) * stop)


def visited(env: LeggedEnv, robots: int) -> list[int]:
    """Return whom a video follows: robots on different terrains, at the middle level or near it."""
    levels, every = env.careers.levels, env.ground.terrain_names
    names = every[levels, env.careers.columns]
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


def view(run: "Run", asked: Asked | None = None) -> None:
    """Show one robot in MuJoCo's viewer, in real time, until its window is closed.

    Raises:
        ConfigError: if there is no display, or the run has no policy, or one of another robot.
    """
    _require_display()
    import mujoco
    import mujoco.viewer

    from terrainkit_robots.rl.runner import policy_of

    asked = replace(asked or Asked(), num_envs=1)
    env, commands = _prepared(run, asked)
    policy = policy_of(run, env)
    held = None if commands is None else commands.reshape(-1, 1, 3)
    each = max(1, round(asked.seconds / env.cfg.dt / (1 if held is None else len(held))))
    data, lamp = mujoco.MjData(env.scene.model), env.scene.model.vis.headlight
    lamp.ambient[:], lamp.diffuse[:], lamp.specular[:] = 0.35, 0.65, 0.1  # it is all the light
    try:
        window = mujoco.viewer.launch_passive(env.scene.model, data)
    except RuntimeError as error:  # macOS wants mjpython
        raise ConfigError(f"MuJoCo's viewer cannot be opened: {error}") from None
    with window:
        window.cam.type = mujoco.mjtCamera.mjCAMERA_TRACKING
        window.cam.trackbodyid = env.scene.base
        steps = 0
        while window.is_running():
            begun = time.monotonic()
            if held is not None and steps % each == 0:
                env.hold_commands(held[steps // each % len(held)])
            with torch.inference_mode():
                env.step(policy(env.get_observations()))
            with window.lock():
                data.qpos[:], data.qvel[:] = env.physics.qpos[0], env.physics.qvel[0]
                mujoco.mj_forward(env.scene.model, data)
            window.sync()
            steps += 1
            time.sleep(max(0.0, env.cfg.dt - (time.monotonic() - begun)))


def _require_display() -> None:
    if sys.platform == "linux" and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise ConfigError(
            "--viewer needs a display, and neither DISPLAY nor WAYLAND_DISPLAY is set; "
            "without it, a video is written"
        )
