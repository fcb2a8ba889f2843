"""Step a copy of a simulation model, and detect divergence."""

import copy
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from terrainkit.integrations.near_geoms import collides
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.simulation.gain import Gain
from terrainkit_robots.simulation.sim_model import SimModel

_MAX_CONTACTS = 300
"""With more contacts one step takes as long as a second of an ordinary robot."""

_MAX_DOFS = 100
"""With more degrees of freedom two seconds take longer than that."""

_MAX_DISTANCE = 100.0
"""Distance within which the floor is searched [m]."""


class Rollout:
    """A simulation of a robot. Use it within `quiet_mujoco`."""

    def __init__(
        self, sim: SimModel, gains: Mapping[str, Gain] | None = None, *, self_collision: bool = True
    ) -> None:
        """Copy a model, and set the gains of its actuators.

        Args:
            sim: The robot.
            gains: Gains of each actuated joint. Without gains the joints move freely.
            self_collision: Whether the shapes of the robot collide with each other.

        Raises:
            CannotCheckError: if the simulation would take too long.
        """
        import mujoco

        self.sim = sim
        self.model = copy.copy(sim.model)
        model = self.model
        check_dofs(model)
        if not self_collision:
            can_collide, floor = collides(model), model.geom_bodyid == 0
            # Only the floor offers a contact bit, and only the robot accepts it.
            model.geom_contype[:] = floor
            model.geom_conaffinity[:] = can_collide & ~floor
        for index, name in enumerate(sim.actuated if gains else ()):
            assert gains is not None
            gain = gains[name]
            model.actuator_gainprm[index, 0] = gain.stiffness
            model.actuator_biasprm[index, 1:3] = -gain.stiffness, -gain.damping
            model.dof_armature[model.joint(name).dofadr[0]] = gain.armature
        self.data = mujoco.MjData(model)
        mujoco.mj_setConst(model, self.data)  # the contact solver scales by these masses

    def disable_floor(self) -> None:
        """Disable the contacts of the floor."""
        floor = self.model.geom_bodyid == 0
        self.model.geom_contype[floor] = 0
        self.model.geom_conaffinity[floor] = 0

    def reset(self, qpos: Any, *, clearance: float | None = None) -> None:
        """Set the state of the robot.

        Args:
            qpos: Positions, shape (nq,).
            clearance: Height of the lowest shape above the floor, which moves the base [m].

        Raises:
            CannotCheckError: if there are so many contacts that the simulation would take too long.
        """
        import mujoco

        model, data = self.model, self.data
        data.qpos[:] = qpos
        if self.sim.floating and clearance is not None:
            # Measured from far above the floor, so that all distances are positive.
            data.qpos[2] = qpos[2] + _MAX_DISTANCE / 2
            mujoco.mj_kinematics(model, data)
            data.qpos[2] += clearance - self._clearance()
        mujoco.mj_forward(model, data)
        check_contacts(data)

    def _clearance(self) -> float:
        """Return the height of the lowest shape above the floor [m]."""
        import mujoco

        model, data = self.model, self.data
        (floors,) = np.nonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
        distances = [
            mujoco.mj_geomDistance(model, data, int(floors[0]), int(geom), _MAX_DISTANCE, None)
            for geom in np.flatnonzero(collides(model))
            if geom not in floors
        ]
        return min(distances, default=float(data.qpos[2]))

    def steps(self, seconds: float) -> Iterator[int]:
        """Step, and yield the index of each step. Stop if the simulation diverges."""
        import mujoco

        for index in range(round(seconds / self.model.opt.timestep)):
            mujoco.mj_step(self.model, self.data)
            if self.diverged:
                return
            yield index

    @property
    def diverged(self) -> bool:
        """Whether a position, velocity or acceleration was not finite, or huge."""
        return has_diverged(self.data)


def check_dofs(model: Any) -> None:
    """Raise CannotCheckError if a model has so many joints that a simulation takes too long."""
    if model.nv > _MAX_DOFS:
        raise CannotCheckError(
            f"degrees of freedom: got {model.nv}; expected at most {_MAX_DOFS} to simulate it"
        )


def check_contacts(data: Any) -> None:
    """Raise CannotCheckError if a state has so many contacts that a simulation takes too long."""
    if data.ncon > _MAX_CONTACTS:
        raise CannotCheckError(
            f"contacts: got {data.ncon}; expected at most {_MAX_CONTACTS} to simulate it"
        )


def has_diverged(data: Any) -> bool:
    """Return whether a position, velocity or acceleration was not finite, or huge.

    MuJoCo then resets the state and continues, with only a warning.
    """
    import mujoco

    kinds = mujoco.mjtWarning
    bad = (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC)
    return any(data.warning[int(kind)].number for kind in bad)
