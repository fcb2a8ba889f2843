"""Rule that moves each joint over its range."""

from terrainkit_robots.analysis.bodies.kinematics import ancestors
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.simulation.joint_sweep import SweepResult, joint_sweep
from terrainkit_robots.simulation.sim_model import make_sim_model
from terrainkit_robots.text import count

_MIN_RANGE_SHARE = 0.1
"""Usable share of the joint range below which a joint is blocked at its default position."""

_FULL_RANGE_SHARE = 0.99
"""Usable share of the joint range from which a joint reaches its limits."""


@rule("DYN003", "unreachable-limits", "note", needs=("simulation",), certainty="likely")
def unreachable_limits(robot: Facts) -> Violations:
    """A joint does not reach its limits while the others stay at the standing pose.

    Either a collision with another body stops the joint, or its motor cannot lift the limb.
    Collisions between legs are common; they are reported in one note. It is a warning if a limb
    blocks its own joint within 10 % of the range, or if a motor of a legged robot cannot hold its
    limb at the standing pose; arms may have springs for that.

    Fix:
        Compare the limits, the collision shapes and the effort limits with the real robot.

    Source:
        MuJoCo: 40 positions in the range of each joint, base fixed in the air, contacts deeper than
        1 mm.
    """
    results = joint_sweep(make_sim_model(robot))
    if not results:
        raise CannotCheckError("no joint with an actuator has limits")
    sources = {joint.name: joint.source for joint in robot.joints}
    for result in results:
        message = _joint_message(robot, result)
        if message:
            yield Violation(
                element=Part(result.joint, sources.get(result.joint, robot.model.source)),
                severity="warning",
                message=message,
                measured={"share": round(result.share, 3), "load": round(result.load, 4)},
            )
    blocked = [result for result in results if result.share < _FULL_RANGE_SHARE]
    weak = [result for result in results if result.max_load > result.effort]
    parts = []
    if blocked:
        worst = min(blocked, key=lambda result: result.share)
        parts.append(
            f"{len(blocked)} of {count(len(results), 'joint')} collide before reaching a limit "
            "when moved alone from the default pose; worst: "
            f"{worst.joint}, which reaches {_describe(worst)}"
        )
    if weak:
        worst = max(weak, key=lambda result: result.max_load / result.effort)
        parts.append(
            f"{len(weak)} of {count(len(results), 'joint')} too weak to lift the limb over the "
            f"whole range; worst: {worst.joint}, which needs {worst.max_load:.3g} "
            f"{worst.units.effort} with an effort limit of {worst.effort:.3g} {worst.units.effort}"
        )
    if parts:
        yield Violation(
            message="; ".join(parts), measured={"short": len(blocked), "weak": len(weak)}
        )


def _joint_message(robot: Facts, result: SweepResult) -> str:
    """Return why a joint cannot move or hold its limb; empty if it can."""
    if _has_limb_collision(robot, result):
        return (
            f"usable range of joint {result.joint}: got {_describe(result)}; expected at least "
            f"{_MIN_RANGE_SHARE:.0%} of its range"
        )
    if robot.legs and result.load > result.effort:
        return (
            f"torque of joint {result.joint} that holds its limb at the default pose: got "
            f"{result.load:.3g} {result.units.effort}; expected at most its effort limit of "
            f"{result.effort:.3g} {result.units.effort}"
        )
    return ""


def _describe(result: SweepResult) -> str:
    first, second = next(pair for pair in result.blocked if pair is not None)
    return (
        f"{result.reached[0]:.2f} to {result.reached[1]:.2f} of {result.limits[0]:.2f} to "
        f"{result.limits[1]:.2f} {result.units.position}, where {first} collides with {second}"
    )


def _has_limb_collision(robot: Facts, result: SweepResult) -> bool:
    """Return whether both directions are blocked by a body and a body that it carries."""
    if result.share >= _MIN_RANGE_SHARE:
        return False
    for pair in result.blocked:
        if pair is None:
            return False
        low, high = sorted(robot.body_of[name].index for name in pair)
        if low != 0 and low not in ancestors(robot.bodies, high):
            return False
    return True
