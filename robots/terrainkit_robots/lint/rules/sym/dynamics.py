"""Rules on the symmetry of damping, friction, armature and gears."""

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.mirror_pairs import MirrorSide, outlier_first
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.transforms import Matrix

_MAX_RATIO = 5.0
"""Allowed ratio of two losses. Losses identified joint by joint differ by a factor of up to 3."""

_TYPICAL = {"damping": 10.0, "friction": 1.0, "armature": 100.0}
"""Typical speed [rad/s], sign and acceleration [rad/s2] of a leg joint, by which a loss takes
effort."""

_MIN_EFFORT_SHARE = 0.1
"""Difference of that effort, as a share of the effort limit, below which a loss does not matter."""


@rule("SYM009", "loss-asymmetry", "warning")
def loss_asymmetry(robot: Facts) -> Violations:
    """The damping, friction or armature of a joint differs widely from its mirror image.

    Both sides have the same motor and gear. A number was mistyped or changed on one side only, and
    the robot veers to that side.

    Fix:
        Give both joints the same values.

    Source:
        The losses of published robots agree exactly, or are identified joint by joint and differ by
        less than a factor of 3.
    """
    for pair in robot.mirror_pairs:
        for name in ("damping", "friction", "armature"):
            a, b = (float(getattr(side.joint, name)) for side in (pair.left, pair.right))
            least, most = sorted((a, b))
            if least < 0 or most <= _MAX_RATIO * least or least == 0:
                continue
            efforts = [side.joint.effort for side in (pair.left, pair.right)]
            known = [effort for effort in efforts if effort is not None]
            if known and (most - least) * _TYPICAL[name] < _MIN_EFFORT_SHARE * max(known):
                continue

            def value(body: Body, name: str = name) -> Matrix | None:
                return None if body.joint is None else np.array([getattr(body.joint, name)])

            odd, other, reason = outlier_first(robot, pair, value)
            own, mirrored = getattr(odd.joint, name), getattr(other.joint, name)
            yield Violation(
                element=Part(odd.joint.name, (odd.joint.dynamics or odd.joint).source),
                message=f"{name} of joint {odd.joint.name}: got {own:g}, and {mirrored:g} for its "
                f"mirror image {other.joint.name}; expected at most a factor of {_MAX_RATIO:g}; "
                f"{reason}",
                measured={name: own, "other": mirrored, "mirror_image": other.joint.name},
            )


@rule("SYM010", "gear-asymmetry", "warning")
def gear_asymmetry(robot: Facts) -> Violations:
    """The gear of an actuator has the opposite sign of its mirror image.

    A positive command then moves the two joints in opposite directions, although their axes and
    limits say otherwise. If all legs with such a joint agree, the sign is a convention.

    Fix:
        Remove the sign of the gear, or mirror the axis and the limits of the joint as well.

    Source:
        MuJoCo's XML reference, actuator: gear scales the force on the joint.
    """
    gears = {actuator.joint: actuator for actuator in robot.model.actuators}
    products = {
        pair: gears[a].gear * gears[b].gear
        for pair in robot.mirror_pairs
        if pair.sign != 0
        and (a := pair.left.joint.name) in gears
        and (b := pair.right.joint.name) in gears
    }
    same = [pair for pair, product in products.items() if product > 0]
    for pair, product in products.items():
        alike = [p for p in same if p.sign == pair.sign]
        is_convention = pair.sign < 0 and not any(_is_parallel(p.left, pair.left) for p in alike)
        if not product < 0 or is_convention:
            continue

        def is_negative(body: Body) -> Matrix | None:
            actuator = gears.get(body.joint.name) if body.joint else None
            return None if actuator is None else np.array([float(actuator.gear < 0)])

        odd, other, _ = outlier_first(robot, pair, is_negative)
        if gears[odd.joint.name].gear > 0:
            odd, other = other, odd
        yield Violation(
            element=Part(odd.joint.name, gears[odd.joint.name].source),
            message=f"gear of the actuator of joint {odd.joint.name}: got "
            f"{gears[odd.joint.name].gear:g}, and {gears[other.joint.name].gear:g} for its mirror "
            f"image {other.joint.name}; expected the same sign",
            measured={"mirror_image": other.joint.name},
        )


def _is_parallel(a: MirrorSide, b: MirrorSide) -> bool:
    return abs(float(a.axis @ b.axis)) > 0.9
