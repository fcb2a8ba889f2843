"""Let a robot stand with the physics settings of its own MJCF file.

`sim_model` simulates the description, with the settings of training. Here MuJoCo compiles the file
itself, so that its gravity compensation, springs, contact parameters, solver and time step act.
"""

import copy
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from terrainkit.integrations.near_geoms import collides
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts, cached_fact
from terrainkit_robots.analysis.legs.stance import GRAVITY, is_statically_stable
from terrainkit_robots.analysis.simulator_conventions.loading import check_mujoco_cost
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.gain import Gain
from terrainkit_robots.simulation.geoms import lowest_point
from terrainkit_robots.simulation.pd_gains import suggest_gains
from terrainkit_robots.simulation.rollout import check_contacts, check_dofs, has_diverged

_SECONDS, _SETTLING_SECONDS = 2.0, 1.0
"""Simulated time, and the part of it before the means are taken [s]."""

_MAX_STEPS = 8000
"""Maximum number of steps; a robot takes 20 to 50 microseconds for each."""

_ALL_BITS = 2**31 - 1
"""Contact bits of a floor that every colliding shape meets."""

_HOLD_RATIO = 1000.0
"""Armature of the rotation of a biped's base over mass times squared leg length. It tilts by less
than a degree in the simulated time, and the armature carries no weight."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WrittenModel:
    """A compiled MJCF file on a floor."""

    model: Any
    """The `mujoco.MjModel`; copy it before you change it."""

    floor: int
    """Index of the plane that the robot stands on."""

    shapes: tuple[int, ...]
    """Indices of the shapes of the robot that collide."""

    positions: Mapping[str, float]
    """Target of each joint [rad] or [m]."""

    gains: Mapping[str, Gain]
    """Gains of the actuated joints without a position actuator of their own."""

    efforts: Mapping[str, float]
    """Effort limit of each joint with one [N m] or [N]."""

    leg_length: float
    """Length of the longest leg [m]."""

    weight: float
    """Weight of the robot [N]."""

    held: bool
    """Whether the base is kept upright, since the robot cannot stand without balancing."""


@dataclass(frozen=True, kw_only=True)
class WrittenStand:
    """How a robot stood. All values are infinite if the simulation diverged."""

    lost_weight: float
    """Share of the weight that the ground does not carry; negative if it carries more."""

    height_loss: float
    """Height of the base at the start minus its lowest height [m]."""

    depth: float
    """Depth of the lowest shape below the ground at the end [m]."""

    clearance: float
    """Height of the lowest shape above the ground at the end [m]."""

    peak_force: float
    """Largest force of the ground over the weight."""

    drift: float
    """Horizontal distance that the base moved [m]."""

    speed: float
    """Largest root mean square of a joint velocity after settling [rad/s] or [m/s]."""


@cached_fact
def compile_file(facts: Facts) -> tuple[Any, Any]:
    """Return the `mujoco.MjSpec` of an MJCF file and its model, as it is written, on a floor.

    Shapes that are only drawn are removed, and so are sensors.

    Raises:
        CannotCheckError: if MuJoCo does not load it.
    """
    import mujoco

    if any(facts.meshes.has_contents(path) for path in facts.model.sources):
        raise CannotCheckError("the file has fixes that are not written yet")
    check_mujoco_cost(facts.model)
    try:
        with quiet_mujoco():
            spec = mujoco.MjSpec.from_file(str(facts.model.file))
            remove_drawings(spec)
            _add_floor(spec)
            return spec, spec.compile()
    except (ValueError, RuntimeError, mujoco.FatalError, mujoco.UnexpectedError):
        raise CannotCheckError("MuJoCo does not load the file (SIM004)") from None


@cached_fact
def make_written_model(facts: Facts) -> WrittenModel:
    """Return the robot of an MJCF file, compiled as it is written, on a floor.

    Raises:
        CannotCheckError: if MuJoCo cannot simulate it.
    """
    import mujoco

    _, model = compile_file(facts)
    (free,) = np.nonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    if free.tolist() != [0]:
        raise CannotCheckError(f"free joints: got {len(free)}; expected one, the joint of the base")
    if _SECONDS / model.opt.timestep > _MAX_STEPS or not -2 * GRAVITY < model.opt.gravity[2] < -1:
        raise CannotCheckError("its gravity or time step is implausible (OPT001, OPT002)")
    names = {model.joint(index).name for index in range(1, model.njnt)}
    if "" in names:
        raise CannotCheckError("a joint has no name")
    check_dofs(model)
    servos = {model.joint(model.actuator_trnid[index, 0]).name for index in position_servos(model)}
    shapes = collides(model)
    shapes[model.pair_geom1] = shapes[model.pair_geom2] = True
    is_floor = model.geom_bodyid == 0
    if (model.geom_type[shapes & is_floor] != mujoco.mjtGeom.mjGEOM_PLANE).any():
        raise CannotCheckError("the ground of its scene is not flat")
    if not (shapes & ~is_floor).any():
        raise CannotCheckError("the robot has no collision shapes and falls through the floor")
    return WrittenModel(
        model=model,
        floor=int(np.flatnonzero(shapes & is_floor)[0]),
        shapes=tuple(np.flatnonzero(shapes & ~is_floor).tolist()),
        positions={name: value for name, value in facts.default_pose.items() if name in names},
        gains={name: gain for name, gain in suggest_gains(facts).items() if name not in servos},
        efforts={joint.name: joint.effort for joint in facts.joints if joint.effort is not None},
        leg_length=max((leg.length for leg in facts.legs), default=1.0),
        weight=float(model.body_subtreemass[model.jnt_bodyid[0]] * -model.opt.gravity[2]),
        held=not is_statically_stable(facts.legs),
    )


def remove_drawings(spec: Any) -> None:
    """Remove sensors, and shapes that neither collide nor have a mass, with their meshes."""
    paired = _paired(spec)
    for element in [*spec.sensors, *spec.cameras, *spec.lights]:
        spec.delete(element)
    used = set()
    targets = {wrap.target.name for tendon in spec.tendons for wrap in tendon.path if wrap.target}
    needed = paired | targets - {""}
    for geom in list(spec.geoms):
        drawn = not (geom.contype or geom.conaffinity or geom.name in needed)
        if drawn and (geom.parent.explicitinertial or geom.parent == spec.worldbody):
            spec.delete(geom)
        else:
            used.add(geom.meshname)
            geom.material = ""
    for mesh in list(spec.meshes):
        if mesh.name and mesh.name not in used:
            spec.delete(mesh)


def _paired(spec: Any) -> set[str]:
    """Return the names of the geoms of explicit pairs."""
    return {name for pair in spec.pairs for name in (pair.geomname1, pair.geomname2)} - {""}


def _add_floor(spec: Any) -> None:
    """Add a floor, unless there is one."""
    import mujoco

    paired = _paired(spec)
    ground = [g for g in spec.worldbody.geoms if g.contype or g.conaffinity or g.name in paired]
    if not ground:
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=[0, 0, 1],
            contype=_ALL_BITS,
            conaffinity=_ALL_BITS,
        )


@cached_fact
def written_stand(facts: Facts) -> WrittenStand:
    """Return how the robot stands with all settings of its file."""
    return stand_as_written(make_written_model(facts))


def stand_as_written(
    written: WrittenModel, settings: Mapping[str, Any] | None = None
) -> WrittenStand:
    """Simulate a robot that holds its pose with the settings of its file.

    Position actuators act as written; other joints get explicit PD control.

    Args:
        written: The robot.
        settings: Other values of fields of its model or of the options of its model.
    """
    import mujoco

    model = copy.copy(written.model)
    gains = written.gains.values()
    joints = [model.joint(name) for name in written.gains]
    dofs = [joint.dofadr[0] for joint in joints]
    addresses = [joint.qposadr[0] for joint in joints]
    stiffness = np.array([gain.stiffness for gain in gains])
    limits = np.array([written.efforts.get(name, np.inf) for name in written.gains])
    model.dof_damping[dofs] += [gain.damping for gain in gains]
    model.dof_armature[dofs] = [gain.armature for gain in gains]
    if written.held:
        model.dof_armature[3:6] = _HOLD_RATIO * written.weight / GRAVITY * written.leg_length**2
    for name, value in (settings or {}).items():
        if hasattr(model.opt, name):
            setattr(model.opt, name, value)
        else:
            getattr(model, name)[:] = value
    data = mujoco.MjData(model)
    with quiet_mujoco():
        mujoco.mj_setConst(model, data)
        for name, position in written.positions.items():
            data.qpos[model.joint(name).qposadr[0]] = position
        targets = data.qpos[addresses]
        for index in position_servos(model):
            joint = model.actuator_trnid[index, 0]
            length = model.actuator_gear[index, 0] * data.qpos[model.jnt_qposadr[joint]]
            offset, slope = model.actuator_biasprm[index, :2]
            data.ctrl[index] = -(offset + slope * length) / model.actuator_gainprm[index, 0]
        mujoco.mj_kinematics(model, data)
        data.qpos[2] -= _clearance(written, model, data)
        mujoco.mj_forward(model, data)
        check_contacts(data)
        start = data.qpos[:3].copy()
        steps = round(_SECONDS / model.opt.timestep)
        speeds = np.zeros((steps, model.nv - 6))
        forces, heights = np.zeros(steps), np.zeros(steps)
        for step in range(steps):
            torques = stiffness * (targets - data.qpos[addresses])
            data.qfrc_applied[dofs] = np.clip(torques, -limits, limits)
            mujoco.mj_step(model, data)
            if has_diverged(data):
                return WrittenStand(**{field.name: np.inf for field in fields(WrittenStand)})
            # Internal forces have no component on the translation of a free body.
            forces[step], heights[step] = data.qfrc_constraint[2], data.qpos[2]
            speeds[step] = data.qvel[6:]
        mujoco.mj_kinematics(model, data)
        clearance = _clearance(written, model, data)
    settled = round(_SETTLING_SECONDS / model.opt.timestep)
    return WrittenStand(
        lost_weight=1 - float(forces[settled:].mean()) / written.weight,
        height_loss=float(start[2] - heights.min()),
        depth=max(-clearance, 0.0),
        clearance=max(clearance, 0.0),
        peak_force=float(forces.max()) / written.weight,
        drift=float(np.hypot(*(data.qpos[:2] - start[:2]))),
        speed=float(np.sqrt((speeds[settled:] ** 2).mean(axis=0)).max(initial=0.0)),
    )


def position_servos(model: Any) -> list[int]:
    """Return the indices of the actuators that control the position of a hinge or slide."""
    import mujoco

    is_servo = (model.actuator_biasprm[:, 1] < 0) & (model.actuator_gainprm[:, 0] != 0)
    on_joint = model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT
    moving = (int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE))
    servos = np.flatnonzero(is_servo & on_joint).tolist()
    return [index for index in servos if model.jnt_type[model.actuator_trnid[index, 0]] in moving]


def _clearance(written: WrittenModel, model: Any, data: Any) -> float:
    """Return the height of the lowest colliding shape above the floor [m]."""
    lowest = min(lowest_point(model, data, geom) for geom in written.shapes)
    return float(lowest - data.geom_xpos[written.floor, 2])
