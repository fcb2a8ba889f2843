"""Over a hundred scenes whose answer is known: each row is passable at one value, not at the next.

The robot starts in the middle of a strip of 4 m x 1.2 m and goes to either end, past the scene. The
limits are in tests/limits.py: step 0.2 m up and 0.25 m down, gap 0.4 m, slope 0.5, foothold 0.1 m,
width 0.4 m, clearance 0.3 m, and slopes of two thirds of the friction coefficient.
"""

from dataclasses import replace

import numpy as np
import pytest

from terrainkit.feasibility import assess_map
from terrainkit.geometry.solids import Solids, make_boxes, make_cylinders, make_hulls
from tests.limits import LIMITS
from tests.terrainkit.maps import plot

X, Y = np.meshgrid(np.arange(40) * 0.1 - 1.95, np.arange(12) * 0.1 - 0.55, indexing="ij")
AWAY = np.abs(X)
FLAT, PIT = 0 * X, np.where((AWAY > 0.5) & (AWAY < 1.7), -1.0, 0.0)
DEGREES = np.pi / 180


def scene(heights=FLAT, *solids, friction=1.0):
    """Return a map with solids on the side of positive x, and the same on the other side."""
    both = [each.transform(np.diag([s, s, 1.0]), [2, 0.6, 0]) for each in solids for s in (1, -1)]
    flat = plot(heights).edited(solids=Solids.concatenate(both))
    return replace(flat, friction=np.broadcast_to(friction, heights.shape).astype(np.float32))


def ramp(grade, top=0.3):
    return np.clip((AWAY - 0.5) * grade, 0, top)


def box(x, y, z, *size, yaw=0.0, pitch=0.0, **flags):
    return make_boxes([[x, y, z]], size, rpy=(0, pitch * DEGREES, yaw * DEGREES), **flags)


def wall(thick, x=0.9, height=1.0, bottom=0.0, yaw=0.0, **flags):
    length = 1.2 / np.cos(yaw * DEGREES) + thick
    return box(x, 0, bottom + height / 2, thick, length, height, yaw=yaw, **flags)


def strips(width, gap, *, yaw=0.0, shift=0.0):
    """Two beams across the pit, with this gap between them and less to the sides of the pit."""
    cos = np.cos(yaw * DEGREES)
    places = 1.1 + shift + np.array([-0.5, 0.5]) * (width + gap) / cos
    return [box(x, 0, -0.25, width, 1.0 / cos, 0.5, yaw=yaw) for x in places]


def bridge(width, *, yaw=0.0, shift=0.0):
    """A beam over the pit, 1 cm below its sides."""
    return box(1.1, shift, -0.26, 1.4 / np.cos(yaw * DEGREES), width, 0.5, yaw=yaw)


def stakes(diameter, gap, *, sides=0, shift=0.0, low=0.0):
    """Two rows of stakes with this gap in between; round, or prisms with a number of sides."""
    places = 1.1 + shift + np.array([-0.5, 0.5]) * (diameter + gap)
    centers = [(x, y + shift, -0.5 - low) for x in places for y in (-0.3, 0.3)]
    if not sides:
        return [make_cylinders(centers, diameter / 2, 1.0)]
    angle = (np.arange(sides) + 0.5) * 2 * np.pi / sides
    ring = np.column_stack([np.cos(angle), np.sin(angle)]) * diameter / 2 / np.cos(np.pi / sides)
    prism = np.vstack([np.column_stack([ring, 0 * angle + z]) for z in (-0.5, 0.5)])
    return [make_hulls([prism + center for center in centers])]


def wedge(rise, run, friction=np.nan):
    """A ramp of solid that ends in a level part up to the end of the strip."""
    points = [(0.8, 0), (0.8 + run, rise), (2, rise), (2, 0)]
    return make_hulls([[(x, y, z) for x, z in points for y in (-0.6, 0.6)]], friction=friction)


def checker(height):
    i, j = np.indices(X.shape)
    return np.where((AWAY > 0.6) & ((i + j) % 2 == 0), height, 0.0)


ROWS = {
    # Steps; the higher ground begins at 0.8 m. A robot that starts at the top goes down.
    "step up": (lambda h: scene(np.where(AWAY > 0.8, h, 0)), 0.2, 0.202),
    "step down": (lambda h: scene(np.where(AWAY > 0.8, -h, 0)), 0.25, 0.252),
    "two steps": (lambda h: scene(h * ((AWAY > 0.8) + 1.0 * (AWAY > 1.2))), 0.2, 0.202),
    "curb": (lambda h: scene(h * ((AWAY > 0.8) & (AWAY < 1.1))), 0.2, 0.202),
    "curb of solid": (lambda h: scene(FLAT, wall(0.3, height=h)), 0.2, 0.202),
    "plateau of solid": (lambda h: scene(FLAT, box(1.4, 0, 0, 1.2, 1.2, 2 * h)), 0.2, 0.202),
    "hurdle between columns": (lambda h: scene(FLAT, wall(0.005, 0.9, h)), 0.2, 0.202),
    "face of 10 cm": (lambda h: scene(FLAT, wedge(h, 0.1)), 0.16, 0.24),
    "face of 5 cm": (lambda h: scene(FLAT, wedge(h, 0.05)), 0.19, 0.21),
    # Gaps. On the ground they are whole cells.
    "ditch": (lambda n: scene(np.where((AWAY > 0.8) & (0.8 + 0.1 * n > AWAY), -1, 0)), 4, 5),
    "ditch from a step": (
        lambda h: scene(np.where(AWAY < 0.8, 0, np.where(AWAY < 1.1, -1, h))),
        0.2,
        0.202,
    ),
    "ditch of solids": (
        lambda w: scene(np.where(AWAY > 0.6, -1, 0), box(1.3 + w / 2, 0, -0.5, 1.4 - w, 1.2, 1.0)),
        0.4,
        0.404,
    ),
    "strips": (lambda w: scene(PIT, *strips(0.2, w)), 0.4, 0.404),
    "strips off the grid": (lambda w: scene(PIT, *strips(0.15, w, shift=0.004)), 0.39, 0.41),
    "strips at 15": (lambda w: scene(PIT, *strips(0.12, w, yaw=15)), 0.39, 0.41),
    "strips at 30": (lambda w: scene(PIT, *strips(0.12, w, yaw=30)), 0.39, 0.41),
    "stakes' gap": (lambda w: scene(PIT, *stakes(0.2, w)), 0.4, 0.404),
    "hexagons' gap": (lambda w: scene(PIT, *stakes(0.2, w, sides=6)), 0.39, 0.41),
    # Slopes, and friction.
    "slope": (lambda g: scene(ramp(g)), 0.5, 0.51),
    "slope down": (lambda g: scene(-ramp(g)), 0.5, 0.51),
    "slope of solid": (lambda g: scene(FLAT, wedge(g * 0.8, 0.8)), 0.49, 0.51),
    "icy slope of 0.3": (lambda mu: scene(ramp(0.3), friction=mu), 0.451, 0.449),
    "icy slope of 0.1": (lambda mu: scene(ramp(0.1), friction=mu), 0.151, 0.149),
    "slope at 0.15": (lambda g: scene(ramp(g), friction=0.15), 0.099, 0.101),
    "ice on the flat": (lambda g: scene(ramp(g), friction=0.0), 0.0, 0.01),
    "ice beside the slope": (
        lambda mu: scene(ramp(0.3), friction=np.where(AWAY < 0.4, 0.01, mu)),
        0.451,
        0.449,
    ),
    "lane of friction": (
        lambda mu: scene(ramp(0.3), friction=np.where(abs(Y) < 0.3, mu, 0.1)),
        0.451,
        0.449,
    ),
    "ice on a solid": (lambda mu: scene(FLAT, wedge(0.24, 0.8, mu)), 0.46, 0.44),
    "ice below a solid": (lambda mu: scene(FLAT, wedge(0.24, 0.8), friction=mu), 0.46, 0.44),
    "friction over ice": (
        lambda mu: scene(FLAT, wedge(0.24, 0.8, mu), friction=0.1),
        0.46,
        0.44,
    ),
    # Footholds.
    "bridge": (lambda w: scene(PIT, bridge(w)), 0.1, 0.098),
    "bridge off the grid": (lambda w: scene(PIT, bridge(w, shift=0.013)), 0.1, 0.098),
    "bridge at 15": (lambda w: scene(PIT, bridge(w, yaw=15)), 0.1, 0.098),
    "bridge at 30": (lambda w: scene(PIT, bridge(w, yaw=30, shift=-0.02)), 0.1, 0.098),
    "bridge at 20": (lambda w: scene(PIT, bridge(w, yaw=-20)), 0.1, 0.098),
    "strips' width": (lambda w: scene(PIT, *strips(w, 0.3)), 0.1, 0.098),
    "rotated strips' width": (lambda w: scene(PIT, *strips(w, 0.2, yaw=40)), 0.1, 0.098),
    "stakes": (lambda d: scene(PIT, *stakes(d, 0.3)), 0.1, 0.098),
    "stakes off the grid": (lambda d: scene(PIT, *stakes(d, 0.3, shift=0.011)), 0.1, 0.098),
    "squares": (lambda d: scene(PIT, *stakes(d, 0.3, sides=4)), 0.1, 0.098),
    "hexagons": (lambda d: scene(PIT, *stakes(d, 0.3, sides=6)), 0.1, 0.098),
    "octagons": (lambda d: scene(PIT, *stakes(d, 0.3, sides=8, shift=-0.007)), 0.1, 0.098),
    "low stakes": (lambda d: scene(PIT, *stakes(d, 0.3, low=0.15)), 0.1, 0.098),
    # On white noise, a cell is a foothold of 0.1 m if steps are above 0.12 x 0.5 = 0.06 m.
    "noise": (lambda h: scene(checker(h)), 0.06, 0.061, {"foothold": 0.12}),
    # Passages between walls: solids of 1 m with a door, up to a column.
    "door": (
        lambda n: scene(np.where((AWAY > 0.8) & (AWAY < 1.1) & (abs(Y - 0.001) > 0.05 * n), 1, 0)),
        4,
        2,
    ),
    "door of solids": (
        lambda w: scene(
            FLAT, *(box(1, s * (0.3 + w / 4), 0.5, 0.3, 0.6 - w / 2, 1) for s in (1, -1))
        ),
        0.44,
        0.36,
    ),
    # Walls.
    "wall": (lambda h: scene(FLAT, wall(0.03, height=h)), 0.2, 0.202),
    "thin wall": (lambda h: scene(FLAT, wall(0.002, 0.9, h)), 0.2, 0.202),
    "thin slanted wall": (lambda h: scene(FLAT, wall(0.004, 0.9, h, yaw=20)), 0.2, 0.202),
    "ghost wall": (lambda c: scene(FLAT, wall(0.1, collides=bool(c))), 0, 1),
    "wall of ground": (lambda h: scene(np.where((AWAY > 0.9) & (AWAY < 1), h, 0)), 0.2, 0.202),
    "wall with a way around": (
        lambda w: scene(FLAT, box(1, -0.6 + w / 2, 0.5, 0.1, w, 1)),
        0.4,
        1.2,
    ),
    # Bars: below at a clearance of 0.3 m, or over at a height of 0.2 m.
    "bar": (lambda c: scene(FLAT, wall(0.1, height=0.1, bottom=c)), 0.301, 0.298),
    "thin bar": (lambda c: scene(FLAT, wall(0.004, height=0.1, bottom=c)), 0.301, 0.298),
    "bar to step over": (lambda z: scene(FLAT, wall(0.1, height=0.05, bottom=z)), 0.15, 0.152),
    "roof": (lambda c: scene(FLAT, wall(0.8, 1.2, height=0.5, bottom=c)), 0.301, 0.298),
    "bar over a curb": (
        lambda c: scene(np.where((AWAY > 0.8) & (AWAY < 1.1), 0.1, 0), wall(0.1, bottom=0.1 + c)),
        0.301,
        0.298,
    ),
    # Rungs over the pit.
    "rungs": (lambda w: scene(PIT, *strips(w, 0.39)), 0.02, 0.018, {"foothold": 0.02}),
    "rungs at 30": (
        lambda w: scene(PIT, *strips(w, 0.39, yaw=30)),
        0.02,
        0.018,
        {"foothold": 0.02},
    ),
    "rungs' gap": (lambda w: scene(PIT, *strips(0.02, w)), 0.4, 0.404, {"foothold": 0.02}),
}
"""Scene as a function of a value, a value that is passable, one that is not, and other limits."""


@pytest.mark.parametrize("end", [0, 1], ids=["below", "above"])
@pytest.mark.parametrize("name", ROWS)
def test_scene_is_passable_up_to_the_limit(name, end):
    build, *values = ROWS[name]
    changed = values[2] if len(values) > 2 else {}
    (result,) = assess_map(build(values[end]), replace(LIMITS, **changed))
    assert result.is_passable == (end == 0), (result.demand, result.limit, result.value)
