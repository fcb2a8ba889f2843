"""Poses of a URDF's links by yourdfpy, which knows nothing of this project.

yourdfpy is given a document with the frames and axes as the file writes them, and nothing else: no
mesh is opened, and what it would refuse is gone.
"""

import io
import warnings
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from lxml import etree

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint
from terrainkit_robots.description.xml.document import RobotFileError, parse_xml, read_bytes
from terrainkit_robots.description.xml.numbers import parse_numbers, replace_commas
from terrainkit_robots.transforms import Matrix, matrix_to_rpy

if TYPE_CHECKING:
    import yourdfpy

_MOST_JOINTS, _MOST_TURNS = 500, 20_000
"""So many joints, and so many times all poses, are asked of yourdfpy: some seconds of work. It
takes the square of the joints; a humanoid has 30."""


def urdf_poses(robot: Facts, positions: Mapping[str, Matrix]) -> dict[str, Matrix]:
    """Return the pose of each link in the root's frame, shape (n, 4, 4) [m], by the link's name.

    Args:
        robot: A robot that was read from URDF or xacro.
        positions: Positions of joints [rad] or [m], shape (n,) each; others are at 0.

    Raises:
        CannotCheckError: if yourdfpy cannot tell.
    """
    joints = [robot.tree.above[name] for name in robot.tree.order[1:]]
    if not joints:
        raise CannotCheckError(f"{robot.model.file.name} has one link, which does not move")
    count = len(next(iter(positions.values()))) if positions else 1
    _check(robot, joints, count)
    document = _document(robot, joints)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what yourdfpy imports, and of what it divides by
        import yourdfpy

        try:
            model = yourdfpy.URDF.load(io.BytesIO(document), load_meshes=False)
            return _poses(model, joints, positions, count)
        except (ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
            why = f"{type(error).__name__}: {' '.join(str(error).split())}"
            raise CannotCheckError(f"yourdfpy fails on {robot.model.file.name}: {why}") from error


def _poses(
    model: "yourdfpy.URDF",
    joints: Sequence[Joint],
    positions: Mapping[str, Matrix],
    count: int,
) -> dict[str, Matrix]:
    """Return the pose of each link: that of its parent times what yourdfpy says of the joint."""
    moved = [joint for joint in joints if joint.moves and joint.name in positions]
    steps = {
        joint.child: np.tile(model.get_transform(joint.child, joint.parent), (count, 1, 1))
        for joint in joints
    }
    for k in range(count):
        model.update_cfg({joint.name: float(positions[joint.name][k]) for joint in moved})
        for joint in moved:
            steps[joint.child][k] = model.get_transform(joint.child, joint.parent)
    poses = {joints[0].parent: np.tile(np.eye(4), (count, 1, 1))}
    for joint in joints:
        poses[joint.child] = poses[joint.parent] @ steps[joint.child]
    return poses


def _check(robot: Facts, joints: Sequence[Joint], poses: int) -> None:
    """Raise if yourdfpy cannot be asked."""
    file = robot.model.file.name
    for a, b in pairwise(sorted(joint.name for joint in joints)):
        if a == b:
            raise CannotCheckError(f"joint {a} of {file} is there twice, so it has no position")
    if len(joints) > _MOST_JOINTS or len(joints) * poses > _MOST_TURNS:
        raise CannotCheckError(f"{file} has {len(joints)} joints; yourdfpy takes too long for that")


def _document(robot: Facts, joints: Sequence[Joint]) -> bytes:
    """Return a URDF of the links and joints of the main tree, with their frames and axes."""
    root = etree.Element("robot", name="robot")
    for link in robot.tree.order:
        etree.SubElement(root, "link", name=link)
    written = _written(robot)
    for joint in joints:
        kind = joint.kind if joint.moves else "fixed"
        element = etree.SubElement(root, "joint", name=joint.name, type=kind)
        etree.SubElement(element, "parent", link=joint.parent)
        etree.SubElement(element, "child", link=joint.child)
        etree.SubElement(element, "origin", dict(_origin(joint, written.get(joint))))
        axis = _axis(joint, written.get(joint))
        if axis:
            etree.SubElement(element, "axis", xyz=axis)
    document: bytes = etree.tostring(root)
    return document


def _written(robot: Facts) -> dict[Joint, "etree._Element"]:
    """Return the element of each joint, as it is in the file; none of what was made from xacro.

    Raises:
        CannotCheckError: if the file is not the one that was read.
    """
    model = robot.model
    if model.kind != "urdf":
        return {}
    try:
        root = parse_xml(model.file, read_bytes(model.file)).root
    except RobotFileError as error:
        raise CannotCheckError(str(error)) from error
    elements = [] if root is None else list(root.iterchildren("joint"))
    if [element.get("name") or "" for element in elements] != [j.name for j in model.joints]:
        raise CannotCheckError(f"{model.file.name} has changed since it was read")
    return dict(zip(model.joints, elements, strict=True))


def _origin(joint: Joint, written: "etree._Element | None") -> Iterator[tuple[str, str]]:
    """Yield xyz and rpy, as far as they are numbers; yourdfpy knows no quaternions."""
    if written is None:
        yield "xyz", _text(joint.origin[:3, 3])
        yield "rpy", _text(matrix_to_rpy(joint.origin[:3, :3]))
        return
    origin = written.find("origin")
    for name in ("xyz", "rpy"):
        text = "" if origin is None else origin.get(name, "")
        if parse_numbers(text, 3) is None:
            text = replace_commas(text, 3)
        if text:
            yield name, text
        elif name == "rpy" and origin is not None and origin.get("quat_xyzw") is not None:
            yield name, _text(matrix_to_rpy(joint.origin[:3, :3]))


def _axis(joint: Joint, written: "etree._Element | None") -> str:
    """Return the axis; of unit length where yourdfpy would take its length for a factor."""
    axis = None if written is None else written.find("axis")
    text = "" if axis is None else axis.get("xyz", "")
    numbers = parse_numbers(text, 3)
    if numbers is None or joint.kind == "prismatic" or not 0.1 < np.linalg.norm(numbers) < 10:
        return "" if joint.axis is None else _text(joint.direction)
    return text


def _text(numbers: Matrix) -> str:
    return " ".join(repr(float(number)) for number in numbers)
