"""The vectorized environment: legged robots that track velocity commands on a terrain."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, cast

import numpy as np
import torch
from numpy.typing import NDArray
from rsl_rl.env import VecEnv
from tensordict import TensorDict

from terrainkit.errors import TerrainkitError, is_built_in, plugin_errors
from terrainkit.perception.orientation import quat_to_yaw
from terrainkit_robots.rl import observations
from terrainkit_robots.rl.actions import JointActions, checked_actions
from terrainkit_robots.rl.commands import CommandTerm, Gait, VelocityCommand, make_waypoints
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.curriculum import TerrainCurriculum, end_episodes, update_progress
from terrainkit_robots.rl.estimator import ESTIMATE
from terrainkit_robots.rl.events import EVENTS, EventTerm, RandomizedParams
from terrainkit_robots.rl.observations import ObservationTerm, PolicyInterface
from terrainkit_robots.rl.own_terms import checked
from terrainkit_robots.rl.rewards import REWARDS, Reward, is_moving, scaled_rewards
from terrainkit_robots.rl.scene import Scene
from terrainkit_robots.rl.simulation import Ids, Simulation, check_env_memory
from terrainkit_robots.rl.state import Sensors, State, scan_points
from terrainkit_robots.rl.symmetry import MirrorMaps, mirror_maps
from terrainkit_robots.rl.terminations import TERMINATIONS, left_terrain
from terrainkit_robots.rl.terrain import Ground
from terrainkit_robots.spec.robot_arrays import Robot
from terrainkit_robots.transforms import BoolArray, FloatArray


def make_env(
    task: Task,
    robot: Robot,
    terrain: Ground,
    device: str = "cpu",
    interface: PolicyInterface | None = None,
) -> "LeggedEnv":
    """Return the environment of a task: of its `env_class`, or of `LeggedEnv`.

    Raises:
        ConfigError: If task, robot and terrain do not fit together.
        PluginError: If an environment of another package fails.
    """
    kind = task.env_class or LeggedEnv
    plugin = None if is_built_in(kind) else f"{kind.__module__}:{kind.__qualname__}"
    with plugin_errors(plugin, TerrainkitError):
        if interface is None:  # which a class of the user need not take
            return kind(task, robot, terrain, device)
        return kind(task, robot, terrain, device, interface)


def has_own_commands(task: Task) -> bool:
    """Return whether the environment of a task has commands of its own."""
    default = LeggedEnv.command_terms
    return getattr(task.env_class, "command_terms", default) is not default


class LeggedEnv(VecEnv):
    """An rsl-rl `VecEnv` of legged robots. Later steps do not modify returned tensors.

    The `env_class` of a task of your own is a subclass with other terms: functions of the
    environment by name. They may use the attributes below, where n is the number of robots.

    Args:
        task: The task.
        robot: The robot.
        terrain: The terrain under it.
        device: Device of observations and rewards, as torch names it.
        interface: Observations and targets of a policy of another project.

    Attributes:
        cfg: The task.
        robot: The robot: its spec, default pose and limits.
        terrain: The ground under the robots: heights, spawns and goals.
        scene: The MuJoCo model and indices into it; `sim`: its n simulations.
        state: State after the last step, with the current commands.
        params: Physical parameters of the robots; the event `params` samples them.
        actions: Scale and offset of the actions, and their joints.
        active_commands: Command terms by name, with their `values`; `commands`: the velocity
            commands, shape (n, 3), 0 without `has_velocity`, the command `velocity`.
        gait, curriculum, waypoints: The gait to follow, the patches of the robots, and their goals.
        rng: Generator of all random numbers but those of the curriculum.
        buffers: Arrays that terms keep between steps, by name, which a checkpoint has.
        num_envs, num_actions: Numbers of robots, n, and of actions.
        step_dt: Time of a step [s].
        steps_since_reset: Steps of each episode, shape (n,); `path_length`: way walked [m].
        term_values: Rewards, such as `rew_torques` [1/s], and evaluation terms of the last step,
            shape (n,) each.
        action_history: The last three actions, the newest first, shape (3, n, a).
        joint_offset, lin_vel_bias, push_vel: Zero offsets of the joints [rad], constant error of
            the observed velocity [m/s], and velocity that the last push added [m/s].
        mass: Mass of the robot [kg].
    """

    params: RandomizedParams
    state: State
    buffers: dict[str, NDArray[Any]]
    _observations: TensorDict

    obs_history: FloatArray
    """Previous observations of the policy, the newest first, shape (n, h)."""

    before_reset: Callable[[Ids], object] | None = None
    """Called with the environments whose episodes end, before they are reset, shape (k,)."""

    def __init__(
        self,
        task: Task,
        robot: Robot,
        terrain: Ground,
        device: str = "cpu",
        interface: PolicyInterface | None = None,
    ) -> None:
        """Build the simulations and reset every environment."""
        self.cfg, self.robot, self.terrain, self.device = task, robot, terrain, device
        self.interface, self.num_envs = interface, task.env.num_envs
        self.max_episode_length, self.step_dt = task.max_episode_length, task.dt
        self.scene = Scene(robot, terrain, task)
        self.has_height_scan = observations.uses_height_scan(task, is_plane=terrain.is_plane)
        self.history_length = observations.history_length(task, robot)
        points = scan_points(task.terrain, self.scene.foot_pos)
        self.scan_points = points if self.has_height_scan else points[:0]
        check_env_memory(
            task,
            robot,
            points=len(self.scan_points),
            history=self.history_length - 1,
            ngeom=self.scene.model.ngeom,
        )
        velocity = np.where(robot.velocity > 0, robot.velocity, np.inf)
        self.sim = Simulation(self.scene, self.num_envs, task.env.num_threads, velocity)
        terrain.bind(self.sim.batch)
        self.mass = float(self.scene.model.body_subtreemass[self.scene.base])
        self.rng = np.random.default_rng(task.runner.seed)
        self.curriculum = TerrainCurriculum(terrain, self.num_envs, task.terrain, task.runner.seed)
        self.gait = Gait(task.commands, robot.leg_length, self.scene.foot_pos)
        self.sensors = Sensors(self.sim, terrain, task.dt, self.gait, self.scan_points)
        self.actions = JointActions(robot, task.control, self.scene.model)
        self.num_actions = len(self.actions.joints)
        self._make_buffers()
        self._make_terms()
        self._call_events("startup")
        self.reset()

    def _make_buffers(self) -> None:
        n = self.num_envs
        self.buffers = {}
        self.action_history = self.add_buffer("action_history", (3, n, self.num_actions))
        self.joint_offset = self.add_buffer("joint_offset", (n, len(self.robot.default_pose)))
        self.lin_vel_bias = self.add_buffer("lin_vel_bias", (n, 3))
        self.push_vel = self.add_buffer("push_vel", (n, 3))
        self.steps_until_push = self.add_buffer("steps_until_push", (n,), np.int64)
        # rsl-rl starts the first episodes at random lengths; this counts the real steps.
        self.steps_since_reset = self.add_buffer("steps_since_reset", (n,), np.int64)
        self.path_length = self.add_buffer("path_length", (n,), np.float64)
        self.episode_length_buf = torch.zeros(n, dtype=torch.int64)

    def add_buffer(self, name: str, shape: tuple[int, ...], dtype: Any = np.float32) -> Any:
        """Return a new array of zeros, one of the `buffers` that a checkpoint has."""
        buffer = self.buffers[name] = np.zeros(shape, dtype)
        return buffer

    def _make_terms(self) -> None:
        n = self.num_envs
        self.active_commands = self.command_terms()
        self.has_velocity = "velocity" in self.active_commands
        commands = LeggedEnv.command_terms(self) | self.active_commands
        self.velocity_command = cast("VelocityCommand", commands["velocity"])
        if not self.has_velocity:
            self.velocity_command.fixed = np.zeros((n, 3), np.float32)
        self.commands = self.velocity_command.values  # a view of the current commands
        self.waypoints = make_waypoints(self.cfg.commands, self.terrain, n)
        self.velocity_command.waypoints = self.waypoints
        groups = self.observation_terms()
        if self.interface is not None:
            groups = {**groups, "policy": self.interface.observation_terms(self, groups)}
        self.obs_terms = {
            group: {
                name: replace(term, function=checked("observation", name, term.function, (n, None)))
                for name, term in terms.items()
            }
            for group, terms in groups.items()
        }
        self.active_rewards = scaled_rewards(self)
        self.episode_sums = {name: np.zeros(n, np.float32) for name in self.active_rewards}
        self.active_terms = {
            name: checked("evaluation term", name, function, (n,))
            for name, function in self.evaluation_terms().items()
        }
        self.term_values: dict[str, FloatArray] = {}
        self.term_sums = {f"rew_{name}": total for name, total in self.episode_sums.items()}
        self.term_sums |= {name: self.add_buffer(f"sum_{name}", (n,)) for name in self.active_terms}
        self.active_terminations = [
            checked("termination", name, function, (n,))
            for name, function in self.termination_terms().items()
        ]
        self.active_events = self.event_terms()

    def command_terms(self) -> dict[str, CommandTerm]:
        """Return the commands by name: `velocity`, and your own ones.

        Without `velocity`, observations and rewards of velocity commands are left out.
        """
        cfg = self.cfg.commands
        is_map = not self.terrain.is_plane
        heading = is_map if cfg.heading_command is None else cfg.heading_command
        return {
            "velocity": VelocityCommand(cfg, self.num_envs, self.cfg.dt, heading_command=heading)
        }

    def observation_terms(self) -> dict[str, dict[str, ObservationTerm]]:
        """Return the terms of each observation group: `policy`, with noise, and `privileged`.

        With an estimator, the group `estimate` has what it predicts.
        """
        groups = {
            "policy": observations.policy_terms(self),
            "privileged": observations.privileged_terms(self),
        }
        if self.cfg.has_estimator:
            groups[ESTIMATE] = observations.estimate_terms(self)
        return groups

    def reward_terms(self) -> dict[str, Reward]:
        """Return the reward terms, whose scales are the fields of these names in the task."""
        return dict(REWARDS)

    def termination_terms(self) -> dict[str, Callable[["LeggedEnv"], BoolArray]]:
        """Return the conditions that end an episode as a fall."""
        return dict(TERMINATIONS)

    def evaluation_terms(self) -> dict[str, Reward]:
        """Return values to log in training, as means of episodes, and to evaluate, by name."""
        return {}

    def event_terms(self) -> dict[str, EventTerm]:
        """Return the events, in the order in which they happen."""
        return dict(EVENTS)

    @property
    def unwrapped(self) -> "LeggedEnv":
        """Return the environment itself, whose `step_dt` rsl-rl's RND reads."""
        return self

    @cached_property
    def mirror_maps(self) -> MirrorMaps:
        """Left-right symmetry of observations and actions."""
        return mirror_maps(self)

    @property
    def obs_sizes(self) -> dict[str, int]:
        """Number of observations in each group."""
        return {name: group.shape[1] for name, group in self.get_observations().items()}

    def get_observations(self) -> TensorDict:
        """Return the current observations; later steps do not modify these tensors."""
        return self._observations

    def step(
        self, actions: torch.Tensor
    ) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """Apply actions of shape (n, a), one for each of `actions.joints`, for one control step.

        Returns:
            Observations, rewards (n,), dones (n,), and extras with `time_outs` and `log`.
        """
        self.apply_actions(actions)
        if size := self.obs_history.shape[1]:  # the newest observation comes first
            self.obs_history = self.get_observations()["policy"].numpy(force=True)[:, :size]
        self._call_events("step")
        unstable = self.sim.step(self.cfg.control.decimation)
        self.episode_length_buf += 1
        self.steps_since_reset += 1
        self.state = state = self._compute_state(slice(None), self.state)
        state.dof_acc[unstable] = 0  # MuJoCo reset the state
        state.fallen[:] = unstable
        for termination in self.active_terminations:
            state.fallen[:] |= termination(self)
        rewards = self._compute_rewards(unstable)
        for name, term in self.active_terms.items():
            self.term_values[name] = term(self)
            self.term_sums[name] += self.term_values[name] * np.float32(self.cfg.dt)
        self.path_length += np.hypot(*state.base_lin_vel[:, :2].T) * self.cfg.dt
        time_out = self.episode_length_buf.numpy() >= self.max_episode_length
        if self.waypoints and self.velocity_command.fixed is None:
            time_out |= self.waypoints.update(state.base_pos[:, :2])
        if self.terrain.ends_at_bounds:
            time_out |= left_terrain(self)
        # A fall at the last step is a termination, which must not be bootstrapped.
        time_out &= ~state.fallen
        done = state.fallen | time_out
        update_progress(self, unstable)
        extras: dict[str, Any] = {"time_outs": torch.from_numpy(time_out).to(self.device)}
        env_ids = np.flatnonzero(done)
        if len(env_ids):
            if self.before_reset is not None:
                self.before_reset(env_ids)
            extras["log"] = end_episodes(self, env_ids, unstable)
            self._reset_idx(env_ids)
            state.update(env_ids, self._compute_state(env_ids))
        for command in self.active_commands.values():
            command.resample_due(self.rng, self.steps_since_reset)
        self._update_commands()
        self.update_observations()
        rewards_tensor = torch.from_numpy(rewards).to(self.device)
        return self._observations, rewards_tensor, torch.from_numpy(done).to(self.device), extras

    def reset(self) -> None:
        """Reset every environment."""
        self._reset_idx(np.arange(self.num_envs))
        self.state = self._compute_state(slice(None))
        self.obs_history = np.zeros((self.num_envs, observations.history_width(self)), np.float32)
        self._update_commands()
        self.update_observations()

    def set_commands(self, commands: FloatArray | None) -> None:
        """Set fixed velocity commands, unless the task has none.

        Args:
            commands: Forward and left velocity [m/s] and yaw velocity [rad/s], shape (n, 3); None
                restores the task's random commands.
        """
        if not self.has_velocity or (commands is None and self.velocity_command.fixed is None):
            return
        self.velocity_command.fixed = commands
        if commands is None:
            self.velocity_command.resample(self.rng, np.arange(self.num_envs))
        self._update_commands()
        self.update_observations()

    def to_ctrl(self, actions: FloatArray) -> FloatArray:
        """Return the actuator controls for actions.

        Args:
            actions: Actions of the policy, shape (n, a).

        Returns:
            Controls of all actuators, shape (n, j).
        """
        if self.interface is not None:
            return self.interface.to_ctrl(self, actions)
        return self.actions.to_ctrl(actions, self.joint_offset)

    def apply_actions(self, actions: torch.Tensor) -> None:
        """Give actions of shape (n, a) to the motors, without a step."""
        values = checked_actions(actions, (self.num_envs, self.num_actions))
        clip = self.cfg.normalization.clip_actions
        self.action_history[1:] = self.action_history[:-1]
        np.clip(values, -clip, clip, out=self.action_history[0])
        self.sim.ctrl[:] = self.to_ctrl(self.action_history[0])

    def _compute_state(self, rows: Any, last: State | None = None) -> State:
        """Return the state of some environments; without the `last` one, after a reset."""
        names = "actions", "last_actions", "last_last_actions"
        actions: dict[str, Any] = dict(zip(names, self.action_history[:, rows].copy(), strict=True))
        measured = self.sensors.read(rows, last, self.commands[rows])
        return State(**measured, **actions, **self._command_state(rows))

    def _command_state(self, rows: Any) -> dict[str, Any]:
        """Return the fields of `State` that depend on the commands."""
        commands = self.commands[rows].copy()
        time = self.steps_since_reset[rows] * self.cfg.dt
        gait_phase, swing_phase = self.gait.phases(time, is_moving(commands))
        return {"commands": commands, "gait_phase": gait_phase, "swing_phase": swing_phase}

    def _update_commands(self) -> None:
        """Let commands follow headings and waypoints, and write them into the state."""
        self.velocity_command.update(self.yaw, self.state.base_pos[:, :2])
        if np.array_equal(self.commands, self.state.commands):
            return
        for name, values in self._command_state(slice(None)).items():
            np.copyto(getattr(self.state, name), values)

    def _compute_rewards(self, unstable: BoolArray) -> FloatArray:
        """Return the rewards of a step, shape (n,), and add them to the episode sums.

        MuJoCo reset the unstable simulations, so only their termination reward counts.
        """
        dt = np.float32(self.cfg.dt)
        total = np.zeros(self.num_envs, np.float32)
        termination = np.zeros_like(total)
        any_unstable = unstable.any()
        for name, (function, scale) in self.active_rewards.items():
            # Scales are per second, so that they do not depend on the control frequency.
            term = function(self) * np.float32(scale) * dt
            if name == "termination":
                termination += term
            else:
                if any_unstable:
                    term[unstable] = 0
                total += term
            self.term_values[f"rew_{name}"] = term / dt
            self.episode_sums[name] += term
        if self.cfg.rewards.only_positive_rewards:
            total = np.maximum(total, 0)
        return total + termination

    def update_observations(self) -> None:
        """Compute the observations of the current state, with new noise."""
        groups = {}
        for name, terms in self.obs_terms.items():
            rng = self.rng if name == "policy" else None  # noise for the policy only
            groups[name] = observations.compute_observations(self, terms, rng)
        observations.fill_history(self, groups["policy"])
        self.set_observations({name: torch.from_numpy(group) for name, group in groups.items()})

    def set_observations(self, groups: Mapping[str, torch.Tensor]) -> None:
        """Replace the current observations of each group, shape (n, width)."""
        self._observations = TensorDict(groups, [self.num_envs], device=self.device)

    def _call_events(self, when: str, *arguments: Any) -> None:
        """Call the functions of all events for `startup`, `reset` or `step`."""
        for name, event in self.active_events.items():
            if function := getattr(event, when):
                is_own = not is_built_in(function)
                with plugin_errors(f"event {name} ({function.__module__})" if is_own else None):
                    function(self, *arguments)

    @property
    def yaw(self) -> FloatArray:
        """Heading of each robot [rad], shape (n,)."""
        return quat_to_yaw(self.sim.qpos[:, 3:7].astype(np.float32))

    def _reset_idx(self, env_ids: Ids) -> None:
        """Start new episodes."""
        self.episode_length_buf[env_ids] = self.steps_since_reset[env_ids] = 0
        self.path_length[env_ids] = self.action_history[:, env_ids] = 0
        for total in self.term_sums.values():
            total[env_ids] = 0
        levels, columns = self.curriculum.levels, self.curriculum.columns
        self.terrain.renew(env_ids, levels, columns, self.rng)
        self._call_events("reset", env_ids)
        self.curriculum.progress.reset(env_ids, self.sim.qpos[env_ids], self.yaw[env_ids])
        if self.waypoints:
            row, column = (index[env_ids] for index in self.curriculum.places)
            self.waypoints.reset(env_ids, self.terrain.goals[row, column, :, :2])
        for command in self.active_commands.values():
            command.resample(self.rng, env_ids)
