"""Orders: in which order each simulator lists the joints and the bodies of a robot.

A policy sees and sends a list of numbers, one for each joint, and nothing in it says which is
which. One that was trained in one order falls over in another.

What the orders follow, and where that is known from:

- **MuJoCo** goes depth first, siblings as their joints (URDF) or bodies (MJCF) stand in the file. A
  link that is merged leaves its children in its place. The tests hold this against its compiler.
- **Genesis** takes a URDF's links depth first as well, but merges fixed joints before that, and
  then sorts siblings by the place of their joints in the file. Read in genesis-world 1.4.5, and
  compared with what it loads; older versions went level by level.
- **Isaac Lab** has PhysX's order: level by level, siblings as the USD file has their joints. The
  URDF importers up to Isaac Sim 5.1 keep joints in a map by name, so siblings come by name there;
  the importer after it walks the URDF as it is written. Joint lists that Isaac Lab publishes for
  G1, H1 and ANYmal D agree.
- **Isaac Gym** is closed. Joint lists published for A1, Go1 and Open Duck Mini are depth first with
  siblings by name, where their URDFs have another order.

Where these do not agree with each other on a robot, the order is one to be verified.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from terrainkit_robots.analysis.simulator_conventions.fixed_joints import (
    SIMULATORS,
    Merged,
    Simulator,
    fixed_joints,
    merge,
    merged_joints,
)
from terrainkit_robots.description.model import JOINT_TYPES, Joint

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

_Names = tuple[str, ...]
_Key = Callable[[Joint], object]


@dataclass(frozen=True, kw_only=True)
class SimulatorOrder:
    """The order in which a simulator lists a robot's joints and bodies."""

    simulator: Simulator

    joints: _Names
    """Joints of the main tree with one degree of freedom, those that mimic another included."""

    bodies: _Names
    """Bodies from the base down, with fixed joints merged as the simulator does by default."""

    certain: bool
    """Whether the order of the joints is known; otherwise it is likely, and to be verified. That of
    the bodies hangs also on what is merged."""

    reason: str
    """Why it is certain, or how to verify it."""

    @property
    def key(self) -> str:
        """Return the name of the simulator as JSON has it, such as `isaac_gym`."""
        return self.simulator.lower().replace(" ", "_")


def simulator_orders(facts: "Facts") -> tuple[SimulatorOrder, ...]:
    """Return the order in MuJoCo, Isaac Gym, Isaac Lab and Genesis."""
    orders = []
    for simulator in SIMULATORS:
        tree = merge(facts, merged_joints(facts, simulator))
        joints, bodies = ((), ()) if tree is None else _listed(facts, tree, simulator)
        certain, reason = _certainty(facts, simulator)
        orders.append(
            SimulatorOrder(
                simulator=simulator, joints=joints, bodies=bodies, certain=certain, reason=reason
            )
        )
    return tuple(orders)


def file_order(facts: "Facts") -> _Names:
    """Return the joints that `simulator_orders` lists in the order of the file."""
    known = set(facts.joints)
    return tuple(joint.name for joint in facts.model.joints if joint in known)


# Walks


def _listed(facts: "Facts", tree: Merged, simulator: Simulator) -> tuple[_Names, _Names]:
    """Return the likely order of joints and bodies."""
    urdf = facts.model.kind != "mjcf"
    match simulator:
        case "MuJoCo":
            key: _Key | None = None
        case "Genesis":
            key = _place_in(facts)
        case _:
            key = _joint_name if urdf else None
    walk = _levels if simulator == "Isaac Lab" else _depth_first
    return _names(facts, tree, walk(_sorted(tree, key), tree.base))


def _names(facts: "Facts", tree: Merged, walked: Iterator[Joint]) -> tuple[_Names, _Names]:
    joints = list(walked)
    virtual = {link.name for body in facts.bodies for link in body.links if link.virtual}
    bodies = [tree.base, *(joint.child for joint in joints)]
    return (
        tuple(joint.name for joint in joints if joint.moves),
        tuple(body for body in bodies if body not in virtual),
    )


_Below = dict[str, tuple[Joint, ...]]


def _sorted(tree: Merged, key: _Key | None) -> _Below:
    """Return the joints below each body, sorted; without a key as they are."""
    if key is None:
        return dict(tree.below)
    return {body: tuple(sorted(joints, key=key)) for body, joints in tree.below.items()}  # type: ignore[arg-type]


def _depth_first(below: _Below, base: str) -> Iterator[Joint]:
    stack = list(reversed(below[base]))
    while stack:
        joint = stack.pop()
        yield joint
        stack.extend(reversed(below[joint.child]))


def _levels(below: _Below, base: str) -> Iterator[Joint]:
    level = list(below[base])
    while level:
        yield from level
        level = [joint for above in level for joint in below[above.child]]


# Orders of siblings


def _place_in(facts: "Facts") -> _Key:
    place = {joint: index for index, joint in enumerate(facts.model.joints)}
    return lambda joint: place[joint]


def _joint_name(joint: Joint) -> object:
    return _usd(joint.name)


def _link_name(joint: Joint) -> object:
    return _usd(joint.child)


def _usd(name: str) -> str:
    """Return a name as USD has it: only letters, digits and underscores."""
    return re.sub(r"[^A-Za-z0-9_]", "_", name)


# What is certain


def _certainty(facts: "Facts", simulator: Simulator) -> tuple[bool, str]:
    if facts.tree.left_out:
        return False, "links or joints are missing from the tree"
    if any(joint.kind not in JOINT_TYPES for joint in facts.model.joints):
        return False, "a joint is of a type that is not known"
    urdf = facts.model.kind != "mjcf"
    match simulator:
        case "MuJoCo":
            what = "joints" if urdf else "bodies"
            return True, f"depth first, siblings as their {what} stand in the file"
        case "Genesis":
            return True, (
                "depth first, siblings as in the file, in genesis-world 1.4.5; "
                "older versions go level by level"
            )
        case "Isaac Lab":
            return _isaac_lab(facts, urdf)
        case "Isaac Gym":
            return _isaac_gym(facts, urdf)


def _isaac_lab(facts: "Facts", urdf: bool) -> tuple[bool, str]:
    if _agree(facts, _levels, (None, _place_in(facts), _joint_name), _mergings(facts)):
        return True, "level by level; siblings have one order by name and in the file"
    likely = (
        "siblings by the name of the joint, as the importers up to Isaac Sim 5.1 write them"
        if urdf
        else "siblings as in the file"
    )
    return False, f"level by level, {likely}; compare with robot.joint_names"


def _isaac_gym(facts: "Facts", urdf: bool) -> tuple[bool, str]:
    ways = (None, _place_in(facts), _joint_name, _link_name)
    if _agree(facts, _depth_first, ways, _mergings(facts)):
        return True, "depth first; siblings have one order by name and in the file"
    likely = (
        "siblings by the name of the joint, as in the lists published for A1 and Go1"
        if urdf
        else "siblings as in the file"
    )
    return False, f"depth first, {likely}; compare with gym.get_asset_dof_names(asset)"


def _mergings(facts: "Facts") -> Iterator[Merged]:
    """Yield the tree with all fixed joints merged, with those above massless links, with none.

    Importers of different age differ in this.
    """
    fixed = fixed_joints(facts)
    light = {
        joint
        for joint in fixed
        if (i := facts.tree.links[joint.child].inertial) is None or not i.mass
    }
    tried: list[set[Joint]] = []
    for merges in (set(fixed), {j for j in fixed if not j.dont_collapse}, light, set[Joint]()):
        if merges not in tried:
            tried.append(merges)
            tree = merge(facts, merges)
            if tree is not None:
                yield tree


def _agree(
    facts: "Facts",
    walk: Callable[[_Below, str], Iterator[Joint]],
    keys: Sequence[_Key | None],
    trees: Iterator[Merged],
) -> bool:
    """Return whether all that could be is one order of the joints."""
    if any(body.virtual for body in facts.bodies):
        return False  # importers make one joint of several
    orders = {
        tuple(id(joint) for joint in walk(_sorted(tree, key), tree.base) if joint.moves)
        for tree in trees
        for key in keys
    }
    return len(orders) <= 1
