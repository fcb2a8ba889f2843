"""The plant: a robot on a floor as a MuJoCo model, in memory and without anything to look at.

It is compiled from what was read, not from the file, so that a robot can be simulated that MuJoCo
does not load as it stands: with paths of packages, COLLADA meshes, or without a free joint.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import merge_bodies
from terrainkit_robots.analysis.bodies.tree import build_tree
from terrainkit_robots.analysis.cached_fact import per_robot
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Geometry, Inertial, Link, RobotModel
from terrainkit_robots.description.xml.document import RobotFileError
from terrainkit_robots.export.actuator import ActuatorConfig
from terrainkit_robots.export.canonical import to_canonical
from terrainkit_robots.export.mjcf import Extras, floor_text, mjcf_text
from terrainkit_robots.mesh.mesh_cache import MeshError
from terrainkit_robots.mesh.surface import binary_stl
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.text import short

if TYPE_CHECKING:
    from pathlib import Path

_MOST_BODIES = 300
"""A robot with more bodies is not simulated: two seconds of it would take minutes."""

_HULL_CORNERS = 64
"""Corners of a collision mesh's hull; more cost time at every contact, and change little."""

_PRIMITIVES = frozenset({"box", "sphere", "cylinder", "capsule", "ellipsoid"})

TIME_STEP = 0.005
"""Time step of legged_gym [s], and of the training loop."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Plant:
    """A compiled robot, with a position controller of no gain on each actuated joint.

    The model is shared by all that ask for the plant: copy it before changing it.
    """

    model: Any
    """The `mujoco.MjModel`."""

    floating: bool
    """Whether the base moves freely: then qpos begins with its seven numbers, and qvel with six."""

    joints: tuple[str, ...]
    """Moving joints in the order of qpos."""

    drives: tuple[str, ...]
    """Actuated joints in the order of the actuators."""

    base: str
    """Body that carries the limbs."""

    home: Any
    """qpos of the standing pose, the lowest shape on the floor, shape (nq,)."""


@per_robot
def plant(facts: Facts) -> Plant:
    """Return the plant of a robot.

    Raises:
        CannotCheckError: if it cannot be simulated, with the reason.
    """
    if len(facts.bodies) > _MOST_BODIES:
        raise CannotCheckError(
            f"it has {len(facts.bodies)} bodies, and of more than {_MOST_BODIES} none is simulated"
        )
    try:
        model, assets = _lean(to_canonical(facts).model, facts)
    except RobotFileError as error:
        raise CannotCheckError(str(error)) from None
    drives = {motor.joint: ActuatorConfig(stiffness=0, damping=0) for motor in model.actuators}
    for joint in model.joints:
        if joint.name in drives:
            effort = joint.limit.effort if joint.limit else None
            drives[joint.name] = ActuatorConfig(
                stiffness=0, damping=0, effort=effort, armature=joint.armature
            )
    height = facts.stance.height if facts.stance else 1.0
    extras = Extras(
        actuators=drives,
        excluded=model.excluded,
        home=facts.positions,
        height=height,
        time_step=TIME_STEP,
    )
    try:
        compiled = _compile(model, extras, assets)
    except ValueError as error:
        try:
            compiled = _compile(_lumped(model), extras, assets)
        except ValueError:
            reason = _reason(str(error))
            raise CannotCheckError(f"MuJoCo does not simulate it: {reason}") from None
    return plant_of(compiled, base=model.links[0].name)


def _reason(error: str) -> str:
    """Return what MuJoCo said on one line, and of which element, but not where in our text."""
    what, _, where = error.partition("\nElement ")
    name = re.match(r"name '(.*?)(?:', id -?\d+(?:, line -?\d+)?)?$", where, re.DOTALL)
    of = f"{short(' '.join(name[1].split()))}: " if name else ""
    return of + " ".join(what.removeprefix("Error: ").split())


def _compile(model: RobotModel, extras: Extras, assets: Mapping[str, bytes]) -> Any:
    import mujoco

    text = mjcf_text(model, extras)
    if model.floating:
        text = text.replace("<worldbody>", f"<worldbody>{floor_text()}", 1)
    with quiet_mujoco():
        return mujoco.MjModel.from_xml_string(text, assets)


def plant_of(model: Any, *, base: str) -> Plant:
    """Return the plant that a MuJoCo model is.

    Args:
        model: The `mujoco.MjModel` of a robot and a floor, with an actuator for each driven joint.
        base: Body that carries the limbs.
    """
    import mujoco

    free = mujoco.mjtJoint.mjJNT_FREE
    hinged = [model.joint(k).name for k in range(model.njnt) if model.jnt_type[k] != free]
    return Plant(
        model=model,
        floating=len(hinged) < model.njnt,
        joints=tuple(hinged),
        drives=tuple(model.actuator(k).name for k in range(model.nu)),
        base=base,
        home=model.key_qpos[0].copy() if model.nkey else model.qpos0.copy(),
    )


def _lumped(model: RobotModel) -> RobotModel:
    """Return a robot whose masses are on the links below its moving joints.

    Of the frames and sensors that are fixed to them many have an inertia that MuJoCo refuses.
    """
    bodies = {body.top.name: body for body in merge_bodies(build_tree(model))}

    def lumped(link: Link) -> Link:
        body = bodies.get(link.name)
        if body is None or body.mass <= 0:
            return replace(link, inertial=None)
        origin = np.eye(4)
        origin[:3, 3] = body.center
        inertial = Inertial(source=link.source, mass=body.mass, origin=origin, inertia=body.inertia)
        return replace(link, inertial=inertial)

    return replace(model, links=tuple(lumped(link) for link in model.links))


def _lean(model: RobotModel, facts: Facts) -> tuple[RobotModel, dict[str, bytes]]:
    """Return a robot with nothing but collision shapes, whose meshes are hulls, and their files."""
    assets: dict[str, bytes] = {}
    files: dict[Path, str] = {}

    def lean(shape: Geometry) -> Geometry | None:
        if shape.mesh is None or shape.shape != "mesh":
            return shape if shape.shape in _PRIMITIVES and shape.contacts else None
        path = shape.mesh.path
        if path not in files:
            try:
                hull = facts.meshes.hull(path, _HULL_CORNERS)
            except MeshError as error:
                if facts.meshes.is_readable(shape.mesh) and facts.meshes.is_flat(shape.mesh):
                    return None  # nothing can be inside of it, and no simulator takes it
                raise CannotCheckError(f"its collision mesh {path.name} {error}") from None
            files[path] = f"{len(files)}.stl"
            assets[files[path]] = binary_stl(hull)
        return replace(shape, mesh=replace(shape.mesh, filename=files[path]))

    def slim(link: Link) -> Link:
        shapes = (lean(shape) for shape in link.collisions if shape.contacts)
        return replace(link, visuals=(), collisions=tuple(s for s in shapes if s is not None))

    return replace(model, links=tuple(slim(link) for link in model.links)), assets


def positions_in(plant: Plant, positions: Mapping[str, float]) -> Any:
    """Return qpos of a plant at other joint positions [rad] or [m], shape (nq,)."""
    qpos = np.array(plant.home)
    start = len(qpos) - len(plant.joints)
    for place, name in enumerate(plant.joints):
        qpos[start + place] = positions.get(name, qpos[start + place])
    return qpos
