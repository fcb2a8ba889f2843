"""Rules on units."""

import numpy as np

from terrainkit_robots.analysis.facts import Facts, cached_fact
from terrainkit_robots.analysis.unit_errors import (
    UnitError,
    body_unit_errors,
    effort_error,
    range_error,
)
from terrainkit_robots.lint.rule import Violation, Violations, rule


@cached_fact
def _body_errors(robot: Facts) -> dict[str, UnitError]:
    return dict(body_unit_errors(robot))


def _violation(name: str, what: str, error: UnitError, si: str) -> Violation:
    factor, unit = error.quantity.unit(error.factor)
    size = "large" if factor > 1 else "small"
    larger = max(factor, 1 / factor)
    times = f"{larger if unit else float(f'{larger:.1g}'):g} times too {size}"
    low, high = error.limits
    median = float(np.median(error.values))
    return Violation(
        message=f"{name}: got values about {times} on most of {len(error.values)} elements "
        f"(median {what}: got {median:.3g}; expected {low:g} to {high:g})"
        + (f"; the unit is probably {unit}" if unit else ""),
        hint=f"Give all {name} in {si}" + (f" instead of {unit}." if unit else "."),
        measured={"factor": factor, "values": len(error.values), "median": median},
    )


@rule("UNI001", "mass-unit", "error")
def mass_unit(robot: Facts) -> Violations:
    """All masses are off by the same factor.

    Masses in grams make a robot of 15 tons. One wrong unit is reported once; the rules that would
    report it again for each body are skipped.

    Fix:
        Give all masses in kg.

    Source:
        Mass over the volume of the bounding box of a body has a median of 130 to 1800 kg/m3 in 110
        published files. At least 80 % of the bodies are outside the limits of INR010.
    """
    if "masses" in (errors := _body_errors(robot)):
        yield _violation("masses", "density [kg/m3]", errors["masses"], "kg")


@rule("UNI002", "length-unit", "error")
def length_unit(robot: Facts) -> Violations:
    """All lengths, all shapes or all joint origins are off by the same factor.

    CAD programs use millimeters. If the joint origins are in millimeters, a robot is as large as a
    village; if the shapes are, each part contains the whole robot.

    Fix:
        Give all lengths in meters, and set the scale of meshes to 0.001 0.001 0.001 if their files
        are in millimeters.

    Source:
        The joints of 110 published robots extend over 0.18 to 3.2 m.
    """
    for name in ("lengths", "shapes", "joint origins"):
        if name in (errors := _body_errors(robot)):
            is_joints = name == "joint origins"
            what = "distance of joints [m]" if is_joints else "density [kg/m3]"
            yield _violation(name, what, errors[name], "meters")


@rule("UNI003", "inertia-unit", "error")
def inertia_unit(robot: Facts) -> Violations:
    """All inertias are off by the same factor.

    CAD programs give inertias in g mm2 or kg mm2, which are 1e9 and 1e6 times larger numbers than
    the same inertia in kg m2.

    Fix:
        Give all inertias in kg m2.

    Source:
        The inertia over mass times squared half diagonal has a median of 0.06 to 0.36 in published
        files. At least 80 % of the bodies are outside the limits of INR006 and INR007.
    """
    if "inertias" in (errors := _body_errors(robot)):
        what = "inertia over mass times squared half diagonal"
        yield _violation("inertias", what, errors["inertias"], "kg m2")


@rule("UNI004", "angle-unit", "error")
def angle_unit(robot: Facts) -> Violations:
    """The ranges of all hinges are off by the same factor.

    The limits are in degrees, or were converted to radians twice. Equal ranges of all hinges are a
    placeholder instead, which JNT008 reports.

    Fix:
        Give all limits in radians; in MJCF set <compiler angle="radian"/> or give degrees.

    Source:
        The median range of the driven hinges of 110 published robots is 0.85 to 8 rad.
    """
    if (error := range_error(robot)) is not None:
        yield _violation("angles of joint limits", "range [rad]", error, "radians")


@rule("UNI005", "effort-unit", "error", needs=("legs",))
def effort_unit(robot: Facts) -> Violations:
    """The effort limits of all leg joints are off by the same factor.

    Efforts in N mm do not limit anything, and efforts in kN m do not hold the robot. Equal efforts
    of all joints are a placeholder instead, which JNT011 and NRM005 report.

    Fix:
        Give the peak torque of each motor after the gear, in N m.

    Source:
        The effort over weight times leg length has a median of 0.12 to 0.82 in published files.
    """
    if any(name != "inertias" for name in _body_errors(robot)):
        return
    if (error := effort_error(robot)) is not None:
        yield _violation("effort limits", "effort over weight times leg length", error, "N m")
