"""Write a canonical robot as URDF.

The base has no joint: URDF has no free joint, and simulators add one on request. What
URDF cannot represent in one element is written as several: a capsule as a cylinder and two spheres,
and a joint whose axis does not pass through the origin of its child as a joint to an empty link, to
which the child is fixed.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from lxml import etree

from terrainkit_robots.description.model import Geometry, Inertial, Joint, Link, RobotModel
from terrainkit_robots.description.xml.number_text import number_text, place_text
from terrainkit_robots.export.urdf_shapes import to_elements
from terrainkit_robots.text import UniqueNames
from terrainkit_robots.transforms import Matrix, matrix_to_rpy

MIN_MASS = 1e-7
"""Mass of a link that requires one, but has none [kg]. It is negligible for the dynamics, and large
enough that simulators do not replace it by 1 kg or by the density of water."""

MAX_MASS_RATIO = 1e-7
"""Upper bound of that mass as a share of the mass of the robot."""

INERTIA_PER_MASS = 1e-6
"""Moment of inertia of such a link about each axis divided by its mass [m2]."""

MIN_INERTIA = 1e-13
"""Minimum moment of inertia [kg m2]: a hundred times the value that MuJoCo takes for zero."""

DEFAULT_EFFORT = 1000.0
"""Effort limit of joints without one [N m] or [N]. ROS requires a limit, and a missing one disables
the motor in Isaac Gym."""

DEFAULT_VELOCITY = 100.0
"""Velocity limit of joints without one [rad/s] or [m/s], for the same reason."""

DEFAULT_RANGE = 1000.0
"""Position limit in both directions of prismatic joints without limits [m]; without a limit, the
joint would be locked."""

_MUJOCO_COMPILER = {
    # links with fixed joints remain bodies, so that feet keep their names
    "fusestatic": "false",
    "discardvisual": "false",
    "strippath": "false",
    "balanceinertia": "false",
    # geoms have no mass: all mass is declared
    "inertiafromgeom": "false",
}


def urdf_text(model: RobotModel, *, feet: Sequence[str] = ()) -> str:
    """Return a robot as URDF.

    Args:
        model: The robot in canonical form, with mesh files relative to the URDF.
        feet: Links that Isaac Gym does not merge into their parents.

    Raises:
        ValueError: If the robot is not in canonical form.
    """
    return _Writer(model, feet).text()


class _Writer:
    """Write one robot as XML."""

    def __init__(self, model: RobotModel, feet: Sequence[str]) -> None:
        self._model = model
        self._feet = frozenset(feet)
        names = {link.name for link in model.links}
        self._parent_joints = {j.child: j for j in model.joints if j.parent in names}
        self._names = UniqueNames(names | {joint.name for joint in model.joints})
        self._massless_links = frozenset(_massless_links(model, self._parent_joints))
        total = sum(map(_mass, model.links))
        self._min_mass = min(MIN_MASS, MAX_MASS_RATIO * total) if total > 0 else MIN_MASS
        self._colors = _colors(model)
        self._defaults: dict[str, list[str]] = {}

    def text(self) -> str:
        """Return the document."""
        root = etree.Element("robot", name=self._model.name or "robot")
        etree.SubElement(etree.SubElement(root, "mujoco"), "compiler", _MUJOCO_COMPILER)
        for color, name in self._colors.items():
            material = etree.SubElement(root, "material", name=name)
            etree.SubElement(material, "color", rgba=number_text(color))
        for link in self._model.links:
            if link.name not in self._parent_joints:
                self._link(root, link)
        links = {link.name: link for link in self._model.links}
        for child, joint in self._parent_joints.items():
            self._joint(root, joint)
            self._link(root, links[child])
        for k, line in enumerate(self._header()):
            root.insert(k, etree.Comment(f" {line} "))
        etree.indent(root)
        text: str = etree.tostring(root, encoding="unicode")
        return text + "\n"

    def _header(self) -> Iterator[str]:
        yield "Written by terrainkit onboard. SI units and radians."
        for reason, joints in self._defaults.items():
            # XML comments cannot contain two hyphens in a row
            yield re.sub("-(?=-)", "- ", f"{reason}: {', '.join(joints)}.")

    def _default_value(self, what: str, number: float, joint: Joint) -> str:
        text = number_text(number)
        self._defaults.setdefault(f"Unknown {what}, set to {text}", []).append(joint.name)
        return text

    def _link(self, root: Any, link: Link) -> None:
        element = etree.SubElement(root, "link", name=link.name)
        inertial = link.inertial
        if inertial is not None and inertial.mass is not None and inertial.mass > 0:
            _inertial(element, inertial, inertial.mass)
        elif link.virtual or link.collisions or link.name in self._massless_links:
            # without it, simulators compute the mass from the geometry, or reject moving links
            self._write_min_inertial(element)
        for tag, shapes in (("visual", link.visuals), ("collision", link.collisions)):
            for shape in shapes:
                if tag == "visual" or shape.contacts:
                    self._shape(element, tag, shape)

    def _write_min_inertial(self, link: Any) -> None:
        inertia = np.eye(3) * max(INERTIA_PER_MASS * self._min_mass, MIN_INERTIA)
        _write_inertial(link, np.eye(4), self._min_mass, inertia)

    def _shape(self, link: Any, tag: str, shape: Geometry) -> None:
        for origin, kind, attributes in to_elements(shape):
            element = etree.SubElement(link, tag)
            _origin(element, origin)
            etree.SubElement(etree.SubElement(element, "geometry"), kind, attributes)
            if tag == "visual" and shape.color is not None:
                etree.SubElement(element, "material", name=self._colors[shape.color])

    # Joints

    def _joint(self, root: Any, joint: Joint) -> None:
        if not joint.moves and joint.kind != "fixed":
            raise ValueError(
                f"joint {joint.name}: got type {joint.kind}; expected a canonical joint type"
            )
        anchor = np.zeros(3) if joint.kind == "prismatic" else joint.anchor
        if not joint.moves or not np.abs(anchor).max() > 0:
            self._write_joint(root, joint, joint.child, joint.origin)
            return
        offset = np.eye(4)
        offset[:3, 3] = anchor
        axis = self._names.add(f"{joint.child}_axis")
        self._write_joint(root, joint, axis, joint.origin @ offset)
        self._write_min_inertial(etree.SubElement(root, "link", name=axis))
        fixed = self._element(root, self._names.add(f"{axis}_fixed"), "fixed", joint.child)
        offset[:3, 3] = -anchor
        _origin(fixed, offset)
        _write_parent_and_child(fixed, axis, joint.child)

    def _element(self, root: Any, name: str, kind: str, child: str) -> Any:
        element = etree.SubElement(root, "joint", name=name, type=kind)
        if kind == "fixed" and child in self._feet:
            element.set("dont_collapse", "true")
        return element

    def _write_joint(self, root: Any, joint: Joint, child: str, origin: Matrix) -> None:
        """Write a joint with another child and origin."""
        kind = "continuous" if joint.kind == "revolute" and joint.range is None else joint.kind
        element = self._element(root, joint.name, kind, child)
        if joint.dont_collapse and kind == "fixed":
            element.set("dont_collapse", "true")
        _origin(element, origin)
        _write_parent_and_child(element, joint.parent, child)
        if not joint.moves:
            return
        etree.SubElement(element, "axis", xyz=place_text(joint.direction))
        self._limit(element, joint)
        losses = {"damping": joint.damping, "friction": joint.friction}
        dynamics = {name: number_text(value) for name, value in losses.items() if value > 0}
        if dynamics:
            etree.SubElement(element, "dynamics", dynamics)
        if joint.mimic is not None:
            etree.SubElement(
                element,
                "mimic",
                joint=joint.mimic.joint,
                multiplier=number_text(joint.mimic.multiplier),
                offset=number_text(joint.mimic.offset),
            )

    def _limit(self, element: Any, joint: Joint) -> None:
        attributes = {}
        limits = joint.range
        if limits is not None:
            attributes = {"lower": number_text(limits[0]), "upper": number_text(limits[1])}
        elif joint.kind == "prismatic":
            upper = self._default_value("position limit", DEFAULT_RANGE, joint)
            attributes = {"lower": f"-{upper}", "upper": upper}
        for name, default in (("effort", DEFAULT_EFFORT), ("velocity", DEFAULT_VELOCITY)):
            value = getattr(joint.limit, name, None)
            attributes[name] = (
                self._default_value(f"{name} limit", default, joint)
                if value is None
                else number_text(value)
            )
        etree.SubElement(element, "limit", attributes)


def _massless_links(model: RobotModel, parent_joints: Mapping[str, Joint]) -> Iterator[str]:
    """Yield links below a moving joint that have no mass, including links fixed to them."""
    mass = {link.name: _mass(link) for link in model.links}
    tops = [child for child, joint in parent_joints.items() if joint.moves]
    # from the leaves, because each link comes after its parent
    for child in reversed([link.name for link in model.links]):
        joint = parent_joints.get(child)
        if joint is not None and not joint.moves:
            mass[joint.parent] += mass[child]
    yield from (top for top in tops if mass[top] <= 0)


def _mass(link: Link) -> float:
    mass = link.inertial.mass if link.inertial is not None else None
    return mass if mass is not None and mass > 0 else 0.0


def _colors(model: RobotModel) -> dict[tuple[float, float, float, float], str]:
    shown = {shape.color: None for link in model.links for shape in link.visuals}
    colors = [color for color in shown if color is not None]
    return {color: f"color_{k}" for k, color in enumerate(colors, 1)}


def _inertial(link: Any, inertial: Inertial, mass: float) -> None:
    inertia = np.zeros((3, 3)) if inertial.inertia is None else inertial.inertia
    # rounding errors of zero, relative to the largest component
    rounding = 1e-12 * float(np.abs(inertia).max())
    _write_inertial(link, inertial.origin, mass, np.where(np.abs(inertia) < rounding, 0.0, inertia))


def _write_inertial(link: Any, origin: Matrix, mass: float, inertia: Matrix) -> None:
    element = etree.SubElement(link, "inertial")
    _origin(element, origin)
    etree.SubElement(element, "mass", value=number_text(mass))
    places = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2)}
    numbers = {name: number_text(inertia[place]) for name, place in places.items()}
    etree.SubElement(element, "inertia", {**numbers, "izz": number_text(inertia[2, 2])})


def _origin(element: Any, pose: Matrix) -> None:
    """Write a pose, unless it is the identity."""
    place, rotation = place_text(pose[:3, 3]), place_text(matrix_to_rpy(pose[:3, :3]))
    zero = "0 0 0"
    if (place, rotation) != (zero, zero):
        etree.SubElement(element, "origin", xyz=place, rpy=rotation)


def _write_parent_and_child(joint: Any, parent: str, child: str) -> None:
    etree.SubElement(joint, "parent", link=parent)
    etree.SubElement(joint, "child", link=child)
