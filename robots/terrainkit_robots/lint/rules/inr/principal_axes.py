"""Rule on the orientation of an inertia in its body."""

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.inertial import inertia_part
from terrainkit_robots.description.model import Link
from terrainkit_robots.lint.rule import Violation, Violations, rule
from terrainkit_robots.text import numbers

_MIN_ELONGATION = 2.5
"""Length of a body over its width, from which the moment about its long axis is the smallest."""

_MIN_EXCESS = 1.5
"""Moment about the long axis over the other moments, from which axes are probably exchanged."""


def _exchanged_link(body: Body, long: int) -> Link | None:
    """Return the link with the largest moment about the long axis, or None if that is plausible.

    Args:
        body: The body.
        long: Index of the long axis in the frame of the body.
    """
    largest, found = 0.0, None
    for link, pose in zip(body.links, body.poses, strict=True):
        if link.inertial is None or link.inertial.inertia is None:
            continue
        rotation = (pose @ link.inertial.origin)[:3, :3]
        moments = np.diag(rotation @ link.inertial.inertia @ rotation.T)
        if moments[long] > largest:
            largest = float(moments[long])
            is_exchanged = moments[long] > _MIN_EXCESS * float(np.min(np.delete(moments, long)))
            found = link if is_exchanged else None
    return found


@rule("INR012", "exchanged-axes", "warning", certainty="likely")
def exchanged_axes(robot: Facts) -> Violations:
    """A long body has its largest moment of inertia about its long axis.

    The moment of a rod about its own axis is the smallest. Two moments are exchanged, or the
    inertia is given in the axes of the CAD program instead of the link.

    Fix:
        Exchange the two moments, or turn the origin of the <inertial>.

    Source:
        Axis-aligned bounding box of the collision shapes. Motors at one end of a published thigh
        raise the moment about its axis to a third of the others.
    """
    for body in robot.bodies:
        if body.mass <= 0 or not np.isfinite(body.inertia).all() or body.principal[0] <= 0:
            continue
        box = robot.body_bounds.shape_box(body, lambda _: False)
        if box is None:
            continue
        size = box[1] - box[0]
        order = np.argsort(size)
        long, wide = int(order[2]), float(size[order[1]])
        if size[long] < _MIN_ELONGATION * wide:
            continue
        moments = np.diag(body.inertia)
        others = float(max(moments[order[0]], moments[order[1]]))
        if moments[long] <= _MIN_EXCESS * float(min(moments[order[0]], moments[order[1]])):
            continue
        # The two larger moments of a rod are nearly equal, and now one is about the long axis.
        if moments[long] < 0.95 * others:
            continue
        link = _exchanged_link(body, long)
        if link is None:
            continue  # parts beside the long axis raise the moment about it
        axis = "xyz"[long]
        yield Violation(
            element=inertia_part(link),
            message=f"moments of inertia of body {body.name}: got "
            f"{numbers(moments, '.3g', ', ')} kg m2 for a shape of "
            f"{numbers(size, '.3g', ' x ')} m; expected the smallest about {axis}, its "
            "long axis",
            measured={"long_axis": axis},
        )
