"""Fixed joints: which of them a simulator merges away, and what becomes of the feet.

A link on a fixed joint moves as a part of its parent, so most importers make one body of both. The
body keeps the name of the upper link: what is looked for under the name of the lower one, such as a
foot's contact force, is then not there.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal, get_args

from terrainkit_robots.description.model import Joint

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

Simulator = Literal["MuJoCo", "Isaac Gym", "Isaac Lab", "Genesis"]

SIMULATORS: tuple[Simulator, ...] = get_args(Simulator)

TO_KEEP: Mapping[Simulator, str] = MappingProxyType(
    {
        "MuJoCo": '<mujoco><compiler fusestatic="false"/></mujoco> in the URDF',
        "Isaac Gym": 'dont_collapse="true" on the joint, or collapse_fixed_joints = False',
        "Isaac Lab": 'dont_collapse="true" on the joint, or merge_fixed_joints=False',
        "Genesis": "links_to_keep=[...] of gs.morphs.URDF, or merge_fixed_links=False",
    }
)
"""What keeps a link on a fixed joint as a body of its own. MuJoCo, Isaac Lab and Genesis merge
unless told; Isaac Gym does as legged_gym and its kin tell it."""

_ATTRIBUTE = frozenset({"Isaac Gym", "Isaac Lab"})
"""Those whose importers look at dont_collapse."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Merged:
    """A tree of links, once fixed joints are merged."""

    base: str
    """Name of its root."""

    home: Mapping[str, str]
    """The body that each link is a part of, by the link's name; a body has the name of its top
    link."""

    below: Mapping[str, tuple[Joint, ...]]
    """The joints to the bodies below each body. Those of a link that was merged stand where its own
    joint did."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FootMerge:
    """A foot that some simulators merge away."""

    foot: str
    """Name of the link."""

    joint: Joint
    """The fixed joint that it hangs on."""

    into: Mapping[Simulator, str]
    """The body that it becomes a part of, for each simulator that merges it."""


def keeps(simulator: Simulator, joint: Joint) -> bool:
    """Return whether a simulator keeps what hangs on a fixed joint of a URDF as a body."""
    return joint.dont_collapse and simulator in _ATTRIBUTE


def merge(facts: "Facts", merges: frozenset[Joint] | set[Joint]) -> Merged | None:
    """Return the main tree from the base down with some joints merged; None without any link.

    Args:
        facts: The robot.
        merges: The joints to be merged.
    """
    if not facts.bodies:
        return None
    base = facts.bodies[0].top.name
    home = {base: base}
    below: dict[str, list[Joint]] = {base: []}
    for link in facts.tree.order:  # depth first, each after its parent
        if link == base or link not in facts.body_of:
            continue
        joint = facts.tree.above[link]
        parent = home[joint.parent]
        if joint in merges:
            home[link] = parent
        else:
            home[link] = link
            below[link] = []
            below[parent].append(joint)
    return Merged(base=base, home=home, below={k: tuple(v) for k, v in below.items()})


def merged_joints(facts: "Facts", simulator: Simulator) -> frozenset[Joint]:
    """Return the joints of the main tree that a simulator merges.

    Those are the fixed ones of a URDF, and those of a type that is not known. The bodies of MJCF
    stay as they are.
    """
    return frozenset(joint for joint in fixed_joints(facts) if not keeps(simulator, joint))


def fixed_joints(facts: "Facts") -> tuple[Joint, ...]:
    """Return the joints of the main tree of a URDF that hold two links together."""
    if facts.model.kind == "mjcf":
        return ()
    tops = {body.top.name for body in facts.bodies}
    return tuple(facts.tree.above[link] for link in facts.body_of if link not in tops)


def foot_merges(facts: "Facts") -> tuple[FootMerge, ...]:
    """Return the feet with a shape of their own that at least one simulator merges away."""
    fixed = set(fixed_joints(facts))
    found = []
    merged = {
        simulator: merge(facts, merged_joints(facts, simulator))
        for simulator in (SIMULATORS if fixed and facts.legs else ())
    }
    for leg in facts.legs:
        joint = facts.tree.above.get(leg.foot)
        if joint is None or joint not in fixed or not facts.tree.links[leg.foot].collisions:
            continue
        into = {
            simulator: tree.home[leg.foot]
            for simulator, tree in merged.items()
            if tree is not None and tree.home[leg.foot] != leg.foot
        }
        if into:
            found.append(FootMerge(foot=leg.foot, joint=joint, into=into))
    return tuple(found)
