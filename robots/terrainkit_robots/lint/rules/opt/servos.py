"""Rules on position actuators, keyframes and reference positions of an MJCF file."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.simulation.sim_model import make_sim_model
from terrainkit_robots.simulation.time_step import joint_inertia
from terrainkit_robots.simulation.written_model import (
    compile_file,
    make_written_model,
    position_servos,
)
from terrainkit_robots.text import count, names

# The models of MuJoCo Menagerie and Playground have 0.11 to 1.2, and robots of others 0.03.
_MIN_DAMPING_RATIO = 0.02
"""Damping over critical damping, at least. A joint with less swings six times before its amplitude
halves."""

# ANYmal of MuJoCo Menagerie shares one range between joints, 5.8 rad beyond the limits of one.
_MAX_EXCESS = 2 * math.pi
"""Distance of a target from the limits of its joint that is only a note [rad]: a turn."""

_TOLERANCE, _MAX_SHARE, _MAX_TARGET_ERROR = 1e-3, 0.01, 0.01
"""Distance of a position from its limits that is attributed to rounding [rad], the same as a share
of a small range, and the distance of a target [rad]."""


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


def _others(items: Sequence[str], word: str = "joint") -> str:
    others = f"{count(len(items), f'other {word}')}: {names(items)}"
    return f"; the same applies to {others}" if items else ""


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
            f"it swings at {frequency:.0f} Hz"
            + _others([servo.joint for servo in loose if servo is not worst]),
            measured={"ratio": found[worst], "joints": len(loose)},
        )


@rule("OPT011", "excessive-control-range", "warning", needs=("mjcf", "simulation"))
def excessive_control_range(robot: Facts) -> Violations:
    """The targets of a position actuator lie beyond the limits of its joint.

    A policy whose actions are scaled to ctrlrange commands targets that the joint cannot reach.
    MuJoCo reads ctrlrange in radians, even if the angles of the file are in degrees. Up to a turn
    beyond the limits it is a note.

    Fix:
        Replace ctrlrange by inheritrange="1", or give the limits of the joint in radians.

    Source:
        MuJoCo's XML reference, actuator: ctrlrange; position: inheritrange.
    """
    found = [s for s in _servos(compile_file(robot)[1]) if s.excess > _MAX_TARGET_ERROR]
    if found:
        worst = max(found, key=lambda servo: servo.excess)
        low, high = worst.commands
        yield Violation(
            element=_actuator(robot, worst.joint),
            severity=None if worst.excess > _MAX_EXCESS else "note",
            message=f"ctrlrange of the position actuator of joint {worst.joint}: got {low:g} to "
            f"{high:g} rad, {worst.excess:.3g} rad beyond the limits of the joint; expected "
            "targets within them" + _others([servo.joint for servo in found if servo is not worst]),
            measured={"excess": worst.excess, "joints": len(found)},
        )


@rule("OPT013", "keyframe-outside-limits", "warning", needs=("mjcf", "simulation"))
def keyframe_outside_limits(robot: Facts) -> Violations:
    """A keyframe has a position outside of the limits of its joint, or such a command.

    MuJoCo loads it without a message. In the first steps the limit throws the joint back, and
    MuJoCo replaces a command by the end of its ctrlrange, so that the robot leaves the pose.

    Fix:
        Move the value into the limits, or correct the limits.

    Source:
        MuJoCo's XML reference, keyframe. Up to 0.001 rad, or 1 % of a small range, is rounding.
    """
    import mujoco

    spec, model = compile_file(robot)
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    (joints,) = np.nonzero(model.jnt_limited & np.isin(model.jnt_type, (slide, hinge)))
    (motors,) = np.nonzero(model.actuator_ctrllimited)
    for kind, field, columns, indices, ranges in (
        ("joint", "qpos", model.jnt_qposadr[joints], joints, model.jnt_range),
        ("actuator", "ctrl", motors, motors, model.actuator_ctrlrange),
    ):
        low, high = ranges[indices].T
        values = getattr(model, f"key_{field}")[:, columns]
        excess = np.maximum(low - values, values - high)
        excess[[not len(getattr(key, field)) for key in spec.keys]] = 0
        keys, outside = np.nonzero(excess > np.minimum(_TOLERANCE, _MAX_SHARE * (high - low)))
        if len(keys):
            found = [getattr(model, kind)(int(index)) for index in indices[outside]]
            places = [
                f"{item.name or item.id + 1} in keyframe {model.key(int(key)).name or key + 1}"
                for item, key in zip(found, keys, strict=True)
            ]
            key, column = int(keys[0]), int(outside[0])
            yield Violation(
                element=Part(found[0].name or str(found[0].id + 1), robot.model.source),
                message=f"{field} of {kind} {places[0]}: got {values[key, column]:.5g}; expected "
                f"{low[column]:.5g} to {high[column]:.5g}" + _others(places[1:], "value"),
                measured={"values": len(keys)},
            )


@rule("OPT012", "reference-outside-limits", "warning", needs=("mjcf", "simulation"))
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
    model = compile_file(robot)[1]
    known = {model.joint(index).name for index in range(model.njnt)}
    joints = [joint for joint in robot.joints if joint.name in known]
    # The springs of grippers are preloaded.
    floats = any(joint.kind == "floating" for joint in robot.model.joints)
    for name in ("ref", "springref") if floats else ("ref",):
        found = []
        for joint in joints:
            limits, adr = joint.range, model.joint(joint.name).qposadr[0]
            is_sprung = model.jnt_stiffness[model.joint(joint.name).id] > 0
            spring = float(model.qpos_spring[adr]) if is_sprung else 0.0
            value = joint.reference if name == "ref" else spring
            low, high = limits or (-math.inf, math.inf)
            if limits and value != 0 and not low - _TOLERANCE <= value <= high + _TOLERANCE:
                found.append((joint, value, limits))
        if found:
            joint, value, (low, high) = found[0]
            yield Violation(
                element=joint,
                message=f"{name} of joint {joint.name}: got {value:.4g} {joint.unit}; expected a "
                f"position within its limits of {low:.4g} to {high:.4g} {joint.unit}"
                + _others([other.name for other, *_ in found[1:]]),
                measured={"value": value, "joints": len(found)},
            )
