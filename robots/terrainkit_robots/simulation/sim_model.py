"""Compile a robot on a floor as a MuJoCo model, in memory and without visual geometry.

It is compiled from our description, not from the file, so that it works for robots that MuJoCo does
not load unchanged: with package paths, COLLADA meshes, or without a free joint.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit.errors import one_line
from terrainkit.settings.text import truncate
from terrainkit_robots.analysis.bodies.bodies import merge_bodies
from terrainkit_robots.analysis.bodies.tree import build_tree
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts, cached_fact
from terrainkit_robots.description.model import (
    PRISMATIC,
    REVOLUTE,
    Geometry,
    Inertial,
    JointUnits,
    Link,
    RobotModel,
)
from terrainkit_robots.description.xml.document import RobotFileError
from terrainkit_robots.export.actuator import ActuatorConfig
from terrainkit_robots.export.canonical import to_canonical
from terrainkit_robots.export.mjcf import Extras, floor_text, mjcf_text
from terrainkit_robots.mesh.mesh_cache import MeshError
from terrainkit_robots.mesh.surface import binary_stl
from terrainkit_robots.quiet_mujoco import quiet_mujoco

if TYPE_CHECKING:
    from pathlib import Path

_MAX_BODIES = 300
"""A robot with more bodies is not simulated: two seconds of it would take minutes."""

_MAX_HULL_VERTICES = 64
"""Vertices of the convex hull of a collision mesh. More slow down every contact for little gain."""

_PRIMITIVES = frozenset({"box", "sphere", "cylinder", "capsule", "ellipsoid"})

TIME_STEP = 0.005
"""Time step of legged_gym and of the training loop [s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SimModel:
    """A compiled robot with a position actuator of zero gains on each actuated joint.

    The MuJoCo model is shared. Copy it before you change it.
    """

    model: Any
    """The `mujoco.MjModel`."""

    spec: Any
    """The `mujoco.MjSpec` that it was compiled from; None if it is unknown."""

    floating: bool
    """Whether the base has a free joint: the first 7 elements of qpos, and the first 6 of qvel."""

    joints: tuple[str, ...]
    """Moving joints in the order of qpos."""

    actuated: tuple[str, ...]
    """Actuated joints in actuator order."""

    base: str
    """Name of the body that the limbs are attached to."""

    standing_qpos: Any
    """qpos of the standing pose with the lowest shape on the floor, shape (nq,)."""

    @classmethod
    def from_mujoco(cls, model: Any, *, base: str, spec: Any = None) -> "SimModel":
        """Return the simulation model of a MuJoCo model.

        Args:
            model: The `mujoco.MjModel` of a robot and a floor, with an actuator for each actuated
                joint.
            base: Name of the body that the limbs are attached to.
            spec: The `mujoco.MjSpec` that it was compiled from; its joints can then be welded.
        """
        import mujoco

        free = mujoco.mjtJoint.mjJNT_FREE
        joints = [model.joint(k).name for k in range(model.njnt) if model.jnt_type[k] != free]
        return cls(
            model=model,
            spec=spec,
            floating=len(joints) < model.njnt,
            joints=tuple(joints),
            actuated=tuple(model.actuator(k).name for k in range(model.nu)),
            base=base,
            standing_qpos=model.key_qpos[0].copy() if model.nkey else model.qpos0.copy(),
        )

    @property
    def base_dofs(self) -> int:
        """Return the number of degrees of freedom of the base."""
        return 6 if self.floating else 0

    def units(self, name: str) -> JointUnits:
        """Return the units of a joint. Any other name, such as the base's, counts as revolute."""
        import mujoco

        if name not in self.joints:
            return REVOLUTE
        is_slide = int(self.model.joint(name).type[0]) == int(mujoco.mjtJoint.mjJNT_SLIDE)
        return PRISMATIC if is_slide else REVOLUTE

    def effort_limit(self, name: str) -> float:
        """Return the effort limit of an actuated joint [N m] or [N]; infinite if unlimited."""
        index = self.actuated.index(name)
        is_limited = self.model.actuator_forcelimited[index]
        return float(self.model.actuator_forcerange[index, 1]) if is_limited else math.inf

    def qpos_at(self, positions: Mapping[str, float]) -> Any:
        """Return the standing qpos with other joint positions [rad] or [m], shape (nq,)."""
        qpos = np.array(self.standing_qpos)
        start = len(qpos) - len(self.joints)
        for address, name in enumerate(self.joints, start):
            qpos[address] = positions.get(name, qpos[address])
        return qpos


@cached_fact
def make_sim_model(facts: Facts) -> SimModel:
    """Return the simulation model of a robot.

    Raises:
        CannotCheckError: if the robot cannot be simulated, with the reason.
    """
    if len(facts.bodies) > _MAX_BODIES:
        raise CannotCheckError(
            f"bodies: got {len(facts.bodies)}; expected at most {_MAX_BODIES} to simulate it"
        )
    try:
        model, assets = _keep_collision_shapes(to_canonical(facts).model, facts)
    except RobotFileError as error:
        raise CannotCheckError(str(error)) from None
    armature = {joint.name: joint.armature for joint in model.joints}
    actuators = {
        motor.joint: ActuatorConfig(
            stiffness=0, damping=0, effort=motor.effort, armature=armature[motor.joint]
        )
        for motor in model.actuators
    }
    extras = Extras(
        actuators=actuators,
        keyframe=facts.default_pose,
        height=facts.stance.height if facts.stance else 1.0,
        time_step=TIME_STEP,
    )
    try:
        return _compile(model, extras, assets)
    except ValueError as error:
        try:
            return _compile(_merge_inertia(model), extras, assets)
        except ValueError:
            reason = _compiler_message(str(error))
            raise CannotCheckError(f"MuJoCo cannot simulate it: {reason}") from None


def _compiler_message(error: str) -> str:
    """Return an error of the compiler on one line, with the element but without line numbers."""
    message, _, location = error.partition("\nElement ")
    name = re.match(r"name '(.*?)(?:', id -?\d+(?:, line -?\d+)?)?$", location, re.DOTALL)
    subject = f"{truncate(one_line(name[1]))}: " if name else ""
    return subject + one_line(message.removeprefix("Error: "))


def _compile(model: RobotModel, extras: Extras, assets: Mapping[str, bytes]) -> SimModel:
    import mujoco

    text = mjcf_text(model, extras)
    if model.floating:
        text = text.replace("<worldbody>", f"<worldbody>{floor_text()}", 1)
    with quiet_mujoco():
        spec = mujoco.MjSpec.from_string(text, assets=dict(assets))
        return SimModel.from_mujoco(spec.compile(), spec=spec, base=model.links[0].name)


def _merge_inertia(model: RobotModel) -> RobotModel:
    """Return a robot whose inertials are merged into the links directly below moving joints.

    MuJoCo rejects the inertias of many frames and sensors on fixed joints.
    """
    bodies = {body.top.name: body for body in merge_bodies(build_tree(model))}

    def with_body_inertial(link: Link) -> Link:
        body = bodies.get(link.name)
        if body is None or body.mass <= 0:
            return replace(link, inertial=None)
        origin = np.eye(4)
        origin[:3, 3] = body.center
        inertial = Inertial(source=link.source, mass=body.mass, origin=origin, inertia=body.inertia)
        return replace(link, inertial=inertial)

    return replace(model, links=tuple(with_body_inertial(link) for link in model.links))


def _keep_collision_shapes(model: RobotModel, facts: Facts) -> tuple[RobotModel, dict[str, bytes]]:
    """Return a robot with only its collision shapes, with hulls for meshes, and the mesh files."""
    assets: dict[str, bytes] = {}
    files: dict[Path, str] = {}

    def convert(shape: Geometry) -> Geometry | None:
        if not shape.contacts:
            return None
        if shape.mesh is None or shape.shape != "mesh":
            return shape if shape.shape in _PRIMITIVES else None
        path = shape.mesh.path
        if path not in files:
            try:
                hull = facts.meshes.hull(path, _MAX_HULL_VERTICES)
            except MeshError as error:
                if facts.meshes.is_readable(shape.mesh) and facts.meshes.is_flat(shape.mesh):
                    return None  # a flat mesh has no volume, and no simulator accepts it
                raise CannotCheckError(f"its collision mesh {path.name} {error}") from None
            files[path] = f"{len(files)}.stl"
            assets[files[path]] = binary_stl(hull)
        return replace(shape, mesh=replace(shape.mesh, filename=files[path]))

    links = []
    for link in model.links:
        shapes = (convert(shape) for shape in link.collisions)
        collisions = tuple(shape for shape in shapes if shape is not None)
        links.append(replace(link, visuals=(), collisions=collisions))
    return replace(model, links=tuple(links)), assets
