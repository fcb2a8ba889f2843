"""Rules on joint axes."""

import numpy as np

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.fix import SetAttribute, make_fix
from terrainkit_robots.description.model import Joint
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.text import count, numbers

_MIN_AXIS_LENGTH = 1e-6
"""Axis length below which MuJoCo rejects the axis."""

_MIN_OTHER_AXES = 3
"""Number of other joints, none of which turns about x, from which a missing axis looks
forgotten."""

_MAX_AXIS_ERROR = 1e-3
"""Allowed deviation of the axis length from 1, for axes with three digits such as 0.707 0.707 0."""


@rule("JNT004", "zero-axis", "error", onboarding="blocks")
def zero_axis(robot: Facts) -> Violations:
    """The axis of a joint is zero or has no numbers.

    A zero vector has no direction. MuJoCo rejects the file; other simulators divide by its length
    and produce NaN, or do not move the joint. A joint without an <axis> element is valid: its axis
    is x. It is a warning if all other joints have one and none of them is x, since it was probably
    forgotten.

    Fix:
        Write the axis as three numbers in the frame of the joint, such as 0 1 0.

    Source:
        MuJoCo 4.0: "axis too small"; http://wiki.ros.org/urdf/XML/joint for the default.
    """
    for joint in robot.model.joints:
        short_axis = joint.moves and _axis_length(joint) < _MIN_AXIS_LENGTH
        if short_axis and not robot.unparsed.at(joint.axis_source):
            assert joint.axis is not None
            yield Violation(
                element=Part(joint.name, joint.axis_source or joint.source),
                message=f"axis of joint {joint.name}: got {numbers(joint.axis, '.9g')} or no "
                "numbers; expected a direction such as 0 1 0",
            )
    moving = [joint for joint in robot.model.joints if joint.moves]
    axisless = [joint for joint in moving if joint.axis is None]
    has_x = any(joint.axis is not None and abs(joint.direction[0]) > 0.9 for joint in moving)
    if len(axisless) == 1 and len(moving) > _MIN_OTHER_AXES and not has_x:
        joint = axisless[0]
        yield Violation(
            element=joint,
            severity="warning",
            certainty="likely",
            message=f"axis of joint {joint.name}: got none, which means 1 0 0; expected an <axis>, "
            f"as in the other {count(len(moving) - 1, 'joint')}, none of which turns about x",
        )


def _axis_length(joint: Joint) -> float:
    """Return the length of an axis; 1 if the axis is missing or not finite."""
    if joint.axis is None or not (np.abs(joint.axis) < 1e100).all():
        return 1.0
    return float(np.linalg.norm(joint.axis))


@rule("JNT005", "unnormalized-axis", "warning", fixes="safe")
def unnormalized_axis(robot: Facts) -> Violations:
    """The axis of a joint is not a unit vector.

    Most simulators normalize the axis. In the others the joint moves further than its position
    says, and its limits and torque are scaled by the same factor.

    Fix:
        Divide the axis by its length, as the safe fix does.

    Source:
        http://wiki.ros.org/urdf/XML/joint: "the vector should be normalized". MJCF does not require
        it.
    """
    if robot.model.kind == "mjcf":
        return
    for joint in robot.model.joints:
        length = _axis_length(joint)
        if not joint.moves or length < _MIN_AXIS_LENGTH or abs(length - 1) <= _MAX_AXIS_ERROR:
            continue
        assert joint.axis is not None
        source = joint.axis_source or joint.source
        edit = SetAttribute(source=source, name="xyz", value=numbers(joint.direction, ".9g"))
        yield Violation(
            element=Part(joint.name, source),
            message=f"axis length of joint {joint.name}: got {length:.6g} "
            f"({numbers(joint.axis, '.9g')}); expected 1 +- {_MAX_AXIS_ERROR:g}",
            measured={"length": length},
            fix=make_fix("safe", f"Scale the axis of joint {joint.name} to length 1.", [edit]),
        )
