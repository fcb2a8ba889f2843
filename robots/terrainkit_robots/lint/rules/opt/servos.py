"""Rules on position actuators and reference positions of an MJCF file."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.simulation.sim_model import make_sim_model
from terrainkit_robots.simulation.time_step import joint_inertia
from terrainkit_robots.simulation.written_model import make_written_model, position_servos
from terrainkit_robots.text import count

# The models of MuJoCo Menagerie and Playground have 0.11 to 1.2, and robots of others 0.03.
_MIN_DAMPING_RATIO = 0.02
"""Damping over critical damping, at least. A joint with less swings six times before its amplitude
halves."""

# ANYmal of MuJoCo Menagerie shares one range between joints, 5.8 rad beyond the limits of one.
_MAX_EXCESS = 2 * math.pi
"""Distance of a target from the limits of its joint, at most [rad]: a turn."""


@dataclass(frozen=True, kw_only=True)
class _Servo:
    """A position actuator on a hinge, with values on the joint."""

    joint: str
    stiffness: float
    """Position gain [N m/rad]."""

    damping: float
    """Damping of the actuator and of the joint [N m s/rad]."""

    excess: float
    """Largest distance of a command from the limits of the joint [rad]; 0 without limits."""

    commands: tuple[float, float]
    """Range of the commands, as written."""


def _servos(model: Any) -> Iterator[_Servo]:
    import mujoco

    for index in position_servos(model):
        bias, gear = model.actuator_biasprm[index], float(model.actuator_gear[index, 0])
        joint = int(model.actuator_trnid[index, 0])
        if gear == 0 or int(model.jnt_type[joint]) != int(mujoco.mjtJoint.mjJNT_HINGE):
            continue
        low, high = (float(limit) for limit in model.actuator_ctrlrange[index])
        ends = sorted((low / gear, high / gear))
        is_limited = model.actuator_ctrllimited[index] and model.jnt_limited[joint]
        lower, upper = model.jnt_range[joint]
        damping = model.actuator_damping[index] - bias[2]
        yield _Servo(
            joint=model.joint(joint).name,
            stiffness=float(-bias[1] * gear**2),
            damping=float(damping * gear**2 + model.dof_damping[model.jnt_dofadr[joint]]),
            excess=float(max(lower - ends[0], ends[1] - upper)) if is_limited else 0.0,
            commands=(low, high),
        )


def _actuator(robot: Facts, joint: str) -> Part:
    sources = {actuator.joint: actuator.source for actuator in reversed(robot.model.actuators)}
    return Part(joint, sources.get(joint, robot.model.source))


def _others(joints: int) -> str:
    return f"; the same applies to {count(joints - 1, 'other joint')}" if joints > 1 else ""


@rule("OPT010", "undamped-position-gain", "warning", needs=("mjcf", "legs", "simulation"))
def undamped_position_gain(robot: Facts) -> Violations:
    """A position actuator has almost no damping.

    The actuator is a spring, and the joint swings around its target. The default kv of <position>
    is 0, so that the damping of the joint is the only one.

    Fix:
        Set dampratio="1", or kv, or the damping of the joint.

    Source:
        Damping over 2 sqrt(gain x inertia), with the inertia of the joint in the standing pose.
    """
    inertias = joint_inertia(make_sim_model(robot))
    found = {
        servo: servo.damping / (2 * math.sqrt(servo.stiffness * inertias[servo.joint].free))
        for servo in _servos(make_written_model(robot).model)
        if servo.joint in inertias
    }
    loose = [servo for servo, ratio in found.items() if ratio < _MIN_DAMPING_RATIO]
    if loose:
        worst = min(loose, key=lambda servo: found[servo])
        frequency = math.sqrt(worst.stiffness / inertias[worst.joint].free) / (2 * math.pi)
        yield Violation(
            element=_actuator(robot, worst.joint),
            message=f"damping of the position actuator of joint {worst.joint}: got "
            f"{worst.damping:g} N m s/rad with a gain of {worst.stiffness:g} N m/rad, "
            f"{found[worst]:.1%} of critical damping; expected at least {_MIN_DAMPING_RATIO:.0%}; "
            f"it swings at {frequency:.0f} Hz" + _others(len(loose)),
            measured={"ratio": found[worst], "joints": len(loose)},
        )


@rule("OPT011", "excessive-control-range", "warning", needs=("mjcf", "legs", "simulation"))
def excessive_control_range(robot: Facts) -> Violations:
    """The targets of a position actuator lie far beyond the limits of its joint.

    A policy whose actions are scaled to ctrlrange commands mostly targets that the joint cannot
    reach. MuJoCo reads ctrlrange in radians, even if the angles of the file are in degrees.

    Fix:
        Replace ctrlrange by inheritrange="1", or give the limits of the joint in radians.

    Source:
        MuJoCo's XML reference, actuator: ctrlrange; position: inheritrange.
    """
    found = [s for s in _servos(make_written_model(robot).model) if s.excess > _MAX_EXCESS]
    if found:
        worst = max(found, key=lambda servo: servo.excess)
        low, high = worst.commands
        yield Violation(
            element=_actuator(robot, worst.joint),
            message=f"ctrlrange of the position actuator of joint {worst.joint}: got {low:g} to "
            f"{high:g} rad, {worst.excess:.3g} rad beyond the limits of the joint; expected at "
            f"most {_MAX_EXCESS:.2g} rad" + _others(len(found)),
            measured={"excess": worst.excess, "joints": len(found)},
        )


@rule("OPT012", "reference-outside-limits", "warning", needs=("mjcf", "legs", "simulation"))
def reference_outside_limits(robot: Facts) -> Violations:
    """The reference position of a joint or of its spring lies outside its limits.

    `ref` is the joint position in the pose that the file describes, and `springref` the position at
    which the spring of a joint is relaxed. The limits count from the same zero. A wrong offset
    shifts all positions of the joint, so that policies and poses from other files do not fit.

    Fix:
        Remove ref and springref, or shift the range of the joint by the same angle.

    Source:
        MuJoCo's XML reference, joint: ref, springref.
    """
    model = make_written_model(robot).model
    for name in ("ref", "springref"):
        found = []
        for joint in robot.joints:
            index, limits = model.joint(joint.name).id, joint.range
            spring = float(model.qpos_spring[model.jnt_qposadr[index]])
            value = joint.reference if name == "ref" else spring * (model.jnt_stiffness[index] > 0)
            if limits and value != 0 and not limits[0] - 1e-3 <= value <= limits[1] + 1e-3:
                found.append((joint, value, limits))
        if found:
            joint, value, (low, high) = found[0]
            yield Violation(
                element=joint,
                message=f"{name} of joint {joint.name}: got {value:.4g} {joint.unit}; expected a "
                f"position within its limits of {low:.4g} to {high:.4g} {joint.unit}"
                + _others(len(found)),
                measured={"value": value, "joints": len(found)},
            )
