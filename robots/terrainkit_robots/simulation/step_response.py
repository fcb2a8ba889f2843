"""Step the target of each joint of a written robot, with the base held in the air."""

import copy
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.transforms import Matrix

SECONDS = 1.0
"""Time after the step [s]."""

MAX_RISE_TIME, MAX_OVERSHOOT, MAX_ERROR = 0.3, 1.0, 0.5
"""Limits of a joint that a policy moves. The legs of six published robots take at most 0.19 s and
overshoot by at most 56 %; a gait has half a second."""

_SETTLING_SECONDS = 0.5
"""Time at the default pose before the step [s]."""

_STEP = {"hinge": 0.2, "slide": 0.02}
"""Largest step [rad], [m]; it ends within the range of the target."""

_BASE_ARMATURE = 1e6
"""Armature that holds a free base [kg], [kg m2]; it has no weight."""


@dataclass(frozen=True, kw_only=True)
class StepResponse:
    """How a joint follows a step of its target, relative to the size of the step."""

    joint: str

    rise_time: float
    """Time until 90 % of the step [s]; infinite if it is not reached."""

    overshoot: float
    """Largest position beyond the target."""

    error: float
    """Distance from the target at the end."""

    @property
    def failure(self) -> str:
        """Why the joint does not follow its target; empty if it does."""
        if self.error > 1.5:
            return "moves away from its target"
        if self.error > MAX_ERROR:
            return f"ends {self.error:.0%} of the step away from its target"
        if math.isinf(self.rise_time):
            return "does not reach 90 % of the step"
        if self.rise_time > MAX_RISE_TIME:
            return f"takes {self.rise_time:.2g} s for 90 % of the step"
        if self.overshoot > MAX_OVERSHOOT:
            return f"overshoots by {self.overshoot:.0%} of the step"
        return ""


def step_responses(model: Any, qpos: Matrix) -> tuple[StepResponse, ...]:
    """Return the response of each joint with a position actuator, in the order of the actuators.

    Args:
        model: The `mujoco.MjModel` of a written robot.
        qpos: The default pose, shape (nq,).
    """
    import mujoco

    model = copy.copy(model)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    for joint in np.flatnonzero(model.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE)):
        model.dof_armature[model.jnt_dofadr[joint] : model.jnt_dofadr[joint] + 6] = _BASE_ARMATURE
    start = mujoco.MjData(model)
    with quiet_mujoco():
        mujoco.mj_setConst(model, start)
        servos = np.flatnonzero(model.actuator_biasprm[:, 1] < 0)
        start.qpos[:] = qpos
        start.ctrl[servos] = qpos[model.jnt_qposadr[model.actuator_trnid[servos, 0]]]
        mujoco.mj_step(model, start, nstep=round(_SETTLING_SECONDS / model.opt.timestep))
        return tuple(_response(model, start, int(index)) for index in servos)


def _response(model: Any, start: Any, actuator: int) -> StepResponse:
    import mujoco

    joint = int(model.actuator_trnid[actuator, 0])
    is_slide = model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_SLIDE)
    data = copy.copy(start)
    step = _STEP["slide" if is_slide else "hinge"]
    target = float(start.ctrl[actuator])
    is_limited = model.actuator_ctrllimited[actuator]
    low, high = model.actuator_ctrlrange[actuator] if is_limited else (-np.inf, np.inf)
    # Toward the side with more room.
    step = min(step, high - target) if high - target >= target - low else -min(step, target - low)
    data.ctrl[actuator] = target + step
    address = int(model.jnt_qposadr[joint])
    positions = np.zeros(round(SECONDS / model.opt.timestep))
    for number in range(len(positions)):
        mujoco.mj_step(model, data)
        positions[number] = data.qpos[address]
    share = (positions - start.qpos[address]) / step
    reached = np.flatnonzero(share >= 0.9)
    return StepResponse(
        joint=model.joint(joint).name,
        rise_time=float(model.opt.timestep * (reached[0] + 1)) if len(reached) else np.inf,
        overshoot=float(max(share.max() - 1, 0.0)),
        error=float(abs(share[-1] - 1)),
    )
