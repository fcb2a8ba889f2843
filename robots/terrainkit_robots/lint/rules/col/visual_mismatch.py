"""Rules on differences between collision and visual shapes."""

import math
from collections import Counter
from pathlib import Path

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body, BodyShape
from terrainkit_robots.analysis.bodies.shapes import bounds, has_bounds
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.wheels import turns_without_limits
from terrainkit_robots.description.model import Geometry, Joint
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.text import numbers
from terrainkit_robots.transforms import Matrix, invert_poses, pose_error

# The 4 published files beyond these limits have 87 mm to 1.6 m, or 90 degrees.
_MAX_OFFSET = 0.005
"""Allowed distance between a mesh as visual and as collision shape [m]."""

_MAX_ANGLE = math.radians(3)
"""Allowed angle between them [rad]."""

_MAX_SIZE_RATIO = 1.5
"""Allowed ratio of the sizes of a primitive as collision and as visual shape."""

_MAX_ERROR_RATIO = 9.0
"""The same for an error: from a decimal place on, a part collides with everything around it."""

_MIN_SHARE_INSIDE = 0.5
"""Share of a collision shape's bounding box that has to be inside of the visible robot around
it."""

_MAX_AXIS_ANGLE = math.radians(45)
"""Allowed angle of a cylinder to the visible one, or of a wheel to the axis that it turns about
[rad]."""

_MAX_WHEEL_OFFSET = 0.1
"""Allowed distance of the center of a wheel to its axis, over its radius."""

_MAX_ELONGATION = 1.5
"""Ratio of the two longest sides of a shape that is between its joints however it is turned."""

_VISUAL_MARGIN = 0.01
"""Margin of the visible robot [m]."""


@rule("COL009", "displaced-collision-mesh", "warning")
def displaced_collision_mesh(robot: Facts) -> Violations:
    """A mesh has another pose or scale as collision shape than as visual shape of the same link.

    The origin or the scale was changed in one of the two elements only. The robot collides where
    it cannot be seen, for example with its own thighs. A collision primitive that is larger than
    the visual primitive at the same place is reported as well, such as a sphere whose radius is
    the diameter, and a cylinder that is turned against the visible one, or against the axis of the
    wheel that it belongs to. From 9 times on it is an error.

    Fix:
        Copy <origin> and scale from the correct element to the other one.

    Source:
        Issue 184 of OrbbecSDK_ROS2, issue 2969 of realsense-ros and issue 115 of unitree_ros.
    """
    for link in robot.links:
        for collision in link.collisions:
            mesh = collision.mesh
            same = [v for v in link.visuals if _is_same_file(collision, v)]
            differences = [_difference(collision, visual) for visual in same]
            if mesh is not None and differences and all(differences) and not collision.fit_to_mesh:
                yield Violation(
                    element=Part(link.name, collision.source),
                    message=f"collision mesh {Path(mesh.filename).name} of link {link.name}: got "
                    f"{differences[0]} the same mesh of the visual; expected the same pose and "
                    "scale",
                )
    yield from _resized_primitives(robot)
    yield from _turned_cylinders(robot)


def _turned_cylinders(robot: Facts) -> Violations:
    """Yield cylinders that lie across the visible ones, or across the axes of their wheels."""
    parents = {body.parent for body in robot.bodies}
    across: list[tuple[BodyShape, str, float]] = []
    for body in robot.bodies:
        joint, shapes = body.joint, body.collisions
        is_end = joint is not None and turns_without_limits(joint) and body.index not in parents
        for shape in shapes:
            for visual in body.visuals:
                angle = _axis_angle(shape.pose, visual.pose[:3, 2])
                if _is_same_cylinder(shape, visual) and angle > _MAX_AXIS_ANGLE:
                    across.append((shape, "the visible cylinder", angle))
                    break
            else:
                if joint is not None and is_end and len(shapes) == 1 and _is_wheel(shape, joint):
                    angle = _axis_angle(shape.pose, joint.direction)
                    if angle > _MAX_AXIS_ANGLE:
                        across.append((shape, f"the axis of joint {joint.name}", angle))
    for shape, reference, angle in across:
        # One disk across its axis may be a lens that turns; wheels come in pairs.
        if reference.startswith("the visible") or len(across) > 1:
            yield Violation(
                element=Part(shape.link, shape.geometry.source),
                certainty="likely",
                message=f"axis of the collision cylinder of link {shape.link}: got "
                f"{math.degrees(angle):.3g} deg to {reference}; expected 0 deg",
                measured={"angle": math.degrees(angle)},
            )


def _axis_angle(pose: Matrix, axis: Matrix) -> float:
    """Return the angle between the z axis of a pose and an axis, which has no direction [rad]."""
    return math.acos(min(abs(float(pose[:3, 2] @ axis)), 1.0))


def _is_same_cylinder(a: BodyShape, b: BodyShape) -> bool:
    """Return whether two cylinders have the same size and center."""
    sizes = a.geometry.size, b.geometry.size
    is_cylinder = a.geometry.shape == b.geometry.shape == "cylinder" and a.link == b.link
    return (
        is_cylinder
        and len(sizes[0]) == len(sizes[1]) == 2
        and np.allclose(*sizes, rtol=_MAX_SIZE_RATIO - 1, atol=0)
        and float(np.linalg.norm(a.pose[:3, 3] - b.pose[:3, 3])) < _MAX_OFFSET
    )


def _is_wheel(shape: BodyShape, joint: Joint) -> bool:
    """Return whether a shape is a disk in the middle of the axis of a joint."""
    if shape.geometry.shape != "cylinder" or len(shape.geometry.size) != 2:
        return False
    radius, half_length = shape.geometry.size
    arm = np.cross(shape.pose[:3, 3] - joint.anchor, joint.direction)
    is_centered = float(np.linalg.norm(arm)) <= _MAX_WHEEL_OFFSET * radius
    return is_centered and radius > half_length > 0


def _resized_primitives(robot: Facts) -> Violations:
    """Yield collision primitives that are larger than the same primitive of the visual.

    If several links agree in the ratio, it is intended: the feet of many quadrupeds.
    """
    found: list[tuple[str, Geometry, Geometry, float]] = []
    for link in robot.links:
        for collision in link.collisions:
            same = [v for v in link.visuals if _is_same_place(collision, v)]
            ratios = [max(a / b for a, b in zip(collision.size, v.size, strict=True)) for v in same]
            if ratios and min(ratios) > _MAX_SIZE_RATIO:
                visual = same[ratios.index(min(ratios))]
                found.append((link.name, collision, visual, round(min(ratios), 2)))
    counts = Counter(ratio for _, _, _, ratio in found)
    for name, collision, visual, ratio in found:
        if counts[ratio] == 1:
            yield Violation(
                element=Part(name, collision.size_source or collision.source),
                severity="error" if ratio > _MAX_ERROR_RATIO else None,
                certainty="likely",
                message=f"size of the collision {collision.shape} of link {name}: got "
                f"{numbers(collision.size)} m, {ratio:g} times the "
                f"{numbers(visual.size)} m of the visual at the same place (half "
                "lengths); expected the same size",
                measured={"ratio": ratio},
            )


def _is_same_place(a: Geometry, b: Geometry) -> bool:
    """Return whether two primitives of a kind have the same pose and comparable sizes."""
    is_primitive = a.mesh is None and a.shape == b.shape and len(a.size) == len(b.size) > 0
    return (
        is_primitive
        and min(*a.size, *b.size, 1.0) > 0
        and float(np.abs(a.origin - b.origin).max()) < _MAX_OFFSET
    )


def _is_same_file(a: Geometry, b: Geometry) -> bool:
    return (
        a.mesh is not None and b.mesh is not None and a.mesh.path == b.mesh.path
    ) and a.shape == b.shape == "mesh"


def _difference(a: Geometry, b: Geometry) -> str:
    """Return how the poses and scales of two shapes with the same mesh differ."""
    assert a.mesh is not None
    assert b.mesh is not None
    scales = np.array(a.mesh.scale), np.array(b.mesh.scale)
    if np.abs(scales[0] - scales[1]).max() > 0.02 * np.abs(scales[1]).max():
        return f"scale {numbers(scales[0])} instead of {numbers(scales[1])} of"
    distance, angle = map(float, pose_error(a.origin, b.origin))
    if distance > _MAX_OFFSET:
        return f"a distance of {1000 * distance:.3g} mm to"
    return f"an angle of {math.degrees(angle):.3g} deg to" if angle > _MAX_ANGLE else ""


@rule("COL010", "collision-outside-visual", "warning", needs=("legs",), certainty="likely")
def collision_outside_visual(robot: Facts) -> Violations:
    """Most of a collision shape is outside of the visible robot.

    The shape is turned, or on the wrong side of the joint: an origin was lost, has a wrong sign, or
    is in degrees. The visible part passes through obstacles, and empty space collides with them.

    Fix:
        Correct the <origin> of the <collision>. Show collision shapes in a viewer.

    Source:
        Bounding boxes at position 0 of the shape and of the visual shapes of its body and of the
        bodies next to it. Checked are the legs and the trunk of robots with visual shapes on most
        bodies, without meshes and spheres, which have no direction.
    """
    drawn = [body for body in robot.bodies if body.visuals]
    if 2 * len(drawn) < len(robot.bodies):
        return
    for body in robot.bodies:
        if not body.visuals or body.index not in robot.leg_bodies | {0}:
            continue
        suspects = [shape for shape in body.collisions if _needs_check(robot, body, shape)]
        for shape in suspects:
            box = bounds([shape], robot.meshes)
            visible = _visible_box(robot, body)
            if box is None or visible is None:
                continue
            share = _share_inside(box, visible)
            if share < _MIN_SHARE_INSIDE:
                yield Violation(
                    element=Part(shape.link, shape.geometry.source),
                    message=f"part of the collision {shape.geometry.shape} of link {shape.link} "
                    f"inside of the visible robot: got {share:.0%}; expected at least "
                    f"{_MIN_SHARE_INSIDE:.0%}",
                    measured={"share": share},
                )


def _needs_check(robot: Facts, body: Body, shape: BodyShape) -> bool:
    """Return whether a primitive is not between the joints of its body.

    Opening visual meshes is slow, and the segment between the joints settles most shapes.
    """
    if shape.geometry.shape in ("mesh", "plane", "sphere", "unknown"):
        return False
    if not has_bounds(shape.geometry, robot.meshes):
        return False
    box = bounds([shape], robot.meshes)
    points = [np.zeros(3), *(b.origin[:3, 3] for b in robot.bodies if b.parent == body.index)]
    points += [pose[:3, 3] for pose in body.poses]
    joints = np.array([np.min(points, axis=0), np.max(points, axis=0)])
    size = 0.15 * float(np.linalg.norm(joints[1] - joints[0])) + _VISUAL_MARGIN
    joints += np.array([[-size], [size]])
    if box is None or _share_inside(box, joints) >= _MIN_SHARE_INSIDE:
        return False
    center, sides = box.mean(axis=0), np.sort(box[1] - box[0])
    is_between = bool((joints[0] <= center).all() and (center <= joints[1]).all())
    is_compact = sides[2] <= _MAX_ELONGATION * sides[1]  # its rotation does not matter
    return not (is_between and is_compact and sides[2] <= float((joints[1] - joints[0]).max()))


def _visible_box(robot: Facts, body: Body) -> Matrix | None:
    """Return the bounding box of the visuals of a body, its parent and its children.

    None if one of them cannot be read. Shape (2, 3), in the frame of the body [m].
    """
    near = [
        b for b in robot.bodies if b.parent == body.index or b.index in (body.index, body.parent)
    ]
    inverse = invert_poses(body.zero_pose)
    shapes = [
        BodyShape(geometry=v.geometry, link=v.link, pose=inverse @ b.zero_pose @ v.pose)
        for b in near
        for v in b.visuals
    ]
    if not all(has_bounds(shape.geometry, robot.meshes) for shape in shapes):
        return None
    box = bounds(shapes, robot.meshes)
    return None if box is None else box + np.array([[-_VISUAL_MARGIN], [_VISUAL_MARGIN]])


def _share_inside(box: Matrix, outer: Matrix) -> float:
    """Return the share of the volume of a box that is inside of another one."""
    size = box[1] - box[0]
    inside = np.minimum(box[1], outer[1]) - np.maximum(box[0], outer[0])
    return float(np.prod(np.clip(inside, 0, None) / np.maximum(size, 1e-9)))
