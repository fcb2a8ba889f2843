"""Many MuJoCo simulations of one scene, stepped together by `mujoco.batch.Batch`."""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import ArrayLike, NDArray

from terrainkit.files.memory import check_memory
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.scene import Scene
from terrainkit_robots.rl.terrain import Ids as Ids
from terrainkit_robots.spec.robot_arrays import Robot

SPEED_AT_EFFORT = 0.9
"""Share of a joint's speed limit up to which its motor has the whole effort. From there, the torque
falls to zero at the limit, as for a DC motor whose stall torque is ten times the effort."""


class Simulation:
    """n simulations of a scene; its arrays are views that change with every step."""

    after_step: Callable[[], object] | None = None
    """Called after every physics step."""

    def __init__(
        self, scene: Scene, num_envs: int, num_threads: int = 0, velocity: ArrayLike = np.inf
    ) -> None:
        """Allocate the simulations in the model's default state.

        `velocity` has the speed limit of each joint [rad/s or m/s], shape (j,).
        """
        warnings = (f"mjWARN_BAD{name}" for name in ("QPOS", "QVEL", "QACC", "CTRL"))
        self._unstable = [int(getattr(mujoco.mjtWarning, name)) for name in warnings]
        self._stage = mujoco.mjtStage.mjSTAGE_VEL
        self.scene = scene
        self.batch = Batch(scene.model, num_envs, num_threads)
        names = ("qpos", "qvel", "ctrl", "actuator_force", "sensordata")
        self.qpos, self.qvel, self.ctrl, self.torque, self._sensordata = map(self.batch.bind, names)
        self._max_speed = np.asarray(velocity, float)
        self._effort = scene.model.actuator_forcerange[:, 1]
        self._forcerange = self.batch.expand("actuator_forcerange")
        near = scene.near_geoms
        self._update_geoms = near.bind(self.batch) if near else None

    def step(self, count: int) -> NDArray[np.bool_]:
        """Step every simulation `count` times.

        Returns:
            Unstable simulations, shape (n,). MuJoCo has reset them to its default state.
        """
        if self._update_geoms:
            self._update_geoms(self.qpos[:, :2])
        # A reset also restores the counters, so only counts that start at 0 are reliable.
        self.batch.warning[:, self._unstable, 1] = 0
        with quiet_mujoco():
            for k in range(count):
                self._limit_torques()
                # Sensors of the steps between cost a quarter of a step.
                is_read = self.after_step is not None or k == count - 1
                stage = self._stage if is_read else mujoco.mjtStage.mjSTAGE_NONE
                self.batch.step(nstep=1, stage=stage)
                if self.after_step:
                    self.after_step()
        return (self.batch.warning[:, self._unstable, 1] > 0).any(axis=1)

    def _limit_torques(self) -> None:
        """Reduce the largest torques in the direction of motion near the speed limits."""
        speed = self.qvel[:, self.scene.joint_qvel] / self._max_speed
        share = np.clip((1 - np.abs(speed)) / (1 - SPEED_AT_EFFORT), 0, 1)
        self._forcerange[:, :, 0] = -self._effort * np.where(speed < 0, share, 1)
        self._forcerange[:, :, 1] = self._effort * np.where(speed > 0, share, 1)

    def reset(self, env_ids: Ids, qpos: NDArray[np.float64], qvel: NDArray[np.float64]) -> None:
        """Reset some simulations.

        Args:
            env_ids: Simulations, sorted, shape (k,).
            qpos: Positions, shape (k, nq).
            qvel: Velocities, shape (k, nv).
        """
        self.batch.reset(env_ids, stage=mujoco.mjtStage.mjSTAGE_NONE)
        self.qpos[env_ids] = qpos
        self.qvel[env_ids] = qvel
        self.forward(env_ids)

    def forward(self, env_ids: Ids) -> None:
        """Update the sensors of states that were written, except for contacts."""
        with quiet_mujoco():
            self.batch.forward(env_ids, stage=self._stage)

    def reset_action_delay(self, env_ids: Ids, delay: NDArray[Any], ctrl: NDArray[Any]) -> None:
        """Set the action delays of some simulations.

        Args:
            env_ids: Simulations, shape (k,).
            delay: Delays [s], shape (k,).
            ctrl: Controls that the motors received until now, shape (k, j).
        """
        dt, samples = self.scene.model.opt.timestep, self.scene.model.actuator_history[0, 0]
        # MuJoCo applies the last control that is old enough. With half a step less than the delay,
        # the rounding errors of the time do not matter.
        delay = dt * np.maximum(np.rint(delay / dt) - 0.5, 0)
        self.batch.expand("actuator_delay")[env_ids] = delay[:, None]
        # The history of a motor is two counters, the times of the samples, and their controls.
        history = self.batch.bind("history").reshape(len(self.qpos), ctrl.shape[1], -1)
        history[env_ids, :, 2 + samples :] = ctrl[:, :, None]

    def sensor(self, name: str, env_ids: Any = slice(None)) -> NDArray[np.float32]:
        """Return a copy of the data of sensors.

        Args:
            name: Name of the group of sensors.
            env_ids: Simulations; by default all.

        Returns:
            Data, shape (n, bodies, 3).
        """
        values = self._sensordata[env_ids, self.scene.sensors[name]].astype(np.float32)
        return values.reshape(len(values), -1, 3)


def check_env_memory(task: Task, robot: Robot, *, points: int, history: int, ngeom: int) -> None:
    """Raise MemoryLimitError if training needs more memory than is free, within a factor of two."""
    joints = len(robot.default_pose)
    steps = task.runner.num_steps_per_env
    policy = task.policy
    num_envs = task.env.num_envs
    observations = 45 + 7 * joints + 2 * points + history * (20 + 3 * joints)
    hidden = sum(policy.actor_hidden_dims + policy.critic_hidden_dims)
    samples = steps / task.algorithm.num_mini_batches * (1 + (task.algorithm.symmetry is not False))
    learning = max(3 * steps * observations, samples * (5 * hidden + 2 * observations))
    floats = (12 + steps) * observations + 3 * steps * joints + learning
    per_env = 4 * floats + 8 * (100 + (60 + 2 * task.max_delay_steps) * joints + 3 * ngeom)
    what = f"training with env.num_envs {num_envs}, {per_env / 1e6:.2g} MB each,"
    check_memory(round(num_envs * per_env), what, ("env.num_envs", num_envs))
