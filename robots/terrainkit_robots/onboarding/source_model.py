"""The MJCF source of a robot as MuJoCo loads it, and the gains that MuJoCo computes."""

import os
from dataclasses import replace
from typing import Any

import numpy as np

from terrainkit.errors import one_line
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts, cached_fact
from terrainkit_robots.description.model import Dynamics, Joint
from terrainkit_robots.description.xml.document import RobotFileError, read_bytes
from terrainkit_robots.onboarding.dynamics import Side, joint_names_of, make_side
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.written_model import remove_drawings


@cached_fact
def load_source(facts: Facts) -> Any:
    """Return the `mujoco.MjModel` of an MJCF file with its repairs, as MuJoCo loads it.

    Copy it before you change it.

    Raises:
        CannotCheckError: If MuJoCo does not load it.
    """
    import mujoco

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
            return spec.compile()
    except (ValueError, RuntimeError, RobotFileError, mujoco.FatalError) as error:
        raise CannotCheckError(f"MuJoCo does not load the source: {one_line(str(error))}") from None


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
