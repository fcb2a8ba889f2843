"""Compare a written file with its source, both as MuJoCo models.

The random states close the loops of the source as far as possible, and contacts and limits are
off. Links and joints are compared by name, and forces on the joints only, unless both bases are
free.
"""

import copy
import math
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Any

import mujoco
import numpy as np

from terrainkit_robots.analysis.legs.stance import GRAVITY
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.text import count, names
from terrainkit_robots.transforms import Matrix, pose_error

NUM_STATES = 30
"""Number of random states."""

_SMALLEST = 1e-2
"""Smallest value that differences are relative to, over the root of the mass that moves."""

_MAX_POSITION = np.pi
"""Random positions of joints without limits are at most this far from 0 [rad] or [m]."""

_NUM_ITERATIONS = 30
"""Gauss-Newton steps that close the loops of a state."""

_FORCES = (
    "mass matrix",
    "gravity and Coriolis force",
    "force of springs, damping and actuators",
    "violation of constraints",
    "acceleration that constraints demand",
)
"""What is compared for each joint; the first two follow from the masses and the frames alone."""

_TOLERANCES = dict.fromkeys(("mass", *_FORCES), 1e-3) | {
    "link position": 1e-4,
    "link rotation": 1e-3,
}
"""Largest errors: positions [m] and rotations [rad] of links, and relative errors. Ten digits are
written, and gains have two or more."""


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """How a written file differs from its source."""

    file: str
    """Name of the written file."""

    errors: Mapping[str, tuple[float, str]]
    """Largest error of each quantity, and the link or joint that has it: link positions [m] and
    rotations [rad]; other errors are relative."""

    changes: tuple[str, ...] = ()
    """What else differs, one phrase each."""

    @property
    def differences(self) -> tuple[str, ...]:
        """What differs by more than the tolerances, one phrase each; empty if nothing does."""
        excessive = (
            f"{name} by {error_text(name, error)}"
            for name, error in self.errors.items()
            if not error[0] <= _TOLERANCES[name]
        )
        return (*self.changes, *excessive)


def error_text(quantity: str, error: tuple[float, str]) -> str:
    """Return an error of a `Comparison` with its unit and place."""
    value, place = error
    text = f"{value:.2g}"
    if quantity == "link position":
        text = f"{1000 * value:.2g} mm"
    elif quantity == "link rotation":
        text = f"{math.degrees(value):.2g} deg"
    return f"{text} at {place}" if place else text


@dataclass(frozen=True, kw_only=True, eq=False)
class Side:
    """A model with the addresses of the joints and links that both models have."""

    model: Any
    data: Any
    joints: tuple[int, ...]
    """Indices of the joints in the order of the names."""

    free: int
    """Address of the free joint in qpos, or -1."""

    servos: Mapping[int, int]
    """Position actuator of each joint, by place of the joint."""

    base: int
    """Index of the body that is the base; 0 if it is the world."""

    links: tuple[Any, ...]
    """Views of the body or site of each link in the data."""

    @property
    def qpos(self) -> Any:
        """Addresses of the joints in qpos."""
        return self.model.jnt_qposadr[list(self.joints)]

    @property
    def dofs(self) -> Any:
        """Addresses of the joints in qvel."""
        return self.model.jnt_dofadr[list(self.joints)]


def compare_models(
    file: str,
    source: Any,
    written: Any,
    *,
    base: str,
    mass: float,
    pose: Mapping[str, float],
    base_joints: Collection[str] = (),
    ignored: Collection[str] = (),
) -> Comparison:
    """Return the differences of a written model from its source.

    Args:
        file: Name of the written file.
        source: The `mujoco.MjModel` of the source.
        written: The `mujoco.MjModel` of the written file.
        base: Name of the base link in the written file.
        mass: Mass of the source [kg].
        pose: Joint positions of the first keyframe of the written file, if it has one.
        base_joints: Joints of the source that a free joint replaces.
        ignored: What is not compared: `forces` of springs, actuators and constraints with their
            settings, gains of `actuators`, or `shapes`.
    """
    source_names, written_names = joint_names_of(source), joint_names_of(written)
    joint_names = [name for name in written_names if name in set(source_names)]
    frames = {written.body(k).name for k in range(written.nbody)}
    frames |= {written.site(k).name for k in range(written.nsite)}
    links = [name for k in range(1, source.nbody) if (name := source.body(k).name) in frames]
    sides = (
        make_side(source, joint_names, base, links),
        make_side(written, joint_names, base, links),
    )
    changed = {
        "without the joints": [n for n in source_names if n not in {*joint_names, *base_joints}],
        "with the joints": [name for name in written_names if name not in source_names],
    }
    if written.nkey:
        held = written.key_qpos[0][sides[1].qpos]
        expected = [pose.get(name, 0.0) for name in joint_names]
        is_other = ~np.isclose(held, expected, atol=1e-6)
        changed["another keyframe of"] = list(compress(joint_names, is_other))
    for what, is_other in _changed_settings(*sides).items():
        if "forces" not in ignored or what in ("limits", "friction"):
            changed[f"{what} of"] = list(compress(joint_names, is_other))
    changes = [f"{what} {names(joints, max_count=4)}" for what, joints in changed.items() if joints]
    others = int((source.actuator_trntype != int(mujoco.mjtTrn.mjTRN_JOINT)).sum())
    if others and "forces" not in ignored:
        changes.append(f"without {count(others, 'actuator')} of tendons or bodies")
    kinds, written_kinds = (_contact_kinds(side) for side in sides)
    lost = (kinds - written_kinds).total()
    if lost and "shapes" not in ignored:
        changes.append(f"contact parameters of {lost} of {kinds.total()} shapes")
    total = float(written.body_mass.sum())
    errors = {"mass": (abs(total / mass - 1) if mass else total, "")}
    places = {"link position": links, "link rotation": links}
    for name, error in _largest_errors(*sides, ignored).items():
        if error.size:
            place = int(error.argmax())
            where = places.get(name, [*joint_names, *["the base"] * 6])[place]
            errors[name] = float(error[place]), where
    return Comparison(file=file, errors=errors, changes=tuple(changes))


def _largest_errors(source: Side, written: Side, ignored: Collection[str]) -> dict[str, Matrix]:
    """Return the largest error of each quantity at random states, by link or by joint."""
    with quiet_mujoco():
        for side in (source, written):
            _isolate(side, written.model.opt.timestep)
        states = list(_states(source, written, has_targets="actuators" not in ignored))
    left_out = _FORCES[2:] if "forces" in ignored else ()
    return {
        name: np.max([state[name] for state in states], axis=0)
        for name in states[0]
        if name not in left_out
    }


def _isolate(side: Side, time_step: float) -> None:
    """Turn off contacts, limits and friction, and use the time step of the written model."""
    options = side.model.opt
    flags = ("CONTACT", "LIMIT", "FRICTIONLOSS", "CLAMPCTRL")
    off = (int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}")) for flag in flags)
    options.disableflags = sum(off)
    side.model.actuator_forcelimited[:] = 0
    side.model.jnt_actfrclimited[:] = 0
    options.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    options.timestep = time_step  # it limits how stiff constraints are


def joint_names_of(model: Any) -> list[str]:
    """Return the names of the hinges and slides of a model that have one."""
    moving = np.flatnonzero(model.jnt_type >= int(mujoco.mjtJoint.mjJNT_SLIDE))
    return [name for k in moving if (name := model.joint(k).name)]


def make_side(
    original: Any, joint_names: Sequence[str], base: str = "", links: Sequence[str] = ()
) -> Side:
    """Return a copy of a model with the addresses of its joints and their position actuators.

    Args:
        original: The `mujoco.MjModel`.
        joint_names: Names of hinges and slides of the model.
        base: Name of the base; a model without this body has the world as its base.
        links: Names of bodies or sites of the model.
    """
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
    data, body = mujoco.MjData(model), mujoco.mjtObj.mjOBJ_BODY
    return Side(
        model=model,
        data=data,
        joints=joints,
        free=int(model.jnt_qposadr[free[0]]) if len(free) else -1,
        servos=servos,
        base=max(mujoco.mj_name2id(model, body, base), 0),
        links=tuple(
            data.body(name) if mujoco.mj_name2id(model, body, name) >= 0 else data.site(name)
            for name in links
        ),
    )


def _changed_settings(source: Side, written: Side) -> dict[str, Any]:
    """Return whether each joint has another setting, which no state shows, by setting."""
    before, after = (
        {
            "limits": _ranges(side),
            "friction": side.model.dof_frictionloss[side.dofs, None],
            "effort limits": _effort_limits(side)[:, None],
            "armature": side.model.dof_armature[side.dofs, None],
        }
        for side in (source, written)
    )
    # A servo without a limit gets one, and stiff gains may need more armature at the time step of
    # training, see robot.toml.
    after["effort limits"][np.isinf(before["effort limits"])] = np.inf
    after["armature"] = np.minimum(after["armature"], before["armature"])
    rtol = {"limits": 1e-6, "effort limits": 0.01}
    return {
        name: ~np.isclose(value, after[name], rtol=rtol.get(name, 1e-3), atol=1e-6).all(axis=1)
        for name, value in before.items()
    }


def _ranges(side: Side) -> Matrix:
    """Return the limits of each joint, infinite without limits, shape (joints, 2)."""
    joints = list(side.joints)
    is_limited = side.model.jnt_limited[joints, None].astype(bool)
    return np.where(is_limited, side.model.jnt_range[joints], [-np.inf, np.inf])


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


def _states(source: Side, written: Side, *, has_targets: bool) -> Iterator[dict[str, Matrix]]:
    """Yield the errors of each quantity at random states, by link or by joint."""
    rng = np.random.default_rng(0)
    model = source.model
    low, high = np.clip(_ranges(source), -_MAX_POSITION, _MAX_POSITION).T
    shared = [k for k in source.servos if has_targets and k in written.servos]
    both_free = source.free >= 0 and written.free >= 0
    for _ in range(NUM_STATES):
        source.data.qpos[:] = model.qpos0
        source.data.qpos[source.qpos] = rng.uniform(low, high)
        _close(source)
        positions = source.data.qpos[source.qpos].copy()
        speeds = rng.uniform(-1, 1, len(positions))
        targets = rng.uniform(low, high)
        results = []
        for side in (source, written):
            data = side.data
            data.qpos[side.qpos], data.qvel[:] = positions, 0.0
            data.qvel[side.dofs] = speeds
            if both_free and side is written:
                data.qpos[side.free + 3 : side.free + 7] = source.data.xquat[source.base]
            for k in shared:
                index = side.servos[k]
                data.ctrl[index] = targets[k] * side.model.actuator_gear[index, 0]
                if (state := side.model.actuator_actadr[index]) >= 0:  # a filter has settled
                    data.act[state] = data.ctrl[index]
            mujoco.mj_fwdPosition(side.model, data)
            # The bases may be turned in the world.
            down = -data.xmat[side.base].reshape(3, 3)[:, 2]
            side.model.opt.gravity[:] = GRAVITY * down
            mujoco.mj_fwdVelocity(side.model, data)
            mujoco.mj_fwdActuation(side.model, data)
            results.append(_quantities(side, shared, both_free))
        distance, angle = pose_error(*(_link_poses(side) for side in (source, written)))
        # Scaled by the masses that the source moves, small joints count as much as the base.
        moved = np.diag(results[0]["mass matrix"])
        weights = 1 / np.sqrt(np.maximum(moved, moved.max(initial=0.0) * 1e-12 + 1e-12))
        for result in results:
            result["mass matrix"] = weights[:, None] * result["mass matrix"]
        errors = {"link position": distance, "link rotation": angle}
        for name in _FORCES:
            value, other = (weights * result[name] for result in results)
            largest = max(float(np.abs(value).max(initial=0.0)), _SMALLEST)
            error = np.atleast_2d(np.abs(value - other)).max(axis=0, initial=0.0)
            errors[name] = error / largest
        yield errors


def _link_poses(side: Side) -> Matrix:
    """Return the poses of the links in the frame of the base, shape (links, 4, 4) [m]."""
    data, poses = side.data, np.tile(np.eye(4), (len(side.links), 1, 1))
    rotation = data.xmat[side.base].reshape(3, 3)
    for pose, link in zip(poses, side.links, strict=True):
        pose[:3, 3] = (link.xpos - data.xpos[side.base]) @ rotation
        pose[:3, :3] = rotation.T @ link.xmat.reshape(3, 3)
    return poses


def _close(side: Side) -> None:
    """Move the joints so that the equality constraints hold, as far as possible."""
    model, data = side.model, side.data
    for _ in range(_NUM_ITERATIONS if model.neq else 0):
        mujoco.mj_fwdPosition(model, data)
        rows = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        violation = data.efc_pos[rows]
        if np.abs(violation).max(initial=0.0) < 1e-9:
            break
        jacobian = data.efc_J.reshape(data.nefc, model.nv)[rows]
        step = np.zeros(model.nv)
        step[side.dofs] = -np.linalg.pinv(jacobian[:, side.dofs], rcond=1e-6) @ violation
        mujoco.mj_integratePos(model, data.qpos, step, 1.0)


def _quantities(side: Side, shared: list[int], both_free: bool) -> dict[str, Matrix]:
    """Return what is compared, in the order of the joints, then of the base."""
    model, data, dofs = side.model, side.data, side.dofs
    if both_free:
        first = int(model.jnt_dofadr[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE][0])
        dofs = np.concatenate([dofs, first + np.arange(6)])
    mass = np.zeros((model.nv, model.nv))
    for column, unit in enumerate(np.eye(model.nv)):
        mujoco.mj_mulM(model, data, mass[column], unit)
    mass -= np.diag(model.dof_armature)  # compared on its own, since onboarding adds it
    rows = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    jacobian = data.efc_J.reshape(data.nefc, model.nv)[rows]
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


def _contact_kinds(side: Side) -> Counter[tuple[float, ...]]:
    """Return how many colliding shapes of a robot have the same contact parameters."""
    model = side.model
    columns = ("friction", "condim", "priority", "solref", "solimp", "solmix", "margin", "gap")
    roots = model.body_rootid[model.jnt_bodyid[list(side.joints)]]
    collides = (model.geom_contype | model.geom_conaffinity).astype(bool)
    of_robot = np.isin(model.body_rootid[model.geom_bodyid], roots)
    # The sizes of meshes are those of their bounding boxes.
    size = np.where(model.geom_dataid[:, None] < 0, model.geom_size, 0.0)
    parameters = [getattr(model, f"geom_{name}") for name in columns]
    table = np.column_stack([model.geom_type, size, *parameters])
    return Counter(map(tuple, table[collides & of_robot].round(5).tolist()))
