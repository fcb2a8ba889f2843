"""Let a policy cross the patches of a map."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from terrainkit import TerrainMap
from terrainkit.curriculum.waypoints import Waypoints, route_lengths
from terrainkit.errors import ConfigError
from terrainkit.map.patch import Patch
from terrainkit.perception.orientation import quat_to_yaw
from terrainkit_robots.policy.evaluate import EvaluationConfig, build_eval_env
from terrainkit_robots.policy.load_policy import load_policy, single_torch_thread
from terrainkit_robots.policy.policy_rollout import rollout
from terrainkit_robots.report_card.route import GOAL_RADIUS, HEADING_STIFFNESS, SPEED, patch_routes
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import PolicySpec
from terrainkit_robots.rl.terrain import MapGround

OUTCOMES = ("crossed", "fell", "left", "timed out")
"""Outcomes of an attempt: it crossed the patch, fell, left the patch, or took too long."""

CROSSED, FELL, LEFT, TIMED_OUT = range(4)

START_OFFSET, START_YAW = 0.1, 0.3
"""Largest random offset from the spawn origin along x and y [m], and heading to either side [rad].
"""

TIME_FACTOR, EXTRA_TIME = 1.5, 5.0
"""Time limit: a multiple of the time for the route at the commanded speed, half a turn at the
largest commanded yaw rate, and a constant [s]."""


class Attempts:
    """The attempts of n robots to cross a patch.

    Attributes:
        outcomes: Index into `OUTCOMES`, shape (n,).
        seconds: Time of the attempts that crossed [s], else NaN, shape (n,).
    """

    def __init__(
        self, env: LeggedEnv, patches: list[Patch], speed: float, radius: float = GOAL_RADIUS
    ) -> None:
        n = len(patches)
        self.outcomes, self.seconds = np.full(n, TIMED_OUT, np.int8), np.full(n, np.nan)
        self._env = env
        self._active = np.ones(n, bool)
        self._steps = 0
        # Robots on the same patch take its routes in turn.
        earlier = Counter[tuple[float, float]]()
        routes = []
        for patch in patches:
            every = patch_routes(patch)
            routes.append(every[earlier[patch.grid.lower] % len(every)])
            earlier[patch.grid.lower] += 1
        goals = np.full((n, max(map(len, routes)), 2), np.nan)
        for robot, route in enumerate(routes):
            goals[robot, : len(route)] = route
        self._waypoints = Waypoints.make(n, goals.shape[1], radius)
        self._waypoints.reset(np.arange(n), goals)
        self._speed = speed
        self._lower = np.array([patch.grid.lower for patch in patches])
        self._upper = np.array([patch.grid.upper for patch in patches])
        turn = np.pi / min(-env.cfg.commands.ang_vel_yaw[0], env.cfg.commands.ang_vel_yaw[1])
        lengths = np.nanmax(route_lengths(env.curriculum.progress.start, goals), axis=1)
        seconds = TIME_FACTOR * lengths / speed + turn + EXTRA_TIME
        self._max_steps = np.rint(seconds / env.cfg.dt)

    def schedule(self) -> Iterator[NDArray[np.float32]]:
        """Yield the commands of each step until every attempt has ended."""
        while self._active.any():
            state = self._env.state
            yaw, limits = quat_to_yaw(state.base_quat), self._env.cfg.commands.ang_vel_yaw
            yield self._waypoints.commands(
                state.base_pos[:, :2], yaw, self._speed, HEADING_STIFFNESS, limits
            )

    def update(self, fell: NDArray[np.bool_]) -> None:
        """Record the attempts that a step ended."""
        self._steps += 1
        position = self._env.state.base_pos[:, :2]
        crossed = self._waypoints.update(position)
        left = ((position < self._lower) | (position > self._upper)).any(axis=1)
        late = self._steps >= self._max_steps
        for outcome, mask in ((FELL, fell), (CROSSED, crossed), (LEFT, left), (TIMED_OUT, late)):
            ended = self._active & mask
            self.outcomes[ended] = outcome
            self._active &= ~ended
            if outcome == CROSSED:
                self.seconds[ended] = self._steps * self._env.cfg.dt


class Crossing:
    """A policy that crosses the patches of a map.

    Each robot follows the goals of its patch, or walks to a far side of it, at 75 % of the largest
    forward command. There is no noise and no randomization; only the starts differ. The same seed
    gives the same result.
    """

    def __init__(
        self,
        spec: PolicySpec,
        terrain_map: TerrainMap,
        num_envs: int,
        config: EvaluationConfig,
        scale: float = 1.0,
    ) -> None:
        """Load a policy onto a map.

        Args:
            spec: The policy, such as a run.
            terrain_map: The map.
            num_envs: Robots that walk at once.
            config: Seed and device.
            scale: Factor of the offset of the starts and of the radius of the goals.

        Raises:
            ConfigError: if a run has no policy, or its policy is for another robot, or its task
                does not command to walk ahead.
            MemoryLimitError: if the simulations would not fit in memory.
        """
        commands = spec.task.commands
        self.speed = SPEED * commands.lin_vel_x[1]
        if self.speed <= 0 or not commands.ang_vel_yaw[0] < 0 < commands.ang_vel_yaw[1]:
            got = f"got lin_vel_x {list(commands.lin_vel_x)}, ang_vel_yaw "
            got += f"{list(commands.ang_vel_yaw)}"
            raise ConfigError(f"commands: {got}; expected a task to walk ahead and turn both ways")
        start = replace(spec.task.init_state, position=scale * START_OFFSET, yaw=START_YAW)
        asset = replace(spec.task.asset, visual_collisions=True)
        spec = replace(spec, task=replace(spec.task, init_state=start, asset=asset))
        collision = spec.task.terrain.collision
        terrain = MapGround(terrain_map, "auto" if collision == "plane" else collision)
        config = replace(config, seconds=3600.0)  # episodes have no time-out; attempts do
        self._map, self._env = terrain_map, build_eval_env(spec, terrain, num_envs, config)
        self._policy = load_policy(spec, self._env)
        self._goal_radius = scale * GOAL_RADIUS

    @single_torch_thread()
    def attempt(self, levels: NDArray[np.int64], columns: NDArray[np.int64]) -> Attempts:
        """Return the attempts of robots to cross patches.

        Args:
            levels: Row of the patch of each robot, shape (num_envs,).
            columns: Column of the patch of each robot, shape (num_envs,).
        """
        env = self._env
        env.curriculum.levels[:], env.curriculum.columns[:] = levels, columns
        env.set_commands(None)
        env.reset()
        if reset := getattr(self._policy, "reset", None):  # a network with the last attempt's state
            with torch.inference_mode():
                reset(torch.ones(env.num_envs, dtype=torch.bool))
        patches = [self._map.patch(*place) for place in zip(levels, columns, strict=True)]
        attempts = Attempts(env, patches, self.speed, self._goal_radius)
        for _, fell in rollout(env, self._policy, attempts.schedule()):
            attempts.update(fell)
        return attempts
