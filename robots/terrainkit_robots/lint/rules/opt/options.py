"""Rules on gravity, the time step and disabled parts of the physics."""

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.stance import GRAVITY
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.text import names

_MAX_GRAVITY_ERROR = 0.2
"""Allowed distance of gravity from 9.81 m/s2 downward [m/s2]; 10 m/s2 is common."""

_MIN_TIME_STEP, _MAX_TIME_STEP = 1e-5, 0.0101
"""Time steps that legged robots are simulated with [s]; the ant of Gymnasium uses 0.01."""

_CONSEQUENCES = {
    "actuation": "the motors have no torque",
    "contact": "the robot falls through the ground",
    "constraint": "there are no contacts, limits or equalities",
    "equality": "closed chains and coupled joints are open",
    "limit": "the joints have no limits",
}
"""What happens if a flag is disabled."""

_FATAL = frozenset({"actuation", "contact", "constraint"})


@rule("OPT001", "wrong-gravity", "error", needs=("legs",))
def wrong_gravity(robot: Facts) -> Violations:
    """Gravity is off, or does not point down.

    The robot floats, falls sideways or falls up. Gravity is often switched off to look at a model,
    and the file of a simulator in which y points up has gravity along y. It is a warning if the
    trunk has no free joint, since such files are parts of a scene with options of its own.

    Fix:
        Remove `gravity` from <option> and `gravity` from its <flag>; the default is 0 0 -9.81.

    Source:
        MuJoCo's XML reference, option: gravity, and flag: gravity.
    """
    options = robot.model.options
    if options is None:
        return
    off = "gravity" in options.disabled
    x, y, z = (0.0, 0.0, 0.0) if off else options.gravity
    error = (x * x + y * y + (z + GRAVITY) ** 2) ** 0.5
    if error <= _MAX_GRAVITY_ERROR:
        return
    points_down = x == y == 0 and z < 0
    is_part = not any(joint.kind == "floating" for joint in robot.model.joints)
    if points_down and abs(z + 100 * GRAVITY) < 1:
        return  # the unit of length is the centimeter, as for insects
    yield Violation(
        element=Part(robot.model.title, options.source),
        severity="warning" if points_down or is_part else None,
        message=f"gravity{', which is disabled' if off else ''}: got {x:g} {y:g} {z:g} m/s2; "
        f"expected 0 0 {-GRAVITY:g} m/s2",
        measured={"x": x, "y": y, "z": z},
    )


@rule("OPT002", "implausible-time-step", "warning", needs=("legs",))
def implausible_time_step(robot: Facts) -> Violations:
    """The time step is too long or too short for a legged robot.

    Contacts and PD control become unstable with long steps. With very short ones, training takes
    days instead of hours.

    Fix:
        Use 0.002 s to 0.005 s, in seconds.

    Source:
        The defaults of MuJoCo (0.002 s), legged_gym, Isaac Lab and mjlab (0.005 s).
    """
    options = robot.model.options
    if options is None or _MIN_TIME_STEP <= options.timestep <= _MAX_TIME_STEP:
        return
    yield Violation(
        element=Part(robot.model.title, options.source),
        message=f"time step: got {options.timestep:g} s; expected {_MIN_TIME_STEP:g} s to "
        f"{_MAX_TIME_STEP:.2g} s",
        measured={"timestep": options.timestep},
    )


@rule("OPT003", "disabled-physics", "error", needs=("legs",))
def disabled_physics(robot: Facts) -> Violations:
    """A part of the physics is disabled.

    Without contacts or constraints the robot falls through the ground. Without actuation it stays
    limp, and without limits its knees turn around. Such flags are set for debugging and forgotten.

    Fix:
        Remove the attribute from <flag>.

    Source:
        MuJoCo's XML reference, option/flag.
    """
    options = robot.model.options
    if options is None:
        return
    disabled = sorted(options.disabled & set(_CONSEQUENCES))
    if disabled:
        effects = "; ".join(_CONSEQUENCES[name] for name in disabled)
        yield Violation(
            element=Part(robot.model.title, options.source),
            severity=None if _FATAL & set(disabled) else "warning",
            message=f"flags of <option>: got {names(disabled)} disabled ({effects}); expected "
            "enable",
        )
