"""MSH: mesh files."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Literal

from terrainkit.errors import TerrainkitError
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.meshes.scale import HUGE, LARGE, TINY, Misfit, Scales
from terrainkit_robots.analysis.meshes.uses import (
    MeshUse,
    UsedMesh,
    is_elsewhere,
    is_lost,
    meshes_by_file,
    meshes_by_name,
    relative_name,
    renamed,
    replaced,
)
from terrainkit_robots.description.fix import Edit, Fix
from terrainkit_robots.description.package_resolver import is_absolute, names_package, right_letters
from terrainkit_robots.description.xml.document import read_bytes
from terrainkit_robots.lint.rule import Severity, Violation, rule
from terrainkit_robots.mesh.mesh_cache import MeshError, Meshes, TooLargeError
from terrainkit_robots.mesh.sniff import MUJOCO_SUFFIXES
from terrainkit_robots.mesh.surface import FLAT, binary_stl, clustered, thickness
from terrainkit_robots.text import names

_MOST_FACES = 200_000
"""MuJoCo's reader of STL refuses more."""

_MANY_FACES = 20_000
"""A collision mesh with more is a copy of what is drawn: most are below 5,000, and a hull of 1,000
lies within a hundredth of its size."""

_SIMPLIFIED = 100_000
"""Faces that a simplified mesh may have: half of what MuJoCo takes."""

_GRID = 512
"""Cells along the longest side of a mesh that is simplified, to begin with."""

_HULL_CORNERS = 500
"""Corners of a hull that is written: it lies within a hundredth of its size."""

_BLOATED = 2.0
"""Volume of the hull over that of the solid from which it is told. Limbs and brackets have 1.1 to
1.8; beyond 2 most of what collides is air."""

_FAR_UP = 3
"""Folders up that a relative path may lead: from urdf/ to another package of the same workspace."""


@rule("MSH001", "missing-mesh", "error", fixes="unsafe")
def missing_mesh(robot: Facts) -> Iterator[Violation]:
    """A mesh file is not where the robot says.

    MuJoCo stops at the first collision mesh that it cannot open. Isaac Sim, Genesis and PyBullet go
    on in part, with a link that touches nothing or is not to be seen. A visual mesh that is missing
    is a warning, since it takes no part in the training; of a MJCF file MuJoCo wants that, too.

    Fix:
        Put the file there, correct its name, or say where a package lies with --package NAME=DIR.
        Where a file of that name lies in a folder around, --unsafe-fixes refers to it.

    Source:
        MuJoCo: "Error opening file"; URDF names files relative to its own folder.
    """
    for used in meshes_by_name(robot):
        if is_lost(used) and not _is_written_absolute(robot, used):
            there = is_elsewhere(used.mesh)
            refused = robot.model.kind == "mjcf" and not used.collisions
            yield Violation(
                subject=used.name,
                source=used.source,
                message=f"{_words(used)} does not exist: {_looked_for(robot, used)}"
                + ("; MuJoCo does not load the robot without it" if refused else ""),
                severity="error" if used.collisions else "warning",
                fix=_relative_fix(robot, used, "unsafe") if there else None,
            )


def _looked_for(robot: Facts, used: UsedMesh) -> str:
    """Return where a missing mesh was looked for, as the second half of a sentence."""
    mesh = used.mesh
    if is_elsewhere(mesh):
        folder = robot.model.file.parent
        return f"it is not in {folder}, but there is {mesh.path}"
    if re.match(r"(?i)[a-z]{2,}://", mesh.filename) and mesh.found_by == "nothing":
        package = re.match(r"(?i)(?:package|model)://([^/]+)", mesh.filename)
        if package is None:
            return "nothing is fetched from a network"
        return (
            f"package {package[1]} was not given, and there is no package.xml or folder of that "
            "name above or around the robot, nor in ROS_PACKAGE_PATH or AMENT_PREFIX_PATH"
        )
    return f"it is not at {mesh.path}"


@rule("MSH002", "absolute-path", "error", fixes="unsafe")
def absolute_path(robot: Facts) -> Iterator[Violation]:
    """A mesh is named by a path from the root of somebody's disk.

    The robot loads on one machine and no other: not in a container, not on the cluster, not at
    whoever downloads it.

    Fix:
        Name it relative to the robot's file. --unsafe-fixes does so where the file, or one with the
        same end of its path, lies near the robot.

    Source:
        Every reader takes such a path as it is written.
    """
    for used in meshes_by_name(robot):
        if not _is_written_absolute(robot, used):
            continue
        missing = not robot.meshes.exists(used.mesh.path)
        if missing:
            where = "which does not exist here"
        elif used.mesh.found_by == "search":
            where = f"which does not exist here; there is {used.mesh.path}"
        else:
            where = "which exists on this machine only"
        yield Violation(
            subject=used.name,
            source=used.source,
            message=f"the {used.role} has an absolute path, {used.name}, {where}",
            fix=None if missing else _relative_fix(robot, used, "unsafe"),
        )


def _is_written_absolute(robot: Facts, used: UsedMesh) -> bool:
    """Return whether the file itself has an absolute path, rather than xacro's $(find) made it."""
    if not is_absolute(used.name):
        return False
    if robot.model.kind != "xacro":
        return True
    folders = re.sub(r"(?i)^file:(//)?", "", used.name).split("/")[:-1]
    # a macro may put the path together: what is left of it after two folders is telling enough
    starts = ["/".join(folders[:k]).encode() for k in range(3, len(folders) + 1)]
    texts = [_text(source) for source in robot.model.sources]
    return any(start in text for start in starts for text in texts)


def _text(path: Path) -> bytes:
    try:
        return read_bytes(path)
    except TerrainkitError:
        return b""


@rule("MSH003", "package-uri", "warning", fixes="safe")
def package_uri(robot: Facts) -> Iterator[Violation]:
    """A mesh is named by its ROS package.

    `package://`, `model://` and `$(find ...)` mean something only where ROS or Gazebo is installed
    and the package is on its path. MuJoCo looks for a folder that is called `package:`; others
    guess. A relative path after `file://` is no better: what comes first is taken for a host.

    Fix:
        Name it relative to the robot's file; --fix does so for every mesh that was found.

    Source:
        MuJoCo 4.0: "Error opening file 'package:/...'"; seen.
    """
    groups: dict[tuple[str, str], list[tuple[UsedMesh, Fix | None]]] = {}
    for used in meshes_by_name(robot):
        host = used.name.lower().startswith("file:") and not is_absolute(used.name)
        if not (host or names_package(used.name)) or is_lost(used):
            continue
        # a file of that name in another folder need not be the one that ROS would find
        fix = _relative_fix(robot, used, "safe" if _ends_alike(used) else "unsafe")
        place = "a host" if host else f"the package {_package_of(used.name)}"
        key = place, fix.safety if fix else ""
        groups.setdefault(key, []).append((used, fix))
    for (place, _), alike in groups.items():
        first, fix = alike[0]
        edits = [edit for _, each in alike if each is not None for edit in each.edits]
        text = (
            fix.description if fix and len(alike) == 1 else "Refer to them relative to this file."
        )
        yield Violation(
            subject=first.name,
            source=first.source,
            message=f"{names((each.name for each, _ in alike), 2)}: named by {place}, which MuJoCo "
            "cannot load",
            measured={"meshes": len(alike)},
            fix=None if fix is None else _fix(fix.safety, text, edits),
        )


def _package_of(name: str) -> str:
    match = re.match(r"(?:\w+:/+|\$\(\s*find\s+)([^/\\()\s]+)", name)
    return match.group(1) if match else name


def _ends_alike(used: UsedMesh) -> bool:
    """Return whether the path in the package is the end of the path on disk, but for letters."""
    rest = re.sub(r"^(?:file:/*|\w+:/+[^/\\]+|\$\([^)]*\))[/\\]*", "", used.name)
    parts = [part.lower() for part in re.split(r"[/\\]+", rest) if part not in ("", ".", "..")]
    return [part.lower() for part in used.mesh.path.parts[-len(parts) :]] == parts


@rule("MSH004", "filename-case", "error", fixes="safe")
def filename_case(robot: Facts) -> Iterator[Violation]:
    """The name of a mesh differs from its file's in upper and lower case, or has backslashes.

    It is found on Windows, and on most Macs, and nowhere where robots are trained: on Linux
    `Foot.STL` and `foot.stl` are two files, and a backslash is a letter like any other.

    Fix:
        Write the name as the file has it, with slashes; --fix does.

    Source:
        POSIX file names are compared byte by byte.
    """
    for used in meshes_by_name(robot):
        right = None if is_lost(used) else right_letters(used.name, used.mesh.path)
        if right is None:
            continue
        slashes = right == used.name.replace("\\", "/")
        how = "has backslashes" if slashes else "has other letters than the file"
        # a package path is made relative, with the right letters, by MSH003
        edits = None if names_package(used.name) else renamed(robot, used.uses, right)
        yield Violation(
            subject=used.name,
            source=used.source,
            message=f"the name {used.name} of the {used.role} {how}; wanted {right}",
            fix=_fix("safe", f"Refer to it as {right}.", edits),
        )


@rule("MSH005", "unsupported-format", "error", fixes="unsafe")
def unsupported_format(robot: Facts) -> Iterator[Violation]:
    """A collision mesh is in a format that MuJoCo cannot read.

    MuJoCo reads STL, OBJ and its own MSH, by the end of the name. COLLADA (.dae), which ROS is full
    of, stops it at once. Visual meshes of a URDF are left alone: MuJoCo drops them.

    Fix:
        Convert it; --unsafe-fixes writes an STL beside it: its hull, if it has over 20,000 faces.
        The up axis of COLLADA is left out of account, as RViz and MoveIt do; look at the result.

    Source:
        MuJoCo 4.0: "no decoder found for mesh file"; seen.
    """
    for used in meshes_by_file(robot):
        suffix = used.mesh.path.suffix.lower()
        if not used.strict or suffix in MUJOCO_SUFFIXES or used.header.state != "fine":
            continue
        uses = used.uses if robot.model.kind == "mjcf" else used.collisions
        edits = None
        if _is_solid(robot.meshes, uses):
            edits = replaced(robot, uses, ".stl", _converted(robot.meshes, used))
        yield Violation(
            subject=used.name,
            source=used.source,
            message=f"{_words(used)} is a {suffix or 'nameless'} file; MuJoCo reads "
            f"{', '.join(MUJOCO_SUFFIXES)}",
            fix=_fix("unsafe", "Convert it to an STL beside it.", edits),
        )


def _is_solid(meshes: Meshes, uses: Sequence[MeshUse]) -> bool:
    """Return whether a mesh can be read, and has a hull as every use scales it."""
    try:
        return not any(meshes.is_flat(use.mesh) for use in uses)
    except MeshError:
        return False


def _converted(meshes: Meshes, used: UsedMesh) -> Callable[[], bytes]:
    def convert() -> bytes:
        if meshes.faces(used.mesh.path) > _MANY_FACES:
            return _hull(meshes, used)()
        return binary_stl(meshes.surface(used.mesh.path))

    return convert


def _hull(meshes: Meshes, used: UsedMesh) -> Callable[[], bytes]:
    return lambda: binary_stl(meshes.hull(used.mesh.path, _HULL_CORNERS))


@rule("MSH006", "malformed-mesh", "error")
def malformed_mesh(robot: Facts) -> Iterator[Violation]:
    """A mesh file is empty, cut off or something else than its name says.

    A binary STL has 84 bytes and 50 for each face; one that has not was cut off while it was copied
    or downloaded. Readers refuse it, or make triangles of what lies behind it in memory.

    Fix:
        Get the file anew, or export it again.

    Source:
        MuJoCo 4.0: "STL file has wrong size", "is empty", "vertex coordinate is not finite"; seen.
    """
    for used in meshes_by_file(robot):
        problem, severity = _problem(robot.meshes, used)
        if problem:
            yield Violation(
                subject=used.name,
                source=used.source,
                message=f"{_words(used)} {problem}",
                severity=severity,
                measured={"bytes": used.header.size},
            )


def _problem(meshes: Meshes, used: UsedMesh) -> tuple[str, Severity]:
    """Return what is wrong with a file, as far as no other rule says it, and how bad that is."""
    if used.header.state in ("lfs", "missing"):
        return "", "info"
    if used.header.problem:
        # every reader but MuJoCo's takes the faces and leaves the rest
        harmless = not used.strict and used.header.faces is not None
        return used.header.problem, "warning" if harmless else "error"
    if used.header.format != "other":
        for use in used.collisions:
            try:
                meshes.vertices(use.mesh)
            except TooLargeError as error:
                return f"was not looked into: it {error}", "info"
            except MeshError as error:
                return str(error), "error"
    return "", "info"


@rule("MSH007", "ascii-stl", "error", fixes="safe")
def ascii_stl(robot: Facts) -> Iterator[Violation]:
    """A mesh is an STL of text.

    MuJoCo reads binary STL only, and takes the text for a number of faces. Other readers take both;
    so a mesh that is only drawn, in a URDF, is not worth more than a note.

    Fix:
        Save it as a binary STL; --fix writes one beside it.

    Source:
        MuJoCo 4.0: "perhaps this is an ASCII file?"; seen.
    """
    for used in meshes_by_file(robot):
        if used.header.format == "ascii-stl" and used.header.state == "fine":
            content = _binary(robot.meshes, used)
            edits = replaced(robot, used.uses, "_binary.stl", content)
            yield Violation(
                subject=used.name,
                source=used.source,
                message=f"{_words(used)} is an ASCII STL of {used.header.size:,} bytes; MuJoCo "
                "reads binary STL only",
                severity="error" if used.strict else "info",
                fix=_fix("safe", "Write a binary STL beside it.", edits),
            )


def _binary(meshes: Meshes, used: UsedMesh) -> Callable[[], bytes]:
    return lambda: binary_stl(meshes.surface(used.mesh.path))


@rule("MSH008", "too-many-faces", "error", fixes="unsafe")
def too_many_faces(robot: Facts) -> Iterator[Violation]:
    """A mesh has over 200,000 faces.

    MuJoCo refuses such an STL. Where it is only drawn, or in another format, it is read, and costs
    memory and time for each of thousands of robots.

    Fix:
        Reduce it, in Blender or MeshLab for the best result. --unsafe-fixes writes a coarser copy
        beside it, of a collision mesh its hull.

    Source:
        MuJoCo 4.0: "number of faces should be between 1 and 200000"; seen.
    """
    for used in meshes_by_file(robot):
        faces = _faces(robot.meshes, used)
        if faces is None or faces <= _MOST_FACES:
            continue
        refused = used.strict and used.header.format in ("stl", "ascii-stl")
        yield Violation(
            subject=used.name,
            source=used.source,
            message=f"{_words(used)} has {faces:,} faces; wanted {_MOST_FACES:,} or fewer, as "
            "MuJoCo takes of an STL",
            severity="error" if refused else "warning",
            measured={"faces": faces},
            fix=_fix("unsafe", "Write a coarser mesh beside it.", _coarser(robot, used)),
        )


def _faces(meshes: Meshes, used: UsedMesh) -> int | None:
    """Return the number of triangles, where that is known or worth the reading."""
    if used.header.state != "fine":
        return None
    if used.header.faces is not None or not used.collisions:
        return used.header.faces
    try:
        return meshes.faces(used.mesh.path)
    except MeshError:
        return None


def _coarser(robot: Facts, used: UsedMesh) -> Sequence[Edit] | None:
    """Return edits for a mesh with too many faces: the hull of what collides, less of the rest."""
    if used.header.format == "ascii-stl":
        return None  # MSH007 comes first
    drawn = [use for use in used.uses if not use.collides]
    simplify = _simplified(robot.meshes, used)
    if robot.model.kind == "mjcf":  # one element for all of them
        return replaced(robot, used.uses, "_simplified.stl", simplify)
    edits: list[Edit] = []
    for uses, ending, content in (
        (used.collisions, "_hull.stl", _hull(robot.meshes, used)),
        (drawn, "_simplified.stl", simplify),
    ):
        made = replaced(robot, uses, ending, content) if uses else ()
        if made is None or (content is not simplify and not _is_solid(robot.meshes, uses)):
            return None
        edits += made
    return edits


def _simplified(meshes: Meshes, used: UsedMesh) -> Callable[[], bytes]:
    def simplify() -> bytes:
        surface = meshes.surface(used.mesh.path)
        cells = _GRID
        while True:
            coarse = clustered(surface, cells)
            if not len(coarse.faces):
                raise MeshError("has nothing left once its corners are merged")
            share = _SIMPLIFIED / len(coarse.faces)
            if share >= 1:
                return binary_stl(coarse)
            # faces grow about as the square of the cells
            cells = max(1, int(cells * min(0.9, share**0.5)))

    return simplify


@rule("MSH009", "dense-collision-mesh", "warning", fixes="unsafe")
def dense_collision_mesh(robot: Facts) -> Iterator[Violation]:
    """A collision mesh has over 20,000 faces.

    It is the mesh that is drawn. MuJoCo and PhysX make a hull or pieces of it each time the robot
    is loaded, PyBullet and Gazebo may collide with every face, and none of it makes contacts better
    than a hull, or a few primitives, would.

    Fix:
        Use primitives, a hull, or a few convex pieces (CoACD). --unsafe-fixes writes the hull of at
        most 500 corners beside it.

    Source:
        MuJoCo's documentation, "Collision detection": meshes collide by their hulls.
    """
    for used in meshes_by_file(robot):
        faces = _faces(robot.meshes, used) if used.collisions else None
        if faces is None or not _MANY_FACES < faces <= _MOST_FACES:
            continue
        if robot.model.kind == "urdf" and used.mesh.path.suffix.lower() not in MUJOCO_SUFFIXES:
            continue  # what MSH005 converts gets a hull
        yield Violation(
            subject=used.name,
            source=used.collisions[0].mesh.source,
            message=f"{_words(used)} has {faces:,} faces; wanted {_MANY_FACES:,} or fewer",
            measured={"faces": faces},
            fix=_fix("unsafe", "Collide with its hull.", _hull_edits(robot, used)),
        )


def _hull_edits(robot: Facts, used: UsedMesh) -> Sequence[Edit] | None:
    drawn = {use.mesh.source for use in used.uses if not use.collides}
    shared = any(use.mesh.source in drawn for use in used.collisions)
    if shared or used.header.format == "ascii-stl" or not _is_solid(robot.meshes, used.collisions):
        return None
    return replaced(robot, used.collisions, "_hull.stl", _hull(robot.meshes, used))


@rule("MSH010", "flat-mesh", "error")
def flat_mesh(robot: Facts) -> Iterator[Violation]:
    """A collision mesh lies in a plane, and so has no hull.

    Simulators collide with hulls. Of a flat mesh there is none: MuJoCo and PhysX refuse it. It is
    flat if it is thinner than 1/10,000 of its diagonal; a scale of 0 makes it so, too.

    Fix:
        Use a thin box in its place.

    Source:
        MuJoCo 4.0: "has coplanar vertices", "at least 4 vertices required"; seen.
    """
    for used in meshes_by_file(robot):
        for use in used.collisions:
            if not robot.meshes.readable(use.mesh) or not robot.meshes.is_flat(use.mesh):
                continue
            corners = robot.meshes.vertices(use.mesh)
            flat = thickness(corners)
            yield Violation(
                subject=used.name,
                source=use.mesh.source,
                message=f"{_words(used)} is flat: where its {len(corners):,} corners are "
                f"closest together they span {flat:.2g} of its diagonal; wanted {FLAT:g} or more, "
                "or there is no hull",
                measured={"corners": len(corners), "thickness": flat},
            )
            break


@rule("MSH011", "wrong-scale", "error")
def wrong_scale(robot: Facts) -> Iterator[Violation]:
    """A mesh is many times too large or too small for the joints around it.

    Millimetres were taken for metres, or a scale was left out or given twice. A collision mesh a
    thousand times too large holds the whole robot; one too small touches nothing.

    It is measured by the diagonal of its box against the distance to the next joints: over 50 times
    is an error, over 15 times a warning, and so is under 1/50 an error, where the part is a dot of
    less than 5 mm. Only what nothing but a wrong unit explains is told: details, sensors, and
    scenery on a base without mass may be of any size.

    Fix:
        Correct the scale: 0.001 0.001 0.001 for a file in millimetres, 0.0254 for inches.

    Source:
        STL has no unit; URDF and MJCF measure in metres.
    """
    scales = Scales(robot)
    files = meshes_by_file(robot)
    if files and scales.span <= 0:
        raise CannotCheckError(
            "no joint is away from another, so that nothing says how large it is"
        )
    for used in files:
        for use in used.uses:
            misfit = scales.misfit(use)
            if misfit is None:
                continue
            large = misfit.ratio > 1
            yield Violation(
                subject=used.name,
                source=use.mesh.scale_source or use.mesh.source,
                message=f"{used.name} measures {misfit.diagonal:.3g} m on link {use.link.name}, "
                f"{misfit.ratio:.3g} times the {misfit.reference:.3g} m {misfit.against}; wanted "
                + (f"{LARGE:g} times or less" if large else f"{TINY:g} times or more"),
                hint=_hint(misfit),
                severity="warning" if large and misfit.ratio <= HUGE else "error",
                certainty="likely",
                measured={
                    "diagonal": misfit.diagonal,
                    "reference": misfit.reference,
                    "ratio": misfit.ratio,
                },
            )
            break


def _hint(misfit: Misfit) -> str:
    if misfit.ratio > 1:
        return (
            'If the file is in millimetres, scale it by "0.001 0.001 0.001"; in inches, by 0.0254.'
        )
    return "If it was scaled from millimetres twice, or is in metres, take the scale away."


@rule("MSH012", "negative-scale", "warning")
def negative_scale(robot: Facts) -> Iterator[Violation]:
    """A mesh is mirrored by a negative scale.

    PhysX takes no negative scale for a convex mesh, Webots none at all, and where the corners are
    multiplied and the faces stay as they are the mesh is inside out. A mesh that is only drawn, and
    one in MJCF, where this is allowed, is a note.

    Fix:
        Save a mirrored copy of the file, and scale that by positive numbers.

    Source:
        PhysX: PxConvexMeshGeometry; Webots: Transform; MuJoCo: mesh/scale allows it.
    """
    for used in meshes_by_file(robot):
        mirrored = [use for use in used.uses if min(use.mesh.scale) < 0]
        if not mirrored:
            continue
        first = next((use for use in mirrored if use.collides), mirrored[0])
        harmful = first.collides and robot.model.kind != "mjcf"
        scale = " ".join(f"{factor:g}" for factor in first.mesh.scale)
        yield Violation(
            subject=used.name,
            source=first.mesh.scale_source or first.mesh.source,
            message=f"{_words(used)} is scaled by {scale}; wanted numbers over 0",
            severity="warning" if harmful else "info",
        )


@rule("MSH013", "lfs-pointer", "error")
def lfs_pointer(robot: Facts) -> Iterator[Violation]:
    """A mesh file is a Git LFS pointer.

    The repository was cloned without Git LFS, or downloaded as an archive: in the place of each
    large file there are three lines of text that say where it is kept. No simulator reads them.

    Fix:
        Run `git lfs install` and `git lfs pull` in the repository.

    Source:
        Git LFS, "Specification": pointer files start with the word version.
    """
    for used in meshes_by_file(robot):
        if used.header.state == "lfs":
            yield Violation(
                subject=used.name,
                source=used.source,
                message=f"{_words(used)} {used.header.problem}",
                measured={"bytes": used.header.size},
            )


@rule("MSH014", "nonconvex-collision", "info")
def nonconvex_collision(robot: Facts) -> Iterator[Violation]:
    """The hull of a collision mesh is far larger than the mesh.

    MuJoCo, and PhysX unless it is told otherwise, collide with the hull: holes, notches and the
    inside of a shell are filled. That is right for a limb, and wrong for what should fit into
    something else, such as a gripper or a bracket around a joint. It is told if the hull has more
    than twice the volume of the closed mesh.

    Fix:
        If its notches matter, use several convex pieces (CoACD) or primitives.

    Source:
        MuJoCo's documentation, "Collision detection": meshes collide by their hulls.
    """
    for used in meshes_by_file(robot):
        faces = _faces(robot.meshes, used) if used.collisions else None
        if faces is None or faces > _MOST_FACES:
            continue
        first = used.collisions[0]
        try:
            solid = robot.meshes.solid_volume(first.mesh)
            if not solid:
                continue
            hull = robot.meshes.hull_volume(first.mesh)
        except MeshError:
            continue
        if hull > _BLOATED * solid:
            yield Violation(
                subject=used.name,
                source=first.mesh.source,
                message=f"{_words(used)} encloses {solid:.3g} m3, and its hull {hull:.3g} m3: "
                f"{hull / solid:.3g} times as much; wanted {_BLOATED:g} times or less",
                measured={"solid": solid, "hull": hull},
            )


def _words(used: UsedMesh) -> str:
    return f"{used.name}, {used.role},"


def _relative_fix(robot: Facts, used: UsedMesh, safety: Literal["safe", "unsafe"]) -> Fix | None:
    """Return a fix that names the file relative to the robot's, if it lies near."""
    if robot.model.kind != "urdf":
        return None  # a name in MJCF starts at meshdir
    name = relative_name(robot, used.mesh.path)
    if is_absolute(name) or name.split("/").count("..") > _FAR_UP:
        return None
    return _fix(safety, f"Refer to it as {name}.", renamed(robot, used.uses, name))


def _fix(
    safety: Literal["safe", "unsafe"], description: str, edits: Iterable[Edit] | None
) -> Fix | None:
    """Return a fix; None where the file cannot be edited."""
    if edits is None:
        return None
    return Fix(safety=safety, description=description, edits=tuple(edits))
