"""Rules that compare the heights and positions of the spec with the standing pose."""

from collections.abc import Mapping

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.legs import mean_length
from terrainkit_robots.analysis.legs.stance import Stance
from terrainkit_robots.lint.rule import Severity, Violation, Violations, rule
from terrainkit_robots.spec.per_joint import match_joints
from terrainkit_robots.spec.robot_spec import RobotSpec
from terrainkit_robots.text import names

_MAX_PENETRATION = 0.001
"""Depth of the feet in the ground that a simulator tolerates at the start [m]."""

# v = sqrt(2 g h).
_MAX_DROP = 0.06
"""Largest height of the feet above the ground at the start [m]; the robot lands at 1.1 m/s."""

_MAX_HEIGHT_ERROR = 0.1
"""Allowed difference of the target height from the standing height, as a share."""

_MIN_HEIGHT_SHARE = 0.3
"""A base lower than this share of the leg length has its origin at its feet."""

_LIMIT_TOLERANCE = 1e-3
"""Distance of a position from a limit that is attributed to rounding [rad] or [m]."""


def _spec_and_stance(robot: Facts) -> tuple[RobotSpec, Stance]:
    """Return the spec and the stance at its default pose.

    Raises:
        CannotCheckError: If the default pose does not cover all leg joints.
    """
    spec, stance = robot.required_spec, robot.stance
    assert stance is not None
    actuated = [joint.name for joint in robot.actuated]
    joints = [j.name for leg in robot.legs for j in leg.joints if j.name in set(actuated)]
    pose = match_joints(spec.default_pose, actuated).values
    missing = [name for name in joints if name not in pose]
    if missing:
        raise CannotCheckError(f"default_pose of the spec has no unique value for {names(missing)}")
    return spec, stance


def _report_height(
    robot: Facts, message: str, measured: Mapping[str, float], severity: Severity | None = None
) -> Violation:
    trunk = robot.bodies[0].top
    return Violation(
        element=trunk,
        message=message,
        severity=severity,
        measured={name: round(value, 5) for name, value in measured.items()},
    )


@rule("LEG008", "spec-spawn-height", "error", needs=("spec",))
def spec_spawn_height(robot: Facts) -> Violations:
    """The spawn height of the spec is inside the ground or far above it.

    If the feet start inside the ground, contact forces throw the robot up at the first step. If
    they start far above it, each episode begins with a fall.

    Fix:
        Set spawn_height to the height at which the feet touch the ground at the default pose, plus
        1 cm.

    Source:
        Lowest point of the collision shapes at the spec's default pose, with a level trunk.
    """
    spec, stance = _spec_and_stance(robot)
    if spec.spawn_height is None:
        raise CannotCheckError("the spec has no spawn_height")
    gap = spec.spawn_height - stance.height
    if -_MAX_PENETRATION <= gap <= _MAX_DROP:
        return
    side = f"{1000 * -gap:.0f} mm inside the ground" if gap < 0 else f"{gap:.3f} m above the ground"
    message = (
        f"spawn_height: got {spec.spawn_height:.4f} m, with the feet {side}; expected "
        f"{stance.height:.4f} m, where the feet touch the ground at the default pose, or at most "
        f"{_MAX_DROP:g} m more"
    )
    measured = {"spawn_height": spec.spawn_height, "contact_height": stance.height}
    yield _report_height(robot, message, measured, None if gap < 0 else "warning")


@rule("LEG009", "spec-target-height", "warning", needs=("spec",))
def spec_target_height(robot: Facts) -> Violations:
    """The target height of the spec differs from the standing height.

    The reward for the base height and the default pose, to which all actions are added, then
    contradict each other: the robot learns to crouch or stretch all the time.

    Fix:
        Set base_height_target to the standing height, or change the default pose.

    Source:
        legged_gym, reward for base height; lowest collision shape at the spec's default pose.
    """
    spec, stance = _spec_and_stance(robot)
    target = spec.base_height_target
    if target is None:
        raise CannotCheckError("the spec has no base_height_target")
    # The height of a base with its origin at the feet says nothing, so the leg length is used.
    size = max(abs(stance.height), _MIN_HEIGHT_SHARE * mean_length(robot.legs))
    error, limit = abs(target - stance.height), _MAX_HEIGHT_ERROR * size
    if error > limit:
        message = (
            f"base_height_target: got {target:.4f} m, {error:.3f} m from the standing height of "
            f"{stance.height:.4f} m at the default pose; expected at most {limit:.3f} m"
        )
        yield _report_height(robot, message, {"target": target, "standing": stance.height})


@rule("LEG010", "spec-reset-range", "warning", needs=("spec",), certainty="proven")
def spec_reset_range(robot: Facts) -> Violations:
    """The reset range of the spec exceeds the joint limits.

    At reset, the default pose is multiplied by a random factor from the reset range. If a position
    is outside of its limits, the simulator pushes the joint back and the robot jumps at the first
    step.

    Fix:
        Reduce reset_range, or move the default pose away from the limits.

    Source:
        legged_gym, reset of joints: the default pose times a random factor of 0.5 to 1.5.
    """
    spec = robot.required_spec
    joints = {joint.name: joint for joint in robot.actuated}
    distances: dict[str, float] = {}
    for name, position in match_joints(spec.default_pose, list(joints)).values.items():
        limits = joints[name].range
        if limits is None:
            continue
        if not limits[0] - _LIMIT_TOLERANCE <= position <= limits[1] + _LIMIT_TOLERANCE:
            continue  # reported by XRF015
        ends = [factor * position for factor in spec.reset_range]
        distance = max(limits[0] - min(ends), max(ends) - limits[1])
        if distance > _LIMIT_TOLERANCE:
            distances[name] = distance
    if not distances:
        return
    largest = max(distances, key=lambda name: distances[name])
    listed = names(
        f"{name} by {value:.3g} {joints[name].unit}" for name, value in distances.items()
    )
    lower, upper = spec.reset_range
    yield Violation(
        element=joints[largest],
        message=f"reset_range: got {lower:g} to {upper:g} times the default pose, which exceeds "
        f"the limits of {len(distances)} joints ({listed}); expected positions within the limits",
        measured={"joints": len(distances), "farthest": round(distances[largest], 5)},
    )
