"""Use the position gains that a file declares, if they can hold the robot in training.

They are published with many MJCF files and in the ros2_control of URDF files. They are not used if
explicit PD control would be unstable at the time step of training, if a leg collapses, or if they
are too slow to balance two legs. Joints with equal gains are judged together: many arms are stable
only at shorter time steps than the legs.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from terrainkit_robots.analysis.facts import Facts, cached_fact
from terrainkit_robots.description.model import Joint
from terrainkit_robots.simulation.gain import Gain
from terrainkit_robots.simulation.pd_gains import suggest_gains
from terrainkit_robots.simulation.sim_model import TIME_STEP, make_sim_model
from terrainkit_robots.simulation.stiffness import balance_frequency
from terrainkit_robots.simulation.time_step import (
    JointInertia,
    joint_inertia,
    max_stable_time_step,
)
from terrainkit_robots.text import contrast

_BALANCE_SHARE = 0.8
"""Declared gains are used from this share of `balance_frequency` on."""

_MAX_SAG = 1.0
"""Allowed error of a joint that holds a leg at the standing pose [rad], as in JNT028."""


@dataclass(frozen=True, kw_only=True)
class DeclaredGains:
    """The position gains of a file."""

    gains: Mapping[str, Gain]
    """Gains of each actuated joint for which the file declares some."""

    unused: Mapping[str, str]
    """Why gains are not used, by joint."""


@cached_fact
def declared_gains(facts: Facts) -> DeclaredGains:
    """Return the gains that the file of a robot declares.

    Raises:
        CannotCheckError: if the robot cannot be simulated.
    """
    joints = [joint for joint in facts.actuated if joint.position_gains is not None]
    if not joints:
        return DeclaredGains(gains={}, unused={})
    sim, suggested = make_sim_model(facts), suggest_gains(facts)
    inertia = joint_inertia(sim)
    gains = {
        joint.name: _gain(joint, suggested[joint.name], inertia[joint.name].locked)
        for joint in joints
        if suggested[joint.name].stiffness > 0  # a wheel has no position target
    }
    torques = {} if facts.stance is None else facts.stance.torques
    unused = {
        name: f"standing deflects it by {torque / gain.stiffness:.2g} rad; expected at most "
        f"{_MAX_SAG:g} rad"
        for name, gain in gains.items()
        if _MAX_SAG * gain.stiffness < (torque := abs(torques.get(name, 0.0))) < math.inf
    }
    legs = {joint.name for joint in facts.leg_joints}
    of_legs = {name: gain for name, gain in gains.items() if name in legs}
    if slow := _too_slow_to_balance(of_legs, inertia, balance_frequency(facts, sim)):
        unused |= dict.fromkeys(of_legs, slow)
    # Joints of one class of actuators, such as all knees, keep the same gains.
    group = {name: (gain.stiffness, gain.damping, name in legs) for name, gain in gains.items()}
    while True:
        used = {name: gain for name, gain in gains.items() if name not in unused}
        stable = max_stable_time_step(sim, {**suggested, **used})
        if stable.seconds >= TIME_STEP or stable.joint not in used:
            return DeclaredGains(gains=gains, unused=unused)
        got, expected = contrast(1000 * stable.seconds, 1000 * TIME_STEP, ".3g")
        reason = f"explicit PD control of {stable.joint} is stable up to a time step of {got} ms"
        reason += f"; expected {expected} ms"
        unused |= {name: reason for name in used if group[name] == group[stable.joint]}


def standing_gains(facts: Facts) -> Mapping[str, Gain]:
    """Return gains for each actuated joint: as declared where they can be used, or as suggested.

    Raises:
        CannotCheckError: if the robot cannot be simulated.
    """
    declared = declared_gains(facts)
    found = {**suggest_gains(facts), **declared.gains}
    for name, why in declared.unused.items():
        gain, own = suggest_gains(facts)[name], found[name]
        text = f"{gain.reason}; declared are {own.stiffness:g} and {own.damping:g}, but {why}"
        found[name] = replace(gain, reason=text)
    return found


def _too_slow_to_balance(
    gains: Mapping[str, Gain], inertia: Mapping[str, JointInertia], frequency: float
) -> str | None:
    """Return why the gains of the legs cannot balance a robot, if they cannot.

    Args:
        gains: Gains of the joints of the legs.
        inertia: Inertia of the joints.
        frequency: The `balance_frequency` [rad/s].
    """
    expected = _BALANCE_SHARE * frequency
    frequencies = [math.sqrt(gain.stiffness / inertia[name].free) for name, gain in gains.items()]
    fastest = max(frequencies, default=math.inf)
    if fastest >= expected:
        return None
    return (
        f"no joint of the legs is faster than {fastest:.2g} rad/s (natural frequency); a policy "
        f"that balances the robot needs {expected:.2g} rad/s"
    )


def _gain(joint: Joint, suggested: Gain, inertia: float) -> Gain:
    assert joint.position_gains is not None
    stiffness = joint.position_gains.stiffness
    damping = joint.position_gains.damping or joint.damping
    origin = "position controller in the file"
    if not damping:
        damping = float(f"{2 * math.sqrt(stiffness * inertia):.2g}")
        origin += f"; kd critical for the inertia of the joint, {inertia:.2g}"
    return Gain(
        stiffness=stiffness,
        damping=damping,
        armature=joint.armature,
        reason=f"{origin}; suggested are {suggested.stiffness:g} and {suggested.damping:g}",
        declared=True,
    )
