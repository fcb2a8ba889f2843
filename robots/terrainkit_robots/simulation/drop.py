"""A drop: the robot falls without torque, which shows whether it is sound at all."""

from dataclasses import dataclass

import numpy as np

from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.rollout import Trial
from terrainkit_robots.simulation.sim_model import Plant
from terrainkit_robots.simulation.time_step import free_dofs


@dataclass(frozen=True, kw_only=True)
class Drop:
    """What happened to a robot that was dropped, or let swing if it is bolted down."""

    blew_up: bool
    """Whether a position, speed or acceleration stopped being a number, or was huge."""

    top_speed: float
    """Highest speed of a joint, or at which the base turned [rad/s] or [m/s]."""

    fastest: str
    """The joint that had it; `base` for the base."""

    seconds: float
    """How long it was simulated: less than asked for if it blew up [s]."""


def let_fall(
    plant: Plant, *, height: float = 0.1, seconds: float = 1.5, self_collision: bool = True
) -> Drop:
    """Drop a robot from its standing pose, nothing holding its joints.

    Args:
        plant: The robot.
        height: Of its lowest shape above the floor [m].
        seconds: How long to simulate [s].
        self_collision: Whether the robot can touch itself.

    Raises:
        CannotCheckError: if simulating it would take too long.
    """
    with quiet_mujoco():
        trial = Trial(plant, self_collision=self_collision)
        trial.put(plant.home, above=height)
        top, steps = np.zeros(trial.model.nv), 0
        for _ in trial.steps(seconds):
            np.maximum(top, np.abs(trial.data.qvel), out=top)
            steps += 1
        blew_up, step = trial.blew_up, trial.model.opt.timestep
    base = free_dofs(plant)
    top[: base // 2] = 0  # how fast the base falls says nothing
    fastest = int(np.argmax(top)) if len(top) else 0
    return Drop(
        blew_up=blew_up,
        top_speed=float(top[fastest]) if len(top) else 0.0,
        fastest="base" if fastest < base else plant.joints[fastest - base] if len(top) else "base",
        seconds=steps * float(step),
    )
