"""Rules on the number of faces of meshes."""

from collections.abc import Sequence

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.meshes.uses import MAX_COLLISION_FACES, MAX_STL_FACES, UsedMesh
from terrainkit_robots.description.fix import Edit, make_fix
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.mesh.sniff import MUJOCO_SUFFIXES


@rule("MSH008", "too-many-faces", "error", fixes="unsafe", onboarding="converts")
def too_many_faces(robot: Facts) -> Violations:
    """A mesh has over 200,000 faces.

    MuJoCo rejects such an STL file. A visual mesh, or a mesh in another format, can be loaded, but
    it costs memory and time. Then it is a warning.

    Fix:
        Simplify the mesh, for example in Blender or MeshLab. --unsafe-fixes writes a simplified
        copy beside it, or the convex hull of a collision mesh.

    Source:
        Observed in MuJoCo 4.0: "number of faces should be between 1 and 200000".
    """
    for used in robot.mesh_files:
        faces = used.count_faces()
        if faces is None or faces <= MAX_STL_FACES:
            continue
        is_rejected = used.strict and used.header.format in ("stl", "ascii-stl")
        yield Violation(
            element=used,
            message=f"number of faces of {used.label}: got {faces:,}; expected at most "
            f"{MAX_STL_FACES:,}, MuJoCo's limit for STL",
            severity="error" if is_rejected else "warning",
            measured={"faces": faces},
            fix=make_fix("unsafe", "Simplify the mesh.", _simplify_edits(robot, used)),
        )


def _simplify_edits(robot: Facts, used: UsedMesh) -> Sequence[Edit] | None:
    """Return the edits that replace collision meshes by hulls and simplify visual meshes."""
    if used.header.format == "ascii-stl":
        return None  # MSH007 converts it first
    visuals = [use for use in used.uses if not use.is_collision]
    simplify = used.simplified_stl
    if robot.model.kind == "mjcf":  # all uses share one element
        return used.replace_edits(robot.model, used.uses, "_simplified.stl", simplify)
    edits: list[Edit] = []
    for uses, ending, content in (
        (used.collisions, "_hull.stl", used.hull_stl),
        (visuals, "_simplified.stl", simplify),
    ):
        made = used.replace_edits(robot.model, uses, ending, content) if uses else ()
        if made is None or (content is not simplify and not used.has_hull(uses)):
            return None
        edits += made
    return edits


@rule("MSH009", "dense-collision-mesh", "warning", fixes="unsafe")
def dense_collision_mesh(robot: Facts) -> Violations:
    """A collision mesh has over 20,000 faces.

    It is usually the visual mesh. MuJoCo and PhysX compute its hull or a decomposition each time
    the robot is loaded, and PyBullet and Gazebo may collide with every face. The contacts are no
    better than with a convex hull or a few primitives.

    Fix:
        Use primitives, a convex hull, or a convex decomposition (CoACD). --unsafe-fixes writes a
        hull with at most 500 vertices beside it.

    Source:
        MuJoCo's documentation, "Collision detection": meshes collide by their hulls.
    """
    for used in robot.mesh_files:
        faces = used.count_faces() if used.collisions else None
        if faces is None or not MAX_COLLISION_FACES < faces <= MAX_STL_FACES:
            continue
        if robot.model.kind == "urdf" and used.mesh.path.suffix.lower() not in MUJOCO_SUFFIXES:
            continue  # MSH005 converts it to a hull
        yield Violation(
            element=Part(used.name, used.collisions[0].mesh.source),
            message=f"number of faces of {used.label}: got {faces:,}; expected at most "
            f"{MAX_COLLISION_FACES:,}",
            measured={"faces": faces},
            fix=make_fix("unsafe", "Use its convex hull for collision.", _hull_edits(robot, used)),
        )


def _hull_edits(robot: Facts, used: UsedMesh) -> Sequence[Edit] | None:
    visuals = {use.mesh.source for use in used.uses if not use.is_collision}
    is_shared = any(use.mesh.source in visuals for use in used.collisions)
    if is_shared or used.header.format == "ascii-stl" or not used.has_hull(used.collisions):
        return None
    return used.replace_edits(robot.model, used.collisions, "_hull.stl", used.hull_stl)
