"""Read the SDF joints in the <gazebo> elements of a URDF, which close loops."""

from collections.abc import Iterator

import numpy as np
from lxml import etree

from terrainkit.errors import ConfigError
from terrainkit.settings.text import truncate
from terrainkit_robots.description.loops import MAX_LOOPS, make_loop
from terrainkit_robots.description.model import Loop, RobotModel
from terrainkit_robots.description.xml.numbers import parse_numbers
from terrainkit_robots.transforms import rpy_to_matrix

_CONNECTED = ("revolute", "continuous", "ball")
"""Types of joints that become a connect. The other joints of a loop keep the axis of a hinge, as in
a planar linkage."""


def gazebo_loops(
    root: etree._Element, robot: RobotModel
) -> Iterator[tuple[etree._Element, Loop | str]]:
    """Yield each SDF joint with the loop that it closes, or why it closes none.

    Args:
        root: The element <robot>.
        robot: Its links and joints.
    """
    # A joint of URDF, which has links as attributes, is reported as misplaced.
    joints = (j for j in root.iterfind("gazebo/joint") if j.find("parent[@link]") is None)
    for number, element in enumerate(joints, 1):
        if number > MAX_LOOPS:
            yield element, f"got more than {MAX_LOOPS} loops"
            return
        try:
            yield element, _loop(element, number, robot)
        except ConfigError as error:
            yield element, str(error)


def _loop(element: etree._Element, number: int, robot: RobotModel) -> Loop:
    """Return the loop that a joint closes, or raise ConfigError."""
    kind = element.get("type", "")
    if kind not in (*_CONNECTED, "fixed"):
        expected = ", ".join((*_CONNECTED, "fixed"))
        raise ConfigError(f"type: got {truncate(kind) or 'nothing'}; expected one of: {expected}")
    # A name may have the model before it.
    texts = (element.findtext(tag) or "" for tag in ("parent", "child"))
    parent, child = (text.strip().rpartition("::")[2] for text in texts)
    owner, frame = child, np.eye(4)
    pose = element.find("pose")
    if pose is not None:
        values = parse_numbers(pose.text or "", 6)
        if values is None:
            raise ConfigError(f"pose: got {truncate(pose.text or '')!r}; expected six numbers")
        turn = np.radians(values[3:]) if pose.get("degrees") == "true" else values[3:]
        frame[:3, :3] = rpy_to_matrix(turn)
        frame[:3, 3] = values[:3]
        named = pose.get("relative_to") or pose.get("frame") or child
        owner = {joint.name: joint.child for joint in robot.joints}.get(named, named)
    links = (parent, child)
    return make_loop(robot, number, "weld" if kind == "fixed" else "connect", links, (owner, frame))
