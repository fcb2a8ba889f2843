"""Rule on the largest stable time step."""

from dataclasses import replace

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import PRISMATIC
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.simulation.pd_gains import suggest_gains
from terrainkit_robots.simulation.sim_model import TIME_STEP, make_sim_model
from terrainkit_robots.simulation.time_step import (
    joint_inertia,
    max_stable_stiffness,
    max_stable_time_step,
)
from terrainkit_robots.text import count

_MIN_STIFFNESS_SHARE = 0.003
"""Stable stiffness divided by the required stiffness below which the inertia is probably wrong. The
ankle of a humanoid has 0.04 without the inertia of its rotor."""


@rule("DYN004", "low-joint-inertia", "note", needs=("simulation",), certainty="likely")
def low_joint_inertia(robot: Facts) -> Violations:
    """The inertia of a joint is too low for its gains at the training time step.

    The explicit actuators of legged_gym and Isaac Lab compute the torque once per time step of 5
    ms. A joint with little inertia oscillates at this rate for any useful gain. Real joints also
    have the reflected inertia of the rotor, which URDF cannot express: simulators call it armature.
    An inertia that is several hundred times too low is a warning, since it is probably wrong.

    Fix:
        Set the suggested armature in the simulator, or halve the time step.

    Source:
        Largest stable time step of explicit PD, by Jury's criterion on the mass matrix; Unitree's
        MJCF has an armature of 0.01 kg m2.
    """
    model, gains = make_sim_model(robot), suggest_gains(robot)
    declared = {name: float(model.model.joint(name).armature[0]) for name in gains}
    inertias = joint_inertia(model)
    shares = {
        name: max_stable_stiffness(inertias[name].free) / gain.stiffness
        for name, gain in gains.items()
        if gain.armature > declared[name] and gain.stiffness > 0
    }
    if not shares:
        return
    lightest = min(shares, key=lambda name: shares[name])
    gain, units = gains[lightest], model.units(lightest)
    inertia = inertias[lightest].free
    without = {name: replace(gain, armature=declared[name]) for name, gain in gains.items()}
    step = max_stable_time_step(model, without).seconds
    legged = {joint.name for leg in robot.legs for joint in (*leg.joints, *leg.branches)}
    is_wrong = lightest in legged and shares[lightest] < _MIN_STIFFNESS_SHARE
    others = count(len(shares) - 1, "other joint")
    yield Violation(
        element=next(
            (joint for joint in robot.joints if joint.name == lightest),
            Part(lightest, robot.model.source),
        ),
        severity="warning" if is_wrong else "note",
        message=f"largest stable time step of explicit PD on joint {lightest} (kp "
        f"{gain.stiffness:g}, kd {gain.damping:g}, {'mass' if units == PRISMATIC else 'inertia'} "
        f"{inertia:.2g} {units.inertia}): got {1000 * step:.2g} ms; expected at least twice the "
        f"training time step of {1000 * TIME_STEP:g} ms, as with an armature of {gain.armature:g} "
        f"{units.inertia}" + (f"; the same applies to {others}" if len(shares) > 1 else ""),
        measured={
            "inertia": inertia,
            "stable_step": step,
            "armature": gain.armature,
            "joints": len(shares),
        },
    )
