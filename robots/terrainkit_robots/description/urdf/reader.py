"""Read the robot of a URDF document.

Defaults follow http://wiki.ros.org/urdf/XML. Whatever is wrong is recorded as a problem, and the
rest is read.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from lxml import etree

from terrainkit.settings.text import truncate
from terrainkit_robots.description.fix import (
    Fix,
    RemoveAttribute,
    RemoveElement,
    SetAttribute,
    make_fix,
    number_fix,
)
from terrainkit_robots.description.loops import with_loops
from terrainkit_robots.description.model import (
    Dynamics,
    Geometry,
    Inertial,
    Joint,
    Limit,
    Link,
    MeshFile,
    Mimic,
    PositionGains,
    Problem,
    RobotModel,
    SafetyController,
    Source,
)
from terrainkit_robots.description.package_resolver import PackageResolver
from terrainkit_robots.description.urdf.colors import (
    Color,
    color_of,
    named_colors,
    undefined_materials,
)
from terrainkit_robots.description.urdf.gazebo_joints import gazebo_loops
from terrainkit_robots.description.urdf.references import invalid_references
from terrainkit_robots.description.urdf.tags import (
    has_variable,
    misspelled_names,
    repeated_children,
    unexpanded_xacro,
    unread_elements,
)
from terrainkit_robots.description.xml.document import XmlDocument
from terrainkit_robots.description.xml.number_text import place_text
from terrainkit_robots.description.xml.numbers import is_in_degrees, parse_numbers, replace_commas
from terrainkit_robots.transforms import Matrix, matrix_to_rpy, quat_to_matrix, rpy_to_matrix

_VERSIONS = ("1.0", "1.1", "1.2")
"""Versions of the format that urdfdom 6 reads. Releases before 5.1 read the first only."""

_Numbers = TypeVar("_Numbers", Limit, Dynamics, SafetyController)


def read_urdf(doc: XmlDocument, *, packages: Mapping[str, Path]) -> RobotModel:
    """Return the robot of a document whose root is <robot>.

    Args:
        doc: The XML document.
        packages: Folders of ROS packages by name.
    """
    return _Reader(doc, packages).robot()


class _Reader:
    """Read one document and collect its problems."""

    def __init__(self, doc: XmlDocument, packages: Mapping[str, Path]) -> None:
        self._doc = doc
        self._packages = PackageResolver(doc.file, packages)
        self._problems = list(doc.problems)
        self._colors: Mapping[str, Color] = {}
        self._controlled: Mapping[str, etree._Element] = {}

    def robot(self) -> RobotModel:
        """Return the robot."""
        root = self._doc.required_root
        source = self._doc.source(root)
        if not root.get("name", "").strip():
            fix = _name_fix(source, self._doc.file.stem)
            self._report(
                "XML003", root, "the robot has no name; expected <robot name=...>", fix=fix
            )
        self._check_version(root)
        self._check_names(root)
        self._colors = named_colors(root)
        self._controlled = {
            joint.get("name", ""): joint for joint in root.iterfind("ros2_control/joint")
        }
        links = tuple(self._link(element) for element in root.iterchildren("link"))
        joints = tuple(self._joint(element) for element in root.iterchildren("joint"))
        compiler = root.find("mujoco/compiler")
        model = RobotModel(
            name=root.get("name", "").strip(),
            kind="urdf",
            file=self._doc.file,
            source=source,
            links=links,
            joints=joints,
            driven=frozenset(_driven_joints(root)),
            keeps_fixed_links=compiler is not None and compiler.get("fusestatic") == "false",
            sources=(self._doc.file,),
        )
        loops = []
        for element, found in gazebo_loops(root, model):
            if isinstance(found, str):
                self._report("XML019", element, f"<joint> in <gazebo> is not read: {found}")
            else:
                loops.append(found)
        return replace(with_loops(model, loops), problems=tuple(self._problems))

    def _report(
        self,
        code: str,
        element: "etree._Element",
        message: str,
        *,
        attribute: str = "",
        fix: Fix | None = None,
    ) -> None:
        self._problems.append(
            Problem(
                code=code,
                message=message,
                source=self._doc.source(element),
                subject=_owner(element),
                attribute=attribute,
                fix=fix,
            )
        )

    def _removal(self, element: "etree._Element", description: str) -> Fix | None:
        return make_fix("safe", description, [RemoveElement(source=self._doc.source(element))])

    def _check_version(self, root: "etree._Element") -> None:
        """Report a version that urdfdom rejects."""
        version = root.get("version", _VERSIONS[0])
        if version not in _VERSIONS and not has_variable(version):
            self._problems.append(
                Problem(
                    code="XML006",
                    message=f"version of <robot>: got {truncate(version)!r}; expected "
                    f"{_VERSIONS[0]}, the version of the format, since urdfdom and ROS reject "
                    "the file",
                    source=self._doc.source(root),
                    attribute="version",
                    severity="warning",
                )
            )

    def _check_names(self, root: "etree._Element") -> None:
        """Report unexpanded xacro and misspelled names."""
        for element, what in unexpanded_xacro(root):
            self._report("XML004", element, f"{what} is xacro that was not expanded")
        for element, attribute, known in misspelled_names(root):
            what = f"attribute {attribute} of <{element.tag}>" if attribute else f"<{element.tag}>"
            message = f"{what} is unknown and ignored; did you mean {known}?"
            self._report("XML007", element, message, attribute=attribute)
        for element, message in unread_elements(root):
            self._report("XML019", element, message)
        for element in repeated_children(root):
            parent = element.getparent()
            message = f"second <{element.tag}> in a <{parent.tag}>; expected one, and the first is "
            is_copy = _same_content(parent.find(element.tag), element)
            fix = self._removal(element, "Remove the copy.") if is_copy else None
            self._report("XML015", element, f"{message}read", fix=fix)
        for element in undefined_materials(root):
            name = truncate(element.get("name", ""))
            message = f"material {name}: has no color or texture anywhere; expected a definition"
            self._report("XML016", element, message)
        if not any(problem.code in ("XML001", "XML004") for problem in self._problems):
            self._problems += invalid_references(self._doc)

    # Numbers

    def _parse_numbers(self, element: "etree._Element", name: str, count: int) -> Matrix | None:
        """Return the numbers of an attribute, shape (count,); None if missing or invalid."""
        text = element.get(name)
        if text is None:
            return None
        values = parse_numbers(text, count)
        if values is not None:
            return values
        if has_variable(text):
            return None  # reported as unexpanded xacro
        repaired = replace_commas(text, count)
        expected = "a number" if count == 1 else f"{count} numbers"
        hint = ", with decimal points and separated by spaces" if repaired else ""
        self._report(
            "XML006",
            element,
            f"{name} of <{element.tag}>: got {truncate(text, 40)!r}; expected {expected}{hint}",
            attribute=name,
            fix=number_fix(self._doc.source(element), name, repaired),
        )
        return parse_numbers(repaired, count) if repaired else None

    def _parse_number(self, element: "etree._Element | None", name: str) -> float | None:
        values = None if element is None else self._parse_numbers(element, name, 1)
        return None if values is None else float(values[0])

    def _required(
        self, element: "etree._Element | None", name: str, parent: "etree._Element"
    ) -> str:
        """Return a required attribute, or an empty string."""
        value = None if element is None else element.get(name)
        if value is None or not value.strip():
            tag = parent.tag if element is None else element.tag
            at = parent if element is None else element
            self._report("XML013", at, f"<{tag}> has no {name}")
        return value or ""

    def _origin(self, parent: "etree._Element") -> Matrix:
        """Return the pose in the <origin> of an element, shape (4, 4) [m]."""
        pose = np.eye(4)
        origin = parent.find("origin")
        if origin is None:
            return pose
        xyz, rpy = self._parse_numbers(origin, "xyz", 3), self._parse_numbers(origin, "rpy", 3)
        rotation = self._quaternion(origin)
        if xyz is not None:
            pose[:3, 3] = xyz
        if rpy is not None:
            pose[:3, :3] = rpy_to_matrix(rpy)
            if is_in_degrees(rpy.tolist()):
                got = truncate(origin.get("rpy", ""), 40)
                self._report("XML018", origin, f"rpy of <origin>: got {got} rad; expected radians")
        elif rotation is not None:
            pose[:3, :3] = rotation
        return pose

    def _quaternion(self, origin: "etree._Element") -> Matrix | None:
        """Return the rotation of the quat_xyzw of URDF 1.1, shape (3, 3), or None."""
        quat = self._parse_numbers(origin, "quat_xyzw", 4)
        if quat is None:
            return None
        message = ""
        if origin.get("rpy") is not None:
            message = "<origin> has quat_xyzw and rpy; expected only one of them"
        elif not 0 < np.linalg.norm(quat) < np.inf:
            text = truncate(origin.get("quat_xyzw", ""), 40)
            message = f"quat_xyzw of <origin>: got {text!r}; expected a nonzero quaternion"
        if message:
            self._report("XML006", origin, message, attribute="quat_xyzw")
            return None
        rotation = quat_to_matrix(np.roll(quat, 1))
        rpy = place_text(matrix_to_rpy(rotation))
        if rpy != "0 0 0":
            message = f'simulators ignore quat_xyzw of <origin>; expected rpy="{rpy}"'
            source = self._doc.source(origin)
            edits = (
                SetAttribute(source=source, name="rpy", value=rpy),
                RemoveAttribute(source=source, name="quat_xyzw"),
            )
            fix = make_fix("unsafe", f'Set rpy="{rpy}".', edits)
            self._report("XML014", origin, message, fix=fix)
        return rotation

    # Links

    def _link(self, element: "etree._Element") -> Link:
        return Link(
            name=self._required(element, "name", element),
            source=self._doc.source(element),
            inertial=self._inertial(element.find("inertial")),
            collisions=tuple(self._geometries(element, "collision")),
            visuals=tuple(self._geometries(element, "visual")),
        )

    def _inertial(self, element: "etree._Element | None") -> Inertial | None:
        if element is None:
            return None
        tensor = element.find("inertia")
        inertia = None
        if tensor is not None:
            values = [self._parse_number(tensor, name) for name in _DIAGONAL]
            values += [
                self._parse_number(tensor, name) if tensor.get(name) is not None else 0.0
                for name in _PRODUCTS
            ]
            inertia = _symmetric(values)
            self._check_products(tensor)
        return Inertial(
            source=self._doc.source(element),
            mass=self._parse_number(element.find("mass"), "value"),
            origin=self._origin(element),
            inertia=inertia,
            inertia_source=None if tensor is None else self._doc.source(tensor),
            missing=tuple(n for n in _DIAGONAL if tensor is None or tensor.get(n) is None),
        )

    def _check_products(self, tensor: "etree._Element") -> None:
        """Report missing products of inertia; INR003 reports missing moments."""
        missing = [name for name in _PRODUCTS if tensor.get(name) is None]
        if missing and set(tensor.keys()) >= set(_DIAGONAL):
            message = f"<inertia> has no {', '.join(missing)}; MuJoCo rejects the file"
            source = self._doc.source(tensor)
            edits = [SetAttribute(source=source, name=name, value="0") for name in missing]
            what = f"Set {', '.join(missing)} to 0, which lenient readers assume."
            self._report("XML013", tensor, message, fix=make_fix("safe", what, edits))

    def _geometries(self, link: "etree._Element", tag: str) -> Iterator[Geometry]:
        for element in link.iterchildren(tag):
            for extra in element.findall("material")[1:]:
                fix = self._removal(extra, "Remove the second material.")
                self._report("XML008", extra, f"<{tag}> has two materials; expected one", fix=fix)
            geometry = self._geometry(element)
            color = color_of(element, self._colors) if tag == "visual" else None
            yield geometry if color is None else replace(geometry, color=color)

    def _geometry(self, element: "etree._Element") -> Geometry:
        source, name = self._doc.source(element), element.get("name", "")
        origin = self._origin(element)
        geometry = element.find("geometry")
        shape = None if geometry is None else next(geometry.iterchildren(etree.Element), None)
        if shape is None:
            self._report("XML013", element, f"<{element.tag}> has no shape in a <geometry>")
            return Geometry(source=source, name=name, shape="unknown", origin=origin)
        size_source = self._doc.source(shape)
        if shape.tag == "mesh":
            mesh = self._mesh(shape)
            return Geometry(source=source, name=name, shape="mesh", origin=origin, mesh=mesh)
        size: tuple[float, ...] | None = None
        match shape.tag:
            case "box":
                sides = self._parse_numbers(shape, "size", 3)
                size = None if sides is None else tuple(float(side) / 2 for side in sides)
            case "sphere":
                size = _complete(self._parse_number(shape, "radius"))
            case "cylinder" | "capsule":
                length = self._parse_number(shape, "length")
                size = _complete(self._parse_number(shape, "radius"), length and length / 2)
            case _:
                return Geometry(source=source, name=name, shape="unknown", origin=origin)
        if size is None and not set(shape.keys()) >= _SIZES[shape.tag]:
            missing = ", ".join(sorted(_SIZES[shape.tag] - set(shape.keys())))
            self._report("XML013", shape, f"<{shape.tag}> has no {missing}")
        return Geometry(
            source=source,
            name=name,
            shape=shape.tag,
            size=size or (),
            size_source=size_source,
            origin=origin,
        )

    def _mesh(self, element: "etree._Element") -> MeshFile | None:
        filename = self._required(element, "filename", element).strip()
        if not filename:
            return None
        path, found_by = self._packages.resolve(filename)
        scale = self._parse_numbers(element, "scale", 3)
        x, y, z = (1.0, 1.0, 1.0) if scale is None else map(float, scale)
        return MeshFile(
            source=self._doc.source(element),
            filename=filename,
            path=path,
            found_by=found_by,
            scale=(x, y, z),
        )

    # Joints

    def _joint(self, element: "etree._Element") -> Joint:
        name = self._required(element, "name", element)
        parent, child = element.find("parent"), element.find("child")
        axis = element.find("axis")
        blank = axis is None or not axis.get("xyz", "").strip()
        direction = None if axis is None or blank else self._parse_numbers(axis, "xyz", 3)
        if axis is not None and direction is None:
            direction = np.zeros(3)  # an invalid axis, not a missing one
        return Joint(
            name=name,
            source=self._doc.source(element),
            kind=self._required(element, "type", element),
            parent=self._required(parent, "link", element),
            child=self._required(child, "link", element),
            origin=self._origin(element),
            axis=direction,
            axis_source=None if axis is None else self._doc.source(axis),
            limit=self._numbers(Limit, element.find("limit")),
            mimic=self._mimic(element.find("mimic")),
            dynamics=self._numbers(Dynamics, element.find("dynamics")),
            dont_collapse=element.get("dont_collapse", "").lower() == "true",
            safety_controller=self._numbers(SafetyController, element.find("safety_controller")),
            position_gains=self._position_gains(self._controlled.get(name)),
        )

    def _position_gains(self, control: "etree._Element | None") -> PositionGains | None:
        """Return the gains of a position controller in the <joint> of a <ros2_control>."""
        if control is None:
            return None
        texts = {param.get("name"): param.text or "" for param in control.iterchildren("param")}
        stiffness, damping = (_first_number(texts, names) for names in _GAIN_PARAMETERS)
        if stiffness is None:
            return None
        return PositionGains(source=self._doc.source(control), stiffness=stiffness, damping=damping)

    def _numbers(self, kind: type[_Numbers], element: "etree._Element | None") -> _Numbers | None:
        """Return an element whose attributes are numbers, named like the fields of `kind`."""
        if element is None:
            return None
        names = (part.name for part in fields(kind) if part.name != "source")
        numbers = {name: self._parse_number(element, name) for name in names}
        return kind(source=self._doc.source(element), **numbers)

    def _mimic(self, element: "etree._Element | None") -> Mimic | None:
        if element is None:
            return None
        multiplier = self._parse_number(element, "multiplier")
        offset = self._parse_number(element, "offset")
        return Mimic(
            source=self._doc.source(element),
            joint=element.get("joint", ""),
            multiplier=1.0 if multiplier is None else multiplier,
            offset=offset or 0.0,
        )


_GAIN_PARAMETERS = (("position_kp", "pos_kp"), ("position_kd", "pos_kd"))
"""Parameters for stiffness and damping, in mujoco_ros2_control and in gazebo_ros2_control."""

_NAMED_TAGS = ("link", "joint", "robot")
_DIAGONAL = ("ixx", "iyy", "izz")
_PRODUCTS = ("ixy", "ixz", "iyz")

_SIZES = {
    "box": {"size"},
    "sphere": {"radius"},
    "cylinder": {"radius", "length"},
    "capsule": {"radius", "length"},
}


def _name_fix(robot: Source, stem: str) -> Fix | None:
    """Return the fix that names a robot after its file."""
    name = "".join(c if c.isalnum() and c.isascii() else "_" for c in stem)
    name = name if name[:1].isalpha() else f"robot_{name}"
    edit = SetAttribute(source=robot, name="name", value=name)
    return make_fix("safe", f'Add name="{name}", from the file name.', [edit])


def _symmetric(values: list[float | None]) -> Matrix | None:
    """Return the symmetric matrix of the values xx, yy, zz, xy, xz, yz."""
    if any(value is None or math.isnan(value) for value in values):
        return None
    xx, yy, zz, xy, xz, yz = (float(value) for value in values if value is not None)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _first_number(texts: Mapping[str | None, str], names: Sequence[str]) -> float | None:
    """Return the first of the named numbers that is positive, or None."""
    found = (parse_numbers(texts[name], 1) for name in names if name in texts)
    values = (float(row[0]) for row in found if row is not None)
    return next((value for value in values if 0 < value < math.inf), None)


def _complete(*values: float | None) -> tuple[float, ...] | None:
    """Return the values; None if one of them is None."""
    known = tuple(value for value in values if value is not None)
    return known if len(known) == len(values) else None


def _owner(element: "etree._Element") -> str:
    """Return the name of the link or joint that contains an element."""
    owners = (owner for owner in (element, *element.iterancestors()) if owner.tag in _NAMED_TAGS)
    return next((str(owner.get("name")) for owner in owners if owner.get("name")), "")


def _driven_joints(root: "etree._Element") -> Iterator[str]:
    """Yield the names of joints with a transmission or a command interface."""
    for path in ("transmission/joint", "ros2_control/joint[command_interface]"):
        yield from (joint.get("name", "") for joint in root.iterfind(path))


def _same_content(first: "etree._Element", second: "etree._Element") -> bool:
    """Return whether two elements have the same attributes and children."""
    if first.attrib != second.attrib or len(first) != len(second):
        return False
    return all(a.tag == b.tag and _same_content(a, b) for a, b in zip(first, second, strict=True))
