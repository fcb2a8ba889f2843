"""Compare the SRDF beside a URDF with its links and joints."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from terrainkit_robots.description.model import Problem
from terrainkit_robots.description.package_resolver import exists
from terrainkit_robots.description.urdf.references import Reference, joint_names, link_names
from terrainkit_robots.description.xml.document import (
    RobotFileError,
    XmlDocument,
    parse_xml,
    read_bytes,
)
from terrainkit_robots.text import count, names

if TYPE_CHECKING:
    from lxml import etree

_FOLDERS = (".", "srdf", "config", "../srdf", "../config")
"""Folders of an SRDF, relative to the folder of the URDF."""

_MIN_KNOWN_SHARE = 0.5
"""Smallest share of the names of an SRDF that exist in the robot. Below it, the SRDF belongs to
another variant of the robot, unless it has the name of the URDF file."""

_FREE_JOINT = "root_joint"
"""Name of the joint that Pinocchio adds above the root link of a floating robot."""


def invalid_srdf(doc: XmlDocument) -> Iterator[Problem]:
    """Yield a problem if the SRDF of a URDF has names that the robot lacks.

    The SRDF has the name of the URDF file, or the robot's name if no other URDF has it, and is in
    the same folder, or in srdf/ or config/ of the package.
    """
    assert doc.root is not None
    path = _find_srdf(doc.file, doc.root.get("name", "").strip())
    if path is None:
        return
    try:
        semantics = parse_xml(path, read_bytes(path))
    except RobotFileError:
        return  # it cannot be read, so it is not compared
    root = semantics.root
    if root is None or semantics.problems:
        problem = next(iter(semantics.problems))
        source, message = problem.source, problem.message
        yield Problem(code="TRE010", message=message, source=source, subject=source.file.name)
        return
    known = {
        "link": link_names(doc.root),
        "joint": {*joint_names(doc.root), _FREE_JOINT, *_names_of(root, "virtual_joint")},
        "group": _names_of(root, "group"),
    }
    references = [reference for reference in _references(root) if reference.name]
    missing = [reference for reference in references if reference.name not in known[reference.kind]]
    unknown = list(dict.fromkeys(reference.name for reference in missing))
    total = len({reference.name for reference in references})
    is_own = doc.file.name.startswith(f"{path.stem}.")
    if missing and (is_own or total - len(unknown) >= _MIN_KNOWN_SHARE * total):
        first = missing[0]
        yield Problem(
            code="TRE010",
            message=f"{count(len(unknown), 'unknown name')} in {path.name}: got {names(unknown)}; "
            f"expected names of the robot; the first is {first.place}, a {first.kind}",
            source=semantics.source(first.element),
            subject=first.name,
        )


def _find_srdf(file: Path, robot_name: str) -> Path | None:
    """Return the SRDF of a URDF, or None."""
    stems = [file.name.removesuffix(".xacro").removesuffix(".urdf")]
    is_name = robot_name and robot_name == Path(robot_name).name
    if is_name and not exists(file.with_name(f"{robot_name}.urdf")):
        stems.append(robot_name)
    paths = (file.parent / folder / f"{name}.srdf" for name in stems for folder in _FOLDERS)
    return next((path for path in paths if exists(path)), None)


def _names_of(root: "etree._Element", tag: str) -> set[str]:
    return {element.get("name", "") for element in root.iterchildren(tag)}


_LINK_ATTRIBUTES = {
    "chain": ("base_link", "tip_link"),
    "end_effector": ("parent_link",),
    "virtual_joint": ("child_link",),
    "disable_collisions": ("link1", "link2"),
    "enable_collisions": ("link1", "link2"),
    "disable_default_collisions": ("link",),
    "link_sphere_approximation": ("link",),
}
"""Attributes of SRDF elements that name links."""


def _references(root: "etree._Element") -> Iterator[Reference]:
    for group in root.iterchildren("group", "group_state"):
        for child in group.iterchildren("link", "joint", "group"):
            place = f"<{child.tag}> of a <{group.tag}>"
            yield Reference(child, place, child.tag, child.get("name", ""))
    for element in root.iter(*_LINK_ATTRIBUTES):
        for attribute in _LINK_ATTRIBUTES[element.tag]:
            place = f"{attribute} of <{element.tag}>"
            yield Reference(element, place, "link", element.get(attribute, ""))
    for element in root.iterchildren("end_effector", "group_state"):
        for attribute in ("group", "parent_group"):
            place = f"{attribute} of <{element.tag}>"
            yield Reference(element, place, "group", element.get(attribute, ""))
    for element in root.iterchildren("passive_joint"):
        yield Reference(element, "<passive_joint>", "joint", element.get("name", ""))
    for element in root.iter("joint_property"):
        yield Reference(element, "<joint_property>", "joint", element.get("joint_name", ""))
