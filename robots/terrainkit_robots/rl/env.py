"""The environment: n robots on one ground, as rsl-rl's `VecEnv`.

Each step: act, let the physics run, look, judge, reward, begin anew what has ended, observe. All is
numpy until the border, where arrays become fresh tensors.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from rsl_rl.env import VecEnv
from tensordict import TensorDict

from terrainkit.errors import ConfigError
from terrainkit_robots.rl.careers import Careers
from terrainkit_robots.rl.commands import Orders, asks_headings
from terrainkit_robots.rl.control import control_of
from terrainkit_robots.rl.earnings import Earnings
from terrainkit_robots.rl.ground import Ground
from terrainkit_robots.rl.observations import (
    observe,
    policy_group,
    privileged_group,
    sees_heights,
)
from terrainkit_robots.rl.physics import Physics
from terrainkit_robots.rl.randomization import Pushes, apply_differences, draw_differences
from terrainkit_robots.rl.robot import Robot
from terrainkit_robots.rl.room import require_room
from terrainkit_robots.rl.rotation import yaw_of
from terrainkit_robots.rl.scene import build_scene
from terrainkit_robots.rl.sensors import Sensors
from terrainkit_robots.rl.start import draw_start
from terrainkit_robots.rl.state import State
from terrainkit_robots.rl.task import Task
from terrainkit_robots.rl.terminations import outside

FloatArray = NDArray[np.float32]
Ids = NDArray[np.int64]


class LeggedEnv(VecEnv):
    """Legged robots that follow commands; see :mod:`.task` for what they are paid for."""

    def __init__(self, task: Task, robot: Robot, ground: Ground, device: str = "cpu") -> None:
        """Build it, and begin the first episodes.

        Raises:
            ConfigError: if the robot or the task does not fit.
            MemoryLimitError: if so many environments do not fit in memory.
        """
        self.cfg, self.robot, self.ground = task, robot, ground
        self.num_envs, self.num_actions = task.env.num_envs, len(robot.default_pose)
        self.max_episode_length = task.max_episode_length
        self.device = device
        self.scene = build_scene(robot, ground, task)
        scan = sees_heights(task.terrain, level=ground.level)
        require_room(task, robot, scan=scan, geoms=self.scene.model.ngeom)
        self.physics = Physics(self.scene, self.num_envs, task.env.num_threads)
        self.control = control_of(robot, task)
        self.rng = np.random.default_rng(task.runner.seed)
        self.sensors = Sensors(self.physics, ground, task, scan=scan)
        headings = asks_headings(task.commands, ground)
        self.orders = Orders(task.commands, self.num_envs, task.dt, headings=headings)
        self.pushes = Pushes(task.domain_rand, self.num_envs, task.dt)
        self.earnings = Earnings(task.rewards, robot, task.dt, self.num_envs)
        weight = float(self.scene.model.body_subtreemass[self.scene.base] * 9.81)
        self.groups = {
            "policy": policy_group(robot, task, scan=scan),
            "privileged": privileged_group(robot, task, scan=scan, weight=weight),
        }
        self.differences = draw_differences(self.rng, self.num_envs, self.physics, task.domain_rand)
        apply_differences(self.physics, self.differences)
        self.careers = Careers(ground, self.num_envs, task.terrain.max_init_level, task.runner.seed)
        self._allocate()
        self.begin_all()

    def _allocate(self) -> None:
        """Make what each robot remembers from step to step."""
        n, joints = self.num_envs, self.num_actions
        self.lengths = np.zeros(n, np.int64)  # of episodes, as the runner knows them
        self.actions = np.zeros((3, n, joints), np.float32)  # of this step, and of two before
        self.joint_offset = np.zeros((n, joints), np.float32)
        self.steps = np.zeros(n, np.int64)  # of this episode, whatever the runner says
        self.start = np.zeros((n, 2))
        # What those who look at an environment ask for most; live.
        self.commands, self.heading = self.orders.commands, self.orders.heading
        self.rewards, self.sums = self.earnings.rewards, self.earnings.sums
        self.air_time, self.push_vel = self.sensors.air_time, self.pushes.velocity

    @property
    def episode_length_buf(self) -> torch.Tensor:
        """Length of each episode so far, in steps; live, and the runner may replace it."""
        return torch.from_numpy(self.lengths)

    @episode_length_buf.setter
    def episode_length_buf(self, lengths: torch.Tensor) -> None:
        self.lengths[:] = lengths.cpu().numpy()

    def hold_commands(self, commands: FloatArray | None) -> None:
        """Ask for the same all the time, shape (n, 3); None to draw new commands at once."""
        let_go = commands is None and self.orders.held is not None
        self.orders.held = commands
        if let_go:
            self.orders.draw(self.rng, np.arange(self.num_envs))
        if let_go or commands is not None:
            self.orders.steer(self._yaw())
            np.copyto(self.state.commands, self.commands)
            self._observed = self._observe()

    def begin_all(self) -> None:
        """Begin every episode anew."""
        everyone = np.arange(self.num_envs)
        self._begin(everyone)
        self.orders.steer(self._yaw())
        self.state = self._look(everyone, fresh=True)
        self._observed = self._observe()

    def state_dict(self) -> dict[str, Any]:
        """Return all that changes from step to step, so that a run can go on as if unbroken."""
        arrays = {name: torch.from_numpy(value.copy()) for name, value in self._arrays().items()}
        return {
            "arrays": arrays,
            "rng": self.rng.bit_generator.state,
            "lin_vel_x": self.orders.lin_vel_x,
            "careers": self.careers.state_dict(),
            "state": {k: torch.from_numpy(v.copy()) for k, v in vars(self.state).items()},
            "observed": dict(self._observed.clone().items()),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Go on from a state; with another number of environments only the curriculum does.

        Raises:
            ConfigError: if the state is of another robot or map.
        """
        self.careers.load_state_dict(state["careers"])
        self.orders.lin_vel_x = tuple(state["lin_vel_x"])
        mine, theirs = self._arrays(), state["arrays"]
        if len(theirs["episode_length"]) != self.num_envs:
            self.begin_all()
            return
        kept = {name for name in mine if not name.startswith("rew_")}  # those are the task's
        if kept - theirs.keys() or vars(self.state).keys() != state["state"].keys():
            raise ConfigError(
                "the checkpoint was written by another version of terrainkit; with another "
                "env.num_envs its networks and its curriculum go on"
            )
        for name, value in mine.items():
            if name not in theirs or tuple(theirs[name].shape) != value.shape:
                raise ConfigError(f"the checkpoint's {name} is of another robot or task")
        for name, value in mine.items():
            value[...] = theirs[name].numpy()
        apply_differences(self.physics, self.differences)
        self.rng.bit_generator.state = state["rng"]
        # To look again would count time and draw noise once more.
        self.state = State(**{k: v.numpy().copy() for k, v in state["state"].items()})
        self._observed = TensorDict(state["observed"], batch_size=[self.num_envs]).to(self.device)

    def _arrays(self) -> dict[str, NDArray[Any]]:
        """Return what each robot remembers, by name; live."""
        own = {
            "physics": self.physics.batch.state,
            "episode_length": self.lengths,
            "commands": self.commands,
            "heading": self.heading,
            "actions": self.actions,
            "last_dof_vel": self.sensors.last_dof_vel,
            "joint_offset": self.joint_offset,
            "push_vel": self.push_vel,
            "push_in": self.pushes.wait,
            "air_time": self.air_time,
            "steps": self.steps,
            "start": self.start,
            "followed": self.orders.followed,
        }
        sums = {f"rew_{name}": value for name, value in self.sums.items()}
        return own | sums | vars(self.differences)

    def get_observations(self) -> TensorDict:
        """Return what is observed now, as tensors that later steps do not change."""
        return self._observed

    def step(
        self, actions: torch.Tensor
    ) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """Act for one step of the policy.

        Args:
            actions: Shape (n, j).

        Returns:
            Observations, rewards (n,), dones (n,), and `time_outs` and `log`.

        Raises:
            ConfigError: if an action is not a number.
        """
        self._act(actions)
        self.pushes.push(self.rng, self.physics.qvel)
        bad = self.physics.step(self.cfg.control.decimation)
        self.lengths += 1
        self.steps += 1
        self.sensors.last_dof_vel[bad] = 0  # the jump back to rest is no acceleration
        self.state = state = self._look(np.arange(self.num_envs), bad)
        rewards = self.earnings.pay(state, bad)
        time_out = (self.lengths >= self.max_episode_length) & ~state.fallen
        done = state.fallen | time_out
        self.careers.ask(self.commands, yaw_of(state.base_quat), self.cfg.dt)
        extras: dict[str, Any] = {"time_outs": torch.from_numpy(time_out).to(self.device)}
        ended = np.flatnonzero(done)
        if len(ended):
            extras["log"] = self._end(ended, state, bad)
            self._begin(ended)
        self.orders.renew(self.rng, self.steps)
        self.orders.steer(self._yaw())
        if len(ended):
            state.put(ended, self._look(ended, fresh=True))
        np.copyto(state.commands, self.commands)
        self._observed = self._observe()
        tensor = torch.from_numpy
        return self._observed, tensor(rewards).to(self.device), tensor(done).to(self.device), extras

    def _act(self, actions: torch.Tensor) -> None:
        wanted = actions.detach().to("cpu", torch.float32).numpy()
        if wanted.shape != (self.num_envs, self.num_actions):
            raise ConfigError(
                f"actions have shape {wanted.shape}; wanted {(self.num_envs, self.num_actions)}"
            )
        if not np.isfinite(wanted).all():
            first = int(np.flatnonzero(~np.isfinite(wanted).all(axis=1))[0])
            raise ConfigError(
                f"actions of environment {first} are not numbers; the policy has diverged"
            )
        most = self.cfg.normalization.clip_actions
        self.actions[1:] = self.actions[:-1]
        np.clip(wanted, -most, most, out=self.actions[0])
        self.physics.ctrl[:] = self.control.told(self.actions[0], self.joint_offset)

    def _look(
        self, ids: Ids, bad: NDArray[np.bool_] | None = None, *, fresh: bool = False
    ) -> State:
        """Return the state of robots `ids`; what has just begun has no contacts yet."""
        rows: Any = slice(None) if len(ids) == self.num_envs else ids
        seen = vars(self.sensors.measure(rows, fresh=fresh))
        if bad is not None:
            seen["fallen"] |= bad
        return State(
            **seen,
            actions=self.actions[0, rows].copy(),
            last_actions=self.actions[1, rows].copy(),
            last_last_actions=self.actions[2, rows].copy(),
            commands=self.commands[rows].copy(),
            push_vel=self.push_vel[rows].copy(),
            friction=self.differences.friction[rows].copy(),
            added_mass=self.differences.added_mass[rows].copy(),
            com_shift=self.differences.com_shift[rows].copy(),
            joint_offset=self.joint_offset[rows].copy(),
        )

    def _yaw(self) -> FloatArray:
        """Return the heading of each robot now [rad], shape (n,)."""
        return yaw_of(self.physics.qpos[:, 3:7].astype(np.float32))

    def _end(self, ids: Ids, state: State, bad: NDArray[np.bool_]) -> dict[str, float]:
        """Close the episodes of robots `ids`, and return what is to be logged of them."""
        lived = self.steps[ids] * self.cfg.dt
        earned = self.earnings.per_second(ids, lived)
        log = {f"Episode/rew_{name}": mean for name, mean in earned.items()}
        fallen = state.fallen[ids]
        log["Episode/falls"] = float(fallen.mean())
        self._widen(ids, lived)
        if self.cfg.commands.curriculum:
            log["Curriculum/lin_vel_x"] = self.orders.lin_vel_x[1]
        # The runner may have cut the first episodes to random lengths, which says nothing.
        whole = self.lengths[ids] == self.steps[ids]
        distance = np.linalg.norm(state.base_pos[ids, :2] - self.start[ids], axis=1)
        # Who left the map has crossed its patch, which may be narrower than it is long.
        distance[outside(state.base_pos[ids], self.ground)] = self.ground.patch_length
        distance[bad[ids]] = 0  # MuJoCo has put these at the world's origin
        self.careers.end(
            ids[whole], distance[whole], fallen[whole], move=self.cfg.terrain.curriculum
        )
        if not self.ground.level:
            log["Curriculum/level"] = float(self.careers.levels.mean())
            for name, (level, success) in self.careers.by_terrain().items():
                if not np.isnan(level):
                    log[f"Curriculum/level_{name}"] = level
                if not np.isnan(success):
                    log[f"Curriculum/success_{name}"] = success
        return log

    def _widen(self, ids: Ids, lived: NDArray[np.floating[Any]]) -> None:
        """Ask for more, once what is asked was followed well over as long as an episode of all."""
        if "tracking_lin_vel" in self.rewards:
            self.orders.widen(
                float(self.sums["tracking_lin_vel"][ids].sum()),
                float(lived.sum()),
                scale=self.rewards["tracking_lin_vel"][1],
                enough=self.num_envs * self.cfg.env.episode_length_s,
            )

    def _begin(self, ids: Ids) -> None:
        """Begin new episodes."""
        origins = self.careers.origins[ids]
        qpos, qvel = draw_start(
            self.rng, origins, self.scene, self.robot, self.ground, self.cfg.init_state
        )
        self.physics.reset(ids, qpos, qvel)
        self._lift(ids)
        self.start[ids] = qpos[:, :2]
        self.careers.begin(ids)
        self.lengths[ids] = self.steps[ids] = 0
        self.actions[:, ids] = 0
        self.pushes.begin(self.rng, ids)
        self.sensors.forget(ids)
        most = self.cfg.domain_rand.joint_offset
        self.joint_offset[ids] = self.rng.uniform(-most, most, (len(ids), self.num_actions))
        self.earnings.forget(ids)
        self.orders.draw(self.rng, ids)

    def _lift(self, ids: Ids) -> None:
        """Lift those with a foot in the ground: legs that are bent at random may be too long."""
        x, y, z = np.moveaxis(self.physics.block("foot_position", ids), 2, 0)
        deep = (self.ground.height(x, y) + self.scene.sole_depth - z).max(axis=1)
        if (deep > 0).any():
            self.physics.qpos[ids, 2] += np.maximum(deep, 0)
            self.physics.refresh(ids)

    def _observe(self) -> TensorDict:
        clip = self.cfg.normalization.clip_observations
        noisy = {"policy": self.rng, "privileged": None}
        return TensorDict(
            {
                name: torch.from_numpy(observe(group, self.state, clip, noisy[name]))
                for name, group in self.groups.items()
            },
            batch_size=[self.num_envs],
        ).to(self.device)
