"""The source of a robot as a MuJoCo model, and the gains that MuJoCo computes."""

import os
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from terrainkit.errors import ExportError, one_line
from terrainkit_robots.analysis.bodies.mimic_joints import mimic_joints
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts, cached_fact
from terrainkit_robots.description.model import WORLD, Dynamics, Joint
from terrainkit_robots.description.xml.document import RobotFileError, read_bytes
from terrainkit_robots.onboarding.comparison import Side, joint_names_of, make_side
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.written_model import remove_drawings
from terrainkit_robots.transforms import matrix_to_quat


@cached_fact
def load_source(facts: Facts) -> Any:
    """Return the `mujoco.MjModel` of an MJCF file with its repairs, as MuJoCo loads it.

    Copy it before you change it.

    Raises:
        CannotCheckError: If MuJoCo does not load it.
    """
    file = facts.model.file
    meshes = facts.meshes
    try:
        texts = {  # with the repairs; from_string finds no files
            os.path.relpath(path, file.parent): meshes.data(path)
            if meshes.has_contents(path)
            else read_bytes(path)
            for path in facts.model.sources
        }
        with quiet_mujoco():
            spec = mujoco.MjSpec.from_string(texts[file.name].decode(), include=texts)
            spec.modelfiledir = str(file.parent)
            remove_drawings(spec)  # their meshes may be missing
            _replace_balls(spec)
            return spec.compile()
    except (ValueError, RuntimeError, RobotFileError, mujoco.FatalError) as error:
        raise CannotCheckError(f"MuJoCo does not load the source: {one_line(str(error))}") from None


def _replace_balls(spec: Any) -> None:
    """Replace the ball joints below the base by hinges about x, y and z, as the written files."""
    balls = [joint for joint in spec.joints if joint.type == mujoco.mjtJoint.mjJNT_BALL]
    for ball in balls:
        body = ball.parent
        if body.parent == spec.worldbody:
            continue
        for letter, axis in zip("xyz", np.eye(3), strict=True):
            hinge = body.add_joint(name=f"{ball.name}_{letter}", pos=ball.pos, axis=axis)
            hinge.type, hinge.limited = (
                mujoco.mjtJoint.mjJNT_HINGE,
                mujoco.mjtLimited.mjLIMITED_FALSE,
            )
            for name in ("range", "damping", "stiffness", "armature", "frictionloss"):
                setattr(hinge, name, 0 * hinge.range if name == "range" else getattr(ball, name))
        spec.delete(ball)
        for key in spec.keys:  # it has other positions
            spec.delete(key)


def described_model(facts: Facts, written: Facts) -> Any:
    """Return a `mujoco.MjModel` of the links, joints and masses that were read from a file.

    It shares no code with the files that onboarding writes, and needs no valid inertias.

    Args:
        facts: The robot.
        written: The written robot, whose joints may have other names.

    Raises:
        ExportError: If MuJoCo rejects it.
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    joint_names = {joint.child: joint.name for joint in written.joints}
    top = facts.bodies[0].top.name
    bodies = {top: spec.worldbody.add_body(name=written.bodies[0].top.name)}
    if written.model.floating:
        bodies[top].add_freejoint()
    for name in facts.tree.order:
        if name == top or name not in facts.body_of:
            continue
        joint = facts.tree.parent_joint[name]
        bodies[name] = bodies[joint.parent].add_body(
            name=f"{WORLD}_link" if name == WORLD else name,  # as in the written files
            pos=joint.origin[:3, 3],
            quat=matrix_to_quat(joint.origin[:3, :3]),
        )
        if joint.moves:
            is_slide = joint.kind == "prismatic"
            bodies[name].add_joint(
                name=joint_names.get(name, joint.name),
                type=mujoco.mjtJoint.mjJNT_SLIDE if is_slide else mujoco.mjtJoint.mjJNT_HINGE,
                axis=joint.direction,
                pos=joint.anchor,
                ref=joint.reference,
                range=joint.range or (0, 0),
                limited=joint.range is not None,
                damping=[max(joint.damping, 0.0), 0, 0],
                frictionloss=max(joint.friction, 0.0),
            )
    _add_equalities(spec, facts, bodies)
    moments = {}
    for body in facts.bodies:
        made = bodies[body.top.name]
        moments[made.name], axes = np.linalg.eigh(body.inertia)
        made.explicitinertial, made.mass, made.inertia = True, 1, np.ones(3)
        made.ipos, made.iquat = body.center, matrix_to_quat(axes * np.linalg.det(axes))
    try:
        with quiet_mujoco():
            model = spec.compile()
    except ValueError as error:
        raise ExportError(f"MuJoCo rejects {facts.model.file}: {one_line(str(error))}") from None
    for body, (name, principal) in zip(facts.bodies, moments.items(), strict=True):
        model.body(name).mass, model.body(name).inertia = body.mass, principal
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def _add_equalities(spec: Any, facts: Facts, bodies: Mapping[str, Any]) -> None:
    """Add the constraints of mimic joints and of closed loops.

    Args:
        spec: The `mujoco.MjSpec`.
        facts: The robot.
        bodies: The MuJoCo body of each link.
    """
    for joint in mimic_joints(facts.joints):
        assert joint.mimic is not None
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_JOINT,
            name1=joint.name,
            name2=joint.mimic.joint,
            data=[joint.mimic.offset, joint.mimic.multiplier, *[0] * 10],
        )
    for loop in facts.model.loops:
        ends = [f"{loop.name}_{number}" for number in (1, 2)]
        for end, link, origin in zip(ends, loop.links, loop.origins, strict=True):
            quat = matrix_to_quat(origin[:3, :3])
            bodies[link].add_site(name=end, pos=origin[:3, 3], quat=quat)
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_WELD if loop.kind == "weld" else mujoco.mjtEq.mjEQ_CONNECT,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            name1=ends[0],
            name2=ends[1],
        )


def with_compiled_gains(facts: Facts) -> Facts:
    """Return a robot with the gains and springs that MuJoCo computes when it loads the file.

    These are the damping of a `dampratio` and the springs and damping of a `springdamper`.
    """
    try:
        model = load_source(facts)
    except CannotCheckError:
        return facts  # the comparison says why
    joint_names = joint_names_of(model)
    side = make_side(model, joint_names)
    places = {name: place for place, name in enumerate(joint_names)}
    joints = tuple(
        _compiled_joint(joint, side, places[joint.name]) if joint.name in places else joint
        for joint in facts.model.joints
    )
    if joints == facts.model.joints:
        return facts
    return facts.with_model(replace(facts.model, joints=joints))


def _compiled_joint(joint: Joint, side: Side, place: int) -> Joint:
    model = side.model
    stiffness = float(model.jnt_stiffness[side.joints[place]])
    damping = float(model.dof_damping[side.dofs[place]])
    if not np.allclose((stiffness, damping), (joint.stiffness, joint.damping)):
        dynamics = joint.dynamics or Dynamics(source=joint.source)
        dynamics = replace(dynamics, damping=damping)
        joint = replace(joint, stiffness=stiffness, dynamics=dynamics)
    gains, servo = joint.position_gains, side.servos.get(place)
    if gains is not None and gains.damping is None and servo is not None:
        gain = -model.actuator_biasprm[servo, 2] * model.actuator_gear[servo, 0] ** 2
        if gain > 0:
            joint = replace(joint, position_gains=replace(gains, damping=float(gain)))
    return joint
