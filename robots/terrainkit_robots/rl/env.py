"""The vectorized environment: legged robots that track velocity commands on a terrain."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, cast

import mujoco
import numpy as np
import torch
from numpy.typing import NDArray
from rsl_rl.env import VecEnv
from tensordict import TensorDict

from terrainkit.curriculum.waypoints import Waypoints
from terrainkit.errors import ConfigError, TerrainkitError, is_built_in, plugin_errors
from terrainkit_robots.checkpoint import check_state
from terrainkit_robots.rl import observations
from terrainkit_robots.rl.commands import CommandTerm, Gait, VelocityCommand
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.curriculum import TerrainCurriculum
from terrainkit_robots.rl.events import EVENTS, EventTerm, RandomizedParams, apply_params
from terrainkit_robots.rl.observations import ObservationTerm
from terrainkit_robots.rl.own_terms import checked
from terrainkit_robots.rl.rewards import REWARDS, Reward, is_moving, reward_scales
from terrainkit_robots.rl.scene import Scene
from terrainkit_robots.rl.simulation import Ids, Simulation, check_env_memory
from terrainkit_robots.rl.state import Sensors, State
from terrainkit_robots.rl.symmetry import MirrorMaps, mirror_maps
from terrainkit_robots.rl.terminations import TERMINATIONS, terrain_out_of_bounds
from terrainkit_robots.rl.terrain import Ground
from terrainkit_robots.spec.robot_arrays import Robot
from terrainkit_robots.transforms import BoolArray, FloatArray, quat_to_yaw


def make_env(task: Task, robot: Robot, terrain: Ground, device: str = "cpu") -> "LeggedEnv":
    """Return the environment of a task: of its `env_class`, or of `LeggedEnv`.

    Raises:
        ConfigError: If task, robot and terrain do not fit together.
        PluginError: If an environment of another package fails.
    """
    kind = task.env_class or LeggedEnv
    plugin = None if is_built_in(kind) else f"{kind.__module__}:{kind.__qualname__}"
    with plugin_errors(plugin, TerrainkitError):
        return kind(task, robot, terrain, device)


class LeggedEnv(VecEnv):
    """An rsl-rl `VecEnv` of legged robots. Later steps do not modify returned tensors.

    The `env_class` of a task of your own is a subclass with other terms: functions of the
    environment by name.
    """

    params: RandomizedParams
    """Physical parameters of the robots; the event `params` samples them."""

    state: State
    """State after the last step, with the current commands."""

    obs_history: FloatArray
    """Previous observations of the policy, the newest first, shape (n, h)."""

    _observations: TensorDict

    def __init__(self, task: Task, robot: Robot, terrain: Ground, device: str = "cpu") -> None:
        """Build the simulations and reset every environment."""
        self.cfg, self.robot, self.terrain, self.device = task, robot, terrain, device
        self.num_envs = n = task.env.num_envs
        self.max_episode_length, self.step_dt = task.max_episode_length, task.dt
        self.scene = Scene(robot, terrain, task)
        self.has_height_scan = observations.uses_height_scan(task, is_plane=terrain.is_plane)
        self.history_length = observations.history_length(task, robot)
        check_env_memory(
            task,
            robot,
            scan=self.has_height_scan,
            history=self.history_length - 1,
            ngeom=self.scene.model.ngeom,
        )
        self.sim = Simulation(self.scene, n, task.env.num_threads)
        self.mass = float(self.scene.model.body_subtreemass[self.scene.base])
        self.rng = np.random.default_rng(task.runner.seed)
        self.curriculum = TerrainCurriculum(terrain, n, task.terrain, task.runner.seed)
        self.buffers: dict[str, NDArray[Any]] = {}
        """Arrays that own terms keep between steps, which a checkpoint has."""
        self.gait = Gait(task.commands, robot.leg_length, self.scene.foot_pos)
        self.sensors = Sensors(
            self.sim,
            terrain,
            task,
            averaging_time=self.gait.averaging_time,
            leg_length=robot.leg_length,
            scan=self.has_height_scan,
        )
        self.push_vel = np.zeros((n, 3), np.float32)  # of this step, world frame [m/s]
        self.steps_until_push = np.zeros(n, np.int64)
        self.episode_length_buf = torch.zeros(n, dtype=torch.int64)
        # rsl-rl starts the first episodes at random lengths; this counts the real steps.
        self.steps_since_reset = np.zeros(n, np.int64)
        self.path_length = np.zeros(n)  # since the last reset [m]

        # A motor receives offset + scale * action; without a scale, there is no action.
        kind, scale = task.control.control_type, task.control.action_scale
        default = {"P": robot.action_scale, "V": robot.velocity, "T": robot.effort}[kind]
        scales = default if scale is None else np.where(default == 0, 0, scale)
        self.action_scale = scales.astype(np.float32)
        self.action_joints = np.flatnonzero(self.action_scale)  # indices in the robot's order
        self.num_actions = len(self.action_joints)
        if not self.num_actions:
            raise ConfigError(f"action_scale of {robot.spec.name}: got 0 for every joint")
        self.action_history = np.zeros((3, n, self.num_actions), np.float32)  # the newest first
        self.joint_offset = np.zeros((n, len(robot.default_pose)), np.float32)
        self.lin_vel_bias = np.zeros((n, 3), np.float32)
        self.is_position_controlled = self.scene.model.actuator_biasprm[:, 1] != 0
        self.action_offset = np.where(self.is_position_controlled, robot.default_pose, 0)

        self.active_commands = self.command_terms()
        self.velocity_command = cast("VelocityCommand", self.active_commands["velocity"])
        self.commands = self.velocity_command.values  # a view of the current commands
        self.velocity_command.waypoints = self.waypoints = self._make_waypoints()
        self.obs_terms = {
            group: {
                name: replace(each, function=checked("observation", name, each.function, (n, None)))
                for name, each in terms.items()
            }
            for group, terms in self.observation_terms().items()
        }
        self.active_rewards = self._scaled_rewards()
        self.episode_sums = {name: np.zeros(n, np.float32) for name in self.active_rewards}
        self.active_terminations = [
            checked("termination", *each, (n,)) for each in self.termination_terms().items()
        ]
        self.active_events = self.event_terms()
        self._call_events("startup")
        self.reset()

    def command_terms(self) -> dict[str, CommandTerm]:
        """Return the commands by name: `velocity`, and your own ones."""
        cfg, is_map = self.cfg.commands, not self.terrain.is_plane
        heading = is_map if cfg.heading_command is None else cfg.heading_command
        return {
            "velocity": VelocityCommand(cfg, self.num_envs, self.cfg.dt, heading_command=heading)
        }

    def observation_terms(self) -> dict[str, dict[str, ObservationTerm]]:
        """Return the terms of each observation group: `policy`, with noise, and `privileged`."""
        return {
            "policy": observations.policy_terms(self),
            "privileged": observations.privileged_terms(self),
        }

    def reward_terms(self) -> dict[str, Reward]:
        """Return the reward terms, whose scales are the fields of these names in the task."""
        return dict(REWARDS)

    def termination_terms(self) -> dict[str, Callable[["LeggedEnv"], BoolArray]]:
        """Return the conditions that end an episode as a fall."""
        return dict(TERMINATIONS)

    def event_terms(self) -> dict[str, EventTerm]:
        """Return the events, in the order in which they happen."""
        return dict(EVENTS)

    @property
    def joint_units(self) -> tuple[str, ...]:
        """Unit of each joint's position."""
        slide = mujoco.mjtJoint.mjJNT_SLIDE
        types = (self.scene.model.joint(name).type[0] for name in self.robot.spec.joint_order)
        return tuple("m" if each == slide else "rad" for each in types)

    @property
    def unwrapped(self) -> "LeggedEnv":
        """Return the environment itself, whose `step_dt` rsl-rl's RND reads."""
        return self

    @cached_property
    def drawn_model(self) -> Any:
        """The model with all geoms of the terrain, for pictures."""
        whole = self.scene
        if whole.near_terrain:
            whole = Scene(self.robot, self.terrain, self.cfg, all_geoms=True)
        return whole.model

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
        """Apply actions of shape (n, a), one for each of `action_joints`, for one control step.

        Returns:
            Observations, rewards (n,), dones (n,), and extras with `time_outs` and `log`.
        """
        self._apply_actions(actions)
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
        self.path_length += np.hypot(*state.base_lin_vel[:, :2].T) * self.cfg.dt
        time_out = self.episode_length_buf.numpy() >= self.max_episode_length
        if self.waypoints and self.velocity_command.fixed is None:
            time_out |= self.waypoints.update(state.base_pos[:, :2])
        # A fall at the last step is a termination, which must not be bootstrapped.
        time_out &= ~state.fallen
        done = state.fallen | time_out
        self._update_progress(state, unstable)
        extras: dict[str, Any] = {"time_outs": torch.from_numpy(time_out).to(self.device)}
        env_ids = np.flatnonzero(done)
        if len(env_ids):
            extras["log"] = self._end_episodes(env_ids, state, unstable)
            self._reset_idx(env_ids)
            state.update(env_ids, self._compute_state(env_ids))
        for command in self.active_commands.values():
            command.resample_due(self.rng, self.steps_since_reset)
        self._update_commands()
        self._compute_observations()
        rewards_tensor = torch.from_numpy(rewards).to(self.device)
        return self._observations, rewards_tensor, torch.from_numpy(done).to(self.device), extras

    def reset(self) -> None:
        """Reset every environment."""
        self._reset_idx(np.arange(self.num_envs))
        self.state = self._compute_state(slice(None))
        self._reset_history()
        self._update_commands()
        self._compute_observations()

    def set_commands(self, commands: FloatArray | None) -> None:
        """Set fixed commands.

        Args:
            commands: Forward and left velocity [m/s] and yaw velocity [rad/s], shape (n, 3); None
                restores the task's random commands.
        """
        if commands is None and self.velocity_command.fixed is None:
            return
        self.velocity_command.fixed = commands
        if commands is None:
            self.velocity_command.resample(self.rng, np.arange(self.num_envs))
        self._update_commands()
        self._compute_observations()

    def to_ctrl(self, actions: FloatArray) -> FloatArray:
        """Return the actuator controls for actions.

        Args:
            actions: Actions of the policy, shape (n, a).

        Returns:
            Controls of all actuators, shape (n, j).
        """
        target = np.tile(self.action_offset, (len(actions), 1))
        target[:, self.action_joints] += self.action_scale[self.action_joints] * actions
        # A joint with a zero offset reads too much, so its motor stops short by the same angle.
        return target - self.joint_offset * self.is_position_controlled

    def _apply_actions(self, actions: torch.Tensor) -> None:
        array = actions.detach().to("cpu", torch.float32).numpy()
        expected = (self.num_envs, self.num_actions)
        if array.shape != expected:
            raise ConfigError(f"shape of the actions: got {array.shape}; expected {expected}")
        if not np.isfinite(array).all():
            first = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
            raise ConfigError(f"actions of environment {first} are not finite: the policy diverged")
        clip = self.cfg.normalization.clip_actions
        self.action_history[1:] = self.action_history[:-1]
        np.clip(array, -clip, clip, out=self.action_history[0])
        self.sim.ctrl[:] = self.to_ctrl(self.action_history[0])

    def _compute_state(self, rows: Any, last: State | None = None) -> State:
        """Return the state of some environments; without the `last` one, after a reset."""
        history = self.action_history[:, rows].copy()
        names = "actions", "last_actions", "last_last_actions"
        actions: dict[str, Any] = dict(zip(names, history, strict=True))
        measured = self.sensors.read(rows, last, self.commands[rows])
        return State(**measured, **actions, **self._command_state(rows))

    def _command_state(self, rows: Any) -> dict[str, Any]:
        """Return the fields of `State` that depend on the commands."""
        commands, time = self.commands[rows].copy(), self.steps_since_reset[rows] * self.cfg.dt
        gait_phase, swing_phase = self.gait.phases(time, is_moving(commands))
        return {"commands": commands, "gait_phase": gait_phase, "swing_phase": swing_phase}

    def _update_commands(self) -> None:
        """Let commands follow headings and waypoints, and write them into the state."""
        position = self.sim.qpos[:, :2].astype(np.float32)
        self.velocity_command.update(self._yaw(), position)
        for name, values in self._command_state(slice(None)).items():
            np.copyto(getattr(self.state, name), values)

    def _compute_rewards(self, unstable: BoolArray) -> FloatArray:
        """Return the rewards of a step, shape (n,), and add them to the episode sums.

        MuJoCo reset the unstable simulations, so only their termination reward counts.
        """
        dt = np.float32(self.cfg.dt)
        total = np.zeros(self.num_envs, np.float32)
        termination = np.zeros_like(total)
        for name, (function, scale) in self.active_rewards.items():
            # Scales are per second, so that they do not depend on the control frequency.
            term = function(self) * np.float32(scale) * dt
            if name == "termination":
                termination += term
            else:
                term[unstable] = 0
                total += term
            self.episode_sums[name] += term
        return total + termination

    def _scaled_rewards(self) -> dict[str, tuple[Reward, float]]:
        """Return each reward term with a scale other than 0, and that scale in SI units."""
        terms, own = self.reward_terms(), type(self.cfg.rewards).__name__
        for name in terms.keys() - vars(self.cfg.rewards).keys():
            raise ConfigError(f"reward {name}: {own} has no field {name}; expected its scale")
        scales = reward_scales(self.cfg.rewards, self.mass, self.robot.leg_length)
        return {
            name: (checked("reward", name, function, (self.num_envs,)), scales[name])
            for name, function in terms.items()
            if name in scales
        }

    def _reset_history(self) -> None:
        """Make the history of the policy: the previous observations of the terms before it."""
        terms = self.obs_terms["policy"]
        names = [*terms][: [*terms].index("history")] if "history" in terms else []
        width = sum(terms[name].function(self).shape[1] for name in names)
        past = self.history_length - 1
        self.obs_history = np.zeros((self.num_envs, past * width), np.float32)

    def _make_waypoints(self) -> Waypoints | None:
        """Return the goals of the robots, if they are commanded to walk to them."""
        cfg, goals = self.cfg.commands, self.terrain.goals
        if cfg.waypoints and np.isnan(goals).all():
            raise ConfigError(
                "commands.waypoints: got a terrain without goals; expected a map with terrains "
                "such as course, and not collision plane"
            )
        number = goals.shape[2]
        return Waypoints.make(self.num_envs, number, cfg.waypoint_radius) if cfg.waypoints else None

    def _compute_observations(self) -> None:
        groups = {}
        for name, terms in self.obs_terms.items():
            rng = self.rng if name == "policy" else None  # noise for the policy only
            values = observations.compute_observations(self, terms, rng)
            groups[name] = torch.from_numpy(values)
        if past := self.history_length - 1:
            # The history of a new episode repeats its first observation.
            new, policy = self.steps_since_reset == 0, groups["policy"]
            width = self.obs_history.shape[1] // past
            policy[new, width : width * (1 + past)] = policy[new, :width].repeat(1, past)
        self._observations = TensorDict(groups, batch_size=[self.num_envs]).to(self.device)

    def _update_progress(self, state: State, unstable: BoolArray) -> None:
        progress = self.curriculum.progress
        # MuJoCo moved the unstable robots to the world's origin.
        pos = np.where(unstable[:, None], progress.position, state.base_pos[:, :2])
        rate = self.velocity_command.yaw_rate(progress.yaw.astype(np.float32))
        progress.update(pos, quat_to_yaw(state.base_quat), self.commands, rate, self.cfg.dt)

    def _call_events(self, when: str, *arguments: Any) -> None:
        """Call the functions of all events for `startup`, `reset` or `step`."""
        for name, event in self.active_events.items():
            if function := getattr(event, when):
                is_own = not is_built_in(function)
                with plugin_errors(f"event {name} ({function.__module__})" if is_own else None):
                    function(self, *arguments)

    def _yaw(self) -> FloatArray:
        return quat_to_yaw(self.sim.qpos[:, 3:7].astype(np.float32))

    def _end_episodes(self, env_ids: Ids, state: State, unstable: BoolArray) -> dict[str, float]:
        """Update the curriculum at the end of episodes, and return the values to log."""
        seconds, fallen = self.steps_since_reset[env_ids] * self.cfg.dt, state.fallen[env_ids]
        log = {
            f"Episode/rew_{name}": float((total[env_ids] / seconds).mean())
            for name, total in self.episode_sums.items()
        }
        log["Episode/falls"] = float(fallen.mean())
        log["Episode/speed"] = float((self.path_length[env_ids] / seconds).mean())
        # rsl-rl cuts the first episodes to random lengths, so their progress is not meaningful.
        complete = (self.episode_length_buf.numpy() == self.steps_since_reset)[env_ids]
        left_map = terrain_out_of_bounds(self) & ~unstable
        progress = self.curriculum.progress.of_episodes(
            env_ids, fallen, self.terrain.patch_length / 2, left_map=left_map[env_ids]
        )
        if self.waypoints and self.velocity_command.fixed is None:
            reached = self.waypoints.progress[env_ids]
            commanded = self.curriculum.progress.commanded[env_ids]
            start = self.curriculum.progress.start[env_ids]
            to_goals = self.waypoints.of_episodes(env_ids, fallen, start, commanded)
            progress = np.where(np.isnan(reached), progress, to_goals)
            if not np.isnan(reached).all():
                log["Episode/goals_reached"] = float(np.nanmean(reached))
        if "tracking_lin_vel" in self.active_rewards:
            most = self.cfg.env.episode_length_s * self.active_rewards["tracking_lin_vel"][1]
            tracking = self.episode_sums["tracking_lin_vel"][env_ids] / most
            self.velocity_command.end_episodes(tracking)
        returns = np.sum([total[env_ids] for total in self.episode_sums.values()], axis=0)
        self.curriculum.sampler.update(env_ids[complete], progress[complete], returns[complete])
        return log if self.terrain.is_plane else log | self.curriculum.log()

    def _reset_idx(self, env_ids: Ids) -> None:
        """Start new episodes."""
        self.episode_length_buf[env_ids] = self.steps_since_reset[env_ids] = 0
        self.path_length[env_ids] = self.action_history[:, env_ids] = 0
        for total in self.episode_sums.values():
            total[env_ids] = 0
        self._call_events("reset", env_ids)
        self.curriculum.progress.reset(env_ids, self.sim.qpos[env_ids], self._yaw()[env_ids])
        if self.waypoints:
            level, column = self.curriculum.levels[env_ids], self.curriculum.columns[env_ids]
            self.waypoints.reset(env_ids, self.terrain.goals[level, column, :, :2])
        for command in self.active_commands.values():
            command.resample(self.rng, env_ids)

    def state_dict(self) -> dict[str, Any]:
        """Return all mutable state, for an exact resume."""
        return {
            "arrays": {name: torch.tensor(array) for name, array in self._arrays().items()},
            "rng": self.rng.bit_generator.state,
            "curriculum": self.curriculum.state_dict(),
            "observations": dict(self._observations.clone().items()),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore a state; if the number of environments differs, restore only the curricula."""
        parts = self.state_dict()
        check_state("env", state, dict.fromkeys(parts, ...))
        self.curriculum.load_state_dict(state["curriculum"])
        arrays, saved = self._arrays(), state["arrays"]
        num_envs = len(state["curriculum"]["levels"])
        if num_envs != self.num_envs and num_envs == len(saved["episode_length"]):
            shared = [f"velocity.{name}" for name in ("lin_vel_x", "tracked", "steps")]
            check_state("env.arrays", saved, {name: parts["arrays"][name] for name in shared})
            for name in shared:
                arrays[name][...] = saved[name].numpy()
            self.reset()
            return
        try:
            check_state("env", state, parts | {"curriculum": ...})
        except ConfigError as error:
            hint = "with another env.num_envs, the networks and the curriculum can be used"
            raise ConfigError(f"{error}; {hint}") from error
        for name, array in arrays.items():
            array[...] = saved[name].numpy()
        if self.waypoints and (self.waypoints.index > self.waypoints.numbers).any():
            largest = self.waypoints.index.max()
            raise ConfigError(f"next goal: got {largest}; expected no more than the robot has")
        apply_params(self.sim, self.params)
        self.rng.bit_generator.state = state["rng"]
        groups = {name: state["observations"][name] for name in parts["observations"]}
        self._observations = TensorDict(groups, [self.num_envs]).to(self.device)

    def _arrays(self) -> dict[str, NDArray[Any]]:
        """Return views of the arrays to save, by name."""
        # Names are checkpoint keys; renaming a field breaks resume.
        names = "action_history joint_offset lin_vel_bias steps_since_reset path_length push_vel"
        arrays = {name: getattr(self, name) for name in names.split()} | {
            "physics": self.sim.batch.state,
            "episode_length": self.episode_length_buf.numpy(),
            "steps_until_push": self.steps_until_push,
        }
        if self.cfg.domain_rand.action_delay:
            arrays["action_delay"] = self.sim.batch.expand("actuator_delay")
        # The state has means, accelerations and forces, which cannot be computed from the physics.
        owners = {"state": self.state, "params": self.params, "waypoints": self.waypoints}
        owners |= {"progress": self.curriculum.progress, **self.active_commands}
        tables = {name: vars(owner) for name, owner in owners.items() if owner}
        tables |= {"rewards": self.episode_sums, "buffers": self.buffers}
        return arrays | {
            f"{table}.{name}": each
            for table, values in tables.items()
            for name, each in values.items()
            if isinstance(each, np.ndarray)
        }
