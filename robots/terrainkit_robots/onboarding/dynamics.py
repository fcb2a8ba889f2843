"""Compare the dynamics of a written MJCF with its source, both as MuJoCo loads them.

The random states close the loops of the source as far as possible, and contacts and limits are
off. Joints are compared by name, and forces on the joints only, unless both bases are free.
"""

import copy
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from terrainkit_robots.analysis.legs.stance import GRAVITY
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.text import count, names
from terrainkit_robots.transforms import Matrix

_NUM_STATES = 30
"""Number of random states."""

_TOLERANCE = 1e-3
"""Largest relative difference; ten digits are written, and gains have two or more."""

_SMALLEST = 1e-2
"""Smallest value that differences are relative to, over the root of the mass that moves."""

_MAX_POSITION = np.pi
"""Random positions of joints without limits are at most this far from 0 [rad] or [m]."""

_NUM_ITERATIONS = 30
"""Gauss-Newton steps that close the loops of a state."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Side:
    """A model with the addresses of the joints that both models have."""

    model: Any
    data: Any
    joints: tuple[int, ...]
    """Indices of the joints in the order of the names."""

    base: int
    """Address of the free joint in qpos, or -1."""

    servos: Mapping[int, int]
    """Position actuator of each joint, by place of the joint."""

    @property
    def qpos(self) -> Any:
        """Addresses of the joints in qpos."""
        return self.model.jnt_qposadr[list(self.joints)]

    @property
    def dofs(self) -> Any:
        """Addresses of the joints in qvel."""
        return self.model.jnt_dofadr[list(self.joints)]


def dynamics_differences(
    source: Any,
    written: Any,
    *,
    base_joints: Collection[str] = (),
    compare_actuators: bool = True,
) -> tuple[str, ...]:
    """Return the differences of a written model from its source, one phrase each.

    Args:
        source: The `mujoco.MjModel` of the source.
        written: The `mujoco.MjModel` of the written file.
        base_joints: Joints of the source that a free joint replaces.
        compare_actuators: Whether position actuators have to have the gains of the source.
    """
    import mujoco

    source_names = dict.fromkeys(joint_names_of(source))
    joint_names = [name for name in joint_names_of(written) if name in source_names]
    sides = make_side(source, joint_names), make_side(written, joint_names)
    kept = {*joint_names, *base_joints}
    missing = [name for name in source_names if name not in kept]
    found = [f"without the joints {names(missing, max_count=4)}"] if missing else []
    if not joint_names:
        return tuple(found)
    found += _limit_differences(joint_names, sides)
    on_joint = source.actuator_trntype == int(mujoco.mjtTrn.mjTRN_JOINT)
    if source.nu and not on_joint.all():
        found.append(f"without {count(int((~on_joint).sum()), 'actuator')} of tendons or bodies")
    worst: dict[str, tuple[float, str]] = {}
    with quiet_mujoco():
        for side in sides:
            _isolate(side, written.opt.timestep)
        for state in _states(*sides, compare_actuators=compare_actuators):
            for name, (value, other) in state.items():
                error = np.abs(value - other)
                error = error.max(axis=0) if error.ndim > 1 else error
                place = int(error.argmax())
                relative = float(error[place]) / max(float(np.abs(value).max()), _SMALLEST)
                if relative > max(_TOLERANCE, worst.get(name, (0.0, ""))[0]):
                    worst[name] = relative, [*joint_names, *["the base"] * 6][place]
    found += [f"{name} by {error:.2g} at {joint}" for name, (error, joint) in worst.items()]
    return (*found, *_shape_differences(*sides))


_QUANTITIES = (
    "mass matrix",
    "gravity and Coriolis force",
    "force of springs, damping and actuators",
    "violation of constraints",
    "acceleration that constraints demand",
)


def _isolate(side: Side, time_step: float) -> None:
    """Turn off contacts, limits and friction, and use gravity and time step of both models."""
    import mujoco

    options = side.model.opt
    flags = ("CONTACT", "LIMIT", "FRICTIONLOSS", "CLAMPCTRL")
    off = (int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}")) for flag in flags)
    options.disableflags = sum(off)
    side.model.actuator_forcelimited[:] = 0
    side.model.jnt_actfrclimited[:] = 0
    options.gravity[:] = (0, 0, -GRAVITY)
    options.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    options.timestep = time_step  # it limits how stiff constraints are


def joint_names_of(model: Any) -> list[str]:
    """Return the names of the hinges and slides of a model that have one."""
    import mujoco

    moving = np.flatnonzero(model.jnt_type >= int(mujoco.mjtJoint.mjJNT_SLIDE))
    return [name for k in moving if (name := model.joint(k).name)]


def make_side(original: Any, joint_names: Sequence[str]) -> Side:
    """Return a copy of a model with the addresses of its joints and their position actuators.

    Args:
        original: The `mujoco.MjModel`.
        joint_names: Names of hinges and slides of the model.
    """
    import mujoco

    model = copy.copy(original)
    joints = tuple(int(model.joint(name).id) for name in joint_names)
    (free,) = np.nonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    place = {joint: k for k, joint in enumerate(joints)}
    servos = {
        place[int(model.actuator_trnid[k, 0])]: k
        for k in range(model.nu)
        if model.actuator_trntype[k] == int(mujoco.mjtTrn.mjTRN_JOINT)
        and model.actuator_trnid[k, 0] in place
        and model.actuator_gainprm[k, 0] == -model.actuator_biasprm[k, 1] != 0
    }
    base = int(model.jnt_qposadr[free[0]]) if len(free) else -1
    return Side(model=model, data=mujoco.MjData(model), joints=joints, base=base, servos=servos)


def _limit_differences(joint_names: list[str], sides: tuple[Side, Side]) -> Iterator[str]:
    source_range, written_range = (
        np.where(
            side.model.jnt_limited[list(side.joints), None].astype(bool),
            side.model.jnt_range[list(side.joints)],
            np.inf,
        )
        for side in sides
    )
    loss, written_loss = (side.model.dof_frictionloss[side.dofs] for side in sides)
    armature, written_armature = (side.model.dof_armature[side.dofs] for side in sides)
    effort, written_effort = (_effort_limits(side) for side in sides)
    checks = {
        # A servo without a limit gets one, see robot.toml.
        "effort limits": (effort == np.inf) | np.isclose(effort, written_effort, rtol=0.01),
        "limits": np.isclose(source_range, written_range, rtol=1e-6, atol=1e-6).all(axis=1),
        "friction": np.isclose(loss, written_loss, rtol=_TOLERANCE),
        # Stiff gains may need more armature at the time step of training, see robot.toml.
        "armature": written_armature >= armature * (1 - _TOLERANCE),
    }
    for what, is_same in checks.items():
        if not is_same.all():
            changed = [n for n, equal in zip(joint_names, is_same, strict=True) if not equal]
            yield f"{what} of {names(changed, max_count=4)}"


def _effort_limits(side: Side) -> Matrix:
    """Return the effort limit of the position actuator of each joint, shape (joints,)."""
    model, limits = side.model, np.full(len(side.joints), np.inf)
    for place, index in side.servos.items():
        if model.actuator_forcelimited[index]:
            force = model.actuator_forcerange[index, 1] * abs(model.actuator_gear[index, 0])
            limits[place] = force
        if model.jnt_actfrclimited[side.joints[place]]:
            largest = model.jnt_actfrcrange[side.joints[place], 1]
            limits[place] = min(limits[place], largest)
    return limits


def _states(
    source: Side, written: Side, *, compare_actuators: bool
) -> Iterator[dict[str, tuple[Matrix, ...]]]:
    """Yield the quantities of both models at random states."""
    import mujoco

    rng = np.random.default_rng(0)
    model = source.model
    low, high = model.jnt_range[list(source.joints)].T.copy()
    is_free = ~model.jnt_limited[list(source.joints)].astype(bool) | (low >= high)
    low[is_free], high[is_free] = -_MAX_POSITION, _MAX_POSITION
    low, high = np.clip((low, high), -_MAX_POSITION, _MAX_POSITION)
    shared = [k for k in source.servos if compare_actuators and k in written.servos]
    both_free = source.base >= 0 and written.base >= 0
    for _ in range(_NUM_STATES):
        source.data.qpos[:] = model.qpos0
        source.data.qpos[source.qpos] = rng.uniform(low, high)
        _close(source)
        positions = source.data.qpos[source.qpos].copy()
        speeds = rng.uniform(-1, 1, len(positions))
        targets = rng.uniform(low, high)
        if written.base >= 0:
            _place_base(source, written)
        results = []
        for side in (source, written):
            data = side.data
            data.qpos[side.qpos], data.qvel[:] = positions, 0.0
            data.qvel[side.dofs] = speeds
            for k in shared:
                index = side.servos[k]
                data.ctrl[index] = targets[k] * side.model.actuator_gear[index, 0]
                if (state := side.model.actuator_actadr[index]) >= 0:  # a filter has settled
                    data.act[state] = data.ctrl[index]
            mujoco.mj_forward(side.model, data)
            results.append(_quantities(side, shared, both_free))
        # Scaled by the masses that the source moves, small joints count as much as the base.
        weights = 1 / np.sqrt(np.diag(results[0]["mass matrix"]))
        for result in results:
            result["mass matrix"] = weights[:, None] * result["mass matrix"]
        yield {name: tuple(weights * result[name] for result in results) for name in _QUANTITIES}


def _close(side: Side) -> None:
    """Move the joints so that the equality constraints hold, as far as possible."""
    import mujoco

    model, data = side.model, side.data
    for _ in range(_NUM_ITERATIONS if model.neq else 0):
        mujoco.mj_fwdPosition(model, data)
        rows = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        violation = data.efc_pos[rows]
        if np.abs(violation).max(initial=0.0) < 1e-9:
            break
        jacobian = data.efc_J.reshape(-1, model.nv)[rows]
        step = np.zeros(model.nv)
        step[side.dofs] = -np.linalg.pinv(jacobian[:, side.dofs], rcond=1e-6) @ violation
        mujoco.mj_integratePos(model, data.qpos, step, 1.0)


def _place_base(source: Side, written: Side) -> None:
    """Give the free base of the written model the orientation of the source's base."""
    import mujoco

    mujoco.mj_kinematics(source.model, source.data)
    root = int(written.model.jnt_bodyid[written.model.jnt_type == 0][0])
    name = written.model.body(root).name
    body = mujoco.mj_name2id(source.model, mujoco.mjtObj.mjOBJ_BODY, name)
    if body >= 0:
        start = written.base
        written.data.qpos[start + 3 : start + 7] = source.data.xquat[body]


def _quantities(side: Side, shared: list[int], both_free: bool) -> dict[str, Matrix]:
    """Return what is compared, in the order of the joints, then of the base."""
    import mujoco

    model, data, dofs = side.model, side.data, side.dofs
    if both_free:
        first = int(model.jnt_dofadr[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE][0])
        dofs = np.concatenate([dofs, first + np.arange(6)])
    mass = np.zeros((model.nv, model.nv))
    for column, unit in enumerate(np.eye(model.nv)):
        mujoco.mj_mulM(model, data, mass[column], unit)
    mass -= np.diag(model.dof_armature)  # compared on its own, since onboarding adds it
    rows = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    jacobian = data.efc_J.reshape(-1, model.nv)[rows]
    force = data.qfrc_passive[dofs]
    # A motor has no target. Its joint is compared without the force of the written controller.
    for k in shared:
        force[k] += data.qfrc_actuator[side.dofs[k]]
    return {
        "mass matrix": mass[np.ix_(dofs, dofs)],
        "gravity and Coriolis force": data.qfrc_bias[dofs],
        "force of springs, damping and actuators": force,
        "violation of constraints": (jacobian.T @ data.efc_pos[rows])[dofs],
        "acceleration that constraints demand": (jacobian.T @ data.efc_aref[rows])[dofs],
    }


def _shape_differences(source: Side, written: Side) -> Iterator[str]:
    """Yield whether the numbers of colliding shapes or their contact parameters differ."""
    kinds, written_kinds = _contact_kinds(source), _contact_kinds(written)
    lost = (kinds - written_kinds).total()
    if lost:
        yield f"contact parameters of {lost} of {kinds.total()} shapes"


def _contact_kinds(side: Side) -> Counter[tuple[float, ...]]:
    """Return how many colliding shapes of a robot have the same contact parameters."""
    model = side.model
    columns = ("friction", "condim", "priority", "solref", "solimp", "solmix", "margin", "gap")
    roots = model.body_rootid[model.jnt_bodyid[list(side.joints)]]
    collides = (model.geom_contype | model.geom_conaffinity).astype(bool)
    of_robot = np.isin(model.body_rootid[model.geom_bodyid], roots)
    table = np.column_stack([getattr(model, f"geom_{name}") for name in columns])
    return Counter(map(tuple, table[collides & of_robot].round(6).tolist()))
