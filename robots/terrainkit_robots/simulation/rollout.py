"""A trial: a copy of a plant, put somewhere and stepped, that notices when it blows up."""

import copy
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.simulation.pd_gains import Gain
from terrainkit_robots.simulation.sim_model import Plant
from terrainkit_robots.simulation.time_step import free_dofs

_MOST_CONTACTS = 300
"""With more contacts at once a step takes as long as a second of an ordinary robot."""

_MOST_DOFS = 100
"""With more degrees of freedom two seconds of it take more than that."""

_FAR = 100.0
"""The floor is looked for within this distance [m]."""

_IMMOVABLE = 1e8
"""Inertia of what is locked [kg m2] or [kg]: a robot's torques turn it by less than 1e-4 rad in
minutes, and in the limit the rest moves as if it were welded."""


class Trial:
    """A robot that is about to be simulated. It is used within `quiet_mujoco`."""

    def __init__(
        self,
        plant: Plant,
        gains: Mapping[str, Gain] | None = None,
        *,
        self_collision: bool = True,
    ) -> None:
        """Copy a plant, and give its motors their gains.

        Args:
            plant: The robot.
            gains: Gain of each actuated joint; without them nothing holds the joints.
            self_collision: Whether the robot can touch itself.

        Raises:
            CannotCheckError: if simulating it would take too long.
        """
        import mujoco

        self.plant = plant
        self.model = copy.copy(plant.model)
        if self.model.nv > _MOST_DOFS:
            raise CannotCheckError(
                f"it has {self.model.nv} degrees of freedom, and of more than {_MOST_DOFS} none is "
                "simulated"
            )
        if not self_collision:
            self._ignore_itself()
        for index, name in enumerate(plant.drives if gains else ()):
            assert gains is not None
            self._drive(index, name, gains[name])
        self.data = mujoco.MjData(self.model)
        mujoco.mj_setConst(self.model, self.data)  # the solver scales contacts by these masses

    def _drive(self, index: int, name: str, gain: Gain) -> None:
        model = self.model
        model.actuator_gainprm[index, 0] = gain.stiffness
        model.actuator_biasprm[index, 1:3] = -gain.stiffness, -gain.damping
        model.dof_armature[model.joint(name).dofadr[0]] = gain.armature

    def _ignore_itself(self) -> None:
        """Leave only contacts with the floor."""
        model = self.model
        touches = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
        floor = model.geom_bodyid == 0
        model.geom_contype[:] = np.where(floor, 1, 0)
        model.geom_conaffinity[:] = np.where(floor, 0, touches)

    def lock(self) -> None:
        """Make the joints immovable: their rotors become too heavy to be turned."""
        import mujoco

        self.model.dof_armature[free_dofs(self.plant) :] = _IMMOVABLE
        self.model.eq_active0[:] = 0  # what follows another joint is held, too
        self.data = mujoco.MjData(self.model)
        mujoco.mj_setConst(self.model, self.data)

    def without_floor(self) -> None:
        """Take the floor away."""
        floor = self.model.geom_bodyid == 0
        self.model.geom_contype[floor] = 0
        self.model.geom_conaffinity[floor] = 0

    def put(self, qpos: Any, *, above: float | None = None) -> None:
        """Set the joints, and the base so that the lowest shape is `above` the floor [m].

        Raises:
            CannotCheckError: if so much of it touches that simulating it would take too long.
        """
        import mujoco

        model, data = self.model, self.data
        data.qpos[:] = qpos
        if self.plant.floating and above is not None:
            data.qpos[2] = qpos[2] + _FAR / 2
            mujoco.mj_kinematics(model, data)
            data.qpos[2] += above - self._clearance()
        mujoco.mj_forward(model, data)
        if data.ncon > _MOST_CONTACTS:
            raise CannotCheckError(
                f"{data.ncon} contacts at once, and with more than {_MOST_CONTACTS} none is "
                "simulated"
            )

    def _clearance(self) -> float:
        """Return the height of the lowest shape above the floor [m]."""
        import mujoco

        model, data = self.model, self.data
        (floors,) = np.nonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
        solid = np.flatnonzero((model.geom_contype != 0) | (model.geom_conaffinity != 0))
        distances = [
            mujoco.mj_geomDistance(model, data, int(floors[0]), int(geom), _FAR, None)
            for geom in solid
            if geom not in floors
        ]
        return min(distances, default=float(data.qpos[2]))

    def steps(self, seconds: float) -> Iterator[int]:
        """Step, and yield the number of each step; stop early if the numbers blow up."""
        import mujoco

        for number in range(round(seconds / self.model.opt.timestep)):
            mujoco.mj_step(self.model, self.data)
            if self.blew_up:
                return
            yield number

    @property
    def blew_up(self) -> bool:
        """Whether a position, speed or acceleration was not a number, or huge.

        MuJoCo then starts from its initial state again, without a word.
        """
        import mujoco

        kinds = mujoco.mjtWarning
        counts = self.data.warning.number
        return bool(
            counts[int(kinds.mjWARN_BADQPOS)]
            + counts[int(kinds.mjWARN_BADQVEL)]
            + counts[int(kinds.mjWARN_BADQACC)]
        )
