"""MSH: rules on mesh files."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Literal

from terrainkit.errors import TerrainkitError
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.meshes.scale import (
    MAX_PLAUSIBLE_RATIO,
    MAX_RATIO,
    MIN_RATIO,
    MeshScales,
    ScaleMismatch,
)
from terrainkit_robots.analysis.meshes.uses import (
    MeshUse,
    UsedMesh,
    is_in_other_folder,
    is_missing,
    meshes_by_file,
    meshes_by_name,
    relative_name,
    rename_edits,
    replace_edits,
)
from terrainkit_robots.description.fix import Edit, Fix
from terrainkit_robots.description.package_resolver import (
    filename_on_disk,
    is_absolute,
    is_package_uri,
)
from terrainkit_robots.description.xml.document import read_bytes
from terrainkit_robots.lint.rule import Severity, Violation, rule
from terrainkit_robots.mesh.mesh_cache import MeshError, Meshes, TooLargeError
from terrainkit_robots.mesh.sniff import MUJOCO_SUFFIXES
from terrainkit_robots.mesh.surface import FLAT, binary_stl, cluster_vertices, thickness
from terrainkit_robots.text import display_path, names

_MAX_STL_FACES = 200_000
"""Maximum number of faces that MuJoCo's STL reader accepts."""

_MAX_COLLISION_FACES = 20_000
"""A collision mesh with more faces is usually a copy of the visual mesh. Most collision meshes have
fewer than 5,000, and a hull of 1,000 faces deviates by less than 1% of its size."""

_SIMPLIFIED_FACES = 100_000
"""Maximum number of faces of a simplified mesh: half of MuJoCo's limit."""

_INITIAL_CELLS = 512
"""Number of cells along the longest side of a mesh in the first step of simplification."""

_HULL_VERTICES = 500
"""Maximum number of vertices of a convex hull that replaces a mesh. Its deviation is below 1% of
its size."""

_MAX_HULL_RATIO = 2.0
"""Maximum ratio of the volumes of hull and mesh. Limbs and brackets have 1.1 to 1.8."""

_MAX_PARENT_FOLDERS = 3
"""Maximum number of `..` in a relative path, enough for another package of the same workspace."""


@rule("MSH001", "missing-mesh", "error", fixes="unsafe")
def missing_mesh(robot: Facts) -> Iterator[Violation]:
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
    for used in meshes_by_name(robot.model, robot.meshes):
        if is_missing(used) and not _is_written_absolute(robot, used):
            is_mjcf = robot.model.kind == "mjcf"
            yield Violation(
                subject=used.name,
                source=used.source,
                message=f"{_describe(used)}: does not exist; {_search_result(robot, used)}"
                + ("; MuJoCo cannot load the robot without it" if is_mjcf else ""),
                severity="error" if used.collisions or is_mjcf else "warning",
                measured={"collisions": len(used.collisions)},
                fix=_relative_fix(robot, used, "unsafe") if is_in_other_folder(used.mesh) else None,
            )


def _search_result(robot: Facts, used: UsedMesh) -> str:
    """Return where a missing mesh was searched."""
    mesh = used.mesh
    if is_in_other_folder(mesh):
        folder = display_path(robot.model.file.parent)
        return f"not found in {folder}, but {display_path(mesh.path)} exists"
    if re.match(r"(?i)[a-z]{2,}://", mesh.filename) and mesh.found_by == "nothing":
        package = re.match(r"(?i)(?:package|model)://([^/]+)", mesh.filename)
        if package is None:
            return "network paths are not supported"
        return (
            f"package {package[1]} not found in --package, the folders above and around the robot, "
            "ROS_PACKAGE_PATH or AMENT_PREFIX_PATH"
        )
    return f"searched at {display_path(mesh.path)}"


@rule("MSH002", "absolute-path", "error", fixes="unsafe")
def absolute_path(robot: Facts) -> Iterator[Violation]:
    """A mesh has an absolute path.

    The robot loads on one machine only: not in a container, on a cluster, or for other users.

    Fix:
        Use a path relative to the robot's file. --unsafe-fixes does this if the file, or one with
        the same end of the path, is near the robot.

    Source:
        All readers use absolute paths unchanged.
    """
    for used in meshes_by_name(robot.model, robot.meshes):
        if not _is_written_absolute(robot, used):
            continue
        is_missing = not robot.meshes.exists(used.mesh.path)
        if is_missing:
            status = "which does not exist"
        elif used.mesh.found_by == "search":
            status = f"which does not exist; found {display_path(used.mesh.path)} instead"
        else:
            status = "which exists on this machine only"
        yield Violation(
            subject=used.name,
            source=used.source,
            message=f"path of the {used.role}: got the absolute path {used.name}, {status}; "
            "expected a relative path",
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


@rule("MSH003", "package-uri", "info", fixes="safe")
def package_uri(robot: Facts) -> Iterator[Violation]:
    """A mesh path refers to a ROS package.

    `package://`, `model://` and `$(find ...)` work only where ROS or Gazebo is installed and the
    package is on its path. MuJoCo looks for a folder called `package:`, and other readers guess.
    A package path of a file that was found is a note. A relative path after `file://` is a warning:
    its first part is read as a host name, so that no tool finds the file.

    Fix:
        Use a path relative to the robot's file. --fix does this for every mesh that was found.

    Source:
        Observed in MuJoCo 4.0: "Error opening file 'package:/...'".
    """
    groups: dict[tuple[str, str], list[tuple[UsedMesh, Fix | None]]] = {}
    for used in meshes_by_name(robot.model, robot.meshes):
        has_host = used.name.lower().startswith("file:") and not is_absolute(used.name)
        if not (has_host or is_package_uri(used.name)) or is_missing(used):
            continue
        # A file of the same name in another folder may not be the one that ROS would find.
        fix = _relative_fix(robot, used, "safe" if _is_same_path(used) else "unsafe")
        scheme = "a host" if has_host else f"the package {_package_of(used.name)}"
        groups.setdefault((scheme, fix.safety if fix else ""), []).append((used, fix))
    for (scheme, _), members in groups.items():
        first, fix = members[0]
        edits = [edit for _, each in members if each is not None for edit in each.edits]
        description = fix.description if fix and len(members) == 1 else "Use relative paths."
        yield Violation(
            subject=first.name,
            source=first.source,
            message=f"path of {len(members)} mesh{'es' * (len(members) > 1)} "
            f"({names((each.name for each, _ in members), 2)}): refers to {scheme}; expected a "
            "relative path, which MuJoCo can load",
            severity="warning" if scheme == "a host" else None,
            measured={"meshes": len(members)},
            fix=None if fix is None else _fix(fix.safety, description, edits),
        )


def _package_of(name: str) -> str:
    match = re.match(r"(?:\w+:/+|\$\(\s*find\s+)([^/\\()\s]+)", name)
    return match.group(1) if match else name


def _is_same_path(used: UsedMesh) -> bool:
    """Return whether the path in the package is the end of the path on disk, ignoring case."""
    rest = re.sub(r"^(?:file:/*|\w+:/+[^/\\]+|\$\([^)]*\))[/\\]*", "", used.name)
    parts = [part.lower() for part in re.split(r"[/\\]+", rest) if part not in ("", ".", "..")]
    return [part.lower() for part in used.mesh.path.parts[-len(parts) :]] == parts


@rule("MSH004", "filename-case", "error", fixes="safe")
def filename_case(robot: Facts) -> Iterator[Violation]:
    """A mesh path differs from the file name in case, or contains backslashes.

    The file is found on Windows and on most Macs, but not on Linux, where `Foot.STL` and `foot.stl`
    are different files and a backslash is not a separator.

    Fix:
        Use the case of the file name, and forward slashes. --fix does this.

    Source:
        POSIX compares file names byte by byte.
    """
    for used in meshes_by_name(robot.model, robot.meshes):
        expected = None if is_missing(used) else filename_on_disk(used.name, used.mesh.path)
        if expected is None:
            continue
        # MSH003 makes a package path relative, with the correct case.
        edits = (
            None if is_package_uri(used.name) else rename_edits(robot.model, used.uses, expected)
        )
        yield Violation(
            subject=used.name,
            source=used.source,
            message=f"path of the {used.role}: got {used.name}; expected {expected}",
            fix=_fix("safe", f"Change the path to {expected}.", edits),
        )


@rule("MSH005", "unsupported-format", "error", fixes="unsafe")
def unsupported_format(robot: Facts) -> Iterator[Violation]:
    """A collision mesh is in a format that MuJoCo cannot read.

    MuJoCo reads STL, OBJ and its own MSH, depending on the suffix. It cannot load a robot with
    COLLADA (.dae) meshes, which are common in ROS. Visual meshes of a URDF are not checked, because
    MuJoCo discards them.

    Fix:
        Convert the mesh. --unsafe-fixes writes an STL file beside it, or its convex hull if it has
        more than 20,000 faces. As in RViz and MoveIt, the up axis of COLLADA is ignored; inspect
        the result.

    Source:
        Observed in MuJoCo 4.0: "no decoder found for mesh file".
    """
    for used in meshes_by_file(robot.model, robot.meshes):
        suffix = used.mesh.path.suffix.lower()
        if not used.strict or suffix in MUJOCO_SUFFIXES or used.header.state != "fine":
            continue
        uses = used.uses if robot.model.kind == "mjcf" else used.collisions
        edits = None
        if _is_solid(robot.meshes, uses):
            edits = replace_edits(
                robot.model, robot.meshes, uses, ".stl", _convert(robot.meshes, used)
            )
        yield Violation(
            subject=used.name,
            source=used.source,
            message=f"format of {_describe(used)}: got {suffix or 'no suffix'}; expected "
            f"{', '.join(MUJOCO_SUFFIXES)} for MuJoCo",
            fix=_fix("unsafe", "Convert it to STL.", edits),
        )


def _is_solid(meshes: Meshes, uses: Sequence[MeshUse]) -> bool:
    """Return whether a mesh is readable and has a convex hull at the scale of every use."""
    try:
        return not any(meshes.is_flat(use.mesh) for use in uses)
    except MeshError:
        return False


def _convert(meshes: Meshes, used: UsedMesh) -> Callable[[], bytes]:
    def convert() -> bytes:
        if meshes.faces(used.mesh.path) > _MAX_COLLISION_FACES:
            return _hull(meshes, used)()
        return binary_stl(meshes.surface(used.mesh.path))

    return convert


def _hull(meshes: Meshes, used: UsedMesh) -> Callable[[], bytes]:
    return lambda: binary_stl(meshes.hull(used.mesh.path, _HULL_VERTICES))


@rule("MSH006", "malformed-mesh", "error")
def malformed_mesh(robot: Facts) -> Iterator[Violation]:
    """A mesh file is empty, truncated or in another format than its suffix.

    A binary STL has 84 bytes plus 50 per face. Any other size means that the file was truncated in
    a copy or download. Readers reject it, or read triangles from invalid memory.

    Fix:
        Copy or download the file again, or export it again.

    Source:
        Observed in MuJoCo 4.0: "STL file has wrong size", "is empty", "vertex coordinate is not
        finite".
    """
    for used in meshes_by_file(robot.model, robot.meshes):
        problem, severity = _file_problem(robot.meshes, used)
        if problem:
            yield Violation(
                subject=used.name,
                source=used.source,
                message=f"{_describe(used)} {problem}",
                severity=severity,
                measured={"bytes": used.header.size},
            )


def _file_problem(meshes: Meshes, used: UsedMesh) -> tuple[str, Severity]:
    """Return what is wrong with a file and the severity, unless another rule reports it."""
    if used.header.state in ("lfs", "missing"):
        return "", "info"
    if used.header.problem:
        # All readers except MuJoCo read the faces and ignore the rest.
        is_harmless = not used.strict and used.header.faces is not None
        return used.header.problem, "warning" if is_harmless else "error"
    if used.header.format != "other":
        for use in used.collisions:
            try:
                meshes.vertices(use.mesh)
            except TooLargeError as error:
                return f"was not checked: it {error}", "info"
            except MeshError as error:
                return str(error), "error"
    return "", "info"


@rule("MSH007", "ascii-stl", "error", fixes="safe")
def ascii_stl(robot: Facts) -> Iterator[Violation]:
    """A mesh is an ASCII STL file.

    MuJoCo reads binary STL only, and interprets the text as the number of faces. Other readers
    support both formats, so a visual mesh of a URDF is only a note.

    Fix:
        Save it as binary STL. --fix writes one beside it.

    Source:
        Observed in MuJoCo 4.0: "perhaps this is an ASCII file?".
    """
    for used in meshes_by_file(robot.model, robot.meshes):
        if used.header.format == "ascii-stl" and used.header.state == "fine":
            content = _binary(robot.meshes, used)
            edits = replace_edits(robot.model, robot.meshes, used.uses, "_binary.stl", content)
            yield Violation(
                subject=used.name,
                source=used.source,
                message=f"format of {_describe(used)}: got ASCII STL of {used.header.size:,} "
                "bytes; expected binary STL for MuJoCo",
                severity="error" if used.strict else "info",
                fix=_fix("safe", "Convert it to binary STL.", edits),
            )


def _binary(meshes: Meshes, used: UsedMesh) -> Callable[[], bytes]:
    return lambda: binary_stl(meshes.surface(used.mesh.path))


@rule("MSH008", "too-many-faces", "error", fixes="unsafe")
def too_many_faces(robot: Facts) -> Iterator[Violation]:
    """A mesh has over 200,000 faces.

    MuJoCo rejects such an STL file. A visual mesh, or a mesh in another format, can be loaded, but
    it costs memory and time. Then it is a warning.

    Fix:
        Simplify the mesh, for example in Blender or MeshLab. --unsafe-fixes writes a simplified
        copy beside it, or the convex hull of a collision mesh.

    Source:
        Observed in MuJoCo 4.0: "number of faces should be between 1 and 200000".
    """
    for used in meshes_by_file(robot.model, robot.meshes):
        faces = _faces(robot.meshes, used)
        if faces is None or faces <= _MAX_STL_FACES:
            continue
        is_rejected = used.strict and used.header.format in ("stl", "ascii-stl")
        yield Violation(
            subject=used.name,
            source=used.source,
            message=f"number of faces of {_describe(used)}: got {faces:,}; expected at most "
            f"{_MAX_STL_FACES:,}, MuJoCo's limit for STL",
            severity="error" if is_rejected else "warning",
            measured={"faces": faces},
            fix=_fix("unsafe", "Simplify the mesh.", _simplify_edits(robot, used)),
        )


def _faces(meshes: Meshes, used: UsedMesh) -> int | None:
    """Return the number of faces, or None if it is unknown. Only collision meshes are read."""
    if used.header.state != "fine":
        return None
    if used.header.faces is not None or not used.collisions:
        return used.header.faces
    try:
        return meshes.faces(used.mesh.path)
    except MeshError:
        return None


def _simplify_edits(robot: Facts, used: UsedMesh) -> Sequence[Edit] | None:
    """Return the edits that replace collision meshes by hulls and simplify visual meshes."""
    if used.header.format == "ascii-stl":
        return None  # MSH007 converts it first
    visuals = [use for use in used.uses if not use.is_collision]
    simplify = _simplify(robot.meshes, used)
    if robot.model.kind == "mjcf":  # all uses share one element
        return replace_edits(robot.model, robot.meshes, used.uses, "_simplified.stl", simplify)
    edits: list[Edit] = []
    for uses, ending, content in (
        (used.collisions, "_hull.stl", _hull(robot.meshes, used)),
        (visuals, "_simplified.stl", simplify),
    ):
        made = replace_edits(robot.model, robot.meshes, uses, ending, content) if uses else ()
        if made is None or (content is not simplify and not _is_solid(robot.meshes, uses)):
            return None
        edits += made
    return edits


def _simplify(meshes: Meshes, used: UsedMesh) -> Callable[[], bytes]:
    def simplify() -> bytes:
        surface = meshes.surface(used.mesh.path)
        cells = _INITIAL_CELLS
        while True:
            coarse = cluster_vertices(surface, cells)
            if not len(coarse.faces):
                raise MeshError("has no faces left after its vertices are merged")
            share = _SIMPLIFIED_FACES / len(coarse.faces)
            if share >= 1:
                return binary_stl(coarse)
            # The number of faces grows with the square of the number of cells.
            cells = max(1, int(cells * min(0.9, share**0.5)))

    return simplify


@rule("MSH009", "dense-collision-mesh", "warning", fixes="unsafe")
def dense_collision_mesh(robot: Facts) -> Iterator[Violation]:
    """A collision mesh has over 20,000 faces.

    It is usually the visual mesh. MuJoCo and PhysX compute its hull or a decomposition each time
    the robot is loaded, and PyBullet and Gazebo may collide with every face. The contacts are no
    better than those of a convex hull or a few primitives.

    Fix:
        Use primitives, a convex hull, or a convex decomposition (CoACD). --unsafe-fixes writes a
        hull with at most 500 vertices beside it.

    Source:
        MuJoCo's documentation, "Collision detection": meshes collide by their hulls.
    """
    for used in meshes_by_file(robot.model, robot.meshes):
        faces = _faces(robot.meshes, used) if used.collisions else None
        if faces is None or not _MAX_COLLISION_FACES < faces <= _MAX_STL_FACES:
            continue
        if robot.model.kind == "urdf" and used.mesh.path.suffix.lower() not in MUJOCO_SUFFIXES:
            continue  # MSH005 converts it to a hull
        yield Violation(
            subject=used.name,
            source=used.collisions[0].mesh.source,
            message=f"number of faces of {_describe(used)}: got {faces:,}; expected at most "
            f"{_MAX_COLLISION_FACES:,}",
            measured={"faces": faces},
            fix=_fix("unsafe", "Use its convex hull for collision.", _hull_edits(robot, used)),
        )


def _hull_edits(robot: Facts, used: UsedMesh) -> Sequence[Edit] | None:
    visuals = {use.mesh.source for use in used.uses if not use.is_collision}
    is_shared = any(use.mesh.source in visuals for use in used.collisions)
    if (
        is_shared
        or used.header.format == "ascii-stl"
        or not _is_solid(robot.meshes, used.collisions)
    ):
        return None
    return replace_edits(
        robot.model, robot.meshes, used.collisions, "_hull.stl", _hull(robot.meshes, used)
    )


@rule("MSH010", "flat-mesh", "error")
def flat_mesh(robot: Facts) -> Iterator[Violation]:
    """A collision mesh is flat and has no convex hull.

    Simulators collide with convex hulls. A flat mesh has none, and MuJoCo and PhysX reject it. A
    mesh is flat if its thickness is below 1/10,000 of its diagonal, which includes a scale of 0.

    Fix:
        Use a thin box instead.

    Source:
        Observed in MuJoCo 4.0: "has coplanar vertices", "at least 4 vertices required".
    """
    for used in meshes_by_file(robot.model, robot.meshes):
        for use in used.collisions:
            if not robot.meshes.is_readable(use.mesh) or not robot.meshes.is_flat(use.mesh):
                continue
            vertices = robot.meshes.vertices(use.mesh)
            relative = thickness(vertices)
            yield Violation(
                subject=used.name,
                source=use.mesh.source,
                message=f"thickness of {_describe(used)} over its diagonal: got {relative:.2g}; "
                f"expected at least {FLAT:g}",
                measured={"corners": len(vertices), "thickness": relative},
            )
            break


@rule("MSH011", "wrong-scale", "error")
def wrong_scale(robot: Facts) -> Iterator[Violation]:
    """A mesh is far too large or too small compared with the joint distances.

    The mesh is in millimeters instead of meters, or its scale is missing or applied twice. A
    collision mesh that is 1000 times too large contains the whole robot. One that is too small
    touches nothing.

    The diagonal of the bounding box is compared with the distance to the adjacent joints. A ratio
    above 50 is an error, above 15 a warning. A ratio below 1/50 is an error if the mesh is smaller
    than 5 mm. Sensors, details, and scenery on a base without mass are not reported.

    Fix:
        Correct the scale: 0.001 0.001 0.001 for millimeters, 0.0254 0.0254 0.0254 for inches.

    Source:
        STL has no unit; URDF and MJCF use meters.
    """
    scales = MeshScales(robot.tree, robot.bodies, robot.meshes)
    files = meshes_by_file(robot.model, robot.meshes)
    if files and scales.robot_size <= 0:
        raise CannotCheckError("all joints have the same position, so the size is unknown")
    for used in files:
        for use in used.uses:
            mismatch = scales.mismatch(use)
            if mismatch is None:
                continue
            is_large = mismatch.ratio > 1
            yield Violation(
                subject=used.name,
                source=use.mesh.scale_source or use.mesh.source,
                message=f"size of mesh {used.name} on link {use.link.name}: got "
                f"{mismatch.diagonal:.3g} m, {mismatch.ratio:.3g} times the "
                f"{mismatch.reference:.3g} m {mismatch.description}; expected "
                + (f"at most {MAX_RATIO:g} times" if is_large else f"at least {MIN_RATIO:g} times"),
                hint=_scale_hint(mismatch),
                severity="warning"
                if is_large and mismatch.ratio <= MAX_PLAUSIBLE_RATIO
                else "error",
                certainty="likely",
                measured={
                    "diagonal": mismatch.diagonal,
                    "reference": mismatch.reference,
                    "ratio": mismatch.ratio,
                },
            )
            break


def _scale_hint(mismatch: ScaleMismatch) -> str:
    if mismatch.ratio > 1:
        return 'Set scale="0.001 0.001 0.001" if the file is in millimeters, 0.0254 if in inches.'
    return "Remove the scale if the file is in meters or was already scaled."


@rule("MSH012", "negative-scale", "warning")
def negative_scale(robot: Facts) -> Iterator[Violation]:
    """A mesh is mirrored by a negative scale.

    PhysX does not support a negative scale for convex meshes, and Webots does not support it at
    all. In readers that only scale the vertices, the mesh is inside out. It is a note for visual
    meshes and for MJCF, which allows it.

    Fix:
        Save a mirrored copy of the file and use a positive scale.

    Source:
        PhysX: PxConvexMeshGeometry; Webots: Transform; MuJoCo: mesh/scale allows it.
    """
    for used in meshes_by_file(robot.model, robot.meshes):
        mirrored = [use for use in used.uses if min(use.mesh.scale) < 0]
        if not mirrored:
            continue
        first = next((use for use in mirrored if use.is_collision), mirrored[0])
        is_harmful = first.is_collision and robot.model.kind != "mjcf"
        scale = " ".join(f"{factor:g}" for factor in first.mesh.scale)
        yield Violation(
            subject=used.name,
            source=first.mesh.scale_source or first.mesh.source,
            message=f"scale of {_describe(used)}: got {scale}; expected values > 0",
            severity="warning" if is_harmful else "info",
        )


@rule("MSH013", "lfs-pointer", "error")
def lfs_pointer(robot: Facts) -> Iterator[Violation]:
    """A mesh file is a Git LFS pointer.

    The repository was cloned without Git LFS, or downloaded as an archive. Each large file is
    replaced by three lines of text with its hash, which no simulator can read.

    Fix:
        Run `git lfs install` and `git lfs pull` in the repository.

    Source:
        Git LFS, "Specification": pointer files start with the word version.
    """
    for used in meshes_by_file(robot.model, robot.meshes):
        if used.header.state == "lfs":
            yield Violation(
                subject=used.name,
                source=used.source,
                message=f"{_describe(used)} {used.header.problem}",
                measured={"bytes": used.header.size},
            )


@rule("MSH014", "nonconvex-collision", "info")
def nonconvex_collision(robot: Facts) -> Iterator[Violation]:
    """The convex hull of a collision mesh is far larger than the mesh.

    MuJoCo, and PhysX by default, collide with the convex hull, which fills holes and concave parts.
    This is acceptable for a limb, but not for parts that enclose others, such as a gripper or a
    bracket around a joint. The rule reports closed meshes whose hull has more than twice their
    volume.

    Fix:
        Use a convex decomposition (CoACD) or primitives if the concave parts matter.

    Source:
        MuJoCo's documentation, "Collision detection": meshes collide by their hulls.
    """
    for used in meshes_by_file(robot.model, robot.meshes):
        faces = _faces(robot.meshes, used) if used.collisions else None
        if faces is None or faces > _MAX_STL_FACES:
            continue
        first = used.collisions[0]
        try:
            solid = robot.meshes.solid_volume(first.mesh)
            if not solid:
                continue
            hull = robot.meshes.hull_volume(first.mesh)
        except MeshError:
            continue
        if hull > _MAX_HULL_RATIO * solid:
            yield Violation(
                subject=used.name,
                source=first.mesh.source,
                message=f"volume of the convex hull of {_describe(used)}: got {hull:.3g} m3, "
                f"{hull / solid:.3g} times that of the mesh; expected at most {_MAX_HULL_RATIO:g} "
                "times",
                measured={"solid": solid, "hull": hull},
            )


def _describe(used: UsedMesh) -> str:
    return f"{used.name} ({used.role})"


def _relative_fix(robot: Facts, used: UsedMesh, safety: Literal["safe", "unsafe"]) -> Fix | None:
    """Return a fix that uses a relative path, or None if the file is too far away."""
    if robot.model.kind != "urdf":
        return None  # MJCF paths are relative to meshdir
    name = relative_name(robot.model, used.mesh.path)
    if is_absolute(name) or name.split("/").count("..") > _MAX_PARENT_FOLDERS:
        return None
    return _fix(safety, f"Change the path to {name}.", rename_edits(robot.model, used.uses, name))


def _fix(
    safety: Literal["safe", "unsafe"], description: str, edits: Iterable[Edit] | None
) -> Fix | None:
    """Return a fix, or None if the file cannot be edited."""
    if edits is None:
        return None
    return Fix(safety=safety, description=description, edits=tuple(edits))
