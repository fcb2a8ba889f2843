"""Rules on the paths of mesh files."""

import re
from pathlib import Path
from typing import Literal

from terrainkit.errors import TerrainkitError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.meshes.uses import (
    UsedMesh,
    is_in_other_folder,
    is_missing,
    relative_name,
    rename_edits,
)
from terrainkit_robots.description.fix import Fix, make_fix
from terrainkit_robots.description.package_resolver import (
    filename_on_disk,
    is_absolute,
    is_folder,
    is_package_uri,
)
from terrainkit_robots.description.xml.document import read_bytes
from terrainkit_robots.lint.rule import Severity, Violation, Violations, rule
from terrainkit_robots.text import names, short_path


def not_loaded(used: UsedMesh) -> Severity:
    """Return how severe it is that a file cannot be loaded, whatever the cause.

    Training does not need the visual meshes of a URDF; MuJoCo needs all meshes of an MJCF file.
    """
    return "error" if used.strict else "warning"


_MAX_PARENT_FOLDERS = 3
"""Maximum number of `..` in a relative path, enough for another package of the same workspace."""


@rule("MSH001", "missing-mesh", "error", fixes="unsafe", onboarding="repairs")
def missing_mesh(robot: Facts) -> Violations:
    """A mesh file does not exist.

    MuJoCo stops at the first collision mesh that it cannot open. Isaac Sim, Genesis and PyBullet
    may continue with a link that has no collision shape or is invisible. A missing visual mesh of a
    URDF is a warning, because it does not affect training. MuJoCo requires the visual meshes of an
    MJCF file as well, so there it is an error.

    Fix:
        Add the file, correct its path, or set the folder of a package with --package NAME=DIR. If a
        file of that name exists nearby, --unsafe-fixes refers to it.

    Source:
        MuJoCo: "Error opening file"; paths in a URDF are relative to its folder.
    """
    for used in robot.mesh_names:
        if is_missing(used) and not _is_written_absolute(robot, used):
            is_mjcf = robot.model.kind == "mjcf"
            yield Violation(
                element=used,
                message=f"{used.label}: does not exist; {_search_result(robot, used)}"
                + ("; MuJoCo cannot load the robot without it" if is_mjcf else ""),
                severity=not_loaded(used),
                measured={"collisions": len(used.collisions)},
                fix=_relative_fix(robot, used, "unsafe") if is_in_other_folder(used.mesh) else None,
                is_written=bool(used.collisions),  # a missing visual mesh is omitted
            )


def _search_result(robot: Facts, used: UsedMesh) -> str:
    """Return where a missing mesh was searched."""
    mesh = used.mesh
    if is_in_other_folder(mesh):
        folder = short_path(robot.model.file.parent)
        return f"not found in {folder}, but {short_path(mesh.path)} exists"
    if re.match(r"(?i)[a-z]{2,}://", mesh.filename) and mesh.found_by == "nothing":
        package = re.match(r"(?i)(?:package|model)://([^/]+)", mesh.filename)
        if package is None:
            return "network paths are not supported"
        return (
            f"package {package[1]} not found in --package, the folders above and around the robot, "
            "ROS_PACKAGE_PATH or AMENT_PREFIX_PATH"
        )
    return f"searched at {short_path(mesh.path)}"


@rule("MSH002", "absolute-path", "error", fixes="unsafe", onboarding="converts")
def absolute_path(robot: Facts) -> Violations:
    """A mesh has an absolute path.

    The robot loads on one machine only: not in a container, on a cluster, or for other users. As
    with a missing file, the path of a visual mesh of a URDF is a warning.

    Fix:
        Use a path relative to the robot's file. --unsafe-fixes does this if the file, or one with
        the same end of the path, is near the robot.

    Source:
        All readers use absolute paths unchanged.
    """
    for used in robot.mesh_names:
        if not _is_written_absolute(robot, used) or is_folder(used.mesh.path):
            continue  # MSH006 reports a folder
        is_missing = not robot.meshes.exists(used.mesh.path)
        if is_missing:
            status = "which does not exist"
        elif used.mesh.found_by == "search":
            status = f"which does not exist; found {short_path(used.mesh.path)} instead"
        else:
            status = "which exists on this machine only"
        yield Violation(
            element=used,
            message=f"path of the {used.role}: got the absolute path {used.name}, {status}; "
            "expected a relative path",
            severity=not_loaded(used),
            fix=None if is_missing else _relative_fix(robot, used, "unsafe"),
        )


def _is_written_absolute(robot: Facts, used: UsedMesh) -> bool:
    """Return whether the file contains an absolute path that is not the result of $(find)."""
    if not is_absolute(used.name):
        return False
    if robot.model.kind != "xacro":
        return True
    folders = re.sub(r"(?i)^file:(//)?", "", used.name).split("/")[:-1]
    # A macro may assemble the path, so a prefix with two folders is sufficient.
    prefixes = ["/".join(folders[:k]).encode() for k in range(3, len(folders) + 1)]
    texts = [_read_or_empty(source) for source in robot.model.sources]
    return any(prefix in text for prefix in prefixes for text in texts)


def _read_or_empty(path: Path) -> bytes:
    try:
        return read_bytes(path)
    except TerrainkitError:
        return b""


@rule("MSH003", "package-uri", "note", fixes="safe")
def package_uri(robot: Facts) -> Violations:
    """A mesh path refers to a ROS package.

    `package://`, `model://` and `$(find ...)` work only where ROS or Gazebo is installed and the
    package is on its path. MuJoCo looks for a folder called `package:`, and other readers guess.
    A package path of a file that was found is a note. A relative path after `file://` counts as a
    missing file: its first part is read as a host name, so that no tool finds the file.

    Fix:
        Use a path relative to the robot's file. --fix does this for every mesh that was found.

    Source:
        Observed in MuJoCo 4.0: "Error opening file 'package:/...'".
    """
    groups: dict[tuple[str, str], list[tuple[UsedMesh, Fix | None]]] = {}
    for used in robot.mesh_names:
        is_package = is_package_uri(used.name)
        is_file = used.name.lower().startswith("file:") and not is_absolute(used.name)
        has_host = is_file and not is_package
        if not (has_host or is_package) or is_missing(used):
            continue
        if is_folder(used.mesh.path):
            continue  # MSH006 reports it
        # A file of the same name in another folder may not be the one that ROS would find.
        fix = _relative_fix(robot, used, "safe" if _is_same_path(used) else "unsafe")
        scheme = "a host" if has_host else f"the package {_package_of(used.name)}"
        groups.setdefault((scheme, fix.safety if fix else ""), []).append((used, fix))
    for (scheme, _), members in groups.items():
        first, fix = members[0]
        severity = not_loaded(next((used for used, _ in members if used.strict), first))
        edits = [edit for _, fix in members if fix is not None for edit in fix.edits]
        description = fix.description if fix and len(members) == 1 else "Use relative paths."
        yield Violation(
            element=first,
            message=f"path of {len(members)} mesh{'es' if len(members) > 1 else ''} "
            f"({names((mesh.name for mesh, _ in members), 2)}): refers to {scheme}; expected a "
            "relative path, which MuJoCo can load",
            severity=severity if scheme == "a host" else None,
            measured={"meshes": len(members)},
            fix=None if fix is None else make_fix(fix.safety, description, edits),
        )


def _package_of(name: str) -> str:
    match = re.match(r"(?:\w+:/+)?(?:\$\(\s*find\s+)?([^/\\()\s]+)", name)
    return match.group(1) if match else name


def _is_same_path(used: UsedMesh) -> bool:
    """Return whether the path in the package is the end of the path on disk, ignoring case."""
    rest = re.sub(r"^(?:file:/*|\w+:/+[^/\\]+|\$\([^)]*\))[/\\]*", "", used.name)
    parts = [part.lower() for part in re.split(r"[/\\]+", rest) if part not in ("", ".", "..")]
    return [part.lower() for part in used.mesh.path.parts[-len(parts) :]] == parts


@rule("MSH004", "filename-case", "error", fixes="safe", onboarding="converts")
def filename_case(robot: Facts) -> Violations:
    """A mesh path differs from the file name in case, or contains backslashes.

    The file is found on Windows and on most Macs, but not on Linux, where `Foot.STL` and `foot.stl`
    are different files and a backslash is not a separator. As with a missing file, the path of a
    visual mesh of a URDF is a warning.

    Fix:
        Use the case of the file name, and forward slashes. --fix does this.

    Source:
        POSIX compares file names byte by byte.
    """
    for used in robot.mesh_names:
        expected = None if is_missing(used) else filename_on_disk(used.name, used.mesh.path)
        if expected is None:
            continue
        # MSH003 makes a package path relative, with the correct case.
        edits = (
            None if is_package_uri(used.name) else rename_edits(robot.model, used.uses, expected)
        )
        yield Violation(
            element=used,
            message=f"path of the {used.role}: got {used.name}; expected {expected}",
            severity=not_loaded(used),
            fix=make_fix("safe", f"Change the path {used.name} to the file {expected}.", edits),
        )


def _relative_fix(robot: Facts, used: UsedMesh, safety: Literal["safe", "unsafe"]) -> Fix | None:
    """Return a fix that uses a relative path, or None if the file is too far away."""
    if robot.model.kind != "urdf":
        return None  # MJCF paths are relative to meshdir
    name = relative_name(robot.model, used.mesh.path)
    if is_absolute(name) or name.split("/").count("..") > _MAX_PARENT_FOLDERS:
        return None
    return make_fix(
        safety, f"Change the path to {name}.", rename_edits(robot.model, used.uses, name)
    )
