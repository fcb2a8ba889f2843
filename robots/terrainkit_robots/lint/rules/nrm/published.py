"""Rules that compare the quantities of a robot with those of published robots."""

import math
from collections.abc import Collection, Sequence

from terrainkit_robots.analysis.facts import Facts, cached_fact
from terrainkit_robots.analysis.norms import QUANTITIES, Sample, measure, norms
from terrainkit_robots.lint.rule import Violation, Violations, findings_of, rule
from terrainkit_robots.text import group

_MIN_RANGE, _MIN_VELOCITY, _MIN_ACCELERATION = 8.0, 6.0, 4.0
"""How many times below its limit a value of a leg is a warning. Published values are up to 8 times
below the range (a fruit fly), 4 times below the velocity (Romeo) and 2 times below the
acceleration."""

_MAX_UNIT_COMMAND = 5.0
"""Largest command of a motor that may be a normalized action instead of a torque."""


@cached_fact
def _samples(robot: Facts) -> Sequence[Sample]:
    return tuple(measure(robot))


def _unusual(
    robot: Facts,
    quantities: Collection[str],
    explained: Collection[str] = (),
    below: float = math.inf,
    above: float = math.inf,
) -> Violations:
    """Yield the most unusual small and large value of each quantity.

    Args:
        robot: The robot.
        quantities: The quantities.
        explained: Codes of rules that report such values with their cause.
        below: How many times below its limit a value of a leg is a warning.
        above: How many times above its limit it is one.
    """
    found = []
    for sample in _samples(robot):
        norm = norms().get((sample.quantity, sample.role))
        if norm is not None and sample.quantity in quantities:
            low, high = norm.limits
            excess = max(sample.value / high, low / sample.value)
            if excess > 1:
                found.append(((sample.quantity, sample.value > high), (excess, sample)))
    reported = {f.subject for f in findings_of(robot, *explained)} if found else set()
    unexplained = (
        (kind, (excess, sample))
        for kind, (excess, sample) in found
        if sample.element.name not in reported
    )
    for (quantity, is_large), values in group(unexplained).items():
        excess, worst = max(values, key=lambda value: (value[1].role != "other", value[0]))
        norm = norms()[quantity, worst.role]
        fewer = norm.robots_below(worst.value)
        count = fewer if is_large else norm.robots - fewer
        what, unit = QUANTITIES[quantity]
        unit = unit and f" {unit}"
        others = {sample.element.name for _, sample in values} - {worst.element.name}
        is_far = excess > (above if is_large else below) and worst.role != "other"
        yield Violation(
            element=worst.element,
            severity="warning" if is_far else None,
            message=f"{what} of {worst.role} {worst.element.name}: got {worst.value:.3g}{unit}, "
            f"{'more' if is_large else 'less'} than in {count} of {norm.robots} published robots; "
            f"expected at {'most' if is_large else 'least'} {norm.limits[is_large]:.3g}{unit} "
            f"(median {norm.median:.3g})"
            + (f"; it is unusual for {len(others)} more" if others else ""),
            measured={"value": worst.value, "median": norm.median, "robots": count},
        )


@rule("NRM001", "unusual-mass", "note", needs=("mass-unit",))
def unusual_mass(robot: Facts) -> Violations:
    """A link has an unusual share of the mass, or an unusual density.

    It is lighter or heavier than the same link of nearly all published robots. The mass may belong
    to another link, or have a shifted decimal point; the robot then moves unlike the real one.

    Fix:
        Compare the mass with the real part. A robot may be unusual on purpose.

    Source:
        docs/robot_norms.py. The masses of thighs, shanks and feet count for all legs together; the
        density is the mass over the bounding box of all shapes and joints of a body.
    """
    yield from _unusual(robot, ("mass", "mass share", "density"), ("INR001", "INR009", "INR010"))


@rule("NRM002", "unusual-inertia", "note", needs=("mass-unit", "inertia-unit"))
def unusual_inertia(robot: Facts) -> Violations:
    """A center of mass or an inertia is unusual for the size of its body.

    The radius of gyration and the distance of the center of mass from the middle of the body are
    compared with those of the same body of published robots.

    Fix:
        Take mass, center and inertia of the part from CAD, all in the frame of the link.

    Source:
        docs/robot_norms.py. INR006, INR007 and INR008 report what no body can have.
    """
    explained = ("INR003", "INR004", "INR005", "INR006", "INR007", "INR008", "INR010", "INR012")
    yield from _unusual(robot, ("center of mass", "radius of gyration"), explained)


@rule("NRM003", "unusual-collision", "note", needs=("all-files",))
def unusual_collision(robot: Facts) -> Violations:
    """The collision shapes of a body are unusually far from the visible ones, or of another size.

    The robot then collides where it cannot be seen, or passes through obstacles.

    Fix:
        Show both kinds of shapes in a viewer, and correct the one that is wrong.

    Source:
        docs/robot_norms.py. Bounding boxes of all shapes of a body.
    """
    yield from _unusual(robot, ("collision offset", "collision size"), ("COL009", "COL010"))


@rule("NRM004", "unusual-range", "note", needs=("angle-unit",))
def unusual_range(robot: Facts) -> Violations:
    """The range of a driven hinge is unusually narrow or wide.

    The limits were converted to radians twice, or an MJCF file has limits in radians although its
    angles are in degrees, which is the default of <compiler>. It is a warning for a leg that
    hardly moves.

    Fix:
        Give the limits in radians, and set <compiler angle="radian"/> in MJCF.

    Source:
        docs/robot_norms.py. Nine of ten knees of published robots move by 1.6 rad and more.
    """
    yield from _unusual(robot, ("range",), ("JNT006", "JNT007", "JNT008"), below=_MIN_RANGE)


@rule("NRM005", "unusual-effort", "note", needs=("mass-unit", "effort-unit"))
def unusual_effort(robot: Facts) -> Violations:
    """The effort limit of a joint is unusual for the weight and the size of the robot.

    The number is in another unit, such as kg cm, or is a placeholder. A policy learns to jump with
    torques that the motor does not have. It is a warning if it is too large for a leg. In MJCF this
    is only a note, since benchmark models such as the ant of Gymnasium have such motors, unless a
    gear multiplies a control range that is a torque of the joint already.

    Fix:
        Give the peak torque of the motor after the gear, in N m.

    Source:
        docs/robot_norms.py. Effort over weight times leg length, or over weight times the size of
        a robot without legs.
    """
    is_torque = any(
        abs(motor.gear) > 1 and max(map(abs, motor.commands or (0.0,))) > _MAX_UNIT_COMMAND
        for motor in robot.model.actuators
    )
    above = 1.0 if is_torque or robot.model.kind != "mjcf" else math.inf
    yield from _unusual(robot, ("effort",), ("JNT009", "JNT011", "JNT015"), above=above)


@rule("NRM006", "unusual-velocity", "note")
def unusual_velocity(robot: Facts) -> Violations:
    """The velocity limit of a joint is unusually low or high.

    PhysX clips the velocity of the joint to this number. A velocity in turns per second, or that
    was converted from degrees twice, holds a leg almost still, which is a warning.

    Fix:
        Give the no-load speed of the motor after the gear [rad/s].

    Source:
        docs/robot_norms.py. Nine of ten legs of published robots have 4 rad/s and more.
    """
    yield from _unusual(robot, ("velocity",), ("JNT010", "JNT011"), below=_MIN_VELOCITY)


@rule("NRM007", "unusual-gain", "note", needs=("mass-unit",))
def unusual_gain(robot: Facts) -> Violations:
    """A gain of a position controller is unusual for the weight and the size of the robot.

    A soft joint collapses, and a stiff one makes the simulation unstable at common time steps.

    Fix:
        Compare the gain with the one of the real controller, in N m/rad and N m s/rad.

    Source:
        docs/robot_norms.py. Gains over weight times leg length.
    """
    yield from _unusual(robot, ("stiffness", "damping"), ("JNT028",))


@rule("NRM008", "unusual-loss", "note", needs=("effort-unit",))
def unusual_loss(robot: Facts) -> Violations:
    """Friction, damping or armature of a joint are unusual for its effort.

    The joint moves as if in tar, or as if it had no losses. An armature that is far too large for a
    leg is a warning: it is the inertia of the rotor times the square of the gear ratio, and the
    joint becomes too slow to balance with.

    Fix:
        Use the values of the real joint. Typical armatures are 0.005 to 0.2 kg m2.

    Source:
        docs/robot_norms.py. Acceleration = effort / armature: nine of ten legs of published robots
        have 350 rad/s2 and more. JNT021 and JNT022 report what no motor has.
    """
    losses = ("friction", "damped speed", "acceleration")
    yield from _unusual(robot, losses, ("JNT021", "JNT022"), below=_MIN_ACCELERATION)
