"""Write a canonical robot as MJCF, with actuators, sensors and a keyframe.

The base is the only body of the world, so that the file can be attached to any scene. Geoms have no
mass: all mass is in the `inertial` of each body.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np
from lxml import etree

from terrainkit_robots.description.model import (
    Coupling,
    Geometry,
    Joint,
    Link,
    RobotModel,
)
from terrainkit_robots.description.xml.number_text import number_text
from terrainkit_robots.export.actuator import ActuatorConfig
from terrainkit_robots.text import UniqueNames, free_name
from terrainkit_robots.transforms import Matrix, invert_poses, matrix_to_quat

FLOOR = "floor"
"""Name of the ground geom in the scene."""

COLLISION_SUFFIX = "_collision"
"""A collision geom is named after its body, with this suffix and a number if there are several."""

_VISUAL_COLOR = "0.75 0.77 0.8 1"


@dataclass(frozen=True, kw_only=True, eq=False)
class Site:
    """A frame on a body, with a volume if it senses touch."""

    name: str
    body: str
    pose: Matrix
    """Pose in the body frame, shape (4, 4) [m]."""

    half_size: tuple[float, ...] = ()
    """Half lengths of its box [m]; empty for a small sphere that senses nothing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Extras:
    """Parts of an MJCF in addition to the bodies of the robot."""

    actuators: Mapping[str, ActuatorConfig] = field(default_factory=dict)
    """Controller of each actuated joint, in the order of the actuators."""

    feet: tuple[Site, ...] = ()
    """Sites of the feet, each with a touch sensor."""

    imu: Site | None = None
    """Site of the sensors of orientation, angular velocity and acceleration."""

    frames: tuple[Site, ...] = ()
    """Frames of links that were merged."""

    keyframe: Mapping[str, float] = field(default_factory=dict)
    """Joint positions of the keyframe [rad] or [m]; other joints are at 0."""

    height: float = 0.0
    """Height of the base in the keyframe [m]."""

    height_at_zero: float | None = None
    """Height of the base with all joints at 0 [m], MuJoCo's default state; None for `height`."""

    time_step: float = 0.005
    """Simulation time step [s]."""


def mjcf_text(model: RobotModel, extras: Extras) -> str:
    """Return a robot as MJCF.

    Args:
        model: The robot in canonical form, with mesh files relative to the MJCF.
        extras: Actuators, sensors and keyframe.
    """
    root = etree.Element("mujoco", model=model.name)
    etree.SubElement(root, "compiler", angle="radian", autolimits="true")
    # Damped position control is stable at the time step of training only with implicit
    # integration.
    step = number_text(extras.time_step)
    etree.SubElement(root, "option", timestep=step, integrator="implicitfast")
    _defaults(root)
    writer = _BodyWriter(root, model, extras)
    base = writer.write(etree.SubElement(root, "worldbody"))
    at_zero = extras.height if extras.height_at_zero is None else extras.height_at_zero
    base.set("pos", number_text([0, 0, at_zero]))
    if model.floating:
        name = free_name("root", {joint.name for joint in model.joints})
        base.insert(0, etree.Element("freejoint", name=name))
    _contact(root, model)
    _tendons(root, model)
    _equality(root, model)
    _actuators(root, model, extras)
    _sensors(root, extras)
    _keyframe(root, model, extras)
    for empty in root.xpath("*[not(*|@*)]"):
        root.remove(empty)
    etree.indent(root)
    text: str = etree.tostring(root, encoding="unicode")
    return text + "\n"


_ALL_BITS = str(2**31 - 1)
"""All bits of contype and conaffinity, so that the ground collides with every colliding geom."""


def floor_text() -> str:
    """Return the ground as a geom element."""
    return (
        f'<geom name="{FLOOR}" type="plane" size="0 0 1" contype="{_ALL_BITS}" '
        f'conaffinity="{_ALL_BITS}"/>'
    )


_SCENE = f"""<mujoco model="%(name)s scene">
  <include file="%(file)s"/>
  <statistic center="0 0 %(middle)s" extent="%(extent)s"/>
  <visual>
    <headlight diffuse="0.6 0.6 0.6" ambient="0.3 0.3 0.3"/>
  </visual>
  <asset>
    <texture name="grid" type="2d" builtin="checker" rgb1="0.86 0.88 0.9" rgb2="0.8 0.82 0.85" \
width="300" height="300"/>
    <material name="grid" texture="grid" texrepeat="2 2" texuniform="true"/>
  </asset>
  <worldbody>
    <light pos="0 0 %(light)s" dir="0 0 -1" type="directional"/>
    <geom name="{FLOOR}" type="plane" size="0 0 0.05" material="grid" contype="{_ALL_BITS}" \
conaffinity="{_ALL_BITS}"/>
  </worldbody>
</mujoco>
"""


def scene_text(name: str, file: str, *, height: float) -> str:
    """Return an MJCF with a floor and a light that includes the robot.

    Args:
        name: Name of the robot.
        file: MJCF of the robot in the same folder.
        height: Approximate height of the robot [m].
    """
    return _SCENE % {
        "name": escape(name),
        "file": escape(file),
        "middle": number_text(height / 2),
        "extent": number_text(2 * height),
        "light": number_text(4 * height),
    }


def _unique_sites(extras: Extras) -> list[Site]:
    """Return the sites to write; frames with the name of another site are skipped."""
    imu = () if extras.imu is None else (extras.imu,)
    sites = {site.name: site for site in (*extras.feet, *imu)}
    for frame in extras.frames:
        sites.setdefault(frame.name, frame)
    return list(sites.values())


def _defaults(root: Any) -> None:
    default = etree.SubElement(root, "default")
    visual = etree.SubElement(default, "default", {"class": "visual"})
    etree.SubElement(
        visual, "geom", group="2", contype="0", conaffinity="0", mass="0", rgba=_VISUAL_COLOR
    )
    collision = etree.SubElement(default, "default", {"class": "collision"})
    etree.SubElement(collision, "geom", group="3", mass="0")


_MeshKey = tuple[str, tuple[float, ...]]


def _assets(root: Any, model: RobotModel) -> dict[_MeshKey, str]:
    """Write the meshes, and return their names."""
    shapes = [shape for link in model.links for shape in (*link.collisions, *link.visuals)]
    asset = etree.SubElement(root, "asset")
    names = dict[_MeshKey, str]()
    unique = UniqueNames()
    for file, scale in sorted({_mesh_key(shape) for shape in shapes if shape.shape == "mesh"}):
        name = unique.add(file.rsplit("/", 1)[-1].rsplit(".", 1)[0])
        names[file, scale] = name
        mesh = etree.SubElement(asset, "mesh", name=name, file=file)
        if scale != (1.0, 1.0, 1.0):
            mesh.set("scale", number_text(scale))
    return names


def _mesh_key(geometry: Geometry) -> _MeshKey:
    assert geometry.mesh is not None
    return geometry.mesh.filename, tuple(geometry.mesh.scale)


class _BodyWriter:
    """Write the bodies of a robot, with their joints, shapes and sites."""

    def __init__(self, root: Any, model: RobotModel, extras: Extras) -> None:
        self._meshes = _assets(root, model)
        self._model, self._actuators = model, extras.actuators
        self._names = UniqueNames([FLOOR])
        self._child_joints: dict[str, list[Joint]] = {link.name: [] for link in model.links}
        for joint in model.joints:
            self._child_joints[joint.parent].append(joint)
        self._sites: dict[str, list[Site]] = {link.name: [] for link in model.links}
        for site in (*_unique_sites(extras), *_constraint_sites(model)):
            self._sites[site.body].append(site)

    def write(self, world: Any) -> Any:
        """Write all bodies, and return the element of the base."""
        links = {link.name: link for link in self._model.links}
        # A stack instead of recursion: a chain of links may exceed Python's limit.
        stack: list[tuple[Any, list[Joint], Link]] = [(world, [], self._model.links[0])]
        while stack:
            parent, joints, link = stack.pop()
            after = self._child_joints[link.name]
            if link.virtual and len(after) == 1 and joints:
                stack.append((parent, [*joints, *after], links[after[0].child]))
                continue
            body = self._body(parent, joints, link)
            stack += [(body, [joint], links[joint.child]) for joint in reversed(after)]
        return world[0]

    def _body(self, parent: Any, joints: Sequence[Joint], link: Link) -> Any:
        body = etree.SubElement(parent, "body", name=link.name)
        pose = np.eye(4)
        for joint in joints:
            pose = pose @ joint.origin
        _place(body, pose)
        if link.gravity_compensation:
            body.set("gravcomp", number_text(link.gravity_compensation))
        _inertial(body, link)
        for index, joint in enumerate(joints):
            if joint.moves:
                # The axes of all joints are in the frame of the body at zero position.
                after = np.eye(4)
                for later in joints[index + 1 :]:
                    after = after @ later.origin
                _joint(body, joint, invert_poses(after), self._actuators.get(joint.name))
        for shape in link.visuals:
            _geom(body, shape, "visual", self._meshes)
        for index, shape in enumerate(link.collisions, 1):
            number = str(index) if len(link.collisions) > 1 else ""
            geom = _geom(body, shape, "collision", self._meshes)
            geom.set("name", self._names.add(f"{link.name}{COLLISION_SUFFIX}{number}"))
        for site in self._sites[link.name]:
            _site(body, site)
        return body


def _place(element: Any, pose: Matrix) -> None:
    if np.abs(pose[:3, 3]).max() > 0:
        element.set("pos", number_text(pose[:3, 3]))
    if not np.allclose(pose[:3, :3], np.eye(3), rtol=0, atol=1e-12):
        element.set("quat", number_text(matrix_to_quat(pose[:3, :3])))


def _inertial(body: Any, link: Link) -> None:
    """Write the mass of a link; a massless link with shapes gets the center of its shapes."""
    inertial = link.inertial
    if inertial is None or not inertial.mass:
        if link.collisions:
            # MuJoCo scales the softness of contacts by the inertia at the center of mass, which
            # would otherwise be elsewhere.
            middle = np.mean([shape.origin[:3, 3] for shape in link.collisions], axis=0)
            text = number_text(middle)
            etree.SubElement(body, "inertial", pos=text, mass="0", diaginertia="0 0 0")
        return
    inertia = np.zeros((3, 3)) if inertial.inertia is None else inertial.inertia
    rotation = inertial.origin[:3, :3]
    i = rotation @ inertia @ rotation.T
    element = etree.SubElement(
        body, "inertial", pos=number_text(inertial.origin[:3, 3]), mass=number_text(inertial.mass)
    )
    if inertia.any():
        full = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
        element.set("fullinertia", number_text(full))
    else:  # accepted by MuJoCo for bodies that do not move
        element.set("diaginertia", "0 0 0")


def _joint(body: Any, joint: Joint, frame: Matrix, actuator: ActuatorConfig | None) -> None:
    element = etree.SubElement(body, "joint", name=joint.name)
    if joint.kind == "prismatic":
        element.set("type", "slide")
    anchor = frame[:3, :3] @ joint.anchor + frame[:3, 3]
    if np.abs(anchor).max() > 0:
        element.set("pos", number_text(anchor))
    element.set("axis", number_text(frame[:3, :3] @ joint.direction))
    numbers = {
        "range": joint.range,
        "damping": joint.damping,
        "frictionloss": joint.friction,
        "armature": joint.armature if actuator is None else actuator.armature,
        "stiffness": joint.stiffness,
        # also without a spring: tendons take their length from it
        "springref": joint.spring_reference,
    }
    for name, value in numbers.items():
        if value:
            element.set(name, number_text(value))
    element.attrib.update(joint.settings)


def _geom(body: Any, shape: Geometry, kind: str, meshes: Mapping[_MeshKey, str]) -> Any:
    geom = etree.SubElement(body, "geom", {"class": kind})
    if shape.shape == "mesh":
        geom.set("type", "mesh")
        geom.set("mesh", meshes[_mesh_key(shape)])
    else:
        geom.set("type", shape.shape)
        geom.set("size", number_text(shape.size))
    _place(geom, shape.origin)
    if kind == "collision":
        for attribute in ("contype", "conaffinity"):
            if getattr(shape, attribute) != 1:
                geom.set(attribute, str(getattr(shape, attribute)))
        geom.attrib.update(shape.settings)
    elif shape.color is not None:
        geom.set("rgba", number_text(shape.color))
    return geom


def _site(body: Any, site: Site) -> None:
    element = etree.SubElement(body, "site", name=site.name, group="4")
    _place(element, site.pose)
    if site.half_size:
        element.set("type", "box")
        element.set("size", number_text(site.half_size))


def _contact(root: Any, model: RobotModel) -> None:
    contact = etree.SubElement(root, "contact")
    for first, second in sorted(tuple(sorted(pair)) for pair in model.excluded):
        etree.SubElement(contact, "exclude", body1=first, body2=second)


def _constraint_sites(model: RobotModel) -> Iterator[Site]:
    """Yield the sites of the ends of loops and of the points of tendons."""
    for loop in model.loops:
        for number, end in enumerate(zip(loop.links, loop.origins, strict=True), 1):
            yield Site(name=f"{loop.name}_{number}", body=end[0], pose=end[1])
    for tendon in model.tendons:
        for number, point in enumerate(tendon.points, 1):
            if isinstance(point, tuple):
                yield Site(name=f"{tendon.name}_{number}", body=point[0], pose=point[1])


def _equality(root: Any, model: RobotModel) -> None:
    equality = etree.SubElement(root, "equality")
    followers = [
        Coupling(
            kind="joint",
            follower=joint.name,
            target=joint.mimic.joint,
            coefficients=(joint.mimic.offset, joint.mimic.multiplier, 0, 0, 0),
            settings=joint.mimic.settings,
        )
        for joint in model.joints
        if joint.mimic is not None
    ]
    for coupling in (*followers, *model.couplings):
        kind = coupling.kind
        element = etree.SubElement(equality, kind, {f"{kind}1": coupling.follower})
        if coupling.target:
            element.set(f"{kind}2", coupling.target)
        element.set("polycoef", number_text(coupling.coefficients))
        element.attrib.update(coupling.settings)
    for loop in model.loops:
        # Sites keep both ends; an anchor gives the second one at the zero position only.
        ends = {f"site{number}": f"{loop.name}_{number}" for number in (1, 2)}
        etree.SubElement(equality, loop.kind, name=loop.name, **ends, **loop.settings)


def _tendons(root: Any, model: RobotModel) -> None:
    section = etree.SubElement(root, "tendon")
    for tendon in model.tendons:
        kind = "fixed" if tendon.joints else "spatial"
        element = etree.SubElement(section, kind, name=tendon.name, **tendon.settings)
        for joint, coefficient in tendon.joints.items():
            etree.SubElement(element, "joint", joint=joint, coef=number_text(coefficient))
        for number, point in enumerate(tendon.points, 1):
            if isinstance(point, tuple):
                etree.SubElement(element, "site", site=f"{tendon.name}_{number}")
            else:
                etree.SubElement(element, "pulley", divisor=number_text(point))


def _actuators(root: Any, model: RobotModel, extras: Extras) -> None:
    joints = {joint.name: joint for joint in model.joints}
    section = etree.SubElement(root, "actuator")
    for name, actuator in extras.actuators.items():
        kind = "velocity" if actuator.is_velocity_control else "position"
        element = etree.SubElement(section, kind, name=name, joint=name)
        if not actuator.is_velocity_control:
            element.set("kp", number_text(actuator.stiffness))
        element.set("kv", number_text(actuator.damping))
        limits = (
            actuator.velocity and (-actuator.velocity, actuator.velocity)
            if actuator.is_velocity_control
            else joints[name].range
        )
        if limits:
            element.set("ctrlrange", number_text(limits))
        if actuator.effort is not None:
            element.set("forcerange", number_text([-actuator.effort, actuator.effort]))


_IMU = (
    ("framequat", "orientation"),
    ("gyro", "angular_velocity"),
    ("accelerometer", "acceleration"),
    ("velocimeter", "linear_velocity"),
)
"""MuJoCo's sensors at the IMU, and their names."""


def _sensors(root: Any, extras: Extras) -> None:
    sensor = etree.SubElement(root, "sensor")
    if extras.imu is not None:
        for kind, name in _IMU:
            object_type = {"objtype": "site"} if kind == "framequat" else {}
            target = "objname" if object_type else "site"
            etree.SubElement(sensor, kind, name=name, **object_type, **{target: extras.imu.name})
    for foot in extras.feet:
        etree.SubElement(sensor, "touch", name=f"{foot.name}_contact", site=foot.name)


def _keyframe(root: Any, model: RobotModel, extras: Extras) -> None:
    order = [joint.name for joint in model.joints if joint.moves]
    if not (order or model.floating):
        return
    key = etree.SubElement(etree.SubElement(root, "keyframe"), "key", name="home")
    base = [0.0, 0.0, extras.height, 1.0, 0.0, 0.0, 0.0] if model.floating else []
    key.set("qpos", number_text([*base, *(extras.keyframe.get(name, 0.0) for name in order)]))
    if extras.actuators:
        targets = (
            0.0 if actuator.is_velocity_control else extras.keyframe.get(name, 0.0)
            for name, actuator in extras.actuators.items()
        )
        key.set("ctrl", number_text(list(targets)))
