"""Roll out a policy, and measure velocity errors, gait, falls and success."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np
import torch

from terrainkit_robots.policy import gait
from terrainkit_robots.policy.load_policy import Policy
from terrainkit_robots.policy.metrics import ErrorMean, GaitStep, RolloutMetrics
from terrainkit_robots.policy.motor_loads import Loads
from terrainkit_robots.rl.env import LeggedEnv, has_own_commands
from terrainkit_robots.rl.symmetry import mirror_feet
from terrainkit_robots.transforms import BoolArray, FloatArray

Progress = Callable[[float], object]
"""Called after each step with the completed fraction of the time, 0 to 1."""

SETTLING_TIME, AVERAGING_TIME = 2.0, 1.0
"""Time without measurements after each new command, and time of averaged velocities [s]."""

MAX_GAIT_STEPS, DIAGRAM_TIME = 1000, 2.0
"""Steps after which the gait is no longer recorded, and time of the contact diagram [s]."""

MIN_FOLLOWED = 0.5
"""Share of a command's velocity from which the command is followed."""


def rollout(
    env: LeggedEnv, policy: Policy, schedule: Iterable[FloatArray | None]
) -> Iterator[tuple[FloatArray, BoolArray]]:
    """Step the environment with a policy.

    Args:
        env: The environment.
        policy: Function from observations to actions.
        schedule: Commands of each step, shape (n, 3), or None for the task's random commands.

    Yields:
        After each step, the commands during it, shape (n, 3), and which robots fell, shape (n,).
    """
    previous: object = ...  # neither commands nor None, so that the first entry is applied
    for commands in schedule:
        if commands is not previous:
            env.set_commands(commands)
            previous = commands
        state = env.state
        with torch.inference_mode():
            _, _, dones, extras = env.step(policy(env.get_observations()))
            if reset := getattr(policy, "reset", None):  # of a recurrent network
                reset(dones)
        yield state.commands, (dones & ~extras["time_outs"]).cpu().numpy()


def command_schedule(commands: FloatArray | None, num_steps: int) -> list[FloatArray | None]:
    """Return the commands of each step.

    Args:
        commands: Commands of shape (n, 3), or of shape (k, n, 3) for k parts of equal length; None
            for the task's random commands.
        num_steps: Number of steps.
    """
    if commands is None:
        return [None] * num_steps
    parts = list(commands.reshape(-1, *commands.shape[-2:]))
    return [parts[step * len(parts) // num_steps] for step in range(num_steps)]


class EvaluationRollout:
    """A rollout that measures each robot up to its first fall.

    On a map, a robot is measured until it has crossed half a patch along its commands: the terrain
    beyond belongs to another patch. It succeeds if it crosses. A robot that was commanded less than
    that distance, and did not fall, says nothing about the terrain.
    """

    def __init__(self, env: LeggedEnv) -> None:
        n, dt = env.num_envs, env.cfg.dt
        self.env = env
        self.start_pos = env.curriculum.progress.start.copy()
        self.half_patch = np.inf if env.terrain.is_plane else env.terrain.patch_length / 2
        self.falls, self.crossed = np.zeros(n, bool), np.zeros(n, bool)
        self.commanded_distance, self.sideways = np.zeros(n), np.zeros(n)
        names = "lin_vel_error", "lin_vel_error_1s", "ang_vel_error", "ang_vel_error_1s"
        self.errors = {name: ErrorMean(n) for name in names}  # as in `RolloutMetrics`
        self._settling_steps = round(SETTLING_TIME / dt)
        self._window = max(1, round(AVERAGING_TIME / dt))
        self._recent_errors = np.zeros((self._window, n, 3), np.float32)  # ring buffer
        self.last_commands = np.full((n, 3), np.nan, np.float32)
        self._command_steps = np.zeros(n, np.int64)  # since the command changed
        self._measured_steps = np.zeros(n, np.int64)  # without interruption
        self._num_steps = 0
        # Sums over the measured steps of robots that are commanded to move, by name, shapes (n,).
        self.motion = defaultdict[str, Any](lambda: np.zeros(n))
        self.gait: list[GaitStep] = []
        self.loads = Loads(env)
        self._has_own_commands = has_own_commands(env.cfg)
        own = [*env.term_sums] if self._has_own_commands or env.active_terms else []
        self.terms = {name: ErrorMean(n) for name in own if name != "rew_termination"}

    def run(
        self,
        policy: Policy,
        seconds: float,
        commands: FloatArray | None = None,
        progress: Progress = lambda _: None,
        *,
        stop_early: bool = True,
    ) -> None:
        """Run the policy and measure it.

        Args:
            policy: Function from observations to actions.
            seconds: Duration [s].
            commands: Commands; see `command_schedule`.
            progress: Called after each step with the completed fraction, 0 to 1.
            stop_early: Whether to stop once every robot has fallen or crossed half a patch.
        """
        steps = max(1, round(seconds / self.env.cfg.dt))
        schedule = command_schedule(commands, steps)
        for index, step in enumerate(rollout(self.env, policy, schedule), 1):
            self._update(*step)
            progress(index / steps)
            if stop_early and (self.falls | self.crossed).all():
                break

    def _update(self, commands: FloatArray, falls: BoolArray) -> None:
        active = ~(self.falls | self.crossed)
        self.falls |= active & falls
        active &= ~falls
        state = self.env.state
        velocity = np.column_stack([state.base_lin_vel[:, :2], state.base_ang_vel[:, 2]])
        settled = self._update_errors(commands, velocity - commands, active)
        self._update_gait(commands, velocity, settled)
        self.loads.add(settled)
        for name, mean in self.terms.items():
            mean.add(self.env.term_values[name], settled)
        target = self.env.curriculum.progress.target
        commanded = np.linalg.norm(target, axis=1)
        self.commanded_distance[active] = commanded[active]
        direction = target / np.maximum(commanded, 1e-9)[:, None]
        x, y = (state.base_pos[:, :2] - self.start_pos).T
        crossed = active & (x * direction[:, 0] + y * direction[:, 1] > self.half_patch)
        self.sideways[crossed] = np.abs(x * direction[:, 1] - y * direction[:, 0])[crossed]
        self.crossed |= crossed

    def _update_gait(self, commands: FloatArray, velocity: FloatArray, settled: BoolArray) -> None:
        state = self.env.state
        moving = settled & (commands != 0).any(axis=1)
        along, squares = velocity * commands, np.square(commands)
        lin_command = squares[:, :2].sum(axis=1)
        is_linear = lin_command > 0
        step = {
            "lin_vel": along[:, :2].sum(axis=1),  # dot product of velocity and command [m2/s2]
            "lin_command": lin_command,
            "ang_vel": along[:, 2],  # product of yaw velocity and command [rad2/s2]
            "ang_command": squares[:, 2],
            "pitch": np.arctan2(state.projected_gravity[:, 0], -state.projected_gravity[:, 2]),
            "power": np.abs(state.torques * state.dof_vel).sum(axis=1) * is_linear,  # [W]
            "speed": np.hypot(velocity[:, 0], velocity[:, 1]) * is_linear,
            "steps": np.ones(len(commands)),
        }
        for name, values in step.items():
            self.motion[name][moving] += values[moving]
        if len(self.gait) < MAX_GAIT_STEPS and settled.any():
            foot_speed = np.hypot(state.foot_vel[..., 0], state.foot_vel[..., 1])
            feet = state.foot_contact, state.foot_height.copy(), foot_speed
            self.gait.append(GaitStep(moving, *feet))

    def _update_errors(
        self, commands: FloatArray, error: FloatArray, active: BoolArray
    ) -> BoolArray:
        # A heading command changes the yaw velocity at every step, which is no new command.
        command = self.env.velocity_command
        axes = 2 if command.heading_command and command.fixed is None else 3
        same = (commands[:, :axes] == self.last_commands[:, :axes]).all(axis=1)
        self._command_steps = np.where(same, self._command_steps + 1, 1)
        self.last_commands[:] = commands
        settled = active & (self._command_steps > self._settling_steps)
        self._measured_steps = np.where(settled, self._measured_steps + 1, 0)
        self._recent_errors[self._num_steps % self._window] = error
        self._num_steps += 1
        averaged = self._measured_steps >= self._window
        mean_error = self._recent_errors.mean(axis=0)
        for suffix, value, steps in (("", error, settled), ("_1s", mean_error, averaged)):
            mask = steps & self.env.has_velocity
            self.errors[f"lin_vel_error{suffix}"].add(np.hypot(value[:, 0], value[:, 1]), mask)
            self.errors[f"ang_vel_error{suffix}"].add(np.abs(value[:, 2]), mask)
        return settled

    def metrics(self, mask: BoolArray, **key: Any) -> RolloutMetrics:
        """Return the metrics of some robots, each with the same weight.

        Args:
            mask: Mask of the robots, shape (n,).
            **key: Fields of `RolloutMetrics` that define the group.
        """
        tried = self.crossed | self.falls | (self.commanded_distance >= self.half_patch)
        crossed = self.crossed[mask & tried & self.env.has_velocity]
        sideways = self.sideways[mask & self.crossed]
        errors: dict[str, Any] = {name: error.over(mask) for name, error in self.errors.items()}
        return RolloutMetrics(
            **key,
            terms={name: mean.over(mask) for name, mean in self.terms.items()} or None,
            robots=int(mask.sum()),
            falls=int(self.falls[mask].sum()),
            success=None
            if self.env.terrain.is_plane or not crossed.size
            else float(crossed.mean()),
            drift=float(sideways.mean()) / self.half_patch if sideways.size else None,
            **errors,
            **self._gait_metrics(mask),
            **self.loads.metrics(mask),
        )

    def _gait_metrics(self, mask: BoolArray) -> dict[str, Any]:
        """Return the gait of the robots in a mask, as fields of `RolloutMetrics`."""
        scene = self.env.scene
        motion = {name: total[mask] for name, total in self.motion.items()}
        moved = motion["steps"] > 0
        if not moved.any():
            return {}
        commanded = (self.last_commands[mask] != 0).any(axis=1) | moved
        followed = moved & (motion["lin_vel"] >= MIN_FOLLOWED * motion["lin_command"])
        followed &= motion["ang_vel"] >= MIN_FOLLOWED * motion["ang_command"]
        measured, contact, height, foot_speed = (
            np.array([array[mask] for array in parts]) for parts in zip(*self.gait, strict=True)
        )
        heights = gait.swing_heights(contact, height, measured)
        duty = gait.duty_factors(contact, measured)
        mirror = mirror_feet(scene.foot_pos)
        # Energy over weight times distance; the time step cancels in the ratio of the two sums.
        work = 9.81 * scene.model.body_subtreemass[scene.base] * motion["speed"].sum()
        return {
            "followed": None if self._has_own_commands else float(followed[commanded].mean()),
            "step_frequency": _number(gait.step_frequency(contact, measured, self.env.cfg.dt)),
            "foot_slip": _number(gait.foot_slip(contact, foot_speed, measured)),
            "asymmetry": max(gait.asymmetry(values, mirror) for values in (heights, duty)),
            "base_pitch": float(motion["pitch"].sum() / motion["steps"].sum()),
            "cost_of_transport": float(motion["power"].sum() / work) if work else None,
            "swing_height": tuple(map(_number, heights)),
            "duty_factor": tuple(map(_number, duty)),
        }

    def contacts(self) -> dict[str, str]:
        """Return the contacts of `summarize`."""
        forward, left, yaw = self.last_commands.T
        robot = int((forward - np.abs(left) - np.abs(yaw)).argmax())
        steps = round(DIAGRAM_TIME / self.env.cfg.dt)
        rows = [step.contact[robot] for step in self.gait if step.measured[robot]][-steps:]
        feet = self.env.robot.spec.feet
        return {foot: "".join(str(int(row[k])) for row in rows) for k, foot in enumerate(feet)}


def _number(value: float) -> float | None:
    """Return a number of numpy as a float; None for NaN, which JSON does not have."""
    return None if np.isnan(value) else float(value)
