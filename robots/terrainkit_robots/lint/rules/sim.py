"""Simulators: what each of them makes of the file."""

import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from terrainkit_robots.analysis.bodies.joint_order import permutation
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.simulator_conventions.armature import (
    GENESIS_ARMATURE,
    moved_by_joints,
)
from terrainkit_robots.analysis.simulator_conventions.fixed_joints import (
    SIMULATORS,
    TO_KEEP,
    foot_merges,
)
from terrainkit_robots.analysis.simulator_conventions.joint_order import (
    SimulatorOrder,
    file_order,
    simulator_orders,
)
from terrainkit_robots.lint.rule import Violation, rule
from terrainkit_robots.text import names, short

if TYPE_CHECKING:
    from terrainkit_robots.analysis.simulator_conventions.loading import Refusal

_MOST_SHOWN = 40
"""Of more joints the permutation is no message; the JSON report has it."""

_TELLING: tuple[tuple[str, str], ...] = (
    (r"mass and inertia of moving bodies", "INR001"),
    (r"positive eigenvalues", "INR003"),
    (r"A \+ B >= C", "INR004"),
    (r"package:/", "MSH003"),
    (r"no decoder found|unknown or unsupported mesh", "MSH005"),
    (r"number of faces should be between", "MSH008"),
    (r"coplanar|mesh volume is too small", "MSH010"),
    (r"repeated element: 'material'", "XML008"),
    (r"repeated name|repeated joint|repeated body", "TRE001"),
    (r"multiple parents", "TRE003"),
    (r"free joint can only be used on top level", "TRE008"),
    (r"could not parse|Error=XML_", "XML001"),
)
"""Words of MuJoCo's, and the rule that says more of what they mean."""


@rule("SIM001", "joint-order", "info")
def joint_order(robot: Facts) -> Iterator[Violation]:
    """A simulator lists the joints in another order than the file.

    A policy's observations and actions are lists of numbers in the order of the joints. One that
    was trained in one simulator falls over in another, or on the real robot, until they are
    reordered. Isaac Lab goes through the robot level by level, the others limb by limb.

    Fix:
        Reorder by the list that is printed: `there = [here[i] for i in order]`, where `here` is in
        the order of the file. Better: address joints by their names. The JSON report has all orders
        under `joint_orders`.

    Source:
        MuJoCo's compiler and genesis-world 1.4.5, with which the orders were compared; Isaac Sim's
        URDF importer, and joint lists published for Isaac Lab and Isaac Gym. Where these do not
        settle it, the order is said to be verified.
    """
    file = file_order(robot)
    others = [order for order in simulator_orders(robot) if order.joints != file]
    if not others:
        return
    same = [name for name in SIMULATORS if name not in {order.simulator for order in others}]
    told = "; ".join(_order(order, file) for order in others)
    rest = f"; {_listed(same)} as the file" if same else ""
    yield Violation(
        subject=robot.model.title,
        source=robot.model.source,
        message=f"joints by their number in the file: {told}{rest}",
        certainty="proven" if all(order.certain for order in others) else "likely",
        measured={"joints": len(file)},
    )


def _order(order: SimulatorOrder, file: Sequence[str]) -> str:
    doubt = "" if order.certain else " (to be verified)"
    places = permutation(file, order.joints)
    if places is None:
        raise CannotCheckError("two joints have one name")
    if len(places) > _MOST_SHOWN:
        return f"{order.simulator}{doubt} another order of all {len(places)}"
    return f"{order.simulator}{doubt} {places}"


def _listed(words: Sequence[str]) -> str:
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last


@rule("SIM002", "merged-feet", "info", needs=("legs",))
def merged_feet(robot: Facts) -> Iterator[Violation]:
    """A simulator merges the feet into the shanks, unless it is told not to.

    A foot on a fixed joint is no body of its own there: its name is not found, and contact forces
    are those of the shank. An attribute in the file keeps it in some simulators only.

    Fix:
        MuJoCo: `<mujoco><compiler fusestatic="false"/></mujoco>` in the URDF. Isaac Gym and Isaac
        Lab: `dont_collapse="true"` on the fixed joint. Genesis: name the feet in `links_to_keep` of
        `gs.morphs.URDF`.

    Source:
        MuJoCo's `fusestatic`, which is on for URDF; legged_gym's `collapse_fixed_joints`; Isaac
        Lab's `merge_fixed_joints`; `merge_fixed_links` of genesis-world 1.4.5.
    """
    merges = foot_merges(robot)
    if not merges:
        return
    first = merges[0]
    by = [s for s in SIMULATORS if any(s in merge.into for merge in merges)]
    into = next(iter(first.into.values()))
    example = f"{first.foot} into {into}" + (", ..." if len(merges) > 1 else "")
    yield Violation(
        subject=first.foot,
        source=first.joint.source,
        message=(
            f"{_listed(by)} merge{'s' * (len(by) == 1)} {len(merges)} feet away unless told "
            f"({example})"
        ),
        hint="; ".join(f"{simulator}: {TO_KEEP[simulator]}" for simulator in by),
        measured={"feet": len(merges)},
    )


@rule("SIM003", "genesis-armature", "info")
def genesis_armature(robot: Facts) -> Iterator[Violation]:
    """Genesis gives joints a rotor inertia that is larger than what they move.

    A joint without armature gets 0.1 kg m2 there. That is ten times the rotor of a small legged
    robot: the joint reacts to the same torque many times slower than in other simulators, and
    a policy that was trained with it does not transfer.

    Fix:
        Give gs.morphs.URDF or MJCF a `default_armature` that is your motor's: rotor inertia times
        the square of the gear ratio.

    Source:
        `default_armature` of the morphs of genesis-world 1.4.5, 0.1 unless MuJoCo's compatibility
        is switched on. Compared with the inertia about each axis of all that the joint moves, the
        other joints at 0.
    """
    moved = moved_by_joints(robot)
    slowed = [each for each in moved if each.inertia < GENESIS_ARMATURE]
    if not slowed:
        return
    worst = min(slowed, key=lambda each: each.inertia)
    unit = "kg" if worst.joint.kind == "prismatic" else "kg m2"
    yield Violation(
        subject=worst.joint.name,
        source=worst.joint.source,
        message=(
            f"Genesis adds {GENESIS_ARMATURE} {unit} of armature by default to joint "
            f"{worst.joint.name}, which moves {worst.inertia:.2g} {unit}; {len(slowed)} of "
            f"{len(robot.actuated)} joints get more than they move"
        ),
        measured={"inertia": worst.inertia, "joints": len(slowed)},
    )


@rule("SIM004", "mujoco-load-failure", "info", needs=("simulation",))
def mujoco_load_failure(robot: Facts) -> Iterator[Violation]:
    """MuJoCo does not load the file as it stands.

    MuJoCo stops at the first thing that it does not like, so that there may be more. Readers of
    MuJoCo's are the base of mjlab and Genesis as well.

    Fix:
        Repair what it names; the rule that is named says how. Where a mesh is not found that is
        there, look at meshdir and strippath of the <compiler> in the file.

    Source:
        The file is compiled with the MuJoCo that is installed; nothing is simulated.
    """
    from terrainkit_robots.analysis.simulator_conventions.loading import (
        NotTriedError,
        refused_by_mujoco,
    )

    _check_unchanged(robot)
    try:
        refusal = refused_by_mujoco(robot)
    except NotTriedError as reason:
        raise CannotCheckError(str(reason)) from None
    if refusal is not None:
        yield _refused(robot, "MuJoCo", refusal, _more(robot, refusal.words))


@rule("SIM005", "yourdfpy-load-failure", "info", needs=("simulation",))
def yourdfpy_load_failure(robot: Facts) -> Iterator[Violation]:
    """The library yourdfpy does not load the file as it stands.

    Retargeting, planning and viewing tools in Python read URDF with it.

    Fix:
        Repair what it names. It says so in the words of the library that failed.

    Source:
        The file is read with the yourdfpy that is installed; no meshes are opened.
    """
    from terrainkit_robots.analysis.simulator_conventions.loading import (
        NotTriedError,
        refused_by_yourdfpy,
    )

    if robot.model.kind == "mjcf":
        return
    _check_unchanged(robot)
    try:
        refusal = refused_by_yourdfpy(robot)
    except NotTriedError as reason:
        raise CannotCheckError(str(reason)) from None
    if refusal is not None:
        yield _refused(robot, "yourdfpy", refusal, "")


def _check_unchanged(robot: Facts) -> None:
    """Refuse what is not on disk yet: both open files by themselves."""
    if any(robot.meshes.is_held(path) for path in robot.model.sources):
        raise CannotCheckError("the file is to be changed; ask again once it is written")


def _more(robot: Facts, words: str) -> str:
    """Return the code of the rule that says more of what MuJoCo said; empty if none does."""
    for pattern, code in _TELLING:
        if re.search(pattern, words):
            return code
    missing = re.search(r"Error opening file '([^']*)'", words)
    if missing is None:
        return ""
    name = re.split(r"[/\\]", missing[1])[-1]
    meshes = [
        shape.mesh
        for link in robot.model.links
        for shape in (*link.collisions, *link.visuals)
        if shape.mesh is not None and re.split(r"[/\\]", shape.mesh.filename)[-1] == name
    ]
    found = [mesh for mesh in meshes if robot.meshes.exists(mesh.path)]
    if len(found) < len(meshes):
        return "MSH001"
    return "" if all(mesh.found_by == "path" for mesh in found) else "MSH002"


def _refused(robot: Facts, reader: str, refusal: "Refusal", code: str) -> Violation:
    named = refusal.element
    sources = {each.name: each.source for each in robot.model.joints}
    sources |= {each.name: each.source for each in robot.model.links}
    source = sources.get(named) if named else None
    where = f" ({names([named])})" if named else ""
    return Violation(
        subject=named if source is not None else robot.model.title,
        source=source or robot.model.source,
        message=f"{reader} does not load it as it stands: {short(refusal.words, 200)}{where}",
        hint=f"{code} says more of this." if code else "",
    )
