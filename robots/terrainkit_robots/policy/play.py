"""Play a policy: measure it as an evaluation does, and record a video."""

from dataclasses import dataclass, replace
from itertools import zip_longest

import numpy as np

from terrainkit.errors import ConfigError
from terrainkit_robots.policy.evaluate import (
    EvaluationConfig,
    is_plane,
    make_eval_env,
    summarize,
)
from terrainkit_robots.policy.load_policy import load_policy, single_torch_thread
from terrainkit_robots.policy.metrics import RolloutMetrics
from terrainkit_robots.policy.policy_rollout import (
    EvaluationRollout,
    Progress,
)
from terrainkit_robots.policy.result_table import ResultTable
from terrainkit_robots.rendering.video import DEFAULT_SIZE, Shot, VideoSpec
from terrainkit_robots.rl.config import Commands
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import PolicySpec
from terrainkit_robots.rl.scene import drawn_model
from terrainkit_robots.transforms import FloatArray

DEFAULT_SECONDS = 12.0
"""Duration [s]."""

DEFAULT_ROBOTS = 4
"""Robots that the video of a map follows."""

FORMATION_ENVS = 9
"""Robots on a plane."""

MAX_FPS = 25.0
"""Largest frame rate of a video [Hz]."""


@dataclass(frozen=True, kw_only=True)
class PlayResult:
    """Metrics of a played policy, and the video to render; None without a video."""

    evaluation: ResultTable[RolloutMetrics]
    video: VideoSpec | None


@single_torch_thread()
def play(
    spec: PolicySpec,
    config: EvaluationConfig | None = None,
    *,
    video: bool = True,
    robots: int = DEFAULT_ROBOTS,
    size: tuple[int, int] = DEFAULT_SIZE,
    progress: Progress = lambda _: None,
) -> PlayResult:
    """Roll out a policy, and record a video.

    On a plane the robots walk in formation; `demo_commands` are the default commands. On a
    map there is one robot per patch, and the video follows some `robots` in turn.

    Args:
        spec: The policy with its task and robot.
        config: Settings of the rollout; None for the defaults.
        video: Whether to record a video. Without one, the rollout stops once every
            robot has fallen or crossed half a patch.
        robots: Number of robots that the video follows on a map.
        size: Width and height of the video [pixels].
        progress: Called after each step with the completed fraction, 0 to 1.

    Raises:
        ConfigError: If a run has no policy, or its policy is for another robot; if an option is
            invalid.
    """
    if robots < 1:
        raise ConfigError(f"robots: got {robots}; expected 1 or more")
    config = config or EvaluationConfig(seconds=DEFAULT_SECONDS)
    env, commands = make_play_env(spec, config)
    recorder = PoseRecorder(env)

    def update(fraction: float) -> None:
        progress(fraction)
        if video:
            recorder.record()

    evaluation = EvaluationRollout(env)
    evaluation.run(load_policy(spec, env), config.seconds, commands, update, stop_early=not video)
    recorded = recorder.make_video(robots, size) if video else None
    return PlayResult(evaluation=summarize(spec, config, evaluation), video=recorded)


def make_play_env(
    spec: PolicySpec, config: EvaluationConfig
) -> tuple[LeggedEnv, FloatArray | None]:
    """Return the environment, and the commands of its robots.

    Args:
        spec: The policy with its task and robot.
        config: Settings of the rollout.

    Returns:
        The environment, and commands for `command_schedule`.
    """
    if not is_plane(spec, config.terrain):
        return make_eval_env(spec, config, max_patch_envs=1)
    start = replace(spec.task.init_state, position=0.0, yaw=0.0)  # the formation sets them
    spec = replace(spec, task=replace(spec.task, init_state=start))
    config = replace(config, num_envs=config.num_envs or FORMATION_ENVS)
    if config.command is not None or config.random_commands:
        return make_eval_env(spec, config)
    env, _ = make_eval_env(spec, replace(config, command=(0.0, 0.0, 0.0)))
    return env, np.repeat(demo_commands(spec.task.commands)[:, None], env.num_envs, axis=1)


def demo_commands(commands: Commands) -> FloatArray:
    """Return commands to walk forward, in a curve and sideways, and to turn, at 75 % of the limits.

    Returns:
        Forward and left velocity [m/s] and yaw velocity [rad/s], shape (4, 3).
    """
    limits = (commands.lin_vel_x, commands.lin_vel_y, commands.ang_vel_yaw)
    x, y, yaw = (0.75 * high for _, high in limits)
    return np.array([[x, 0, 0], [x, 0, yaw], [0, y, 0], [0, 0, -yaw]], np.float32)


class PoseRecorder:
    """Records the poses and commands of all robots for a video."""

    def __init__(self, env: LeggedEnv) -> None:
        self.env = env
        self.stride = max(1, round(1 / (env.cfg.dt * MAX_FPS)))
        self.num_steps = 0
        self.poses: list[FloatArray] = []
        self.commands: list[FloatArray] = []
        self.first_fall = np.full(env.num_envs, np.inf)  # [frames]

    def record(self) -> None:
        """Record the state after a step, at the frame rate of the video."""
        fallen = self.env.steps_since_reset == 0
        frame = -(-self.num_steps // self.stride)
        self.first_fall[fallen] = np.minimum(self.first_fall[fallen], frame)
        if self.num_steps % self.stride == 0:
            self.poses.append(self.env.sim.qpos.astype(np.float32))
            self.commands.append(self.env.commands.copy())
        self.num_steps += 1

    def make_video(self, robots: int, size: tuple[int, int]) -> VideoSpec:
        """Return a video of the formation on a plane, or of some robots in turn on a map.

        A robot on a map is shown until it falls.
        """
        env = self.env
        terrain = self.env.terrain
        poses = np.stack(self.poses)
        shots = []
        frames, n = poses.shape[:2]
        if terrain.is_plane:
            side = int(np.ceil(np.sqrt(n)))
            row, col = np.divmod(np.arange(n), side)
            spacing = 2.4 * max(0.5, env.robot.base_height_target)
            poses[:, :, :2] += spacing * np.stack([-row, col - (side - 1) / 2], axis=1)
            captions = tuple(_caption(commands[n // 2]) for commands in self.commands)
            shots.append(Shot(robot=n // 2, captions=captions))
        tracked = select_tracked_robots(env, robots)
        rows = len(terrain.env_origins)
        for robot in tracked if not terrain.is_plane else ():
            level, column = env.curriculum.levels[robot], env.curriculum.columns[robot]
            caption = str(terrain.terrain_names[level, column])
            caption += f", level {level} of {rows - 1}" if rows > 1 else ""
            stop = int(np.clip(self.first_fall[robot], 1, max(1, frames // len(tracked))))
            shots.append(Shot(robot=robot, captions=(caption,) * stop))
        fps = 1 / (env.cfg.dt * self.stride)
        model = drawn_model(env.scene, env.robot, terrain, env.cfg)
        return VideoSpec(model=model, poses=poses, shots=tuple(shots), fps=fps, size=size)


def select_tracked_robots(env: LeggedEnv, count: int) -> list[int]:
    """Return robots for a video: on different terrains first, near the middle level."""
    levels, names = env.curriculum.levels, env.terrain.terrain_names
    by_terrain: dict[str, list[int]] = {name: [] for name in names.ravel().tolist()}
    for robot in np.argsort(np.abs(levels - (len(names) - 1) / 2), kind="stable"):
        by_terrain[names[levels[robot], env.curriculum.columns[robot]]].append(int(robot))
    queues = [queue for queue in by_terrain.values() if queue]
    if count < len(queues):
        queues = [queues[round(k)] for k in np.linspace(0, len(queues) - 1, count)]
    return [robot for turn in zip_longest(*queues) for robot in turn if robot is not None][:count]


def _caption(command: FloatArray) -> str:
    words = ("forward", "backward"), ("left", "right"), ("turning left", "turning right")
    parts = [
        f"{names[int(value < 0)]} {abs(value):g} {unit}"
        for names, value, unit in zip(words, command.round(2), ("m/s", "m/s", "rad/s"), strict=True)
        if value
    ]
    return ", ".join(parts) or "standing"
