"""Compute the order in which each simulator lists the joints and the bodies of a robot.

Observations and actions of a policy are arrays with one number per joint and no names. A policy
that was trained with one order fails with another one.

The orders and their sources:

- **MuJoCo** traverses depth first, with siblings in the order of their joints (URDF) or bodies
  (MJCF) in the file. The children of a merged link take its place. The tests compare this with the
  compiler.
- **Genesis** traverses the links of a URDF depth first too, but merges fixed joints before that,
  and then sorts siblings by the position of their joints in the file. This follows the source of
  genesis-world 1.4.5 and was compared with robots it loads. Older versions are breadth first.
- **Isaac Lab** has the order of PhysX: breadth first, with siblings in the order of the joints in
  the USD file. The URDF importers up to Isaac Sim 5.1 keep joints in a map by name, so siblings are
  sorted by name; the later importer keeps the order of the URDF. The joint lists that Isaac Lab
  publishes for G1, H1 and ANYmal D agree.
- **PyBullet** traverses a URDF depth first, with siblings in the order of their joints in the file,
  and merges nothing. This was compared with pybullet 3.2.7.
- **Isaac Gym** is closed source. The joint lists published for A1, Go1 and Open Duck Mini are depth
  first with siblings sorted by name, although their URDFs have another order.

If the possible orders of a simulator differ for a robot, the order has to be verified.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from terrainkit_robots.analysis.bodies.tree import depth_first
from terrainkit_robots.analysis.simulator_conventions.fixed_joints import (
    SIMULATORS,
    MergedTree,
    Simulator,
    merge_joints,
    merged_tree,
)
from terrainkit_robots.description.model import JOINT_TYPES, Joint

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

_Names = tuple[str, ...]
_Key = Callable[[Joint], object]
_ChildJoints = dict[str, tuple[Joint, ...]]

_SAME_ORDER = "siblings have the same order by name and in the file"


@dataclass(frozen=True, kw_only=True)
class SimulatorOrder:
    """The order in which a simulator lists the joints and bodies of a robot."""

    simulator: Simulator

    joints: _Names
    """Joints of the main tree with one degree of freedom, including mimic joints."""

    bodies: _Names
    """Bodies from the base down, with the fixed joints merged that the simulator merges by
    default."""

    certain: bool
    """Whether the order of the joints is known. Otherwise it is likely, and has to be verified."""

    reason: str
    """Why it is known, or how to verify it."""

    @property
    def key(self) -> str:
        """Return the name of the simulator in JSON, such as `isaac_gym`."""
        return self.simulator.lower().replace(" ", "_")


def simulator_orders(robot: "Facts") -> tuple[SimulatorOrder, ...]:
    """Return the order in MuJoCo, Isaac Gym, Isaac Lab, Genesis and, for a URDF, PyBullet."""
    return tuple(
        _order(robot, name) for name in SIMULATORS if name != "PyBullet" or _is_urdf(robot)
    )


def order_table(
    file_order: Sequence[str], orders: Sequence[SimulatorOrder]
) -> tuple[tuple[str, ...], ...]:
    """Return the rows of a table: a header, one row per joint, and the certainty of each order.

    Args:
        file_order: Names of the joints in the order of the file.
        orders: Order of the joints in each simulator.

    Returns:
        Cells of text. Indices start at 0.
    """
    indices = [{name: index for index, name in enumerate(order.joints)} for order in orders]
    header = ("joint", "file", *(order.simulator for order in orders))
    rows = [
        (name, str(row), *(str(index_of.get(name, "-")) for index_of in indices))
        for row, name in enumerate(file_order)
    ]
    certainty = tuple("certain" if order.certain else "to be verified" for order in orders)
    return (header, *rows, ("", "", *certainty))


def _is_urdf(robot: "Facts") -> bool:
    return robot.model.kind != "mjcf"


def _order(robot: "Facts", simulator: Simulator) -> SimulatorOrder:
    """Return the likely order of joints and bodies, and whether it is certain."""
    joints, bodies = _default_order(robot, simulator)
    certain, reason = _certainty(robot, simulator)
    return SimulatorOrder(
        simulator=simulator, joints=joints, bodies=bodies, certain=certain, reason=reason
    )


def _default_order(robot: "Facts", simulator: Simulator) -> tuple[_Names, _Names]:
    if not robot.bodies:
        return (), ()
    key: _Key | None = None
    if simulator == "Genesis":
        key = _file_index(robot)
    elif simulator not in ("MuJoCo", "PyBullet") and _is_urdf(robot):
        key = _joint_name
    tree = merged_tree(robot, simulator)
    traverse = _breadth_first if simulator == "Isaac Lab" else depth_first
    joints = list(traverse(_sort_siblings(tree, key), tree.base))
    virtual = {link.name for body in robot.bodies for link in body.links if link.virtual}
    body_names = [tree.base, *(joint.child for joint in joints)]
    return (
        tuple(joint.name for joint in joints if joint.moves),
        tuple(name for name in body_names if name not in virtual),
    )


def _certainty(robot: "Facts", simulator: Simulator) -> tuple[bool, str]:
    """Return whether the order of the joints is known, and the reason."""
    if robot.tree.rejected:
        return False, "links or joints are missing from the tree"
    if any(joint.kind not in JOINT_TYPES for joint in robot.model.joints):
        return False, "a joint has an unknown type"
    match simulator:
        case "MuJoCo" | "PyBullet":
            siblings = "joints" if _is_urdf(robot) else "bodies"
            return True, f"depth first, siblings in the order of their {siblings} in the file"
        case "Genesis":
            return True, (
                "depth first, siblings as in the file, in genesis-world 1.4.5; "
                "older versions are breadth first"
            )
        case "Isaac Lab":
            traverse = _breadth_first
            first = "breadth first"
            keys = [_joint_name]
            known, names = "in importers up to Isaac Sim 5.1", "robot.joint_names"
        case "Isaac Gym":
            traverse = depth_first
            first = "depth first"
            keys = [_joint_name, _link_name]
            known = "in the lists published for A1 and Go1"
            names = "gym.get_asset_dof_names(asset)"
    if _is_unique(robot, traverse, (None, _file_index(robot), *keys)):
        return True, f"{first}; {_SAME_ORDER}"
    likely = f"by the name of the joint, as {known}" if _is_urdf(robot) else "as in the file"
    return False, f"{first}, siblings {likely}; compare with {names}"


def _is_unique(
    robot: "Facts",
    traverse: Callable[[_ChildJoints, str], Iterator[Joint]],
    keys: Sequence[_Key | None],
) -> bool:
    """Return whether all sibling orders and merges lead to the same order of the joints."""
    if any(body.virtual for body in robot.bodies):
        return False  # importers turn several joints into one
    orders = {
        tuple(id(joint) for joint in traverse(_sort_siblings(tree, key), tree.base) if joint.moves)
        for tree in _merge_variants(robot)
        for key in keys
    }
    return len(orders) <= 1


def _merge_variants(robot: "Facts") -> Iterator[MergedTree]:
    """Yield the tree as importers of different versions merge it.

    They merge all fixed joints, only fixed joints without dont_collapse, only fixed joints
    above massless links, or none.
    """
    if not robot.bodies:
        return
    massless = {
        joint
        for joint in robot.fixed_joints
        if (i := robot.tree.links[joint.child].inertial) is None or not i.mass
    }
    collapsed = {joint for joint in robot.fixed_joints if not joint.dont_collapse}
    for merged in {frozenset(x) for x in (robot.fixed_joints, collapsed, massless, ())}:
        yield merge_joints(robot, merged)


def _file_index(robot: "Facts") -> _Key:
    """Return the function of a joint that returns its index in the file."""
    return {joint: index for index, joint in enumerate(robot.model.joints)}.__getitem__


def _sort_siblings(tree: MergedTree, key: _Key | None) -> _ChildJoints:
    """Return the joints below each body, sorted by the key if there is one."""
    if key is None:
        return dict(tree.child_joints)
    return {
        body: tuple(sorted(joints, key=key))  # type: ignore[arg-type]
        for body, joints in tree.child_joints.items()
    }


def _breadth_first(child_joints: _ChildJoints, base: str) -> Iterator[Joint]:
    level = list(child_joints[base])
    while level:
        yield from level
        level = [joint for parent in level for joint in child_joints[parent.child]]


def _joint_name(joint: Joint) -> str:
    """Return the name of a joint in USD: only letters, digits and underscores."""
    return re.sub(r"[^A-Za-z0-9_]", "_", joint.name)


def _link_name(joint: Joint) -> str:
    """Return the name of the link below a joint in USD."""
    return re.sub(r"[^A-Za-z0-9_]", "_", joint.child)
