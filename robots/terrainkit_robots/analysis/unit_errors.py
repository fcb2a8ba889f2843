"""Find a quantity that is off by about the same factor on all links or joints of a robot.

Such a factor is a unit: masses in grams, lengths in millimeters, angles in degrees. The values of
robots differ from each other much less than units do. The ranges below were measured on 110
published descriptions of robots and hands.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from terrainkit_robots.analysis.bodies.bounds import half_diagonal
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.density import MAX_DENSITY, MIN_DENSITY, has_derived_mass
from terrainkit_robots.analysis.inertia.inertial import bodies_with_mass, max_inertia
from terrainkit_robots.analysis.inertia.physical import MIN_INERTIA, gyration_radius
from terrainkit_robots.analysis.legs.stance import GRAVITY

_MIN_COUNT = 4
"""Minimum number of values: fewer may be wrong one by one."""

_SHARE = 0.2
"""Share of the values on either end that is ignored: single wrong values, and placeholders."""

_MAX_SPREAD = 100.0
"""Ratio of the other values above which they are not off by the same factor. Densities differ by up
to 50 within a published robot, inertias by 8 in most."""

_UNIT_TOLERANCE = 6.0
"""Factor by which the median of a robot may differ from the typical value: see `DENSITY`."""


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """A quantity whose values are of the same order in all robots."""

    typical: float
    limits: tuple[float, float]
    """Smallest and largest plausible value."""

    units: Mapping[float, str]
    """Units by the factor between a value in it and the same value in the SI unit."""

    tolerance: float = _UNIT_TOLERANCE
    """Factor between an estimate and its unit, at most. A robot may be scaled as a whole."""

    def factor(self, values: Sequence[float]) -> float | None:
        """Return the factor between the values and plausible ones; None if they are plausible."""
        if len(values) < _MIN_COUNT:
            return None
        low, median, high = np.quantile(values, (_SHARE, 0.5, 1 - _SHARE))
        is_wrong = (low > self.limits[1] or high < self.limits[0]) and high < _MAX_SPREAD * low
        return float(median / self.typical) if is_wrong else None

    def unit(self, factor: float) -> tuple[float, str]:
        """Return factor and name of the likely unit; the name is empty if none is known."""
        nearest = min(self.units, key=lambda unit: abs(np.log(factor / unit)))
        is_known = 1 / self.tolerance <= factor / nearest <= self.tolerance
        return (nearest, self.units[nearest]) if is_known else (factor, "")


# Medians of 110 files: 130 to 1800 kg/m3, besides a gripper without a motor with 53.
DENSITY = Quantity(
    typical=700.0, limits=(MIN_DENSITY, MAX_DENSITY), units={1e3: "grams", 1e-3: "tons"}
)
"""Mass over the volume of the bounding box of a body [kg/m3]."""

# Medians: 0.24 to 0.6 for the root of this ratio, besides two robots with wrong inertias.
INERTIA = Quantity(
    typical=0.2,
    limits=(0.0025, 1.1),  # of INR007 and INR006, squared
    units={1e3: "g m2", 1e4: "kg cm2", 1e6: "kg mm2", 1e7: "g cm2", 1e9: "g mm2", 1e-3: "t m2"},
)
"""Largest moment of inertia over mass times squared half diagonal of a body."""

# Joints of 110 robots extend over 0.18 to 3.2 m.
SIZE = Quantity(
    typical=0.8,
    limits=(0.01, 15.0),
    units={1e3: "millimeters", 1e2: "centimeters", 39.37: "inches", 1e-3: "kilometers"},
)
"""Length [m]."""

SHAPE_SIZE = replace(SIZE, tolerance=_UNIT_TOLERANCE ** (1 / 3))
"""A length that is estimated from a density, which has the third power of its error."""

# Medians: 0.85 to 8 rad.
RANGE = Quantity(
    typical=2.0,
    limits=(0.1, 12.6),  # the largest one of JNT008
    units={57.3: "degrees", 1 / 57.3: "radians that were converted from degrees twice"},
)
"""Range of a hinge [rad]."""

# Medians: 0.12 to 0.82.
EFFORT = Quantity(
    typical=0.4,
    limits=(0.005, 5.0),  # the largest one of leg joints, as in NRM005
    units={1e3: "N mm", 1e2: "N cm", 10.2: "kg cm", 1e-3: "kN m"},
)
"""Effort of a leg joint over weight times leg length."""

_MIN_PART = 0.01
"""Half diagonal of a body over the size of the robot; published robots have 0.03 to 0.5. A crane
of 20 m has large parts."""

_LOOSE_DENSITIES = (1.0, 2000.0)
"""Mass over cubed size of a robot [kg/m3] outside of which its meshes are opened. Legged robots
have 10 to 100."""

_LOOSE_RADII = (0.003, 0.5)
"""The same for the median radius of gyration over the size of the robot."""


@dataclass(frozen=True)
class UnitError:
    """A quantity that is off by the same factor on most links or joints."""

    quantity: Quantity
    factor: float
    """Estimate of the factor."""

    values: Sequence[float]
    """What shows it, such as the densities of the bodies."""

    limits: tuple[float, float]
    """Smallest and largest plausible value."""


def _sizes(
    robot: Facts, *, with_visuals: bool = False
) -> tuple[list[float], list[float], list[float]]:
    """Return density, squared ratio of radius of gyration to half diagonal, and half diagonal."""
    densities, inertias, halves = list[float](), list[float](), list[float]()
    for body in bodies_with_mass(robot.bodies):
        box = robot.body_bounds.shape_box(body, lambda _: with_visuals)
        if box is None or (volume := float(np.prod(box[1] - box[0]))) <= 0:
            continue
        half = half_diagonal(box)
        halves.append(half)
        if body.principal[0] > MIN_INERTIA:
            inertias.append((gyration_radius(body.principal, body.mass) / half) ** 2)
        if not has_derived_mass(body):
            densities.append(body.mass / volume)
    return densities, inertias, halves


def _is_suspicious(robot: Facts) -> bool:
    """Return whether masses, lengths or inertias may have another unit; opens no visual mesh."""
    size = robot.body_bounds.robot_size
    bodies = [body for body in bodies_with_mass(robot.bodies) if not has_derived_mass(body)]
    if len(bodies) < _MIN_COUNT or not 0 < size < 1e9:
        return False
    radius = float(np.median([gyration_radius(body.principal, body.mass) for body in bodies]))
    density = sum(body.mass for body in bodies) / size**3
    *_, halves = _sizes(robot)  # INR010 opens the collision meshes as well
    return (
        not _LOOSE_DENSITIES[0] < density < _LOOSE_DENSITIES[1]
        or not _LOOSE_RADII[0] < radius / size < _LOOSE_RADII[1]
        or (len(halves) >= _MIN_COUNT and min(halves) > size)
    )


def body_unit_errors(robot: Facts) -> Iterator[tuple[str, UnitError]]:
    """Yield the errors of lengths, masses and inertias: the name of the quantity, and the error.

    Wrong lengths change densities too, so that masses and inertias are not judged.
    """
    if not _is_suspicious(robot):
        return
    size = robot.body_bounds.robot_size
    densities, ratios, halves = _sizes(robot)
    if len(densities) < _MIN_COUNT:
        densities, ratios, halves = _sizes(robot, with_visuals=True)
    mass = DENSITY.factor(densities)
    half = float(np.median(halves)) if halves else 0.0
    is_joints = not SIZE.limits[0] < size < SIZE.limits[1]
    is_shapes = half > size
    if mass is not None and (is_joints or is_shapes or not 1e-4 < mass < 1e4):
        # A volume is the third power of a length.
        name, factor = "shapes" if is_shapes else "lengths", mass ** (-1 / 3)
        yield name, UnitError(SHAPE_SIZE, factor, densities, DENSITY.limits)
    elif is_joints and half < _MIN_PART * size:
        offsets = [float(np.linalg.norm(body.origin[:3, 3])) for body in robot.bodies[1:]]
        yield "joint origins", UnitError(SIZE, size / SIZE.typical, offsets, SIZE.limits)
    else:
        if mass is not None:
            yield "masses", UnitError(DENSITY, mass, densities, DENSITY.limits)
        inertias = [ratio * (DENSITY.unit(mass)[0] if mass else 1.0) for ratio in ratios]
        factor = INERTIA.factor(inertias)
        if factor is not None and not _has_round_inertias(robot):
            yield "inertias", UnitError(INERTIA, factor, inertias, INERTIA.limits)


def _has_round_inertias(robot: Facts) -> bool:
    """Return whether most bodies have inertias of one digit, such as 0.01: placeholders."""
    inertias = [max_inertia(body.main_link) for body in bodies_with_mass(robot.bodies)]
    return 2 * sum(float(f"{inertia:.0e}") == inertia for inertia in inertias) > len(inertias)


def range_error(robot: Facts) -> UnitError | None:
    """Return the error of the ranges of the driven hinges."""
    ranges = [limits[1] - limits[0] for joint in robot.actuated_hinges if (limits := joint.range)]
    return _error(RANGE, ranges)


def effort_error(robot: Facts) -> UnitError | None:
    """Return the error of the efforts of the leg joints of a URDF."""
    scale = robot.total_mass * GRAVITY * max((leg.length for leg in robot.legs), default=0.0)
    if robot.model.kind == "mjcf" or not scale > 0:
        return None
    efforts = [joint.effort for joint in robot.leg_joints if joint.kind == "revolute"]
    return _error(EFFORT, [effort / scale for effort in efforts if effort])


def _error(quantity: Quantity, values: Sequence[float]) -> UnitError | None:
    """Return the error of some values; equal values that are too large are placeholders."""
    factor = quantity.factor(values)
    if factor is None or (factor > 1 and len(set(values)) == 1):
        return None
    return UnitError(quantity, factor, values, quantity.limits)
