"""Compute the inertia of each joint, and the longest time step at which PD control is stable.

Training computes torque = kp (target - q) - kd dq once per time step. A light joint responds so
fast that the torque comes too late, and oscillates. Actuators of a simulator that integrates the
damping implicitly, such as MuJoCo's implicitfast, do not have this problem.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.gain import Gain
from terrainkit_robots.simulation.sim_model import TIME_STEP, SimModel

# About half of the stability limit of critical damping, where d = 2 w I and the matrix in
# `max_stable_time_step` is 4 - 4 w h - (w h)^2 > 0, so w h < 2 sqrt(2) - 2 = 0.83.
_MAX_FREQUENCY_STEP = 0.4
"""Natural frequency times time step, at most. A joint with critical damping oscillates from 0.83
on, and joints that move along reduce its inertia."""


@dataclass(frozen=True, kw_only=True)
class JointInertia:
    """Inertia of a joint in the standing pose, including armature [kg m2] or [kg]."""

    free: float
    """Inertia when all other joints and the base are free: the response to a sudden torque."""

    locked: float
    """Inertia when nothing else moves."""


def joint_inertia(sim: SimModel) -> Mapping[str, JointInertia]:
    """Return the inertia of each moving joint, by name."""
    mass, inverse = _mass_matrix(sim)
    return {
        name: JointInertia(free=float(1 / inverse[dof, dof]), locked=float(mass[dof, dof]))
        for dof, name in enumerate(sim.joints, sim.base_dofs)
    }


def max_stable_stiffness(inertia: float) -> float:
    """Return the stiffness up to which critical damping is stable [N m/rad] or [N/m].

    Args:
        inertia: Inertia of the joint when all others are free [kg m2] or [kg].
    """
    return (_MAX_FREQUENCY_STEP / TIME_STEP) ** 2 * inertia


def min_stable_inertia(stiffness: float) -> float:
    """Return the inertia from which a stiffness with critical damping is stable [kg m2] or [kg]."""
    return stiffness * (TIME_STEP / _MAX_FREQUENCY_STEP) ** 2


@dataclass(frozen=True, kw_only=True)
class StableTimeStep:
    """The longest time step at which a robot is stable under explicit PD control."""

    seconds: float
    """Time step [s]; infinite without gains."""

    joint: str
    """The joint that becomes unstable first; empty without gains."""


def max_stable_time_step(sim: SimModel, gains: Mapping[str, Gain]) -> StableTimeStep:
    """Return the longest stable time step of explicit PD control in the standing pose.

    With mass, damping and stiffness matrices M, D and K, and semi-implicit integration,
    M (q+ - 2 q + q-) + h D (q - q-) + h^2 K q = 0. For each motion x this is a quadratic equation
    with positive coefficients. By Jury's matrix its roots are inside the unit circle if and only
    if x'(4 M - 2 h D - h^2 K)x is positive. The time step h is stable if this matrix is positive
    definite.
    """
    mass, _ = _mass_matrix(sim)
    stiffness, damping = np.zeros(len(mass)), np.zeros(len(mass))
    for dof, name in enumerate(sim.joints, sim.base_dofs):
        if name in gains:
            stiffness[dof], damping[dof] = gains[name].stiffness, gains[name].damping
            armature = sim.model.dof_armature[dof]
            mass[dof, dof] += max(gains[name].armature - armature, 0.0)
    if not (stiffness.any() or damping.any()):
        return StableTimeStep(seconds=np.inf, joint="")

    def matrix(time_step: float) -> Any:
        return 4 * mass - np.diag(2 * time_step * damping + time_step**2 * stiffness)

    stable, unstable = 0.0, 1.0
    # 30 halvings of 1 s: to a nanosecond.
    for _ in range(30):
        middle = (stable + unstable) / 2
        if np.linalg.eigvalsh(matrix(middle))[0] > 0:
            stable = middle
        else:
            unstable = middle
    motion = np.linalg.eigh(matrix(unstable))[1][:, 0]
    dof = int(np.argmax((2 * damping + unstable * stiffness) * motion**2))
    return StableTimeStep(seconds=stable, joint=sim.joints[dof - sim.base_dofs])


def _mass_matrix(sim: SimModel) -> tuple[Any, Any]:
    """Return the mass matrix in the standing pose and its inverse, each of shape (nv, nv)."""
    import mujoco

    model = sim.model
    data = mujoco.MjData(model)
    data.qpos[:] = sim.standing_qpos
    mass, inverse = np.zeros((model.nv, model.nv)), np.zeros((model.nv, model.nv))
    with quiet_mujoco():
        mujoco.mj_fwdPosition(model, data)
        for row, unit in zip(mass, np.eye(model.nv), strict=True):
            mujoco.mj_mulM(model, data, row, unit)
        mujoco.mj_solveM(model, data, inverse, np.eye(model.nv))
    if not (np.isfinite(inverse).all() and (np.diag(inverse) > 0).all()):
        raise CannotCheckError("its mass matrix is singular")
    return mass, inverse
