"""URDF: a robot in its normal form as text.

The base is not joined to anything: a URDF has no free joint, and simulators add one where they are
told to. What the format cannot say in one element is put together of several: a capsule is a
cylinder and two spheres, and a joint whose axis does not pass through the origin of its child moves
a link without a shape, to which the child is fixed.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from lxml import etree

from terrainkit_robots.description.model import Geometry, Inertial, Joint, Link, RobotModel
from terrainkit_robots.description.xml.number_text import number_text, place_text
from terrainkit_robots.export.urdf_shapes import elements_of
from terrainkit_robots.text import free_name
from terrainkit_robots.transforms import Matrix, matrix_to_rpy

TINY_MASS = 1e-7
"""Mass of a link that has to have one and was given none [kg]: far below what is felt on a robot,
the tip of a dog's tail included, and far above where simulators take it for zero and make up 1 kg
or the density of water."""

TINY_SHARE = 1e-7
"""It is no more than this share of the robot's mass: a robot may be an insect."""

TINY_SQUARE = 1e-6
"""Its moment of inertia about each axis, by its mass [m2]."""

TINY_INERTIA = 1e-13
"""Smallest moment of inertia [kg m2]: a hundred times what MuJoCo takes for nothing."""

NO_EFFORT = 1000.0
"""What stands for an effort that is not known [N m] or [N]: ROS reads no joint without one, and
Isaac Gym takes a missing one for a motor without force."""

NO_VELOCITY = 100.0
"""What stands for a speed that is not known [rad/s] or [m/s], for the same reason."""

NO_RANGE = 1000.0
"""How far a joint slides in both directions that has no limits [m]; without the numbers it would be
locked."""

_FOR_MUJOCO = {
    # links that fixed joints hold stay bodies, so that feet keep their names
    "fusestatic": "false",
    "discardvisual": "false",
    "strippath": "false",
    "balanceinertia": "false",
    # shapes weigh nothing: all mass is declared
    "inertiafromgeom": "false",
}


def urdf_text(model: RobotModel, *, feet: Sequence[str] = ()) -> str:
    """Return a robot as URDF.

    Args:
        model: The robot in its normal form; names of mesh files are relative to the URDF.
        feet: Links that Isaac Gym is told to keep when it merges what is fixed.

    Raises:
        ValueError: if it has joints or shapes that no normal form has.
    """
    return _Writer(model, feet).text()


class _Writer:
    """One robot on its way to XML."""

    def __init__(self, model: RobotModel, feet: Sequence[str]) -> None:
        self._model = model
        self._feet = frozenset(feet)
        names = {link.name for link in model.links}
        self._above = {j.child: j for j in model.joints if j.parent in names}
        self._taken = names | {joint.name for joint in model.joints}
        self._weightless = frozenset(_weightless(model, self._above))
        total = sum(map(_mass, model.links))
        self._tiny = min(TINY_MASS, TINY_SHARE * total) if total > 0 else TINY_MASS
        self._colors = _colors(model)
        self._made_up: dict[str, list[str]] = {}

    def text(self) -> str:
        """Return the document."""
        root = etree.Element("robot", name=self._model.name or "robot")
        etree.SubElement(etree.SubElement(root, "mujoco"), "compiler", _FOR_MUJOCO)
        for color, name in self._colors.items():
            material = etree.SubElement(root, "material", name=name)
            etree.SubElement(material, "color", rgba=number_text(color))
        for link in self._model.links:
            if link.name not in self._above:
                self._link(root, link)
        links = {link.name: link for link in self._model.links}
        for child, joint in self._above.items():
            self._joint(root, joint)
            self._link(root, links[child])
        for k, line in enumerate(self._header()):
            root.insert(k, etree.Comment(f" {line} "))
        etree.indent(root)
        text: str = etree.tostring(root, encoding="unicode")
        return text + "\n"

    def _header(self) -> Iterator[str]:
        yield "Written by terrainkit onboard. SI units and radians."
        for said, joints in self._made_up.items():
            # a comment holds no two hyphens in a row
            yield re.sub("-(?=-)", "- ", f"{said}: {', '.join(joints)}.")

    def _make_up(self, what: str, number: float, joint: Joint) -> str:
        text = number_text(number)
        self._made_up.setdefault(f"No {what} is known, and {text} stands for it", []).append(
            joint.name
        )
        return text

    def _free(self, name: str) -> str:
        free = free_name(name, self._taken)
        self._taken.add(free)
        return free

    def _link(self, root: Any, link: Link) -> None:
        element = etree.SubElement(root, "link", name=link.name)
        inertial = link.inertial
        if inertial is not None and inertial.mass is not None and inertial.mass > 0:
            _inertial(element, inertial, inertial.mass)
        elif link.virtual or link.collisions or link.name in self._weightless:
            # without one, simulators weigh the shapes, or refuse what moves
            self._tiny_inertial(element)
        for tag, shapes in (("visual", link.visuals), ("collision", link.collisions)):
            for shape in shapes:
                if tag == "visual" or shape.contacts:
                    self._shape(element, tag, shape)

    def _tiny_inertial(self, link: Any) -> None:
        inertia = np.eye(3) * max(TINY_SQUARE * self._tiny, TINY_INERTIA)
        _write_inertial(link, np.eye(4), self._tiny, inertia)

    def _shape(self, link: Any, tag: str, shape: Geometry) -> None:
        for origin, kind, attributes in elements_of(shape):
            element = etree.SubElement(link, tag)
            _origin(element, origin)
            etree.SubElement(etree.SubElement(element, "geometry"), kind, attributes)
            if tag == "visual" and shape.color is not None:
                etree.SubElement(element, "material", name=self._colors[shape.color])

    # Joints

    def _joint(self, root: Any, joint: Joint) -> None:
        if not joint.moves and joint.kind != "fixed":
            raise ValueError(f"joint {joint.name} is {joint.kind}; the normal form has none such")
        anchor = np.zeros(3) if joint.kind == "prismatic" else joint.anchor
        if not joint.moves or not np.abs(anchor).max() > 0:
            self._hang(root, joint, joint.child, joint.origin)
            return
        moved = np.eye(4)
        moved[:3, 3] = anchor
        axis = self._free(f"{joint.child}_axis")
        self._hang(root, joint, axis, joint.origin @ moved)
        self._tiny_inertial(etree.SubElement(root, "link", name=axis))
        fixed = self._element(root, self._free(f"{axis}_fixed"), "fixed", joint.child)
        moved[:3, 3] = -anchor
        _origin(fixed, moved)
        _ends(fixed, axis, joint.child)

    def _element(self, root: Any, name: str, kind: str, child: str) -> Any:
        element = etree.SubElement(root, "joint", name=name, type=kind)
        if kind == "fixed" and child in self._feet:
            element.set("dont_collapse", "true")
        return element

    def _hang(self, root: Any, joint: Joint, child: str, origin: Matrix) -> None:
        """Write a joint as it is, but for its child and origin."""
        kind = "continuous" if joint.kind == "revolute" and joint.range is None else joint.kind
        element = self._element(root, joint.name, kind, child)
        if joint.dont_collapse and kind == "fixed":
            element.set("dont_collapse", "true")
        _origin(element, origin)
        _ends(element, joint.parent, child)
        if not joint.moves:
            return
        etree.SubElement(element, "axis", xyz=place_text(joint.direction))
        self._limit(element, joint)
        slowed = {"damping": joint.damping, "friction": joint.friction}
        dynamics = {name: number_text(value) for name, value in slowed.items() if value > 0}
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
        limit, limits = joint.limit, joint.range
        attributes = {}
        if limits is not None:
            attributes = {"lower": number_text(limits[0]), "upper": number_text(limits[1])}
        elif joint.kind == "prismatic":
            upper = self._make_up("limit of the position", NO_RANGE, joint)
            attributes = {"lower": f"-{upper}", "upper": upper}
        effort = limit.effort if limit else None
        velocity = limit.velocity if limit else None
        attributes["effort"] = (
            self._make_up("largest effort", NO_EFFORT, joint)
            if effort is None
            else number_text(effort)
        )
        attributes["velocity"] = (
            self._make_up("largest velocity", NO_VELOCITY, joint)
            if velocity is None
            else number_text(velocity)
        )
        etree.SubElement(element, "limit", attributes)


def _weightless(model: RobotModel, above: Mapping[str, Joint]) -> Iterator[str]:
    """Yield links below a moving joint that weigh nothing with all that is fixed to them."""
    mass = {link.name: _mass(link) for link in model.links}
    tops = [child for child, joint in above.items() if joint.moves]
    # from the tips of the tree on, since each link comes after its parent
    for child in reversed([link.name for link in model.links]):
        joint = above.get(child)
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
    # what rounding leaves of zero, next to the largest of the six
    noise = 1e-12 * float(np.abs(inertia).max())
    _write_inertial(link, inertial.origin, mass, np.where(np.abs(inertia) < noise, 0.0, inertia))


def _write_inertial(link: Any, origin: Matrix, mass: float, inertia: Matrix) -> None:
    element = etree.SubElement(link, "inertial")
    _origin(element, origin)
    etree.SubElement(element, "mass", value=number_text(mass))
    places = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2)}
    numbers = {name: number_text(inertia[place]) for name, place in places.items()}
    etree.SubElement(element, "inertia", {**numbers, "izz": number_text(inertia[2, 2])})


def _origin(element: Any, pose: Matrix) -> None:
    """Write a pose, first in its element, and nothing for none."""
    place, turn = place_text(pose[:3, 3]), place_text(matrix_to_rpy(pose[:3, :3]))
    nothing = "0 0 0"
    if (place, turn) != (nothing, nothing):
        etree.SubElement(element, "origin", xyz=place, rpy=turn)


def _ends(joint: Any, parent: str, child: str) -> None:
    etree.SubElement(joint, "parent", link=parent)
    etree.SubElement(joint, "child", link=child)
