"""Playing: a policy is rolled on some ground, measured as in an evaluation, and filmed.

On a map there is a robot on each patch, and the video visits some of them, on different terrains.
On a plane robots march in formation through a tour of commands.
"""

import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit_robots.policy.actor import policy_of
from terrainkit_robots.policy.evaluate import Asked, is_flat, prepared
from terrainkit_robots.policy.recorder import Recorder
from terrainkit_robots.policy.rollout import timetable, walk
from terrainkit_robots.policy.score import Evaluation, summed_up
from terrainkit_robots.policy.trials import roll_out
from terrainkit_robots.rendering.video import DEFAULT_SIZE, VideoSpec
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.runner import single_torch_thread
from terrainkit_robots.rl.task import Commands

if TYPE_CHECKING:
    from terrainkit_robots.rl.run import Run

FloatArray = NDArray[np.float32]

SECONDS = 12.0
"""How long robots walk unless told [s]."""

ROBOTS = 4
"""Robots that a video follows on a map unless told."""

_MARCHING = 9
"""Robots on a plane unless told."""


@dataclass(frozen=True, kw_only=True)
class Played:
    """What came of it."""

    evaluation: Evaluation
    """How the robots did."""

    film: VideoSpec | None
    """What is to be drawn; None if no film was wanted."""


@single_torch_thread()
def play(
    run: "Run",
    asked: Asked | None = None,
    *,
    filmed: bool = True,
    robots: int = ROBOTS,
    size: tuple[int, int] = DEFAULT_SIZE,
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
    if is_flat(run, asked):
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


@single_torch_thread()
def view(run: "Run", asked: Asked | None = None) -> None:
    """Show one robot in MuJoCo's viewer, in real time, until its window is closed.

    Raises:
        ConfigError: if there is no display, or the run has no policy, or one of another robot.
    """
    _require_display()
    import mujoco
    import mujoco.viewer

    asked = replace(asked or Asked(), num_envs=1)
    env, commands = _prepared(run, asked)
    steps = max(1, round(asked.seconds / env.cfg.dt))
    walking = walk(env, policy_of(run, env), cycle(timetable(commands, steps)))
    data, lamp = mujoco.MjData(env.scene.model), env.scene.model.vis.headlight
    lamp.ambient[:], lamp.diffuse[:], lamp.specular[:] = 0.35, 0.65, 0.1  # it is all the light
    try:
        window = mujoco.viewer.launch_passive(env.scene.model, data)
    except RuntimeError as error:  # macOS wants mjpython
        raise ConfigError(f"MuJoCo's viewer cannot be opened: {error}") from None
    with window:
        window.cam.type = mujoco.mjtCamera.mjCAMERA_TRACKING
        window.cam.trackbodyid = env.scene.base
        while window.is_running():
            begun = time.monotonic()
            next(walking)
            with window.lock():
                data.qpos[:], data.qvel[:] = env.sim.qpos[0], env.sim.qvel[0]
                mujoco.mj_forward(env.scene.model, data)
            window.sync()
            time.sleep(max(0.0, env.cfg.dt - (time.monotonic() - begun)))


def _require_display() -> None:
    if sys.platform == "linux" and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise ConfigError(
            "--viewer needs a display, and neither DISPLAY nor WAYLAND_DISPLAY is set; "
            "without it, a video is written"
        )
