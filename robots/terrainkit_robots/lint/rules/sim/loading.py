"""Rule that loads the file with MuJoCo."""

import re
from itertools import islice
from pathlib import Path

from terrainkit.settings.text import truncate
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.simulator_conventions.loading import LoadError, mujoco_load_error
from terrainkit_robots.description.model import Source
from terrainkit_robots.lint.rule import (
    Element,
    Part,
    Severity,
    Violation,
    Violations,
    findings_of,
    rule,
)
from terrainkit_robots.text import names

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
    (r"coplanar|mesh (?:volume|surface area) is too small", "MSH010 MSH011"),
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


@rule("SIM004", "mujoco-load-failure", "error", needs=("simulation",))
def mujoco_load_failure(robot: Facts) -> Violations:
    """MuJoCo cannot load the unmodified file.

    MuJoCo stops at the first error, so there may be more. mjlab and Genesis load robots with MuJoCo
    as well. The finding is only a note in three cases: another rule reports an error with the same
    cause; MuJoCo does not find a mesh because its path starts with `package://`; or a file beside
    this one includes it, and may define the element that MuJoCo does not find.

    Fix:
        Correct the reported element; the rule in the help explains how. If MuJoCo does not find an
        existing mesh, check meshdir and strippath of <compiler>. If another file includes this one,
        check that file instead.

    Source:
        The file is compiled with the installed version of MuJoCo. If MuJoCo stops at a mesh file of
        a URDF, the file is compiled again with other meshes. Nothing is simulated.
    """
    if any(robot.meshes.has_contents(path) for path in robot.model.sources):
        raise CannotCheckError("the file has fixes that are not written yet")
    refusals: list[LoadError | None] = []
    reason = ""
    try:
        refusals.append(mujoco_load_error(robot.model))
    except CannotCheckError as error:
        reason = str(error)
    is_mesh_error = any(refusal and re.search(_MESH_ERROR, refusal.message) for refusal in refusals)
    if (reason or is_mesh_error) and robot.model.kind == "urdf":
        try:
            refusals.append(mujoco_load_error(robot.model, with_meshes=False))
        except CannotCheckError as error:
            reason = reason or str(error)
    if not refusals:
        raise CannotCheckError(reason)
    for refusal in refusals:
        if refusal is not None:
            code, severity = _explaining_rule(robot, refusal.message)
            if "package:" in refusal.message and any(findings_of(robot, "MSH003")):
                code = "MSH003"  # a missing visual mesh is only a warning, and not the cause
            is_explained = severity == "error" or code == "MSH003"
            if "not found in" in refusal.message and _is_included(robot.model.file):
                is_explained = True
            yield _load_failure(robot, refusal, code, "note" if is_explained else "error")


def _is_included(file: Path) -> bool:
    """Return whether an MJCF file in the same folder includes a file."""
    include = re.compile(rb"<include\s[^>]*file\s*=\s*[\"']" + re.escape(file.name).encode())
    others = (path for path in islice(file.parent.glob("*.xml"), _MAX_SIBLINGS) if path != file)
    small = (path for path in others if path.is_file() and path.stat().st_size < _MAX_BYTES)
    return any(include.search(path.read_bytes()) for path in small)


def _explaining_rule(robot: Facts, message: str) -> tuple[str, Severity]:
    """Return the rule that explains an error of MuJoCo, and the highest severity that it reports.

    Returns:
        Code and severity; an empty code if no rule with findings explains the error.
    """
    for problem in robot.model.problems:
        if message in problem.message:
            return problem.code, "error"
    order: tuple[Severity, ...] = ("note", "warning", "error")
    best: tuple[str, Severity] = "", "note"
    codes = next((known for pattern, known in _EXPLAINED_BY if re.search(pattern, message)), "")
    for code in codes.split():
        try:
            found = [finding.severity for finding in findings_of(robot, code)]
        except CannotCheckError:
            continue
        if found:
            severity = max(found, key=order.index)
            if not best[0] or order.index(severity) > order.index(best[1]):
                best = code, severity
    return best


def _load_failure(robot: Facts, refusal: LoadError, code: str, severity: Severity) -> Violation:
    parts: tuple[Element, ...] = (*robot.model.joints, *robot.model.links)
    elements = {part.name: part for part in parts if part.name}
    source = robot.model.source
    if refusal.line:
        source = Source(file=robot.model.file, line=refusal.line)
    suffix = f" ({names([refusal.element])})" if refusal.element else ""
    return Violation(
        element=elements.get(refusal.element) or Part(robot.model.title, source),
        message=f"MuJoCo cannot load the file: {truncate(refusal.message, 200)}{suffix}",
        hint=f"See rule {code}." if code else "",
        severity=severity,
    )
