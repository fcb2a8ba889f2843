"""Rules on the formats of mesh files."""

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.meshes.uses import UsedMesh
from terrainkit_robots.description.fix import make_fix
from terrainkit_robots.lint.rule import Severity, Violation, Violations, rule
from terrainkit_robots.lint.rules.msh.path import not_loaded
from terrainkit_robots.mesh.mesh_cache import MeshError, Meshes, TooLargeError
from terrainkit_robots.mesh.sniff import MUJOCO_SUFFIXES
from terrainkit_robots.text import names


@rule("MSH005", "unsupported-format", "error", fixes="unsafe", onboarding="converts")
def unsupported_format(robot: Facts) -> Violations:
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
    for used in robot.mesh_files:
        suffix = used.mesh.path.suffix.lower()
        if not used.strict or suffix in MUJOCO_SUFFIXES or used.header.state != "fine":
            continue
        uses = used.uses if robot.model.kind == "mjcf" else used.collisions
        edits = None
        if used.has_hull(uses):
            edits = used.replace_edits(robot.model, uses, ".stl", used.stl_or_hull)
        yield Violation(
            element=used,
            message=f"format of {used.label}: got {suffix or 'no suffix'}; expected "
            f"{', '.join(MUJOCO_SUFFIXES)} for MuJoCo",
            fix=make_fix("unsafe", "Convert it to STL.", edits),
        )


@rule("MSH006", "malformed-mesh", "error")
def malformed_mesh(robot: Facts) -> Violations:
    """A mesh file is empty, truncated or in another format than its suffix.

    A binary STL has 84 bytes plus 50 per face. Any other size means that the file was truncated in
    a copy or download. Readers reject it, or read triangles from invalid memory.

    Fix:
        Copy or download the file again, or export it again.

    Source:
        Observed in MuJoCo 4.0: "STL file has wrong size", "is empty", "vertex coordinate is not
        finite".
    """
    for used in robot.mesh_files:
        problem, severity = _file_problem(robot.meshes, used)
        if problem:
            yield Violation(
                element=used,
                message=f"{used.label} {problem}",
                severity=severity,
                measured={"bytes": used.header.size},
            )


def _file_problem(meshes: Meshes, used: UsedMesh) -> tuple[str, Severity]:
    """Return what is wrong with a file and the severity, unless another rule reports it."""
    if used.header.state in ("lfs", "missing"):
        return "", "note"
    if used.header.problem:
        return used.header.problem, not_loaded(used)
    if used.header.format != "other":
        for use in used.collisions:
            try:
                meshes.vertices(use.mesh)
            except TooLargeError as error:
                return f"was not checked: it {error}", "note"
            except MeshError as error:
                return str(error), "error"
    return "", "note"


@rule("MSH007", "ascii-stl", "error", fixes="safe", onboarding="converts")
def ascii_stl(robot: Facts) -> Violations:
    """A mesh is an ASCII STL file.

    MuJoCo reads binary STL only, and interprets the text as the number of faces. Other readers
    support both formats, so a visual mesh of a URDF is only a note.

    Fix:
        Save it as binary STL. --fix writes one beside it.

    Source:
        Observed in MuJoCo 4.0: "perhaps this is an ASCII file?".
    """
    for used in robot.mesh_files:
        if used.header.format == "ascii-stl" and used.header.state == "fine":
            edits = used.replace_edits(robot.model, used.uses, "_binary.stl", used.binary_copy)
            yield Violation(
                element=used,
                message=f"format of {used.label}: got ASCII STL of {used.header.size:,} "
                "bytes; expected binary STL for MuJoCo",
                severity="error" if used.strict else "note",
                fix=make_fix("safe", "Convert it to binary STL.", edits),
            )


@rule("MSH013", "lfs-pointer", "error")
def lfs_pointer(robot: Facts) -> Violations:
    """A mesh file is a Git LFS pointer.

    The repository was cloned without Git LFS, or downloaded as an archive. Each large file is
    replaced by three lines of text with its hash, which no simulator can read.

    Fix:
        Run `git lfs install` and `git lfs pull` in the repository.

    Source:
        Git LFS, "Specification": pointer files start with the word version.
    """
    for used in robot.mesh_files:
        if used.header.state == "lfs":
            yield Violation(
                element=used,
                message=f"{used.label} {used.header.problem}",
                severity=not_loaded(used),
                measured={"bytes": used.header.size},
            )


@rule("MSH017", "collada-frame", "note")
def collada_frame(robot: Facts) -> Violations:
    """COLLADA meshes have another unit than meters, or another up axis than z.

    Programs read such a file differently. RViz, Gazebo Classic and PyBullet apply the unit;
    trimesh, with which yourdfpy and Genesis read meshes, does not. PyBullet turns the mesh until
    its up axis is z; the others keep the axes as they are. `onboard` applies the unit and keeps the
    axes, as RViz does. A file that states neither is not reported.

    Fix:
        Export the mesh in meters with z up, or convert it to OBJ or STL as RViz shows it.

    Source:
        Bullet: LoadMeshFromCollada.cpp; trimesh: exchange/dae.py; gazebosim/gazebo-classic#1305:
        the tag up_axis is not read; ros-visualization/rviz#1045.
    """
    frames: dict[tuple[float, str], list[UsedMesh]] = {}
    for used in robot.mesh_files:
        unit, up_axis = used.header.unit, used.header.up_axis or "Z_UP"
        if (unit, up_axis) != (1.0, "Z_UP"):
            frames.setdefault((unit, up_axis), []).append(used)
    for (unit, up_axis), members in frames.items():
        yield Violation(
            element=members[0],
            message=f"unit and up axis of {names((used.name for used in members), 2)}: got "
            f"{unit:g} m and {up_axis}; expected 1 m and Z_UP, since "
            + " and ".join(
                ["trimesh (Genesis, yourdfpy) ignores the unit"] * (unit != 1)
                + ["PyBullet turns the mesh by 90 degrees"] * (up_axis != "Z_UP")
            ),
            measured={"unit": unit, "meshes": len(members)},
        )
