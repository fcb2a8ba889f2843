"""Rules that compare position, velocity and effort limits."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TypeVar

import numpy as np

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint
from terrainkit_robots.lint.compare.body_mass import relative_difference
from terrainkit_robots.lint.rule import Part, Severity, Violation, Violations, rule
from terrainkit_robots.lint.rules.xrf.joints import (
    MAX_RELATIVE_DIFFERENCE,
    limit_tolerance,
    matching_joints,
)
from terrainkit_robots.lint.rules.xrf.other_robot import (
    JointPair,
    joint_name,
    other_name,
    other_robot,
)
from terrainkit_robots.text import group, names

_Difference = TypeVar("_Difference")


@rule("XRF003", "joint-limits-differ", "warning", needs=("against",))
def compare_limits(robot: Facts) -> Violations:
    """The limits of a joint differ between the files.

    Limits clip targets, end episodes, and define penalties. A policy trained with one file runs
    into the limits of the other file, which it never met in training.

    Fix:
        Find out the limits of the real robot, and write them into both files.

    Source:
        MuJoCo reads both formats; the tolerance is 0.002 rad, 0.5 mm, and 1 % of a velocity.
    """
    there = other_name(robot)
    pairs = matching_joints(robot)
    for _, same in _grouped(pairs, _range_difference):
        one, other = same[0]
        yield _report_group(
            same,
            "limits",
            f"{_format_range(one)} here and {_format_range(other)} in {there}; expected a "
            f"difference of at most {limit_tolerance(one)} {one.unit}",
        )
    for (_, a, b), same in _grouped(pairs, partial(_difference, "velocity")):
        unit = same[0][0].units.velocity
        yield _report_group(
            same,
            "velocity limit",
            f"{a:.6g} {unit} here and {b:.6g} {unit} in {there}; expected a difference of at most "
            f"{MAX_RELATIVE_DIFFERENCE:.0%}",
        )


def _range_difference(one: Joint, other: Joint) -> tuple[object, ...] | None:
    """Return the ranges of two joints if they differ."""
    a, b = one.range, other.range
    if a == b or (a and b and np.abs(np.subtract(a, b)).max() <= limit_tolerance(one)):
        return None
    return one.kind == "prismatic", a, b


def _difference(name: str, one: Joint, other: Joint) -> tuple[bool, float, float] | None:
    """Return whether a joint slides, and its two limits if both are given and they differ."""
    a, b = getattr(one, name), getattr(other, name)
    if not a or not b or relative_difference(a, b) <= MAX_RELATIVE_DIFFERENCE:
        return None
    return one.kind == "prismatic", a, b


def _format_range(joint: Joint) -> str:
    if joint.range is None:
        return "none"
    return f"({joint.range[0]:.6g}, {joint.range[1]:.6g}) {joint.unit}"


def _grouped(
    pairs: Sequence[JointPair], key: Callable[[Joint, Joint], _Difference | None]
) -> Iterable[tuple[_Difference, list[JointPair]]]:
    """Return each difference with the pairs that have it, without the pairs that agree."""
    differences = ((key(*pair), pair) for pair in pairs)
    return group((found, pair) for found, pair in differences if found is not None).items()


def _report_group(
    same: Sequence[JointPair], label: str, difference: str, severity: Severity | None = None
) -> Violation:
    one, other = same[0]
    listed = names(joint_name(a, b) for a, b in same)
    joints = f"{len(same)} joints ({listed})" if len(same) > 1 else f"joint {listed}"
    return Violation(
        element=Part(one.name, (one.limit or one).source),
        severity=severity,
        message=f"{label} of {joints}: got {difference} "
        f"(line {(other.limit or other).source.line} there)",
        measured={"joints": len(same)},
    )


@rule("XRF006", "effort-differs", "warning", needs=("against",))
def compare_effort(robot: Facts) -> Violations:
    """The effort limit of a joint differs between the files.

    The robot is stronger in one simulator than in the other. Motions learned in one of them fail in
    the other, or on the real robot.

    Fix:
        Look up the torque of the motor after gear and linkage, and write it into both files.

    Source:
        effort in URDF; in MJCF the largest force of the joint's actuators, and actuatorfrcrange.
    """
    other, there = other_robot(robot), other_name(robot)
    pairs = matching_joints(robot)

    def missing(one: Joint, other: Joint) -> bool | None:
        return None if bool(one.effort) == bool(other.effort) else bool(one.effort)

    for (_, a, b), same in _grouped(pairs, partial(_difference, "effort")):
        unit = same[0][0].units.effort
        yield _report_group(
            same,
            "effort limit",
            f"{a:.5g} {unit} here and {b:.5g} {unit} in {there}, "
            f"{relative_difference(a, b):.1%} apart; expected at most "
            f"{MAX_RELATIVE_DIFFERENCE:.0%}",
        )
    for limited, same in _grouped(pairs, missing):
        bare = other if limited else robot
        has_actuators = bool(bare.model.actuators) or bare.model.kind != "mjcf"
        without = there if limited else "this file"
        note = ", which has no actuators"
        yield _report_group(
            same,
            "effort limit",
            f"none in {without}{'' if has_actuators else note}; expected the limit of "
            f"{'this file' if limited else there}",
            severity=None if has_actuators else "note",
        )
