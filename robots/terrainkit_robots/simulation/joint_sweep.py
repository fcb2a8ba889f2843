"""A sweep: each joint moved to both of its limits, as slowly as can be, the base held in the air.

So slowly that only gravity counts: the joint is put from place to place, the others stay at the
standing pose, and MuJoCo says what touches and what torque holds the joint there.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.rollout import Trial
from terrainkit_robots.simulation.sim_model import Plant
from terrainkit_robots.simulation.stiffness import effort_in
from terrainkit_robots.simulation.units import Units, units_of

_PLACES = 40
"""Places over the range of a joint."""

_TOUCH = 0.001
"""How deep two bodies are inside each other that block a joint [m], as COL005 has it."""


@dataclass(frozen=True, kw_only=True)
class Reach:
    """How far a joint gets."""

    joint: str

    units: Units
    """What its numbers are in."""

    limits: tuple[float, float]
    """Lower and upper limit [rad] or [m]."""

    reached: tuple[float, float]
    """Lowest and highest place that nothing blocks, to a fortieth of the range [rad] or [m]."""

    blocked: tuple[tuple[str, str] | None, tuple[str, str] | None]
    """The bodies that meet past the lowest and the highest place; None where nothing does."""

    load: float
    """Torque [N m] or force [N] that holds the limb against gravity in the standing pose."""

    largest_load: float
    """The largest on the way."""

    effort: float
    """What the joint has for that [N m] or [N]; infinite if it is not limited."""

    @property
    def share(self) -> float:
        """Return the share of the range that the joint can use, in 0..1."""
        lower, upper = self.limits
        return (self.reached[1] - self.reached[0]) / (upper - lower)


def sweep(plant: Plant) -> tuple[Reach, ...]:
    """Return how far each actuated joint with limits gets, in the order of the actuators.

    Bodies that touch each other in the standing pose already block nothing.

    Raises:
        CannotCheckError: if it would take too long.
    """
    limited = [name for name in plant.drives if plant.model.joint(name).limited[0]]
    with quiet_mujoco():
        trial = Trial(plant)
        trial.without_floor()
        trial.put(plant.home)
        around = _Around(trial)
        return tuple(around.reach(name) for name in limited)


class _Around:
    """A robot that hangs, and the pairs of bodies that touch where it hangs."""

    def __init__(self, trial: Trial) -> None:
        self._trial = trial
        self._followers = _followers(trial.model)
        self._touching: frozenset[tuple[int, int]] = frozenset()
        self._put(None, 0.0)
        self._touching = frozenset(self._pairs(0.0))

    def reach(self, name: str) -> Reach:
        """Return how far a joint gets."""
        joint = self._trial.model.joint(name)
        lower, upper = (float(limit) for limit in joint.range)
        home = float(np.clip(self._trial.plant.home[int(joint.qposadr[0])], lower, upper))
        down = self._go(name, home, lower, (upper - lower) / _PLACES)
        up = self._go(name, home, upper, (upper - lower) / _PLACES)
        return Reach(
            joint=name,
            units=units_of(self._trial.plant, name),
            limits=(lower, upper),
            reached=(down[0], up[0]),
            blocked=(down[1], up[1]),
            load=abs(down[2][0]),
            largest_load=max(map(abs, (*down[2], *up[2]))),
            effort=effort_in(self._trial.plant, name),
        )

    def _go(
        self, name: str, start: float, end: float, stride: float
    ) -> tuple[float, tuple[str, str] | None, list[float]]:
        """Return the last place that is free, what blocks the next, and the load at each."""
        model, data = self._trial.model, self._trial.data
        dof = int(model.joint(name).dofadr[0])
        reached, loads = start, []
        for place in np.linspace(start, end, 1 + int(np.ceil(abs(end - start) / stride))):
            self._put(name, float(place))
            loads.append(float(data.qfrc_bias[dof]))
            for first, second in self._pairs(_TOUCH):
                return reached, (model.body(first).name, model.body(second).name), loads
            reached = float(place)
        return reached, None, loads

    def _put(self, name: str | None, place: float) -> None:
        import mujoco

        model, data = self._trial.model, self._trial.data
        data.qpos[:] = self._trial.plant.home
        if name is not None:
            data.qpos[int(model.joint(name).qposadr[0])] = place
            for follower, followed, coefficients in self._followers:
                data.qpos[follower] = np.polynomial.Polynomial(coefficients)(data.qpos[followed])
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)  # at rest: gravity alone

    def _pairs(self, depth: float) -> Sequence[tuple[int, int]]:
        """Return the bodies deeper inside each other than `depth` [m], but for those at rest."""
        model, data = self._trial.model, self._trial.data
        deep = data.contact.geom[data.contact.dist < -depth]
        pairs = {tuple(sorted(pair)) for pair in model.geom_bodyid[deep].tolist()}
        return sorted((a, b) for a, b in pairs if (a, b) not in self._touching)


def _followers(model: Any) -> list[tuple[int, int, Any]]:
    """Return the places in qpos of joints that follow another, of that other, and how."""
    import mujoco

    return [
        (
            int(model.jnt_qposadr[model.eq_obj1id[k]]),
            int(model.jnt_qposadr[model.eq_obj2id[k]]),
            model.eq_data[k, :5].copy(),
        )
        for k in range(model.neq)
        if model.eq_type[k] == mujoco.mjtEq.mjEQ_JOINT and model.eq_obj2id[k] >= 0
    ]
