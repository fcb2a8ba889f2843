"""Compute the link poses of a URDF with yourdfpy.

yourdfpy gets a document with the origins and axes of the file only. Meshes are not opened, and
elements that it would reject are left out.
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

_MAX_JOINTS, _MAX_JOINT_POSES = 500, 20_000
"""Maximum number of joints, and of joints times poses, for yourdfpy: a few seconds of work. The
time grows with the square of the joints."""


def urdf_poses(robot: Facts, positions: Mapping[str, Matrix]) -> dict[str, Matrix]:
    """Return the pose of each link in the root frame, shape (n, 4, 4) [m], by the link's name.

    Args:
        robot: A robot that was read from URDF or xacro.
        positions: Joint positions [rad] or [m], shape (n,) each. Other joints are at 0.

    Raises:
        CannotCheckError: if yourdfpy cannot load the robot, or the file has changed.
    """
    joints = [robot.tree.parent_joint[name] for name in robot.tree.order[1:]]
    if not joints:
        raise CannotCheckError(f"{robot.model.file.name} has no joints")
    count = len(next(iter(positions.values()))) if positions else 1
    _check_size(robot, joints, count)
    document = _make_document(robot, joints)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # from imports of yourdfpy, and divisions by zero
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
    """Return the pose of each link: its parent's pose times the joint transform of yourdfpy."""
    moved = [joint for joint in joints if joint.moves and joint.name in positions]
    transforms = {
        joint.child: np.tile(model.get_transform(joint.child, joint.parent), (count, 1, 1))
        for joint in joints
    }
    for k in range(count):
        model.update_cfg({joint.name: float(positions[joint.name][k]) for joint in moved})
        for joint in moved:
            transforms[joint.child][k] = model.get_transform(joint.child, joint.parent)
    poses = {joints[0].parent: np.tile(np.eye(4), (count, 1, 1))}
    for joint in joints:
        poses[joint.child] = poses[joint.parent] @ transforms[joint.child]
    return poses


def _check_size(robot: Facts, joints: Sequence[Joint], poses: int) -> None:
    """Raise an error if joint names repeat or yourdfpy would take too long."""
    file = robot.model.file.name
    for a, b in pairwise(sorted(joint.name for joint in joints)):
        if a == b:
            raise CannotCheckError(f"{file} has two joints called {a}")
    if len(joints) > _MAX_JOINTS or len(joints) * poses > _MAX_JOINT_POSES:
        raise CannotCheckError(
            f"{file} has {len(joints)} joints, which would take yourdfpy too long"
        )


def _make_document(robot: Facts, joints: Sequence[Joint]) -> bytes:
    """Return a URDF with the links and joints of the main tree, with origins and axes only."""
    root = etree.Element("robot", name="robot")
    for link in robot.tree.order:
        etree.SubElement(root, "link", name=link)
    elements = _joint_elements(robot)
    for joint in joints:
        kind = joint.kind if joint.moves else "fixed"
        element = etree.SubElement(root, "joint", name=joint.name, type=kind)
        etree.SubElement(element, "parent", link=joint.parent)
        etree.SubElement(element, "child", link=joint.child)
        etree.SubElement(element, "origin", dict(_origin(joint, elements.get(joint))))
        axis = _axis(joint, elements.get(joint))
        if axis:
            etree.SubElement(element, "axis", xyz=axis)
    document: bytes = etree.tostring(root)
    return document


def _joint_elements(robot: Facts) -> dict[Joint, "etree._Element"]:
    """Return the XML element of each joint. Empty for xacro.

    Raises:
        CannotCheckError: if the file has changed.
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


def _origin(joint: Joint, element: "etree._Element | None") -> Iterator[tuple[str, str]]:
    """Yield valid xyz and rpy attributes. Quaternions are converted, as yourdfpy ignores them."""
    if element is None:
        yield "xyz", _text(joint.origin[:3, 3])
        yield "rpy", _text(matrix_to_rpy(joint.origin[:3, :3]))
        return
    origin = element.find("origin")
    for name in ("xyz", "rpy"):
        text = "" if origin is None else origin.get(name, "")
        if parse_numbers(text, 3) is None:
            text = replace_commas(text, 3)
        if text:
            yield name, text
        elif name == "rpy" and origin is not None and origin.get("quat_xyzw") is not None:
            yield name, _text(matrix_to_rpy(joint.origin[:3, :3]))


def _axis(joint: Joint, element: "etree._Element | None") -> str:
    """Return the axis. It is normalized where yourdfpy would use its length as a factor."""
    axis = None if element is None else element.find("axis")
    text = "" if axis is None else axis.get("xyz", "")
    numbers = parse_numbers(text, 3)
    if numbers is None or joint.kind == "prismatic" or not 0.1 < np.linalg.norm(numbers) < 10:
        return "" if joint.axis is None else _text(joint.direction)
    return text


def _text(numbers: Matrix) -> str:
    return " ".join(repr(float(number)) for number in numbers)
