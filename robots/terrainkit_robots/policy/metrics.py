"""The metrics of a rollout, and the sums over its steps that they are computed from."""

from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from terrainkit_robots.transforms import BoolArray, FloatArray


@dataclass(frozen=True, kw_only=True)
class RolloutMetrics:
    """Metrics of all robots, or of a group with the same command, terrain or level.

    Errors are averaged over the measured steps of each robot, then over robots. They are None if no
    robot was measured. The metrics of the gait (`gait`) only include robots that are
    commanded to move, and are None if there are no such robots.

    Attributes:
        command: Command of the group: forward and left velocity [m/s], yaw velocity [rad/s]. With
            commands of its own, a task has other numbers: `commands` of the result names them.
        direction: Direction of the group's commands on a map.
        terrain: Terrain of the group.
        level: Level of the group.
        parameter: Parameter of the terrain that is its dimension, such as step_height.
        value: Realized value of that parameter on the patches of the group [m], or value of the
            disturbance `condition`.
        condition: Name of the disturbance of the group (`margins`), or nominal.
        unit: Unit of the disturbance; x for a factor.
        terms: Mean of each reward but `termination`, such as `rew_torques` [1/s], and of each
            evaluation term, for a task with commands or evaluation terms of its own.
        robots: Number of robots.
        falls: Number of robots that fell.
        success: Fraction of robots that crossed half a patch along their commands, of those that
            fell or whose commands led that far; None if there are none, as on a plane.
        drift: Mean sideways distance of the robots that crossed, as a share of half a patch.
        lin_vel_error: Norm of the horizontal velocity error [m/s].
        lin_vel_error_1s: The same with velocities averaged over 1 s, which removes the sway of the
            gait.
        ang_vel_error: Absolute yaw velocity error [rad/s].
        ang_vel_error_1s: The same with velocities averaged over 1 s.
        swing_height: Mean peak height of the swings of each foot [m].
        duty_factor: Share of the time that each foot is in contact.
        step_frequency: Complete swings per foot and second [Hz].
        foot_slip: Mean horizontal speed of feet in contact [m/s].
        asymmetry: The larger of the asymmetries of swing height and duty factor.
        base_pitch: Mean pitch of the base [rad], positive when the nose is down.
        followed: Fraction of robots that reach half of their command's linear and yaw velocity;
            robots that fell before they were measured do not.
        cost_of_transport: Power / (weight * speed).
        torque_peak: Largest torque as a share of the limit of the joint; like the other loads, of
            all physics steps.
        torque_95: The same for the 95th percentile over time, of the joint where it is largest.
        joint_speed_peak: Largest joint speed as a share of the limit of the joint.
        joint_speed_95: The same for the 95th percentile.
        foot_force_peak: Largest contact force on a foot in units of the robot's nominal weight.
    """

    command: tuple[float, ...] | None = None
    direction: str | None = None
    terrain: str | None = None
    level: int | None = None
    parameter: str | None = None
    value: float | None = None
    condition: str | None = None
    unit: str | None = None
    terms: dict[str, float | None] | None = None
    robots: int
    falls: int
    success: float | None
    drift: float | None = None
    lin_vel_error: float | None
    lin_vel_error_1s: float | None
    ang_vel_error: float | None
    ang_vel_error_1s: float | None
    swing_height: tuple[float | None, ...] | None = None
    duty_factor: tuple[float | None, ...] | None = None
    step_frequency: float | None = None
    foot_slip: float | None = None
    asymmetry: float | None = None
    base_pitch: float | None = None
    followed: float | None = None
    cost_of_transport: float | None = None
    torque_peak: float | None = None
    torque_95: float | None = None
    joint_speed_peak: float | None = None
    joint_speed_95: float | None = None
    foot_force_peak: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the metrics as a dict, without the first keys that do not apply to the group."""
        names = list(vars(self))
        keys = names[: names.index("robots")]
        return {k: v for k, v in asdict(self).items() if v is not None or k not in keys}

    def load_cells(self) -> tuple[str, str, str]:
        """Return torque and joint speed, peak and percentile, and foot force as text."""
        if self.foot_force_peak is None:
            return "-", "-", "-"
        torque = f"{self.torque_peak:.0%} ({self.torque_95:.0%})"
        speed = f"{self.joint_speed_peak:.0%} ({self.joint_speed_95:.0%})"
        return torque, speed, f"{self.foot_force_peak:.1f}"


class ErrorMean:
    """The mean of an error over the measured steps of each of n robots."""

    def __init__(self, num_envs: int) -> None:
        self.total, self.count = np.zeros(num_envs), np.zeros(num_envs, np.int64)

    def add(self, errors: FloatArray, measured: BoolArray) -> None:
        """Add the errors of a step.

        Args:
            errors: Error of each robot, shape (n,).
            measured: Which robots are measured in this step, shape (n,).
        """
        self.total[measured] += errors[measured]
        self.count[measured] += 1

    def over(self, robots: BoolArray) -> float | None:
        """Return the mean error of some robots, each with the same weight.

        Args:
            robots: Mask of the robots, shape (n,).

        Returns:
            The mean, or None if none of the robots was measured.
        """
        measured = robots & (self.count > 0)
        means = self.total[measured] / self.count[measured]
        return float(means.mean()) if means.size else None


class GaitStep(NamedTuple):
    """The feet in one step."""

    measured: BoolArray  # robots that are commanded to move, shape (n,)
    contact: BoolArray  # shape (n, f)
    height: FloatArray  # above the ground [m], shape (n, f)
    speed: FloatArray  # horizontal [m/s], shape (n, f)
