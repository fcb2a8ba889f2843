"""Rules on the scales of meshes."""

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.meshes.scale import (
    MAX_PLAUSIBLE_RATIO,
    MAX_RATIO,
    MIN_RATIO,
    MeshScales,
    ScaleMismatch,
)
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.text import numbers


@rule("MSH011", "wrong-scale", "error", certainty="likely", needs=("length-unit",))
def wrong_scale(robot: Facts) -> Violations:
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
    scales = MeshScales(robot)
    files = robot.mesh_files
    if files and scales.robot_size <= 0:
        raise CannotCheckError("all joints have the same position, so the size is unknown")
    for used in files:
        for use in used.uses:
            mismatch = scales.mismatch(use)
            if mismatch is None:
                continue
            is_large = mismatch.ratio > 1
            yield Violation(
                element=Part(used.name, use.mesh.scale_source or use.mesh.source),
                message=f"size of mesh {used.name} on link {use.link.name}: got "
                f"{mismatch.diagonal:.3g} m, {mismatch.ratio:.3g} times the "
                f"{mismatch.reference:.3g} m {mismatch.description}; expected "
                + (f"at most {MAX_RATIO:g} times" if is_large else f"at least {MIN_RATIO:g} times"),
                hint=_scale_hint(mismatch),
                severity="warning"
                if is_large and mismatch.ratio <= MAX_PLAUSIBLE_RATIO
                else "error",
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
def negative_scale(robot: Facts) -> Violations:
    """A mesh is mirrored by a negative scale.

    PhysX does not support a negative scale for convex meshes, and Webots does not support it at
    all. In readers that only scale the vertices, the mesh is inside out. It is a note for visual
    meshes and for MJCF, which allows it.

    Fix:
        Save a mirrored copy of the file and use a positive scale.

    Source:
        PhysX: PxConvexMeshGeometry; Webots: Transform; MuJoCo: mesh/scale allows it.
    """
    for used in robot.mesh_files:
        mirrored = [use for use in used.uses if min(use.mesh.scale) < 0]
        if not mirrored:
            continue
        first = next((use for use in mirrored if use.is_collision), mirrored[0])
        is_harmful = first.is_collision and robot.model.kind != "mjcf"
        scale = numbers(first.mesh.scale)
        yield Violation(
            element=Part(used.name, first.mesh.scale_source or first.mesh.source),
            message=f"scale of {used.label}: got {scale}; expected values > 0",
            severity="warning" if is_harmful else "note",
        )
