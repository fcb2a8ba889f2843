"""Poses of a MJCF's bodies by MuJoCo.

MuJoCo is given the bodies and joints of the file and nothing else, with a dummy mass on each body:
kinematics needs no shapes, and so no mesh is opened, and none that is missing is in the way.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.mjcf.document import MjcfDocument, Node, read_document
from terrainkit_robots.description.mjcf.parser import parse_mjcf
from terrainkit_robots.description.xml.document import RobotFileError, parse_xml, read_bytes
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    import mujoco

_SECTIONS = frozenset({"compiler", "default", "worldbody", "asset"})
"""Parts of a model that kinematics hangs on; of the assets, only models that are attached."""

_SHAPES = frozenset({"geom", "site", "camera", "light", "inertial"})
"""Elements of a body that kinematics does not hang on."""


def mjcf_poses(robot: Facts, positions: Mapping[str, Matrix]) -> dict[str, Matrix]:
    """Return the pose of each body in the world's frame, shape (n, 4, 4) [m], by its link's name.

    Args:
        robot: A robot that was read from MJCF.
        positions: Positions of joints [rad] or [m], shape (n,) each; others are at 0, whatever
            their `ref`. Free and ball joints are where the file has them.

    Raises:
        CannotCheckError: if MuJoCo cannot tell.
    """
    import mujoco

    model = _compiled(robot)
    places = _places(robot, model)
    bodies = [link.name for link in robot.model.links if not link.virtual]
    if len(bodies) != model.nbody - 1:
        raise _changed(robot)
    count = len(next(iter(positions.values()))) if positions else 1
    poses = {name: np.tile(np.eye(4), (count, 1, 1)) for name in bodies}
    data = mujoco.MjData(model)
    data.qpos[[places[joint.name] for joint in robot.model.joints if joint.moves]] = 0.0
    for k in range(count):
        for name, values in positions.items():
            data.qpos[places[name]] = values[k]
        mujoco.mj_kinematics(model, data)
        for index, name in enumerate(bodies, 1):
            poses[name][k, :3, :3] = data.xmat[index].reshape(3, 3)
            poses[name][k, :3, 3] = data.xpos[index]
    return poses


def _places(robot: Facts, model: Any) -> dict[str, int]:
    """Return where in qpos each joint is; the order is that of the file in both."""
    joints = [joint for joint in robot.model.joints if joint.kind != "fixed"]
    if len(joints) != model.njnt or any(
        model.joint(k).name not in ("", joint.name) for k, joint in enumerate(joints)
    ):
        raise _changed(robot)
    return {joint.name: int(model.jnt_qposadr[k]) for k, joint in enumerate(joints)}


def _changed(robot: Facts) -> CannotCheckError:
    return CannotCheckError(f"{robot.model.file.name} has changed since it was read")


def _compiled(robot: Facts) -> "mujoco.MjModel":
    """Return MuJoCo's model of the bodies and joints alone."""
    import mujoco

    file = robot.model.file
    try:
        document = parse_xml(file, read_bytes(file))
    except RobotFileError as error:
        raise CannotCheckError(str(error)) from error
    if document.root is None:
        raise _changed(robot)
    tree = read_document(document, {})
    _bare(tree)
    spec, _ = parse_mjcf(tree)
    if spec is None:
        raise CannotCheckError(f"MuJoCo does not read {file.name}")
    _settle(spec)
    try:
        with quiet_mujoco():
            return spec.compile()
    except (ValueError, RuntimeError, mujoco.FatalError, mujoco.UnexpectedError) as error:
        why = " ".join(str(error).split())
        raise CannotCheckError(f"MuJoCo does not compile {file.name}: {why}") from error


def _bare(tree: MjcfDocument) -> None:
    """Take out of a document all that kinematics does not hang on."""
    for root in tree.roots():
        root.children[:] = [section for section in root.children if section.tag in _SECTIONS]
        for section in root.children:
            if section.tag == "asset":
                section.children[:] = [node for node in section.children if node.tag == "model"]
            elif section.tag == "worldbody":
                _without_shapes(section)


def _without_shapes(body: Node) -> None:
    stack = [body]
    while stack:
        node = stack.pop()
        node.children[:] = [child for child in node.children if child.tag not in _SHAPES]
        stack += [child for child in node.children if child.tag != "composite"]


def _settle(spec: "mujoco.MjSpec") -> None:
    """Give each body a mass, and take the joints' limits away: only their motion is asked for."""
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
