"""Rules on the symmetry of masses and centers of mass."""

from collections import Counter
from functools import partial

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.gaps import box_at_zero, shapes_of
from terrainkit_robots.analysis.bodies.shapes import bounds, shape_key
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.inertial import mass_part
from terrainkit_robots.analysis.symmetry.mirror_pairs import (
    MAX_COM_ERROR,
    MAX_MASS_DIFFERENCE,
    MirrorPair,
    outlier_first,
)
from terrainkit_robots.lint.compare.body_mass import relative_difference
from terrainkit_robots.lint.rule import Violation, Violations, findings_of, rule
from terrainkit_robots.lint.rules.sym.other_rules import OtherRules, check_joint_types
from terrainkit_robots.text import contrast, numbers
from terrainkit_robots.transforms import Matrix

_MAX_TRUNK_OFFSET, _TRUNK_OFFSET_SHARE = 0.02, 0.25
"""Allowed distance of the trunk's center of mass from the mirror plane: the larger one of this
distance [m] and this share of the legs' distance. Of 143 published legged robots, none exceeds a
share of 0.11."""


@rule("SYM001", "mass-asymmetry", "warning")
def mass_asymmetry(robot: Facts) -> Violations:
    """The mass of a body differs from its mirror image.

    A number was mistyped, or changed on one side only. The robot leans, and a policy learns to
    compensate for a lean that the real robot does not have.

    Fix:
        Give both bodies the same mass; ignore the rule if the real masses differ.

    Source:
        The masses of tested robots without defects agree to four digits.
    """
    check_joint_types(robot)
    other_rules = OtherRules(robot, "INR010", "INR009", "INR001")
    for pair in robot.uncopied_pairs:
        left, right = pair.left, pair.right
        difference = relative_difference(left.body.mass, right.body.mass)
        if not pair.has_valid_masses or difference <= MAX_MASS_DIFFERENCE:
            continue
        if pair.is_negligible(robot.total_mass) or other_rules.report(pair):
            continue
        odd, other, reason = outlier_first(robot, pair, lambda body: np.array([body.mass]))
        yield Violation(
            element=mass_part(odd.body.main_link),
            message=f"mass of body {odd.body.name}: got {odd.body.mass:.4g} kg, "
            f"{contrast(difference, MAX_MASS_DIFFERENCE, '.1%')[0]} from the "
            f"{other.body.mass:.4g} kg of its mirror image {other.body.name}; expected at most "
            f"{MAX_MASS_DIFFERENCE:.0%}; {reason}",
            measured={
                "mass": odd.body.mass,
                "other": other.body.mass,
                "mirror_image": other.body.name,
            },
        )


@rule("SYM002", "com-asymmetry", "warning")
def com_asymmetry(robot: Facts) -> Violations:
    """A center of mass is not at the mirrored position of its mirror image.

    Usually a sign was lost when one side was copied from the other, or the frame of one link is
    rotated. As with a wrong mass, the weight shifts to one side. The center of mass of the trunk
    has to be close to the mirror plane.

    A part such as a motor that is mounted on both sides in the same way is not reported: its shape
    is not mirrored either.

    Fix:
        Mirror the origin of the <inertial>, in the frame of its own link.

    Source:
        The centers of mass of tested robots without defects agree to 0.1 mm; the tolerance is 2 mm
        plus 10 % of the radius of gyration.
    """
    check_joint_types(robot)
    _, displaced = robot.misalignments
    other_rules = OtherRules(robot, "INR008")
    for pair in robot.uncopied_pairs:
        left, right = pair.left, pair.right
        if pair.indices & displaced or not pair.has_valid_masses:
            continue
        difference = relative_difference(left.body.mass, right.body.mass)
        if pair.is_merged and difference > MAX_MASS_DIFFERENCE:
            continue  # a heavier part shifts the center of mass of the merged body
        error, limit = pair.com_error(robot.mirror), pair.max_com_error
        if error <= limit or other_rules.report(pair):
            continue
        if _is_same_part(robot, left.body, right.body) or _moves_with_shape(robot, pair, limit):
            continue
        odd, other, reason = outlier_first(
            robot, pair, lambda body: body.center, partial(_shape_offset, robot)
        )
        centers = [numbers(1000 * side.body.center, ".1f", ", ") for side in (odd, other)]
        got, expected = contrast(1000 * error, 1000 * limit, ".3g")
        yield Violation(
            element=mass_part(odd.body.main_link),
            message=f"center of mass of body {odd.body.name}: got ({centers[0]}) mm, and "
            f"({centers[1]}) mm for its mirror image {other.body.name}, each in its own "
            f"frame: {got} mm from mirrored; expected at most {expected} mm; {reason}",
            measured={"gap": error, "allowed": limit, "mirror_image": other.body.name},
        )
    if len(robot.legs) > 1 and robot.uncopied_pairs:
        yield from _trunk_offset(robot)


def _shape_offset(robot: Facts, body: Body) -> float | None:
    """Return the distance of the center of mass from the middle of the shapes [m]."""
    box = box_at_zero(body, shapes_of(body), robot.meshes)
    return None if box is None else float(np.linalg.norm(box.mean(axis=0) - body.zero_center))


def _trunk_offset(robot: Facts) -> Violations:
    """Yield a violation if the center of mass of the trunk is far from the mirror plane."""
    trunk, mirror = robot.bodies[0], robot.mirror
    starts = [abs(float(leg.limb.points[0] @ mirror.normal) - mirror.offset) for leg in robot.legs]
    limit = max(_MAX_TRUNK_OFFSET, _TRUNK_OFFSET_SHARE * max(starts))
    distance = abs(float(trunk.center @ mirror.normal) - mirror.offset)
    reported = {finding.subject for finding in findings_of(robot, "INR008")}
    if trunk.mass > 0 and distance > limit and trunk.name not in reported:
        got, expected = contrast(1000 * distance, 1000 * limit, ".3g")
        yield Violation(
            element=mass_part(trunk.main_link),
            message=f"distance of the center of mass of trunk {trunk.name} from the mirror plane: "
            f"got {got} mm; expected at most {expected} mm",
            measured={"gap": distance, "allowed": limit},
        )


def _is_same_part(robot: Facts, a: Body, b: Body) -> bool:
    """Return whether both sides use the same part without mirroring it.

    The center of mass, the shapes and the child bodies are then at the same places of the frame.
    """
    return (
        bool(np.abs(a.center - b.center).max() < MAX_COM_ERROR)
        and bool(a.collisions or a.visuals)
        and _signature(robot, a) == _signature(robot, b)
    )


def _moves_with_shape(robot: Facts, pair: MirrorPair, limit: float) -> bool:
    """Return whether the shapes are as far from mirrored as the centers of mass, as with motors.

    Args:
        robot: The facts about the robot.
        pair: Two bodies.
        limit: Allowed difference of the two distances [m].
    """
    offsets = []
    for body in pair.bodies:
        box = bounds(body.collisions or body.visuals, robot.meshes)
        if box is None:
            return False
        offsets.append(body.zero_pose[:3, :3] @ (body.center - box.mean(axis=0)))
    return float(np.linalg.norm(robot.mirror.image(offsets[0]) - offsets[1])) <= limit


def _signature(robot: Facts, body: Body) -> Counter[tuple[object, ...]]:
    """Return the shapes and child bodies of a body with their poses, key to 1 mm."""

    def key(pose: Matrix) -> tuple[float, ...]:
        return tuple(float(x) for x in np.round(pose[:3], 3).ravel() + 0.0)

    shapes = [(*shape_key(placed.geometry), key(placed.pose)) for placed in shapes_of(body)]
    mounts = [key(other.origin) for other in robot.bodies if other.parent == body.index]
    return Counter([*shapes, *mounts])
