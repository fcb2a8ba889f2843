"""Rules on settings of an MJCF file with which the robot does not stand as it would without."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Link
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.simulation.written_model import (
    WrittenStand,
    make_written_model,
    stand_as_written,
    written_stand,
)
from terrainkit_robots.text import count, names

_CONTACT = {"geom_solref": (0.02, 1.0), "geom_solimp": (0.9, 0.95, 0.001, 0.5, 2.0)}
_SOLVER = {"solver": 2, "iterations": 100, "ls_iterations": 50}
_SOLVERS, _INTEGRATORS = ("PGS", "CG", "Newton"), ("Euler", "RK4", "implicit", "implicitfast")
"""MuJoCo's defaults, with which the robot is simulated for comparison, and names of constants."""

_TIME_STEP = 0.002
"""MuJoCo's default [s]."""

_MAX_TIME_CONSTANT = 0.1
"""Longest plausible time constant of a contact [s]; published robots have at most 0.02."""

_MIN_ITERATIONS = 10
"""Iterations below which PGS and CG may not converge."""

_MAX_SYMPTOMS = 2
"""Number of symptoms in a message."""

# Limits: the models of MuJoCo Menagerie, mjlab and MuJoCo Playground reach 0.06 of the weight, 4 %
# of the leg length in depth and 1 % in clearance, and a force of 6 weights.
_SYMPTOMS = {
    "lost_weight": (0.05, False, "the ground carries {carried:.0f} of {weight:.0f} N"),
    "height_loss": (0.15, True, "the base sinks by {value:.3f} m"),
    "depth": (0.045, True, "the feet sink {mm:.0f} mm into the ground"),
    "clearance": (0.02, True, "the feet are {mm:.0f} mm above the ground"),
    "peak_force": (20.0, False, "the ground pushes with up to {kn:.3g} kN"),
    "drift": (0.25, True, "the base slides by {value:.2f} m"),
    "speed": (1.0, False, "a joint vibrates at {value:.2g} rad/s"),
}
"""Limit, whether it is a share of the leg length, and text of each quantity of a stand."""


def _describe(name: str, stand: WrittenStand, weight: float) -> str:
    value = getattr(stand, name)
    if not math.isfinite(value):
        return "the simulation diverges"
    carried = weight * (1 - stand.lost_weight)
    kn = weight * value / 1000
    return _SYMPTOMS[name][2].format(
        value=value, mm=1000 * value, carried=carried, weight=weight, kn=kn
    )


def _consequence(
    robot: Facts,
    what: str,
    expected: str,
    symptoms: tuple[str, ...],
    settings: Mapping[str, Any],
    link: Link | None = None,
) -> Violations:
    """Yield a violation if the robot does not stand, and stands twice as well with `settings`."""
    written, stand = make_written_model(robot), written_stand(robot)

    def excess(name: str, of: WrittenStand) -> float:
        limit, is_length, _ = _SYMPTOMS[name]
        return float(abs(getattr(of, name))) / (limit * (written.leg_length if is_length else 1))

    found = [name for name in symptoms if excess(name, stand) > 1]
    if not found:
        return
    without = stand_as_written(written, settings)
    found = [name for name in found if excess(name, without) <= excess(name, stand) / 2]
    if not found or not math.isfinite(without.speed):
        return
    found = found[: _MAX_SYMPTOMS if math.isfinite(stand.speed) else 1]
    got, other = (
        ", ".join(_describe(name, result, written.weight) for name in found)
        for result in (stand, without)
    )
    yield Violation(
        element=link or _options(robot),
        message=f"{what}: when the robot stands, {got}; expected {expected}, with which {other}",
        measured={n: round(v, 4) for n in found if math.isfinite(v := getattr(stand, n))},
    )


def _options(robot: Facts) -> Part:
    """Return the <option> of a file, or its root element without one."""
    return Part(robot.model.title, (robot.model.options or robot.model).source)


def _link(robot: Facts, body: int) -> Link | None:
    name = make_written_model(robot).model.body(int(body)).name
    return next((link for link in robot.links if link.name == name), None)


@rule("OPT004", "gravity-compensation", "warning", needs=("mjcf", "legs", "simulation"))
def gravity_compensation(robot: Facts) -> Violations:
    """Bodies of a walking robot do not weigh what they should.

    `gravcomp` cancels the gravity of a body. It is made for arms on a table, whose controllers
    compensate gravity. A robot that walks needs its weight on its feet, and a policy that was
    trained without it falls on hardware.

    Fix:
        Remove gravcomp from the bodies of the robot.

    Source:
        MuJoCo's XML reference, body: gravcomp. The file is simulated as written for 2 s.
    """
    written = make_written_model(robot)
    model = written.model
    (bodies,) = np.nonzero(model.body_gravcomp)
    share = float(model.body_gravcomp @ model.body_mass) / model.body_subtreemass[0]
    lost = written_stand(robot).lost_weight if len(bodies) else 0.0
    if share > _SYMPTOMS["lost_weight"][0]:
        lost = lost if math.isfinite(lost) else share
        yield Violation(
            element=_link(robot, bodies[0]),
            message=f"gravcomp of {names(model.body(int(body)).name for body in bodies)}: got "
            f"{model.body_gravcomp.max():g}, so that the ground carries "
            f"{written.weight * (1 - lost):.0f} of {written.weight:.0f} N; expected 0",
            measured={"lost_weight": round(lost, 4)},
        )


@rule("OPT005", "joint-springs", "warning", needs=("mjcf", "legs", "simulation"))
def joint_springs(robot: Facts) -> Violations:
    """Springs of the joints push a robot out of its pose.

    A joint with a stiffness is a spring around springref. Such numbers are often position gains
    that were written to the joint instead of an actuator. The springs of Cassie, which carry it,
    are not reported.

    Fix:
        Remove the stiffness of the joints, or set springref to the standing pose.

    Source:
        MuJoCo's XML reference, joint: stiffness, springref. The file is simulated as written for
        2 s, and again without the springs.
    """
    model = make_written_model(robot).model
    (joints,) = np.nonzero(model.jnt_stiffness)
    if len(joints):
        value = f"got up to {model.jnt_stiffness.max():g} N m/rad"
        yield from _consequence(
            robot,
            f"stiffness of {count(len(joints), 'joint')}: {value}",
            "0",
            ("height_loss", "drift", "speed", "lost_weight"),
            {"jnt_stiffness": 0, "jnt_stiffnesspoly": 0},
            _link(robot, model.jnt_bodyid[joints[0]]),
        )


@rule("OPT006", "contact-stiffness", "warning", needs=("mjcf", "legs", "simulation"))
def contact_stiffness(robot: Facts) -> Violations:
    """The contacts of the robot are too soft, or faster than the time step.

    The first number of solref is the time constant of a contact. With a long one the feet sink into
    the ground, and their positions and contacts are wrong. MuJoCo raises one below twice the time
    step to it. If the robot stands, it is a note.

    Fix:
        Remove solref and solimp; the defaults are 0.02 1 and 0.9 0.95 0.001 0.5 2.

    Source:
        MuJoCo's documentation, Modeling: contact parameters. The file is simulated as written for
        2 s, and again with the defaults.
    """
    written = make_written_model(robot)
    model, shapes = written.model, np.array(written.shapes)
    name, expected = "geom_solref", "0.02 1"
    changed = shapes[(model.geom_solref[shapes] != _CONTACT[name]).any(axis=1)]
    if not len(changed):
        name, expected = "geom_solimp", "the default"
        changed = shapes[(model.geom_solimp[shapes] != _CONTACT[name]).any(axis=1)]
    if not len(changed):
        return
    link = _link(robot, model.geom_bodyid[changed[0]])
    what = f"{name.removeprefix('geom_')} of {count(len(changed), 'shape')}: got "
    values = " ".join(f"{value:g}" for value in getattr(model, name)[changed[0]])
    found = list(_consequence(robot, what + values, expected, ("depth", "speed"), _CONTACT, link))
    yield from found
    constants = model.geom_solref[shapes, 0]
    shortest, longest = float(constants[constants > 0].min(initial=1.0)), float(constants.max())
    least = 2 * float(model.opt.timestep)
    if not found and (shortest < least or longest > _MAX_TIME_CONSTANT):
        constant = shortest if shortest < least else longest
        yield Violation(
            element=link,
            severity="note",
            message=f"time constant of solref: got {constant:g} s; expected at least twice the "
            f"time step, {least:g} s, which MuJoCo uses instead of a shorter one, and at most "
            f"{_MAX_TIME_CONSTANT:g} s",
            measured={"solref": constant},
        )


@rule("OPT007", "contact-margin", "warning", needs=("mjcf", "legs", "simulation"))
def contact_margin(robot: Facts) -> Violations:
    """Contacts begin far from the surface.

    The ground pushes from the distance `margin` on, minus `gap`. A robot with a large margin jumps
    at the first step, and then stands on air.

    Fix:
        Remove margin, or use 0.001 m.

    Source:
        MuJoCo's XML reference, geom: margin, gap. The file is simulated as written for 2 s, and
        again without margin.
    """
    model = make_written_model(robot).model
    (shapes,) = np.nonzero(model.geom_margin)
    if len(shapes):
        yield from _consequence(
            robot,
            f"margin of {count(len(shapes), 'shape')}: got up to {model.geom_margin.max():g} m",
            "0",
            ("clearance", "peak_force", "speed"),
            {"geom_margin": 0, "geom_gap": 0},
            _link(robot, model.geom_bodyid[shapes[0]]),
        )


@rule("OPT008", "contact-solver", "warning", needs=("mjcf", "legs", "simulation"))
def contact_solver(robot: Facts) -> Violations:
    """The contact solver stops before the forces are right.

    With few iterations, friction and the ground do not hold the feet: the robot slides or sinks.
    MuJoCo Playground trains with one iteration of Newton's method, which is enough for its robots.
    If the robot stands with few iterations of another solver, it is a note.

    Fix:
        Remove solver, iterations and ls_iterations from <option>, or use Newton.

    Source:
        MuJoCo's documentation, Computation: solver. The file is simulated as written for 2 s, and
        again with 100 iterations of Newton's method.
    """
    option = make_written_model(robot).model.opt
    solver, iterations = _SOLVERS[option.solver], int(option.iterations)
    if solver == "Newton" and iterations >= _SOLVER["iterations"]:
        return
    what = f"solver of <option>: got {count(iterations, 'iteration')} of {solver}"
    expected = f"{_SOLVER['iterations']} iterations of Newton"
    symptoms = ("drift", "height_loss", "depth", "speed")
    found = list(_consequence(robot, what, expected, symptoms, _SOLVER))
    yield from found
    if not found and solver != "Newton" and iterations < _MIN_ITERATIONS:
        yield Violation(
            element=_options(robot),
            severity="note",
            message=f"{what}; expected at least {_MIN_ITERATIONS}, or Newton",
            measured={"iterations": iterations},
        )


@rule("OPT009", "unstable-time-step", "warning", needs=("mjcf", "legs", "simulation"))
def unstable_time_step(robot: Facts) -> Violations:
    """The time step of the file is too long for its stiffest joint.

    Springs and position gains are integrated explicitly, and so is the damping of actuators with
    the integrators Euler and RK4. Above the stability limit the joints vibrate, or the simulation
    diverges.

    Fix:
        Use a time step of 0.002 s and integrator="implicitfast", or lower gains.

    Source:
        MuJoCo's documentation, Computation: numerical integration. The file is simulated as written
        for 2 s, and again with these values.
    """
    option = make_written_model(robot).model.opt
    step = min(float(option.timestep), _TIME_STEP)
    yield from _consequence(
        robot,
        f"time step: got {option.timestep:g} s with {_INTEGRATORS[option.integrator]}",
        f"{step:g} s with implicitfast",
        ("speed",),
        {"timestep": step, "integrator": _INTEGRATORS.index("implicitfast")},
    )
