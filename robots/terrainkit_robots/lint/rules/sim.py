"""SIM: rules on how simulators load the robot."""

import re
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from terrainkit.settings.text import truncate
from terrainkit_robots.analysis.bodies.joint_order import permutation
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.simulator_conventions.armature import (
    GENESIS_ARMATURE,
    inertia_without_armature,
)
from terrainkit_robots.analysis.simulator_conventions.fixed_joints import (
    KEEP_LINK_OPTIONS,
    SIMULATORS,
    find_merged_feet,
)
from terrainkit_robots.analysis.simulator_conventions.joint_order import (
    SimulatorOrder,
)
from terrainkit_robots.description.model import Source
from terrainkit_robots.lint.rule import Severity, Violation, get_rule, rule
from terrainkit_robots.text import names

if TYPE_CHECKING:
    from terrainkit_robots.analysis.simulator_conventions.loading import LoadError

_MAX_JOINTS = 40
"""Maximum number of joints for which the message contains the permutation."""

_EXPLAINED_BY: tuple[tuple[str, str], ...] = (
    (r"mass and inertia of moving bodies", "INR001 INR002 INR003 XML006"),
    (r"positive eigenvalues", "INR003"),
    (r"A \+ B >= C", "INR004"),
    (r"axis too small", "JNT004"),
    (r"invalid joint type", "JNT001"),
    (r"repeated in equality constraint", "JNT013"),
    (r"must be positive in geom", "COL004"),
    (r"no decoder found|unknown or unsupported mesh", "MSH005 MSH013"),
    (r"_decoder", "MSH006 MSH007 MSH008 MSH010 MSH013"),
    (r"coplanar|mesh volume is too small", "MSH010"),
    (r"repeated element", "XML008 XML015"),
    (r"repeated URDF name|repeated name|repeated joint|repeated body", "TRE001 XML011"),
    (r"joint parent or child missing", "TRE002 XML013"),
    (r"multiple parents", "TRE003"),
    (r"URDF body not found", "TRE004"),
    (r"free joint can only be used on top level", "TRE008"),
    (r"attribute missing|missing element", "XML013 INR001 INR003 JNT001"),
    (r"bad format|enough data|too much data", "XML006 XML004"),
    (r"Schema violation|unrecognized|unknown|not found", "XML011 XML007"),
    (r"model type", "XML002"),
    (r"could not parse|XML parse error|Error=XML_", "XML001 XML010"),
    (r"Error opening file|already included", "MSH001 MSH002 MSH003 MSH004 XML012"),
)
"""Patterns of MuJoCo error messages, and the rules that may explain them."""

_MAX_SIBLINGS, _MAX_BYTES = 200, 2**20
"""Number and size of the files in a folder that are searched for an <include>."""

_MESH_ERROR = r"Error opening file|decoder|mesh"
"""Pattern of MuJoCo error messages about mesh files. More errors may follow without them."""


@rule("SIM001", "joint-order", "info")
def joint_order(robot: Facts) -> Iterator[Violation]:
    """A simulator orders the joints differently from the file.

    The observations and actions of a policy are ordered by joint. A policy that was trained in one
    simulator fails in another one, or on the real robot, unless they are reordered. Isaac Lab
    traverses the tree breadth-first, the other simulators depth-first.

    Fix:
        Address joints by name, or reorder by the printed list: `there = [here[i] for i in order]`,
        where `here` is in the order of the file. The JSON report contains all orders under
        `joint_orders`.

    Source:
        Compared with MuJoCo's compiler, genesis-world 1.4.5, Isaac Sim's URDF importer, and
        published joint lists for Isaac Lab and Isaac Gym. An order that these do not confirm is
        marked as unverified.
    """
    file = robot.file_order
    others = [order for order in robot.simulator_orders if order.joints != file]
    if not others:
        return
    same = [name for name in SIMULATORS if name not in {order.simulator for order in others}]
    orders = "; ".join(_format_order(order, file) for order in others)
    rest = f"; {_join(same)}: same as the file" if same else ""
    yield Violation(
        subject=robot.model.title,
        source=robot.model.source,
        message=f"joint order, as indices into the file's order: {orders}{rest}",
        certainty="proven" if all(order.certain for order in others) else "likely",
        measured={"joints": len(file)},
    )


def _format_order(order: SimulatorOrder, file: Sequence[str]) -> str:
    unverified = "" if order.certain else " (unverified)"
    indices = permutation(file, order.joints)
    if indices is None:
        raise CannotCheckError("two joints have the same name")
    if len(indices) > _MAX_JOINTS:
        return f"{order.simulator}{unverified}: different ({len(indices)} joints)"
    return f"{order.simulator}{unverified}: {indices}"


def _join(items: Sequence[str]) -> str:
    *first, last = items
    return f"{', '.join(first)} and {last}" if first else last


@rule("SIM002", "merged-feet", "info", needs=("legs",))
def merged_feet(robot: Facts) -> Iterator[Violation]:
    """A simulator merges the feet into the shanks by default.

    A foot on a fixed joint is then not a separate body: its name does not exist, and contact forces
    are reported for the shank. Each simulator has its own option to keep it.

    Fix:
        MuJoCo: `<mujoco><compiler fusestatic="false"/></mujoco>` in the URDF. Isaac Gym and Isaac
        Lab: `dont_collapse="true"` on the fixed joint. Genesis: name the feet in `links_to_keep` of
        `gs.morphs.URDF`.

    Source:
        MuJoCo's `fusestatic`, which is enabled for URDF; legged_gym's `collapse_fixed_joints`;
        Isaac Lab's `merge_fixed_joints`; `merge_fixed_links` of genesis-world 1.4.5.
    """
    merges = find_merged_feet(robot.tree, robot.bodies, robot.legs, robot.fixed_joints)
    if not merges:
        return
    first = merges[0]
    by = [s for s in SIMULATORS if any(s in merge.merged_body for merge in merges)]
    into = next(iter(first.merged_body.values()))
    example = f"{first.foot} into {into}" + (", ..." if len(merges) > 1 else "")
    yield Violation(
        subject=first.foot,
        source=first.joint.source,
        message=(
            f"{_join(by)} merge{'s' * (len(by) == 1)} {len(merges)} feet into their parent links "
            f"by default ({example})"
        ),
        hint="; ".join(f"{simulator}: {KEEP_LINK_OPTIONS[simulator]}" for simulator in by),
        measured={"feet": len(merges)},
    )


@rule("SIM003", "genesis-armature", "info")
def genesis_armature(robot: Facts) -> Iterator[Violation]:
    """The default armature of Genesis exceeds the inertia that a joint moves.

    Genesis sets the armature of a joint without one to 0.1 kg m2, ten times that of a small legged
    robot. The joint accelerates much more slowly than in other simulators, and a policy trained
    with it does not transfer.

    Fix:
        Set `default_armature` of gs.morphs.URDF or gs.morphs.MJCF to that of your motor: rotor
        inertia times the square of the gear ratio.

    Source:
        `default_armature` in genesis-world 1.4.5 is 0.1 unless MuJoCo compatibility is enabled. It
        is compared with the inertia about the joint axis of all links below, at joint positions 0.
    """
    moved = inertia_without_armature(robot.bodies, robot.actuated)
    slowed = [each for each in moved if each.inertia < GENESIS_ARMATURE]
    if not slowed:
        return
    worst = min(slowed, key=lambda each: each.inertia)
    unit = "kg" if worst.joint.kind == "prismatic" else "kg m2"
    yield Violation(
        subject=worst.joint.name,
        source=worst.joint.source,
        message=(
            f"default armature of Genesis: {GENESIS_ARMATURE} {unit} exceeds the moved inertia of "
            f"{len(slowed)} of {len(robot.actuated)} joints; smallest: {worst.joint.name} with "
            f"{worst.inertia:.2g} {unit}"
        ),
        measured={"inertia": worst.inertia, "joints": len(slowed)},
    )


@rule("SIM004", "mujoco-load-failure", "error", needs=("simulation",))
def mujoco_load_failure(robot: Facts) -> Iterator[Violation]:
    """MuJoCo cannot load the unmodified file.

    MuJoCo stops at the first error, so there may be more. mjlab and Genesis load robots with MuJoCo
    as well. This is only a note if an error of another rule has the same cause, if MuJoCo does not
    find a mesh because its path starts with `package://`, or if the file is a part: a file beside
    it includes it and may define the element that MuJoCo does not find.

    Fix:
        Correct the reported element; the rule in the help explains how. If MuJoCo does not find an
        existing mesh, check meshdir and strippath of <compiler>. If another file includes this one,
        check that file instead.

    Source:
        The file is compiled with the installed version of MuJoCo. If MuJoCo stops at a mesh file of
        a URDF, the file is compiled again with other meshes. Nothing is simulated.
    """
    from terrainkit_robots.analysis.simulator_conventions.loading import (
        LoadError,
        NotAttemptedError,
        mujoco_load_error,
    )

    _require_saved(robot)
    refusals: list[LoadError | None] = []
    reason = ""
    try:
        refusals.append(mujoco_load_error(robot.model))
    except NotAttemptedError as error:
        reason = str(error)
    is_mesh_error = any(each and re.search(_MESH_ERROR, each.message) for each in refusals)
    if (reason or is_mesh_error) and robot.model.kind == "urdf":
        try:
            refusals.append(mujoco_load_error(robot.model, with_meshes=False))
        except NotAttemptedError as error:
            reason = reason or str(error)
    if not refusals:
        raise CannotCheckError(reason)
    for refusal in refusals:
        if refusal is not None:
            code, severity = _explaining_rule(robot, refusal.message)
            is_explained = severity == "error" or code == "MSH003"
            if "not found in" in refusal.message and _is_included(robot.model.file):
                is_explained = True
            yield _load_failure(
                robot, "MuJoCo", refusal, code, severity="info" if is_explained else "error"
            )


def _is_included(file: Path) -> bool:
    """Return whether an MJCF file in the same folder includes a file."""
    include = re.compile(rb"<include\s[^>]*file\s*=\s*[\"']" + re.escape(file.name).encode())
    others = (path for path in islice(file.parent.glob("*.xml"), _MAX_SIBLINGS) if path != file)
    small = (path for path in others if path.is_file() and path.stat().st_size < _MAX_BYTES)
    return any(include.search(path.read_bytes()) for path in small)


@rule("SIM005", "yourdfpy-load-failure", "info", needs=("simulation",))
def yourdfpy_load_failure(robot: Facts) -> Iterator[Violation]:
    """The library yourdfpy cannot load the unmodified file.

    Python tools for retargeting, planning and visualization load URDF with yourdfpy. It is only
    tried on files with XML problems, since importing it takes longer than all other rules.

    Fix:
        Correct the reported element. The message is from yourdfpy.

    Source:
        The file is loaded with the installed version of yourdfpy, without meshes.
    """
    from terrainkit_robots.analysis.simulator_conventions.loading import (
        NotAttemptedError,
        yourdfpy_load_error,
    )

    if robot.model.kind == "mjcf" or not robot.model.problems:
        return
    _require_saved(robot)
    try:
        refusal = yourdfpy_load_error(robot.model, robot.tree)
    except NotAttemptedError as reason:
        raise CannotCheckError(str(reason)) from None
    if refusal is not None:
        yield _load_failure(robot, "yourdfpy", refusal, "", severity="info")


def _require_saved(robot: Facts) -> None:
    """Raise an error if the file has unsaved fixes: both libraries read it from disk."""
    if any(robot.meshes.has_contents(path) for path in robot.model.sources):
        raise CannotCheckError("the file has fixes that are not written yet")


def _explaining_rule(robot: Facts, message: str) -> tuple[str, Severity]:
    """Return the rule that explains an error of MuJoCo, and the highest severity that it reports.

    Returns:
        Code and severity; an empty code if no rule with findings explains the error.
    """
    for problem in robot.model.problems:
        if message in problem.message:
            return problem.code, "error"
    order: tuple[Severity, ...] = ("info", "warning", "error")
    best: tuple[str, Severity] = "", "info"
    codes = next((each for pattern, each in _EXPLAINED_BY if re.search(pattern, message)), "")
    for each in map(get_rule, codes.split()):
        try:
            found = [violation.severity or each.severity for violation in each.check(robot)]
        except CannotCheckError:
            continue
        if found:
            severity = max(found, key=order.index)
            if not best[0] or order.index(severity) > order.index(best[1]):
                best = each.code, severity
    return best


def _load_failure(
    robot: Facts, loader: str, refusal: "LoadError", code: str, *, severity: Severity
) -> Violation:
    sources = {link.name: link.source for link in robot.model.links}
    sources = {joint.name: joint.source for joint in robot.model.joints} | sources
    source = sources.get(refusal.element) if refusal.element else None
    element = f" ({names([refusal.element])})" if refusal.element else ""
    if source is None and refusal.line:
        source = Source(file=robot.model.file, line=refusal.line)
    return Violation(
        subject=refusal.element if refusal.element in sources else robot.model.title,
        source=source or robot.model.source,
        message=f"{loader} cannot load the file: {truncate(refusal.message, 200)}{element}",
        hint=f"See rule {code}." if code else "",
        severity=severity,
    )
