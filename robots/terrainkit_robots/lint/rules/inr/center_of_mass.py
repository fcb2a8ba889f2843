"""Rule on centers of mass."""

import numpy as np

from terrainkit_robots.analysis.bodies.bounds import half_diagonal
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.inertial import because_of, bodies_with_mass, mass_part
from terrainkit_robots.lint.rule import Violation, Violations, rule
from terrainkit_robots.text import contrast
from terrainkit_robots.transforms import Matrix

# Of 536 published files, 15 have a warning and 3 an error, 12 to 35 cm outside, all with real
# defects (benchmarks/results/check_robot_precision.md).
_COM_SHARE, _COM_MARGIN, _COM_ERROR = 0.10, 0.005, 3.0
"""Allowed distance of a center of mass from the bounding box of its body: a fraction of the
diagonal plus a margin [m]. The last value is the multiple of that distance that is an error."""


@rule("INR008", "com-outside-body", "warning", needs=("length-unit",))
def com_outside_body(robot: Facts) -> Violations:
    """A center of mass lies outside of its body.

    The origin of an <inertial> is given in the frame of its link. If it was given in the frame of
    the robot or the CAD file, in millimeters, or with the sign of the part on the other side, the
    simulated robot tips over or needs torques that the real one does not need.

    Fix:
        Give the center of mass in the frame of the link, in meters.

    Source:
        The center of mass of a convex body lies inside it. The margin of 10 % of the diagonal is
        for shapes that omit parts of the body; three times the margin is an error.
    """
    body_bounds = robot.body_bounds
    for body in bodies_with_mass(robot.bodies):

        def is_invalid(box: Matrix, center: Matrix = body.center) -> bool:
            return _distance(center, box) > _max_distance(box)

        box = body_bounds.box_if(body, is_invalid)
        if box is None:
            continue
        cause, *_ = max(body.parts(), key=lambda part: part[1] * _distance(part[2][:3, 3], box))
        distance, limit = _distance(body.center, box), _max_distance(box)
        got, expected = contrast(distance, limit, ".3g")
        yield Violation(
            element=mass_part(cause),
            severity="error" if distance > _COM_ERROR * limit else "warning",
            message=f"center of mass of body {body.name}: got {got} m outside of the "
            f"bounding box, whose diagonal is {2 * half_diagonal(box):.3g} m; expected at most "
            f"{expected} m" + because_of(cause, body),
            measured={"outside": distance, "allowed": limit},
        )


def _distance(point: Matrix, box: Matrix) -> float:
    """Return the distance of a point from a box [m]; 0 inside."""
    return float(np.linalg.norm(np.maximum(0, np.maximum(box[0] - point, point - box[1]))))


def _max_distance(box: Matrix) -> float:
    return _COM_SHARE * 2 * half_diagonal(box) + _COM_MARGIN
