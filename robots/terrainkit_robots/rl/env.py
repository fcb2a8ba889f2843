"""The vectorized environment: legged robots that track velocity commands on a terrain."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from rsl_rl.env import VecEnv
from tensordict import TensorDict

from terrainkit.curriculum.waypoints import Waypoints
from terrainkit.errors import ConfigError
from terrainkit_robots.checkpoint import check_state
from terrainkit_robots.rl import observations
from terrainkit_robots.rl.commands import Gait, VelocityCommand
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.curriculum import TerrainCurriculum
from terrainkit_robots.rl.events import Pushes, apply_params, sample_params, sample_reset_state
from terrainkit_robots.rl.rewards import active_rewards, is_moving
from terrainkit_robots.rl.scene import build_scene
from terrainkit_robots.rl.simulation import Ids, Simulation, check_env_memory
from terrainkit_robots.rl.state import Sensors, State
from terrainkit_robots.rl.symmetry import MirrorMaps, mirror_maps
from terrainkit_robots.rl.terminations import terrain_out_of_bounds
from terrainkit_robots.rl.terrain import Ground
from terrainkit_robots.spec.robot import Robot
from terrainkit_robots.transforms import BoolArray, FloatArray, quat_to_yaw


class LeggedEnv(VecEnv):
    """An rsl-rl `VecEnv` of legged robots. Later steps do not modify returned tensors."""

    def __init__(self, task: Task, robot: Robot, terrain: Ground, device: str = "cpu") -> None:
        """Build the simulations and reset every environment."""
        self.cfg, self.robot, self.terrain, self.device = task, robot, terrain, device
        self.num_envs = n = task.env.num_envs
        self.max_episode_length = task.max_episode_length
        self.scene = build_scene(robot, terrain, task)
        scan = observations.uses_height_scan(task, is_plane=terrain.is_plane)
        check_env_memory(task, robot, scan=scan, ngeom=self.scene.model.ngeom)
        self.sim = Simulation(self.scene, n, task.env.num_threads)
        self.rng = np.random.default_rng(task.runner.seed)
        heading = task.commands.heading_command
        heading = not terrain.is_plane if heading is None else heading
        self.velocity_command = VelocityCommand(task.commands, n, task.dt, heading_command=heading)
        self.waypoints = None
        if task.commands.waypoints:
            if np.isnan(terrain.goals).all():
                got = "got a terrain without goals"
                expected = "expected a map with terrains such as course, and not collision plane"
                raise ConfigError(f"commands.waypoints: {got}; {expected}")
            num_goals, radius = terrain.goals.shape[2], task.commands.waypoint_radius
            self.waypoints = Waypoints.make(n, num_goals, radius)
        self.velocity_command.waypoints = self.waypoints
        self.gait = Gait(task.commands, robot.leg_length, self.scene.foot_pos)
        self.sensors = Sensors(self.sim, terrain, task, self.gait.averaging_time, scan=scan)
        self.pushes = Pushes(task.domain_rand, n, task.dt)
        mass = float(self.scene.model.body_subtreemass[self.scene.base])
        self.obs_terms = {
            "policy": observations.policy_group(robot, task, scan=scan),
            "privileged": observations.privileged_group(robot, task, scan=scan, weight=9.81 * mass),
        }
        self.params = sample_params(self.rng, n, self.sim, task.domain_rand)
        apply_params(self.sim, self.params)
        self.curriculum = TerrainCurriculum(terrain, n, task.terrain, task.runner.seed)
        self.episode_length_buf = torch.zeros(n, dtype=torch.int64)
        # rsl-rl starts the first episodes at random lengths; this counts the real steps.
        self.steps_since_reset = np.zeros(n, np.int64)
        self.path_length = np.zeros(n)  # since the last reset [m]
        self.reward_terms = active_rewards(task.rewards, mass, robot.leg_length)
        self.episode_sums = {name: np.zeros(n, np.float32) for name in self.reward_terms}
        self.commands = self.velocity_command.commands  # a view of the current commands

        # A motor receives offset + scale * action; without a scale, there is no action.
        kind, scale = task.control.control_type, task.control.action_scale
        default = {"P": robot.action_scale, "V": robot.velocity, "T": robot.effort}[kind]
        scales = default if scale is None else np.where(default == 0, 0, scale)
        self.action_scale = scales.astype(np.float32)
        self.action_joints = np.flatnonzero(self.action_scale)  # indices in the robot's order
        self.num_actions = len(self.action_joints)
        if not self.num_actions:
            raise ConfigError(f"action_scale of {robot.spec.name}: got 0 for every joint")
        self.action_history = np.zeros((2, n, self.num_actions), np.float32)  # the newest first
        self.joint_offset = np.zeros((n, len(robot.default_pose)), np.float32)
        width = observations.history_width(robot, task, self.num_actions)
        self.obs_history = np.zeros((n, width), np.float32)
        self.is_position_controlled = self.scene.model.actuator_biasprm[:, 1] != 0
        self.action_offset = np.where(self.is_position_controlled, robot.default_pose, 0)
        self.reset()

    @cached_property
    def mirror_maps(self) -> MirrorMaps:
        """Left-right symmetry of observations and actions."""
        robot, scene, scale = self.robot, self.scene, self.action_scale
        return mirror_maps(robot, scene, scale, self.obs_terms, self.state, self.cfg.terrain)

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
        self.pushes.apply(self.rng, self.sim.qvel)
        unstable = self.sim.step(self.cfg.control.decimation)
        self.episode_length_buf += 1
        self.steps_since_reset += 1
        self.sensors.last_dof_vel[unstable] = 0  # MuJoCo reset the state: no acceleration
        self.state = state = self._compute_state(np.arange(self.num_envs), unstable)
        rewards = self._compute_rewards(state, unstable)
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
        self.velocity_command.resample_due(self.rng, self.steps_since_reset)
        self._update_velocity_command()
        if len(env_ids):
            state.update(env_ids, self._compute_state(env_ids, after_reset=True))
        self._update_command_state()
        self._compute_observations()
        rewards_tensor = torch.from_numpy(rewards).to(self.device)
        return self._observations, rewards_tensor, torch.from_numpy(done).to(self.device), extras

    def reset(self) -> None:
        """Reset every environment."""
        env_ids = np.arange(self.num_envs)
        self._reset_idx(env_ids)
        self._update_velocity_command()
        self.state = self._compute_state(env_ids, after_reset=True)
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
        self._update_velocity_command()
        self._update_command_state()
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

    def _compute_state(
        self, env_ids: Ids, unstable: BoolArray | None = None, *, after_reset: bool = False
    ) -> State:
        """Return the state of the given environments; after a reset, there are no contacts."""
        rows: Any = slice(None) if len(env_ids) == self.num_envs else env_ids
        measured = self.sensors.read(rows, after_reset=after_reset)
        if unstable is not None:
            measured["fallen"] |= unstable
        return State(
            **measured,
            actions=self.action_history[0, rows].copy(),
            last_actions=self.action_history[1, rows].copy(),
            **self._command_state(rows),
            push_vel=self.pushes.velocity[rows].copy(),
            friction=self.params.friction[rows].copy(),
            added_mass=self.params.added_mass[rows].copy(),
            com_shift=self.params.com_shift[rows].copy(),
            joint_offset=self.joint_offset[rows].copy(),
            history=self.obs_history[rows].copy(),
        )

    def _command_state(self, rows: Any) -> dict[str, Any]:
        """Return the fields of `State` that depend on the commands."""
        commands, time = self.commands[rows].copy(), self.steps_since_reset[rows] * self.cfg.dt
        gait_phase, swing_phase = self.gait.phases(time, is_moving(commands))
        return {"commands": commands, "gait_phase": gait_phase, "swing_phase": swing_phase}

    def _update_command_state(self) -> None:
        """Write the current commands into the state."""
        for name, values in self._command_state(slice(None)).items():
            np.copyto(getattr(self.state, name), values)

    def _compute_rewards(self, state: State, unstable: BoolArray) -> FloatArray:
        """Return the rewards of a step, shape (n,), and add them to the episode sums.

        MuJoCo reset the unstable simulations, so only their termination reward counts.
        """
        settings, dt = self.cfg.rewards, np.float32(self.cfg.dt)
        total = np.zeros(self.num_envs, np.float32)
        termination = np.zeros_like(total)
        for name, (function, scale) in self.reward_terms.items():
            # Scales are per second, so that they do not depend on the control frequency.
            term = function(state, self.robot, settings) * np.float32(scale) * dt
            if name == "termination":
                termination += term
            else:
                term[unstable] = 0
                total += term
            self.episode_sums[name] += term
        return total + termination

    def _compute_observations(self) -> None:
        clip, groups = self.cfg.normalization.clip_observations, {}
        for name, terms in self.obs_terms.items():
            rng = self.rng if name == "policy" else None  # noise for the policy only
            values = observations.compute_observations(terms, self.state, clip, rng)
            groups[name] = torch.from_numpy(values)
        if past := self.cfg.observations.history_length - 1:
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

    def _yaw(self) -> FloatArray:
        return quat_to_yaw(self.sim.qpos[:, 3:7].astype(np.float32))

    def _update_velocity_command(self) -> None:
        self.velocity_command.update(self._yaw(), self.sim.qpos[:, :2].astype(np.float32))

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
        left_map = terrain_out_of_bounds(state.base_pos, self.terrain) & ~unstable
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
        returns = np.sum([total[env_ids] for total in self.episode_sums.values()], axis=0)
        self.curriculum.sampler.update(env_ids[complete], progress[complete], returns[complete])
        return log if self.terrain.is_plane else log | self.curriculum.log()

    def _reset_idx(self, env_ids: Ids) -> None:
        """Start new episodes."""
        origins, cfg = self.curriculum.env_origins[env_ids], self.cfg.init_state
        qpos, qvel = sample_reset_state(
            self.rng, origins, self.scene, self.robot, self.terrain, cfg
        )
        self.sim.reset(env_ids, qpos, qvel)
        # Random joint positions may put a foot below the ground: raise the base.
        x, y, z = np.moveaxis(self.sim.sensor("foot_position", env_ids), 2, 0)
        depth = (self.terrain.height(x, y, z) + self.scene.sole_depth - z).max(axis=1)
        if (depth > 0).any():
            self.sim.qpos[env_ids, 2] += np.maximum(depth, 0)
            self.sim.forward(env_ids)
        self.curriculum.progress.reset(env_ids, qpos, self._yaw()[env_ids])
        if self.waypoints:
            level, column = self.curriculum.levels[env_ids], self.curriculum.columns[env_ids]
            self.waypoints.reset(env_ids, self.terrain.goals[level, column, :, :2])
        self.episode_length_buf[env_ids] = self.steps_since_reset[env_ids] = 0
        self.path_length[env_ids] = self.action_history[:, env_ids] = 0
        self.pushes.reset(self.rng, env_ids)
        self.sensors.reset(env_ids)
        limit, shape = self.cfg.domain_rand.joint_offset, (len(env_ids), self.joint_offset.shape[1])
        self.joint_offset[env_ids] = self.rng.uniform(-limit, limit, shape)
        if limits := self.cfg.domain_rand.action_delay:
            delay = self.rng.uniform(*limits, len(env_ids))
            ctrl = self.to_ctrl(self.action_history[0])[env_ids]
            self.sim.reset_action_delay(env_ids, delay, ctrl)
        for total in self.episode_sums.values():
            total[env_ids] = 0
        self.velocity_command.resample(self.rng, env_ids)

    def state_dict(self) -> dict[str, Any]:
        """Return all mutable state, for an exact resume."""
        return {
            "arrays": {name: torch.tensor(array) for name, array in self._arrays().items()},
            "rng": self.rng.bit_generator.state,
            "curriculum": self.curriculum.state_dict(),
            "observations": dict(self._observations.clone().items()),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore a state; if the number of environments differs, restore only the curriculum."""
        parts = self.state_dict()
        check_state("env", state, dict.fromkeys(parts, ...))
        self.curriculum.load_state_dict(state["curriculum"])
        arrays, saved = self._arrays(), state["arrays"]
        num_envs = len(state["curriculum"]["levels"])
        if num_envs != self.num_envs and num_envs == len(saved["episode_length"]):
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
            raise ConfigError(f"next_goal: got {largest}; expected no more than the robot has")
        apply_params(self.sim, self.params)
        self.rng.bit_generator.state = state["rng"]
        groups = {name: state["observations"][name] for name in parts["observations"]}
        self._observations = TensorDict(groups, [self.num_envs]).to(self.device)

    def _arrays(self) -> dict[str, NDArray[Any]]:
        """Return views of the arrays to save, by name."""
        # Names are checkpoint keys; renaming a field breaks resume.
        names = "commands joint_offset steps_since_reset path_length"
        arrays = {name: getattr(self, name) for name in names.split()} | {
            "actions": self.action_history,
            "physics": self.sim.batch.state,
            "episode_length": self.episode_length_buf.numpy(),
            "heading": self.velocity_command.heading,
            "last_dof_vel": self.sensors.last_dof_vel,
            "mean_vel": self.sensors.mean_vel,
            "push_vel": self.pushes.velocity,
            "steps_until_push": self.pushes.steps_until_push,
        }
        arrays |= {f"progress_{k}": array for k, array in vars(self.curriculum.progress).items()}
        sums = {f"rew_{name}": total for name, total in self.episode_sums.items()}
        # Computing the state again would draw noise.
        state = {f"state_{name}": array for name, array in vars(self.state).items()}
        if not self.obs_history.size:
            del state["state_history"]
        if self.waypoints:
            arrays |= {"goals": self.waypoints.goals, "next_goal": self.waypoints.index}
            arrays["speed"] = self.velocity_command.speed
        if self.cfg.domain_rand.action_delay:
            arrays["action_delay"] = self.sim.batch.expand("actuator_delay")
        return arrays | sums | state | vars(self.params)
