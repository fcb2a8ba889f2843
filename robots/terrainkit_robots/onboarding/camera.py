"""Cameras: where to stand so that something fills the picture."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from terrainkit_robots.transforms import Matrix

FIELD_OF_VIEW = 25.0
"""Angle between the lower and the upper edge of a picture [deg]; a long lens bends little."""

_FILLED = 0.86
"""Share of a picture's width or height that is filled."""

_ROUNDS = 6
"""So often a picture is centered again; after four nothing moves any more."""

_SMALLEST = 1e-4
"""Size that anything is taken to have at least [m]."""


@dataclass(frozen=True, kw_only=True)
class View:
    """A direction to look in, as MuJoCo's free camera has it."""

    azimuth: float
    """Angle of the direction in the plane, from +x to +y [deg]."""

    elevation: float
    """Angle of the direction above the plane [deg]; negative looks down."""

    @property
    def axes(self) -> tuple[Matrix, Matrix, Matrix]:
        """Return the directions forward, to the right and up of the picture, shape (3,) each."""
        (sin_a, sin_e), (cos_a, cos_e) = (
            function(np.radians([self.azimuth, self.elevation])) for function in (np.sin, np.cos)
        )
        forward = np.array([cos_a * cos_e, sin_a * cos_e, sin_e])
        right = np.array([sin_a, -cos_a, 0.0])
        return forward, right, np.cross(right, forward)


VIEWS: Mapping[str, View] = {
    "front": View(azimuth=180, elevation=-10),
    "side": View(azimuth=90, elevation=-10),
    "corner": View(azimuth=142, elevation=-24),
}
"""What a robot is seen from: its front, its right side with +x to the right, and between both from
above."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Placing:
    """Where a camera is."""

    target: Matrix
    """Point in the middle of the picture, shape (3,) [m]."""

    distance: float
    """From the camera to that point [m]."""


def framed(points: Matrix, view: View, aspect: float) -> Placing:
    """Return where the camera is closest with all points in the picture, and room around them.

    Args:
        points: What is to be seen, shape (n, 3) [m].
        view: The direction to look in.
        aspect: Width of the picture over its height.
    """
    forward, right, up = view.axes
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    depth, across, above = ((points - middle) @ axis for axis in (forward, right, up))
    steep = _FILLED * np.tan(np.radians(FIELD_OF_VIEW) / 2)
    distance = max(
        _needed(across, depth, steep * aspect),
        _needed(above, depth, steep),
        float(-depth.min()) + _SMALLEST / steep,
    )
    away = depth + distance
    target = middle + _centered(across, away) * right + _centered(above, away) * up
    return Placing(target=target, distance=distance)


def _needed(offsets: Matrix, depths: Matrix, slope: float) -> float:
    """Return the least distance at which a camera can have all points in the picture [m].

    A point is in the picture if |offset - middle| <= slope * (depth + distance).
    """
    over = float((offsets - slope * depths).max())
    under = float((-offsets - slope * depths).max())
    return (over + under) / (2 * slope)


def _centered(offsets: Matrix, away: Matrix) -> float:
    """Return where the middle of the picture is, with as much room on one side as on the other."""
    middle = 0.0
    for _ in range(_ROUNDS):
        slopes = (offsets - middle) / away
        first, last = int(slopes.argmin()), int(slopes.argmax())
        # Exact, unless other points are the outermost once it has moved.
        middle = float(
            (offsets[first] * away[last] + offsets[last] * away[first]) / (away[first] + away[last])
        )
    return middle
