"""Rules on actuators and safety controllers."""

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.passive_joints import OPEN_LINKAGE
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.text import count, names

_MAX_COMMAND_RATIO = 4.0
"""Allowed ratio of the two ends of the control range of a motor."""

_MIN_REACHED = 0.05
"""Share of the range of a joint that the targets of its actuator reach, at least."""


@rule("JNT016", "missing-actuator", "warning")
def missing_actuator(robot: Facts) -> Violations:
    """A joint of an MJCF file has no actuator.

    The joint is passive, and an environment made from the file has one action less. Joints that
    mimic others or move with a closed loop or a tendon, joints that carry the trunk of a planar
    model, and files whose actuators pull tendons or other transmissions are not checked. A robot
    without legs may be passive by design, and mjlab and Genesis add actuators to a file without
    any: both are only notes.

    Fix:
        Add a <motor> or <position> actuator for the joint.

    Source:
        MuJoCo: nu is the number of actuators, not of joints.
    """
    if robot.model.kind != "mjcf":
        return
    if not robot.model.actuators:
        if robot.joints:
            yield Violation(
                severity="note",
                message=f"actuators of the file: got 0 for {count(len(robot.joints), 'joint')}; "
                "expected one for each joint, unless the framework adds them",
                measured={"joints": len(robot.joints)},
            )
        return
    actuated = {actuator.joint for actuator in robot.model.actuators}
    if "" in actuated:
        return
    for joint in robot.robot_joints:
        if joint.name not in actuated and joint.mimic is None and not joint.coupled:
            expected = "expected 1"
            if robot.passive_joints.get(joint.name) == OPEN_LINKAGE:
                expected = f"{OPEN_LINKAGE}; expected an <equality> that closes the loop"
            yield Violation(
                element=joint,
                severity="warning" if robot.legs else "note",
                message=f"actuators of joint {joint.name}: got 0; {expected}",
            )


@rule("JNT024", "zero-gear", "error")
def zero_gear(robot: Facts) -> Violations:
    """The gear of an actuator is zero.

    The actuator then has no effect on the joint, and MuJoCo does not warn about it. The
    mechanicalReduction of a URDF <transmission> is a gear as well. Only ROS tools read it, so a
    ratio of zero or one that is not a number is a warning there.

    Fix:
        Set the gear to 1, or to the ratio of the transmission. A negative ratio inverts the
        direction.

    Source:
        MuJoCo's XML reference, actuator: gear scales the length and the force of the actuator;
        wiki.ros.org/urdf/XML/Transmission.
    """
    for actuator in robot.model.actuators:
        if actuator.joint and actuator.gear == 0:
            yield Violation(
                element=Part(actuator.joint, actuator.source),
                message=f"gear of the actuator of joint {actuator.joint}: got 0; expected 1 or "
                "another ratio",
            )


@rule("JNT025", "one-sided-motor", "warning")
def one_sided_motor(robot: Facts) -> Violations:
    """A motor can push a hinge in one direction only.

    Its control range starts or ends at zero, usually because a sign is missing. The joint cannot
    brake or return. A range with one end several times larger than the other one is reported as
    well: a digit is missing.

    Fix:
        Give both ends of ctrlrange: "-23.7 23.7".

    Source:
        MuJoCo's XML reference, actuator: ctrlrange. Joints that several actuators pull, such as
        muscles, are not checked.
    """
    joints = {joint.name: joint for joint in robot.robot_joints}
    used = [actuator.joint for actuator in robot.model.actuators]
    for actuator in robot.model.actuators:
        if actuator.commands is None or used.count(actuator.joint) != 1:
            continue
        joint = joints.get(actuator.joint)
        lower, upper = actuator.commands
        hinge = joint is not None and joint.kind == "revolute"
        ends = sorted((abs(lower), abs(upper)))
        is_one_sided = lower >= 0 or upper <= 0 or ends[1] > _MAX_COMMAND_RATIO * ends[0]
        if hinge and lower < upper and is_one_sided:
            yield Violation(
                element=Part(actuator.joint, actuator.source),
                severity=None if robot.legs else "note",
                message=f"control range of the motor of joint {actuator.joint}: got {lower:g} to "
                f"{upper:g}; expected both signs with similar values",
                measured={"lower": lower, "upper": upper},
            )


@rule("JNT029", "unreachable-range", "warning")
def unreachable_range(robot: Facts) -> Violations:
    """The targets of a position actuator reach almost nothing of the range of its joint.

    The joint is pressed against its limit at every command. Usually a sign was not mirrored, or the
    range is in degrees. OPT011 reports targets far beyond the limits.

    Fix:
        Replace ctrlrange by inheritrange="1", or give the limits of the joint in radians.

    Source:
        Pull request 4 of robotis_mujoco_menagerie; MuJoCo's XML reference, position: inheritrange.
    """
    joints = {joint.name: joint for joint in robot.joints}
    for actuator in robot.model.actuators:
        joint = joints.get(actuator.joint)
        if actuator.targets is None or joint is None or joint.range is None:
            continue
        lower, upper = joint.range
        low, high = actuator.targets
        reached = max(min(high, upper) - max(low, lower), 0.0) / (upper - lower)
        if reached < _MIN_REACHED:
            yield Violation(
                element=Part(joint.name, actuator.source),
                message=f"targets of the actuator of joint {joint.name}: got {low:.4g} to "
                f"{high:.4g} {joint.unit}, {reached:.0%} of the range of {lower:.4g} to "
                f"{upper:.4g} {joint.unit}; expected at least {_MIN_REACHED:.0%}",
                measured={"reached": reached},
            )


@rule("JNT014", "safety-controller", "note")
def safety_controller(robot: Facts) -> Violations:
    """A joint has a safety_controller, which Genesis treats as a position controller.

    The k_position of a <safety_controller> was meant for the controllers of ROS 1. Genesis uses it
    as the stiffness of the joint, so that a robot without gains is held in place.

    Fix:
        Remove the <safety_controller>, or set the gains after loading.

    Source:
        Genesis' URDF parser, which uses the value for dofs_kp.
    """
    controllers = [
        (joint.name, controller)
        for joint in robot.model.joints
        if joint.moves and (controller := joint.safety_controller) is not None
        if controller.k_position is not None
    ]
    if controllers:
        first, controller = controllers[0]
        yield Violation(
            element=Part(first, controller.source),
            message=f"safety_controller of {names(name for name, _ in controllers)}: Genesis uses "
            "k_position as the stiffness of a position controller",
            measured={"joints": len(controllers)},
        )
