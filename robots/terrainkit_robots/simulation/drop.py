"""Drop a robot without joint torques, to test whether its model is valid."""

from dataclasses import dataclass

import numpy as np

from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.rollout import Rollout
from terrainkit_robots.simulation.sim_model import SimModel

DROP_HEIGHT = 0.1
"""Height of the lowest shape above the floor at the start [m]."""

_SECONDS = 1.5
"""Simulated time [s]."""


@dataclass(frozen=True, kw_only=True)
class DropResult:
    """The motion of a robot that was dropped, or that swung because its base is fixed."""

    diverged: bool
    """Whether a position, velocity or acceleration was not finite, or huge."""

    max_speed: float
    """Highest speed of a joint, or of the rotation of the base [rad/s] or [m/s]."""

    max_speed_joint: str
    """The joint with that speed; `base` for the base."""

    seconds: float
    """Simulated time [s]; shorter if the simulation diverged."""


def drop_test(sim: SimModel, *, self_collision: bool = True) -> DropResult:
    """Drop a robot from its standing pose without joint torques.

    Args:
        sim: The robot.
        self_collision: Whether the shapes of the robot collide with each other.

    Raises:
        CannotCheckError: if the simulation would take too long.
    """
    with quiet_mujoco():
        rollout = Rollout(sim, self_collision=self_collision)
        rollout.reset(sim.standing_qpos, clearance=DROP_HEIGHT)
        speeds, steps = np.zeros(rollout.model.nv), 0
        for _ in rollout.steps(_SECONDS):
            np.maximum(speeds, np.abs(rollout.data.qvel), out=speeds)
            steps += 1
        diverged, time_step = rollout.diverged, rollout.model.opt.timestep
    base = sim.base_dofs
    speeds[: base // 2] = 0  # the speed at which the base falls is expected
    fastest = int(np.argmax(speeds)) if len(speeds) else 0
    is_joint = fastest >= base and len(speeds)
    return DropResult(
        diverged=diverged,
        max_speed=float(speeds[fastest]) if len(speeds) else 0.0,
        max_speed_joint=sim.joints[fastest - base] if is_joint else "base",
        seconds=steps * float(time_step),
    )
