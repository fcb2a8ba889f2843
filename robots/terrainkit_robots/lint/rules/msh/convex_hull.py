"""Rules on the convex hulls of collision meshes."""

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.meshes.uses import MAX_STL_FACES
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.mesh.mesh_cache import MeshError
from terrainkit_robots.mesh.surface import FLAT, thickness

_MAX_HULL_RATIO = 2.0
"""Maximum ratio of the volumes of hull and mesh. Limbs and brackets have 1.1 to 1.8."""


@rule("MSH010", "flat-mesh", "error")
def flat_mesh(robot: Facts) -> Violations:
    """A collision mesh is flat and has no convex hull.

    Simulators collide with convex hulls. A flat mesh has none, and MuJoCo and PhysX reject it. A
    mesh is flat if its thickness is below 1/10,000 of its diagonal, which includes a scale of 0.

    Fix:
        Use a thin box instead.

    Source:
        Observed in MuJoCo 4.0: "has coplanar vertices", "at least 4 vertices required".
    """
    for used in robot.mesh_files:
        for use in used.collisions:
            if not robot.meshes.is_readable(use.mesh) or not robot.meshes.is_flat(use.mesh):
                continue
            vertices = robot.meshes.vertices(use.mesh)
            relative = thickness(vertices)
            yield Violation(
                element=Part(used.name, use.mesh.source),
                message=f"thickness of {used.label} over its diagonal: got {relative:.2g}; "
                f"expected at least {FLAT:g}",
                measured={"corners": len(vertices), "thickness": relative},
            )
            break


@rule("MSH014", "nonconvex-collision", "note")
def nonconvex_collision(robot: Facts) -> Violations:
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
    for used in robot.mesh_files:
        faces = used.count_faces() if used.collisions else None
        if faces is None or faces > MAX_STL_FACES:
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
                element=Part(used.name, first.mesh.source),
                message=f"volume of the convex hull of {used.label}: got {hull:.3g} m3, "
                f"{hull / solid:.3g} times the volume of the mesh; expected at most "
                f"{_MAX_HULL_RATIO:g} times",
                measured={"solid": solid, "hull": hull},
            )
