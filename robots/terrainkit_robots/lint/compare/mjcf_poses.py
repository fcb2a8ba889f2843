"""Compute the body poses of an MJCF with MuJoCo.

MuJoCo gets only the bodies and joints of the file, with a dummy mass on each body. Kinematics needs
no shapes, so meshes are not opened and may be missing.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.mjcf.parser import parse_mjcf
from terrainkit_robots.description.mjcf.tree import MjcfTree, Node, read_tree
from terrainkit_robots.description.xml.document import RobotFileError, parse_xml, read_bytes
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    import mujoco

_SECTIONS = frozenset({"compiler", "default", "worldbody", "asset"})
"""Sections that affect kinematics. Of the assets, only attached models do."""

_SHAPES = frozenset({"geom", "site", "camera", "light", "inertial"})
"""Elements of a body that do not affect kinematics."""


def mjcf_poses(robot: Facts, positions: Mapping[str, Matrix]) -> dict[str, Matrix]:
    """Return the pose of each body in the world frame, shape (n, 4, 4) [m], by the link's name.

    Args:
        robot: A robot that was read from MJCF.
        positions: Joint positions [rad] or [m], shape (n,) each. Other joints are at 0, regardless
            of their `ref`. Free and ball joints stay at their initial position.

    Raises:
        CannotCheckError: if MuJoCo cannot load the robot, or the file has changed.
    """
    import mujoco

    model = _compile(robot)
    addresses = _qpos_addresses(robot, model)
    bodies = [link.name for link in robot.model.links if not link.virtual]
    if len(bodies) != model.nbody - 1:
        raise _changed_file(robot)
    count = len(next(iter(positions.values()))) if positions else 1
    poses = {name: np.tile(np.eye(4), (count, 1, 1)) for name in bodies}
    data = mujoco.MjData(model)
    data.qpos[[addresses[joint.name] for joint in robot.model.joints if joint.moves]] = 0.0
    for k in range(count):
        for name, values in positions.items():
            data.qpos[addresses[name]] = values[k]
        mujoco.mj_kinematics(model, data)
        for index, name in enumerate(bodies, 1):
            poses[name][k, :3, :3] = data.xmat[index].reshape(3, 3)
            poses[name][k, :3, 3] = data.xpos[index]
    return poses


def _qpos_addresses(robot: Facts, model: Any) -> dict[str, int]:
    """Return the index of each joint in qpos. Both use the order of the file."""
    joints = [joint for joint in robot.model.joints if joint.kind != "fixed"]
    if len(joints) != model.njnt or any(
        model.joint(k).name not in ("", joint.name) for k, joint in enumerate(joints)
    ):
        raise _changed_file(robot)
    return {joint.name: int(model.jnt_qposadr[k]) for k, joint in enumerate(joints)}


def _changed_file(robot: Facts) -> CannotCheckError:
    return CannotCheckError(f"{robot.model.file.name} has changed since it was read")


def _compile(robot: Facts) -> "mujoco.MjModel":
    """Return a MuJoCo model of the bodies and joints only."""
    import mujoco

    file = robot.model.file
    try:
        document = parse_xml(file, read_bytes(file))
    except RobotFileError as error:
        raise CannotCheckError(str(error)) from error
    if document.root is None:
        raise _changed_file(robot)
    tree = read_tree(document, {})
    _remove_other_elements(tree)
    spec, _ = parse_mjcf(tree)
    if spec is None:
        raise CannotCheckError(f"MuJoCo cannot parse {file.name}")
    _set_dummy_masses(spec)
    try:
        with quiet_mujoco():
            return spec.compile()
    except (ValueError, RuntimeError, mujoco.FatalError, mujoco.UnexpectedError) as error:
        why = " ".join(str(error).split())
        raise CannotCheckError(f"MuJoCo cannot compile {file.name}: {why}") from error


def _remove_other_elements(tree: MjcfTree) -> None:
    """Remove all elements that do not affect kinematics."""
    for root in tree.roots():
        root.children[:] = [section for section in root.children if section.tag in _SECTIONS]
        for section in root.children:
            if section.tag == "asset":
                section.children[:] = [node for node in section.children if node.tag == "model"]
            elif section.tag == "worldbody":
                _remove_shapes(section)


def _remove_shapes(body: Node) -> None:
    stack = [body]
    while stack:
        node = stack.pop()
        node.children[:] = [child for child in node.children if child.tag not in _SHAPES]
        stack += [child for child in node.children if child.tag != "composite"]


def _set_dummy_masses(spec: "mujoco.MjSpec") -> None:
    """Give each body a mass and remove joint limits, which do not affect kinematics."""
    import mujoco

    compiler, free = spec.compiler, mujoco.mjtLimited.mjLIMITED_FALSE
    compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    compiler.fusestatic = compiler.balanceinertia = False
    compiler.settotalmass = -1
    for body in spec.bodies:
        if body.name != "world":
            body.explicitinertial, body.mass, body.inertia = True, 1.0, np.ones(3)
    for joint in spec.joints:
        joint.limited, joint.actfrclimited = free, free
        joint.springdamper = np.zeros(2)
