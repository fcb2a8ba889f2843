"""Move each joint to both of its limits quasi-statically, with the base fixed in the air.

Only gravity acts: the joint is set to a sequence of positions while the others stay in the standing
pose, and MuJoCo computes the contacts and the holding torque at each position.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from terrainkit_robots.description.model import JointUnits
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.rollout import Rollout
from terrainkit_robots.simulation.sim_model import SimModel

_SAMPLES = 40
"""Number of positions over the range of a joint."""

_MIN_DEPTH = 0.001
"""Penetration depth from which a contact blocks a joint [m], as in COL005."""


@dataclass(frozen=True, kw_only=True)
class SweepResult:
    """The range that a joint can reach."""

    joint: str

    units: JointUnits

    limits: tuple[float, float]
    """Lower and upper limit [rad] or [m]."""

    reached: tuple[float, float]
    """Lowest and highest unblocked position, accurate to a fortieth of the range [rad] or [m]."""

    blocked: tuple[tuple[str, str] | None, tuple[str, str] | None]
    """The bodies that collide beyond the lowest and the highest position; None if none do."""

    load: float
    """Torque [N m] or force [N] against gravity in the standing pose."""

    max_load: float
    """Largest torque or force over the sweep."""

    effort: float
    """Effort limit of the joint [N m] or [N]; infinite if it is unlimited."""

    @property
    def share(self) -> float:
        """Return the reachable share of the range, in 0..1."""
        lower, upper = self.limits
        return (self.reached[1] - self.reached[0]) / (upper - lower)


def joint_sweep(sim: SimModel) -> tuple[SweepResult, ...]:
    """Return the reachable range of each actuated joint with limits, in actuator order.

    Bodies that touch each other in the standing pose do not block a joint.

    Raises:
        CannotCheckError: if the simulation would take too long.
    """
    limited = [name for name in sim.actuated if sim.model.joint(name).limited[0]]
    with quiet_mujoco():
        rollout = Rollout(sim)
        rollout.disable_floor()
        rollout.reset(sim.standing_qpos)
        sweep = _Sweep(rollout)
        return tuple(sweep.run(name) for name in limited)


class _Sweep:
    """A robot with a fixed base, and the pairs of bodies that touch in the standing pose."""

    def __init__(self, rollout: Rollout) -> None:
        self._rollout = rollout
        self._mimic_joints = _mimic_joints(rollout.model)
        self._ignored: frozenset[tuple[int, int]] = frozenset()
        self._set_position(None, 0.0)
        self._ignored = frozenset(self._contact_pairs(0.0))

    def run(self, name: str) -> SweepResult:
        """Sweep one joint."""
        sim, joint = self._rollout.sim, self._rollout.model.joint(name)
        lower, upper = (float(limit) for limit in joint.range)
        start = float(np.clip(sim.standing_qpos[int(joint.qposadr[0])], lower, upper))
        down = self._move(name, start, lower, (upper - lower) / _SAMPLES)
        up = self._move(name, start, upper, (upper - lower) / _SAMPLES)
        return SweepResult(
            joint=name,
            units=sim.units(name),
            limits=(lower, upper),
            reached=(down[0], up[0]),
            blocked=(down[1], up[1]),
            load=abs(down[2][0]),
            max_load=max(map(abs, (*down[2], *up[2]))),
            effort=sim.effort_limit(name),
        )

    def _move(
        self, name: str, start: float, end: float, step: float
    ) -> tuple[float, tuple[str, str] | None, list[float]]:
        """Return the last unblocked position, the bodies that block the next one, and the loads."""
        model, data = self._rollout.model, self._rollout.data
        dof = int(model.joint(name).dofadr[0])
        reached = start
        loads = []
        for position in np.linspace(start, end, 1 + int(np.ceil(abs(end - start) / step))):
            self._set_position(name, float(position))
            loads.append(float(data.qfrc_bias[dof]))
            for first, second in self._contact_pairs(_MIN_DEPTH):
                return reached, (model.body(first).name, model.body(second).name), loads
            reached = float(position)
        return reached, None, loads

    def _set_position(self, name: str | None, position: float) -> None:
        import mujoco

        model, data = self._rollout.model, self._rollout.data
        data.qpos[:] = self._rollout.sim.standing_qpos
        if name is not None:
            data.qpos[int(model.joint(name).qposadr[0])] = position
            for address, target, coefficients in self._mimic_joints:
                data.qpos[address] = np.polynomial.Polynomial(coefficients)(data.qpos[target])
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)  # at zero velocity the bias force is gravity

    def _contact_pairs(self, depth: float) -> Sequence[tuple[int, int]]:
        """Return the pairs of bodies that overlap deeper than `depth` [m], except ignored ones."""
        model, data = self._rollout.model, self._rollout.data
        deep = data.contact.geom[data.contact.dist < -depth]
        pairs = {tuple(sorted(pair)) for pair in model.geom_bodyid[deep].tolist()}
        return sorted((a, b) for a, b in pairs if (a, b) not in self._ignored)


def _mimic_joints(model: Any) -> list[tuple[int, int, Any]]:
    """Return the qpos addresses of mimic joints and their targets, and the coefficients."""
    import mujoco

    is_mimic = (model.eq_type == mujoco.mjtEq.mjEQ_JOINT) & (model.eq_obj2id >= 0)
    joints, targets = model.eq_obj1id[is_mimic], model.eq_obj2id[is_mimic]
    addresses = model.jnt_qposadr[joints], model.jnt_qposadr[targets]
    return list(zip(*addresses, model.eq_data[is_mimic, :5], strict=True))
