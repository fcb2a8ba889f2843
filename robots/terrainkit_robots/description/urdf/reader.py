"""URDF: from XML to a robot.

The reader follows http://wiki.ros.org/urdf/XML; what an element lacks gets the default that is
given there, and what is wrong is recorded and read around.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from lxml import etree

from terrainkit_robots.description.model import (
    Geometry,
    Inertial,
    Joint,
    Limit,
    Link,
    MeshFile,
    Mimic,
    Problem,
    RobotModel,
)
from terrainkit_robots.description.package_resolver import Packages
from terrainkit_robots.description.urdf.colors import Color, color_of, named_colors
from terrainkit_robots.description.urdf.tags import has_variable, misspelt, unexpanded
from terrainkit_robots.description.xml.document import XmlDocument
from terrainkit_robots.description.xml.number_text import place_text
from terrainkit_robots.description.xml.numbers import parse_numbers, replace_commas
from terrainkit_robots.text import short
from terrainkit_robots.transforms import Matrix, matrix_to_rpy, quat_to_matrix, rpy_to_matrix


def read_urdf(document: XmlDocument, *, packages: Mapping[str, Path]) -> RobotModel:
    """Return the robot of a document whose root is <robot>.

    Args:
        document: The document.
        packages: Folder of each ROS package that was named on the way in.
    """
    return _Reader(document, packages).robot()


class _Reader:
    """One walk through a document; its problems are gathered on the way."""

    def __init__(self, document: XmlDocument, packages: Mapping[str, Path]) -> None:
        self._document = document
        self._packages = Packages(document.file, packages)
        self._problems = list(document.problems)
        self._colors: Mapping[str, Color] = {}

    def robot(self) -> RobotModel:
        """Return the robot."""
        root = self._document.root
        assert root is not None
        source = self._document.source(root)
        if not root.get("name", "").strip():
            self._tell("XML003", root, "the robot has no name; wanted <robot name=...>")
        self._words(root)
        self._colors = named_colors(root)
        links = tuple(self._link(element) for element in root.iterchildren("link"))
        joints = tuple(self._joint(element) for element in root.iterchildren("joint"))
        return RobotModel(
            name=root.get("name", "").strip(),
            kind="urdf",
            file=self._document.file,
            source=source,
            links=links,
            joints=joints,
            problems=tuple(self._problems),
            sources=(self._document.file,),
        )

    def _tell(
        self, code: str, element: "etree._Element", message: str, subject: str = "", **details: str
    ) -> None:
        self._problems.append(
            Problem(
                code=code,
                message=message,
                source=self._document.source(element),
                subject=subject or _owner(element),
                details=details,
            )
        )

    def _words(self, root: "etree._Element") -> None:
        """Tell of words that do not belong into a URDF."""
        for element, what in unexpanded(root):
            self._tell("XML004", element, f"{what} is xacro that was not expanded")
        for element, attribute, known in misspelt(root):
            what = f"attribute {attribute} of <{element.tag}>" if attribute else f"<{element.tag}>"
            message = f"{what} is not known and is skipped; {known} is"
            self._tell("XML007", element, message, attribute=attribute, known=known)

    # Numbers

    def _numbers(self, element: "etree._Element", name: str, count: int) -> Matrix | None:
        """Return the numbers of an attribute, shape (count,); None if it is missing or wrong."""
        text = element.get(name)
        if text is None:
            return None
        values = parse_numbers(text, count)
        if values is not None:
            return values
        repaired = replace_commas(text, count)
        wanted = "a number" if count == 1 else f"{count} numbers"
        if has_variable(text):
            return None  # told as unexpanded xacro
        self._tell(
            "XML006",
            element,
            f"{name} of <{element.tag}> is {short(text, 40)!r}; wanted {wanted}"
            + (", with a point for the decimals and spaces between" if repaired else ""),
            attribute=name,
            repaired=repaired,
        )
        return parse_numbers(repaired, count) if repaired else None

    def _number(self, element: "etree._Element | None", name: str) -> float | None:
        values = None if element is None else self._numbers(element, name, 1)
        return None if values is None else float(values[0])

    def _text(self, element: "etree._Element | None", name: str, parent: "etree._Element") -> str:
        """Return an attribute that has to be there."""
        value = None if element is None else element.get(name)
        if value is None or not value.strip():
            tag = parent.tag if element is None else element.tag
            at = parent if element is None else element
            self._tell("XML013", at, f"<{tag}> has no {name}")
        return value or ""

    def _origin(self, element: "etree._Element") -> Matrix:
        origin = np.eye(4)
        written = element.find("origin")
        if written is None:
            return origin
        xyz, rpy = self._numbers(written, "xyz", 3), self._numbers(written, "rpy", 3)
        turn = self._quaternion(written)
        if xyz is not None:
            origin[:3, 3] = xyz
        if rpy is not None:
            origin[:3, :3] = rpy_to_matrix(rpy)
        elif turn is not None:
            origin[:3, :3] = turn
        return origin

    def _quaternion(self, origin: "etree._Element") -> Matrix | None:
        """Return the rotation of URDF 1.1's x, y, z and w, shape (3, 3); None if there is none."""
        quat = self._numbers(origin, "quat_xyzw", 4)
        if quat is None:
            return None
        if origin.get("rpy") is not None:
            told = "quat_xyzw of <origin> stands beside its rpy; wanted one of them"
        elif not 0 < np.linalg.norm(quat) < np.inf:
            told = (
                f"quat_xyzw of <origin> is {short(origin.get('quat_xyzw', ''), 40)!r}, no rotation"
            )
        else:
            turn = quat_to_matrix(np.roll(quat, 1))
            self._tell_of_quaternion(origin, turn)
            return turn
        self._tell("XML006", origin, told, attribute="quat_xyzw")
        return None

    def _tell_of_quaternion(self, origin: "etree._Element", turn: Matrix) -> None:
        rpy = place_text(matrix_to_rpy(turn))
        if rpy != place_text(np.zeros(3)):
            told = "quat_xyzw of <origin> is skipped by simulators, for which nothing is turned"
            self._tell("XML014", origin, f'{told}; wanted rpy="{rpy}"', rpy=rpy)

    # Links

    def _link(self, element: "etree._Element") -> Link:
        return Link(
            name=self._text(element, "name", element),
            source=self._document.source(element),
            inertial=self._inertial(element.find("inertial")),
            collisions=tuple(self._geometries(element, "collision")),
            visuals=tuple(self._geometries(element, "visual")),
        )

    def _inertial(self, element: "etree._Element | None") -> Inertial | None:
        if element is None:
            return None
        written = element.find("inertia")
        inertia = None
        if written is not None:
            six = [self._number(written, name) for name in ("ixx", "iyy", "izz")]
            six += [
                self._number(written, name) if written.get(name) is not None else 0.0
                for name in ("ixy", "ixz", "iyz")
            ]
            inertia = _symmetric(six)
        return Inertial(
            source=self._document.source(element),
            mass=self._number(element.find("mass"), "value"),
            origin=self._origin(element),
            inertia=inertia,
            inertia_source=None if written is None else self._document.source(written),
            missing=tuple(
                name
                for name in ("ixx", "iyy", "izz")
                if written is None or written.get(name) is None
            ),
        )

    def _geometries(self, link: "etree._Element", tag: str) -> Iterator[Geometry]:
        for element in link.iterchildren(tag):
            for again in element.findall("material")[1:]:
                self._tell("XML008", again, f"<{tag}> has two materials; wanted one")
            geometry = self._geometry(element)
            color = color_of(element, self._colors) if tag == "visual" else None
            yield geometry if color is None else replace(geometry, color=color)

    def _geometry(self, element: "etree._Element") -> Geometry:
        source, name = self._document.source(element), element.get("name", "")
        origin = self._origin(element)
        geometry = element.find("geometry")
        shape = None if geometry is None else next(geometry.iterchildren(etree.Element), None)
        if shape is None:
            self._tell("XML013", element, f"<{element.tag}> has no shape in a <geometry>")
            return Geometry(source=source, name=name, shape="unknown", origin=origin)
        size_source = self._document.source(shape)
        if shape.tag == "mesh":
            mesh = self._mesh(shape)
            return Geometry(source=source, name=name, shape="mesh", origin=origin, mesh=mesh)
        size: tuple[float, ...] | None = None
        match shape.tag:
            case "box":
                sides = self._numbers(shape, "size", 3)
                size = None if sides is None else tuple(float(side) / 2 for side in sides)
            case "sphere":
                size = _all(self._number(shape, "radius"))
            case "cylinder" | "capsule":
                length = self._number(shape, "length")
                size = _all(self._number(shape, "radius"), length and length / 2)
            case _:
                return Geometry(source=source, name=name, shape="unknown", origin=origin)
        if size is None and not set(shape.keys()) >= _SIZES[shape.tag]:
            lacks = ", ".join(sorted(_SIZES[shape.tag] - set(shape.keys())))
            self._tell("XML013", shape, f"<{shape.tag}> has no {lacks}")
        return Geometry(
            source=source,
            name=name,
            shape=shape.tag,
            size=size or (),
            size_source=size_source,
            origin=origin,
        )

    def _mesh(self, element: "etree._Element") -> MeshFile | None:
        filename = self._text(element, "filename", element).strip()
        if not filename:
            return None
        path, found_by = self._packages.resolve(filename)
        scale = self._numbers(element, "scale", 3)
        x, y, z = (1.0, 1.0, 1.0) if scale is None else map(float, scale)
        return MeshFile(
            source=self._document.source(element),
            filename=filename,
            path=path,
            found_by=found_by,
            scale=(x, y, z),
        )

    # Joints

    def _joint(self, element: "etree._Element") -> Joint:
        name = self._text(element, "name", element)
        parent, child = element.find("parent"), element.find("child")
        axis = element.find("axis")
        blank = axis is None or not axis.get("xyz", "").strip()
        direction = None if axis is None or blank else self._numbers(axis, "xyz", 3)
        if axis is not None and direction is None:
            direction = np.zeros(3)  # there, but without numbers: no axis at all
        safety = element.find("safety_controller")
        return Joint(
            name=name,
            source=self._document.source(element),
            kind=self._text(element, "type", element),
            parent=self._text(parent, "link", element),
            child=self._text(child, "link", element),
            origin=self._origin(element),
            axis=direction,
            axis_source=None if axis is None else self._document.source(axis),
            limit=self._limit(element.find("limit")),
            mimic=self._mimic(element.find("mimic")),
            damping=self._number(element.find("dynamics"), "damping") or 0.0,
            friction=self._number(element.find("dynamics"), "friction") or 0.0,
            dont_collapse=element.get("dont_collapse", "").lower() == "true",
            safety_controller=None
            if safety is None or safety.get("k_position") is None
            else self._document.source(safety),
        )

    def _limit(self, element: "etree._Element | None") -> Limit | None:
        if element is None:
            return None
        return Limit(
            source=self._document.source(element),
            lower=self._number(element, "lower"),
            upper=self._number(element, "upper"),
            effort=self._number(element, "effort"),
            velocity=self._number(element, "velocity"),
        )

    def _mimic(self, element: "etree._Element | None") -> Mimic | None:
        if element is None:
            return None
        multiplier, offset = self._number(element, "multiplier"), self._number(element, "offset")
        return Mimic(
            source=self._document.source(element),
            joint=element.get("joint", ""),
            multiplier=1.0 if multiplier is None else multiplier,
            offset=offset or 0.0,
        )


_SIZES = {
    "box": {"size"},
    "sphere": {"radius"},
    "cylinder": {"radius", "length"},
    "capsule": {"radius", "length"},
}


def _symmetric(six: list[float | None]) -> Matrix | None:
    """Return ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)) of xx, yy, zz, xy, xz, yz."""
    if any(value is None or math.isnan(value) for value in six):
        return None
    xx, yy, zz, xy, xz, yz = (float(value) for value in six if value is not None)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _all(*values: float | None) -> tuple[float, ...] | None:
    there = tuple(value for value in values if value is not None)
    return there if len(there) == len(values) else None


def _owner(element: "etree._Element") -> str:
    """Return the name of the link or joint that an element belongs to."""
    at: etree._Element | None = element
    while at is not None:
        if at.tag in ("link", "joint", "robot") and at.get("name"):
            return str(at.get("name"))
        at = at.getparent()
    return ""
