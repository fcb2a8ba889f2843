"""MJCF: a robot in its normal form as text, with motors, sensors and a keyframe.

The body that carries the robot is the only one in the world, so that the file can be attached to
any scene. Shapes weigh nothing: all mass is in the `inertial` of each body, as declared.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from lxml import etree

from terrainkit_robots.description.model import Geometry, Inertial, Joint, Link, RobotModel
from terrainkit_robots.export.actuator import ActuatorConfig
from terrainkit_robots.text import free_name
from terrainkit_robots.transforms import Matrix, invert_poses, matrix_to_quat

_DIGITS = 10
"""Significant digits of each number: a nanometre on a robot of a metre."""

FLOOR = "floor"
"""What the ground is called in the scene."""

_VISUAL_COLOR = "0.75 0.77 0.8 1"


@dataclass(frozen=True, kw_only=True, eq=False)
class Site:
    """A frame on a body, with a volume where it senses touch."""

    name: str
    body: str
    pose: Matrix
    """Pose in the body's frame, shape (4, 4) [m]."""

    half_size: tuple[float, ...] = ()
    """Half lengths of its box [m]; none for a small ball that senses nothing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Extras:
    """What a MJCF has beyond the robot's body."""

    actuators: Mapping[str, ActuatorConfig] = field(default_factory=dict)
    """Controller of each actuated joint, in the order of the actuators."""

    feet: tuple[Site, ...] = ()
    """Where the feet touch: a site and a touch sensor each."""

    imu: Site | None = None
    """Where orientation, turning and acceleration are sensed."""

    frames: tuple[Site, ...] = ()
    """Frames that are kept for whoever looks for them by name."""

    excluded: Iterable[frozenset[str]] = ()
    """Pairs of bodies that do not touch each other."""

    home: Mapping[str, float] = field(default_factory=dict)
    """Joint positions of the keyframe [rad] or [m]; joints that are not named are at 0."""

    height: float = 0.0
    """Height of the base in the keyframe [m]."""

    height_at_zero: float | None = None
    """Height of the base with all joints at 0, which is where MuJoCo begins unless it is told of
    the keyframe [m]; as in the keyframe if None."""

    time_step: float = 0.005
    """[s]"""


def mjcf_text(model: RobotModel, extras: Extras) -> str:
    """Return a robot as MJCF.

    Args:
        model: The robot in its normal form; names of mesh files are relative to the MJCF.
        extras: Motors, sensors, keyframe.
    """
    root = etree.Element("mujoco", model=model.name)
    etree.SubElement(root, "compiler", angle="radian", autolimits="true")
    # Position control with damping is stable at training's time step only if its derivative is
    # part of the solution.
    step = _text(extras.time_step)
    etree.SubElement(root, "option", timestep=step, integrator="implicitfast")
    _defaults(root)
    names = _assets(root, model)
    world = etree.SubElement(root, "worldbody")
    base = _bodies(world, model, names, extras)
    at_zero = extras.height if extras.height_at_zero is None else extras.height_at_zero
    base.set("pos", _text([0, 0, at_zero]))
    if model.floating:
        name = free_name("root", {joint.name for joint in model.joints})
        base.insert(0, etree.Element("freejoint", name=name))
    _contact(root, extras)
    _equality(root, model)
    _actuators(root, model, extras)
    _sensors(root, extras)
    _keyframe(root, model, extras)
    etree.indent(root)
    text: str = etree.tostring(root, encoding="unicode")
    return text + "\n"


_EVERYTHING = str(2**31 - 1)
"""All bits of contype and conaffinity: whatever touches anything touches the ground."""


def floor_text() -> str:
    """Return the ground by itself."""
    return (
        f'<geom name="{FLOOR}" type="plane" size="0 0 1" contype="{_EVERYTHING}" '
        f'conaffinity="{_EVERYTHING}"/>'
    )


def scene_text(name: str, file: str, *, height: float) -> str:
    """Return a MJCF with a floor and a light that includes the robot's.

    Args:
        name: What to call it.
        file: The robot's MJCF, beside it.
        height: How tall the robot is, about [m].
    """
    root = etree.Element("mujoco", model=f"{name} scene")
    etree.SubElement(root, "include", file=file)
    etree.SubElement(root, "statistic", center=_text([0, 0, height / 2]), extent=_text(2 * height))
    visual = etree.SubElement(root, "visual")
    etree.SubElement(visual, "headlight", diffuse="0.6 0.6 0.6", ambient="0.3 0.3 0.3")
    asset = etree.SubElement(root, "asset")
    etree.SubElement(
        asset,
        "texture",
        name="grid",
        type="2d",
        builtin="checker",
        rgb1="0.86 0.88 0.9",
        rgb2="0.8 0.82 0.85",
        width="300",
        height="300",
    )
    etree.SubElement(
        asset, "material", name="grid", texture="grid", texrepeat="2 2", texuniform="true"
    )
    world = etree.SubElement(root, "worldbody")
    etree.SubElement(
        world, "light", pos=_text([0, 0, 4 * height]), dir="0 0 -1", type="directional"
    )
    etree.SubElement(
        world,
        "geom",
        name=FLOOR,
        type="plane",
        size="0 0 0.05",
        material="grid",
        contype=_EVERYTHING,
        conaffinity=_EVERYTHING,
    )
    etree.indent(root)
    text: str = etree.tostring(root, encoding="unicode")
    return text + "\n"


def _named_once(extras: Extras) -> list[Site]:
    """Return the sites to be written; a frame whose name another site has is left out."""
    imu = () if extras.imu is None else (extras.imu,)
    found = {site.name: site for site in (*extras.feet, *imu)}
    for frame in extras.frames:
        found.setdefault(frame.name, frame)
    return list(found.values())


def _text(value: float | Sequence[float] | Matrix) -> str:
    numbers = np.atleast_1d(np.asarray(value, dtype=float))
    return " ".join(f"{number + 0.0:.{_DIGITS}g}" for number in numbers)


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
    """Write the meshes, and return the name of each."""
    colliding = {_mesh_key(g) for link in model.links for g in link.collisions if g.shape == "mesh"}
    seen = {_mesh_key(g) for link in model.links for g in link.visuals if g.shape == "mesh"}
    if not (colliding or seen):
        return {}
    asset, names, taken = etree.SubElement(root, "asset"), dict[_MeshKey, str](), set[str]()
    for key in sorted(colliding | seen):
        file, scale = key
        name = free_name(file.rsplit("/", 1)[-1].rsplit(".", 1)[0], taken)
        taken.add(name)
        names[key] = name
        mesh = etree.SubElement(asset, "mesh", name=name, file=file)
        if scale != (1.0, 1.0, 1.0):
            mesh.set("scale", _text(scale))
    return names


def _mesh_key(geometry: Geometry) -> _MeshKey:
    assert geometry.mesh is not None
    return geometry.mesh.filename, tuple(geometry.mesh.scale)


def _bodies(world: Any, model: RobotModel, meshes: Mapping[_MeshKey, str], extras: Extras) -> Any:
    """Write all bodies, and return the element of the base."""
    links = {link.name: link for link in model.links}
    below: dict[str, list[Joint]] = {name: [] for name in links}
    for joint in model.joints:
        below[joint.parent].append(joint)
    sites: dict[str, list[Site]] = {name: [] for name in links}
    for site in _named_once(extras):
        sites[site.body].append(site)
    # A stack, since a chain of links may be longer than Python's own.
    base = model.links[0]
    stack: list[tuple[Any, list[Joint], Link]] = [(world, [], base)]
    first = None
    taken = {FLOOR}
    while stack:
        parent, joints, link = stack.pop()
        if link.virtual and len(below[link.name]) == 1 and joints:
            (joint,) = below[link.name]
            stack.append((parent, [*joints, joint], links[joint.child]))
            continue
        body = _body(parent, joints, link, meshes, extras, sites[link.name], taken)
        first = body if first is None else first
        stack += [(body, [joint], links[joint.child]) for joint in reversed(below[link.name])]
    return first


def _body(
    parent: Any,
    joints: Sequence[Joint],
    link: Link,
    meshes: Mapping[_MeshKey, str],
    extras: Extras,
    sites: Sequence[Site],
    taken: set[str],
) -> Any:
    body = etree.SubElement(parent, "body", name=link.name)
    place = np.eye(4)
    for joint in joints:
        place = place @ joint.origin
    _place(body, place)
    if link.inertial is not None and link.inertial.mass:
        _inertial(body, link.inertial)
    elif link.collisions:
        # MuJoCo makes contacts as soft as what is felt at the place of the mass, which it would
        # take to be elsewhere.
        middle = np.mean([shape.origin[:3, 3] for shape in link.collisions], axis=0)
        etree.SubElement(body, "inertial", pos=_text(middle), mass="0", diaginertia="0 0 0")
    for index, joint in enumerate(joints):
        if joint.moves:
            # Axes of several joints are all given in the frame of the body, at zero.
            after = np.eye(4)
            for later in joints[index + 1 :]:
                after = after @ later.origin
            _joint(body, joint, invert_poses(after), extras.actuators.get(joint.name))
    for kind, shapes in (("visual", link.visuals), ("collision", link.collisions)):
        for shape in shapes:
            _geom(body, shape, kind, meshes, taken)
    for site in sites:
        _site(body, site)
    return body


def _place(element: Any, pose: Matrix) -> None:
    if np.abs(pose[:3, 3]).max() > 0:
        element.set("pos", _text(pose[:3, 3]))
    if not np.allclose(pose[:3, :3], np.eye(3), rtol=0, atol=1e-12):
        element.set("quat", _text(matrix_to_quat(pose[:3, :3])))


def _inertial(body: Any, inertial: Inertial) -> None:
    assert inertial.mass is not None
    inertia = np.zeros((3, 3)) if inertial.inertia is None else inertial.inertia
    turn = inertial.origin[:3, :3]
    i = turn @ inertia @ turn.T
    element = etree.SubElement(
        body, "inertial", pos=_text(inertial.origin[:3, 3]), mass=_text(inertial.mass)
    )
    if inertia.any():
        full = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
        element.set("fullinertia", _text(full))
    else:  # which MuJoCo takes on what does not move, written so
        element.set("diaginertia", "0 0 0")


def _joint(body: Any, joint: Joint, frame: Matrix, drive: ActuatorConfig | None) -> None:
    element = etree.SubElement(body, "joint", name=joint.name)
    if joint.kind == "prismatic":
        element.set("type", "slide")
    anchor = frame[:3, :3] @ joint.anchor + frame[:3, 3]
    if np.abs(anchor).max() > 0:
        element.set("pos", _text(anchor))
    element.set("axis", _text(frame[:3, :3] @ joint.direction))
    if joint.range is not None:
        element.set("range", _text(joint.range))
    if joint.damping:
        element.set("damping", _text(joint.damping))
    if joint.friction:
        element.set("frictionloss", _text(joint.friction))
    armature = joint.armature if drive is None else drive.armature
    if armature:
        element.set("armature", _text(armature))


def _geom(
    body: Any, shape: Geometry, kind: str, meshes: Mapping[_MeshKey, str], taken: set[str]
) -> None:
    geom = etree.SubElement(body, "geom", {"class": kind})
    if kind == "collision" and shape.name and shape.name not in taken:
        geom.set("name", shape.name)
        taken.add(shape.name)
    if shape.shape == "mesh":
        geom.set("type", "mesh")
        geom.set("mesh", meshes[_mesh_key(shape)])
    else:
        geom.set("type", shape.shape)
        geom.set("size", _text(shape.size))
    _place(geom, shape.origin)
    if kind == "collision":
        for attribute in ("contype", "conaffinity"):
            if getattr(shape, attribute) != 1:
                geom.set(attribute, str(getattr(shape, attribute)))
    elif shape.color is not None:
        geom.set("rgba", _text(shape.color))


def _site(body: Any, site: Site) -> None:
    element = etree.SubElement(body, "site", name=site.name, group="4")
    _place(element, site.pose)
    if site.half_size:
        element.set("type", "box")
        element.set("size", _text(site.half_size))


def _contact(root: Any, extras: Extras) -> None:
    pairs = sorted(tuple(sorted(pair)) for pair in extras.excluded)
    if pairs:
        contact = etree.SubElement(root, "contact")
        for first, second in pairs:
            etree.SubElement(contact, "exclude", body1=first, body2=second)


def _equality(root: Any, model: RobotModel) -> None:
    followers = [joint for joint in model.joints if joint.mimic is not None]
    if followers:
        equality = etree.SubElement(root, "equality")
        for joint in followers:
            assert joint.mimic is not None
            etree.SubElement(
                equality,
                "joint",
                joint1=joint.name,
                joint2=joint.mimic.joint,
                polycoef=_text([joint.mimic.offset, joint.mimic.multiplier, 0, 0, 0]),
            )


def _actuators(root: Any, model: RobotModel, extras: Extras) -> None:
    if not extras.actuators:
        return
    joints = {joint.name: joint for joint in model.joints}
    actuator = etree.SubElement(root, "actuator")
    for name, drive in extras.actuators.items():
        kind = "velocity" if drive.is_velocity_control else "position"
        element = etree.SubElement(actuator, kind, name=name, joint=name)
        if not drive.is_velocity_control:
            element.set("kp", _text(drive.stiffness))
        element.set("kv", _text(drive.damping))
        limits = (
            drive.velocity and (-drive.velocity, drive.velocity)
            if drive.is_velocity_control
            else joints[name].range
        )
        if limits:
            element.set("ctrlrange", _text(limits))
        if drive.effort is not None:
            element.set("forcerange", _text([-drive.effort, drive.effort]))


_IMU = (
    ("framequat", "orientation"),
    ("gyro", "angular_velocity"),
    ("accelerometer", "acceleration"),
    ("velocimeter", "linear_velocity"),
)
"""MuJoCo's sensors at the IMU, and what they are called."""


def _sensors(root: Any, extras: Extras) -> None:
    if extras.imu is None and not extras.feet:
        return
    sensor = etree.SubElement(root, "sensor")
    if extras.imu is not None:
        for kind, name in _IMU:
            element = etree.SubElement(sensor, kind, name=name)
            if kind == "framequat":
                element.set("objtype", "site")
            element.set("objname" if kind == "framequat" else "site", extras.imu.name)
    for foot in extras.feet:
        etree.SubElement(sensor, "touch", name=f"{foot.name}_contact", site=foot.name)


def _keyframe(root: Any, model: RobotModel, extras: Extras) -> None:
    order = [joint.name for joint in model.joints if joint.moves]
    if not (order or model.floating):
        return
    key = etree.SubElement(etree.SubElement(root, "keyframe"), "key", name="home")
    base = [0.0, 0.0, extras.height, 1.0, 0.0, 0.0, 0.0] if model.floating else []
    key.set("qpos", _text([*base, *(extras.home.get(name, 0.0) for name in order)]))
    if extras.actuators:
        targets = (
            0.0 if drive.is_velocity_control else extras.home.get(name, 0.0)
            for name, drive in extras.actuators.items()
        )
        key.set("ctrl", _text(list(targets)))
