"""Step size: what inertia each joint has, and how long a time step of simulation it bears.

Training computes torque = kp (target - q) - kd dq once per time step. A light joint answers so fast
that the torque comes too late, and shakes itself to pieces. Motors of a simulator that solve for
the damping, as MuJoCo's implicitfast does, are spared that.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.sim_model import TIME_STEP, Plant

if TYPE_CHECKING:
    from terrainkit_robots.simulation.pd_gains import Gain

_BRISK = 0.4
"""Natural frequency times the time step that is still quiet: a joint with critical damping shakes
from 0.83 on, and others that move along make it lighter."""


@dataclass(frozen=True, kw_only=True)
class JointInertia:
    """Inertia of a joint with armature, in the standing pose [kg m2] or [kg]."""

    free: float
    """When all other joints and the base give way: what a sudden torque has to turn."""

    locked: float
    """When nothing else moves."""


def joint_inertias(plant: Plant) -> Mapping[str, JointInertia]:
    """Return the inertia of each moving joint, by name."""
    mass, inverse = _mass_matrix(plant)
    return {
        name: JointInertia(free=float(1 / inverse[dof, dof]), locked=float(mass[dof, dof]))
        for dof, name in enumerate(plant.joints, free_dofs(plant))
    }


def free_dofs(plant: Plant) -> int:
    """Return how many degrees of freedom the base has."""
    return 6 if plant.floating else 0


def stable_stiffness(inertia: float, step: float = TIME_STEP) -> float:
    """Return the stiffness that a joint bears with critical damping [N m/rad] or [N/m].

    Args:
        inertia: What it turns when all others give way [kg m2] or [kg].
        step: The time step [s].
    """
    return (_BRISK / step) ** 2 * inertia


def needed_inertia(stiffness: float, step: float = TIME_STEP) -> float:
    """Return the inertia with which a joint bears a stiffness [kg m2] or [kg]."""
    return stiffness * (step / _BRISK) ** 2


@dataclass(frozen=True, kw_only=True)
class StepSize:
    """The longest time step at which a robot under explicit PD does not shake."""

    seconds: float
    """Time step [s]; infinite without gains."""

    joint: str
    """The joint that shakes first; empty without gains."""


def longest_step(plant: Plant, gains: Mapping[str, "Gain"]) -> StepSize:
    """Return the longest stable time step of explicit PD in the standing pose, all joints at once.

    With M, D and K the matrices of mass, damping and stiffness, and positions that take the new
    speed, M (q+ - 2 q + q-) + h D (q - q-) + h^2 K q = 0. Each motion x makes that a quadratic of
    positive numbers whose roots are inside the unit circle if and only if x'(4 M - 2 h D - h^2 K)x
    is positive (Jury's criterion): the step h is stable as long as this matrix is.
    """
    mass, _ = _mass_matrix(plant)
    stiffness, damping = np.zeros(len(mass)), np.zeros(len(mass))
    for dof, name in enumerate(plant.joints, free_dofs(plant)):
        if name in gains:
            stiffness[dof], damping[dof] = gains[name].stiffness, gains[name].damping
            armature = plant.model.dof_armature[dof]
            mass[dof, dof] += max(gains[name].armature - armature, 0.0)
    if not (stiffness.any() or damping.any()):
        return StepSize(seconds=np.inf, joint="")

    def rest(step: float) -> Any:
        return 4 * mass - np.diag(2 * step * damping + step**2 * stiffness)

    stable, unstable = 0.0, 1.0
    for _ in range(30):
        middle = (stable + unstable) / 2
        if _is_positive(rest(middle)):
            stable = middle
        else:
            unstable = middle
    shaking = np.linalg.eigh(rest(unstable))[1][:, 0]
    loudest = int(np.argmax((2 * damping + unstable * stiffness) * shaking**2))
    return StepSize(seconds=stable, joint=plant.joints[loudest - free_dofs(plant)])


def _is_positive(matrix: Any) -> bool:
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True


def _mass_matrix(plant: Plant) -> tuple[Any, Any]:
    """Return the mass matrix in the standing pose and its inverse, shape (nv, nv)."""
    import mujoco

    model = plant.model
    data = mujoco.MjData(model)
    data.qpos[:] = plant.home
    mass, inverse = np.zeros((model.nv, model.nv)), np.zeros((model.nv, model.nv))
    with quiet_mujoco():
        mujoco.mj_fwdPosition(model, data)
        for row, unit in zip(mass, np.eye(model.nv), strict=True):
            mujoco.mj_mulM(model, data, row, unit)
        mujoco.mj_solveM(model, data, inverse, np.eye(model.nv))
    if not (np.isfinite(inverse).all() and (np.diag(inverse) > 0).all()):
        raise CannotCheckError("its mass matrix cannot be inverted")
    return mass, inverse
