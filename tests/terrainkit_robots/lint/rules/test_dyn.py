"""Thresholds of the DYN rules, with simulations whose results are given."""

import math
import re
from dataclasses import replace

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.model import PRISMATIC, REVOLUTE
from terrainkit_robots.lint.rule import get_rule
from terrainkit_robots.lint.rules.dyn import joint_sweep, stability, time_step
from terrainkit_robots.lint.runner import lint
from terrainkit_robots.simulation.drop import DropResult
from terrainkit_robots.simulation.joint_sweep import SweepResult
from tests.robots import QUADRUPED
from tests.tables import read_table

BIPED = bundled.urdf_path("biped")
BOTH = (("FL_hip", "FR_hip"), ("FL_hip", "FR_hip"))
OWN = (("FL_hip", "FL_calf"), ("base", "FL_hip"))


def check(code, path=QUADRUPED):
    return list(get_rule(code).findings(Facts(load_robot(path))))


def drop(speed=1.0, joint="FL_hip_joint", *, diverged=False):
    return DropResult(diverged=diverged, max_speed=speed, max_speed_joint=joint, seconds=0.25)


@pytest.mark.parametrize(
    ("with_contacts", "without", "has_mesh", "expected"),
    [
        (drop(100.0), drop(), False, None),
        (drop(100.1), drop(), False, ("warning", "proven")),
        (drop(500.0), drop(100.0), False, ("warning", "proven")),
        (drop(500.1), drop(), False, ("error", "proven")),
        (drop(diverged=True), drop(), False, ("error", "proven")),
        (drop(500.1), drop(), True, ("warning", "likely")),
        (drop(100.1), drop(), True, ("note", "likely")),
        (drop(100.1), drop(100.1), True, ("warning", "proven")),
        (drop(500.1), drop(diverged=True), True, ("error", "proven")),
    ],
)
def test_unstable_drop_severity(monkeypatch, with_contacts, without, has_mesh, expected):
    def drop_test(_, *, self_collision=True):
        assert stability.DROP_HEIGHT == 0.1
        return with_contacts if self_collision else without

    monkeypatch.setattr(stability, "drop_test", drop_test)
    monkeypatch.setattr(stability, "_has_mesh_collision", lambda _: has_mesh)
    found = [(each.severity, each.certainty) for each in check("DYN001")]
    assert found == ([expected] if expected else [])


def test_unstable_drop_of_sliding_joint_is_in_meters(monkeypatch, sliding_shanks):
    speeds = iter([drop(123.4, "FL_calf_joint"), drop(5.6, "FL_hip_joint")])
    monkeypatch.setattr(stability, "drop_test", lambda *_, **__: next(speeds))
    (violation,) = check("DYN001", sliding_shanks)
    assert violation.message == (
        "largest velocity when dropped from 0.1 m without torques: got 123 m/s at FL_calf_joint; "
        "expected at most 100 m/s; without self-collision 6 rad/s"
    )
    assert violation.measured == {
        "speed": 123.4,
        "blew_up": 0,
        "seconds": 0.25,
        "speed_without_self_collision": 5.6,
    }


@pytest.mark.parametrize(
    ("robot", "tilt", "lifted", "most_legs", "severity"),
    read_table(__file__, "does_not_stand_severity"),
)
def test_does_not_stand_severity(monkeypatch, stood, robot, tilt, lifted, most_legs, severity):
    fallen = replace(stood, tilt=math.radians(tilt), lifted_feet=lifted)
    monkeypatch.setattr(stability, "MAX_SINGLE_LEGS", most_legs)
    monkeypatch.setattr(stability, "stand_test", lambda *_, **__: fallen)
    violations = check("DYN002", bundled.urdf_path(robot))
    assert [violation.severity for violation in violations] == ([severity] if severity else [])
    assert all("tilts by" in violation.message for violation in violations)


@pytest.mark.parametrize(
    ("tilt", "has_mesh", "severity"),
    [(40, False, "error"), (40, True, "warning"), (12, True, "note"), (5, True, "note")],
)
def test_fall_by_hulls_alone_is_less_severe(monkeypatch, stood, tilt, has_mesh, severity):
    def stand_test(*_, self_collision, **__):
        return replace(stood, tilt=math.radians(tilt)) if self_collision else stood

    monkeypatch.setattr(stability, "stand_test", stand_test)
    monkeypatch.setattr(stability, "_has_mesh_collision", lambda _: has_mesh)
    (violation,) = check("DYN002")
    assert violation.severity == severity
    assert violation.message.endswith("; without self-collision the robot stands")
    assert "COL005" in violation.hint


def test_biped_needs_its_center_of_mass_above_its_feet(monkeypatch):
    robot, rule = Facts(load_robot(BIPED)), get_rule("DYN002")
    margin = robot.stance.margin
    for limit, reasons in (
        (margin, ["the center of mass of the biped is not above its feet"]),
        (0.99 * margin, []),
    ):
        monkeypatch.setattr("terrainkit_robots.simulation.standing.MIN_MARGIN", limit)
        assert [each.reason for each in lint(robot, [rule]).skipped] == reasons


def sweep(share=1.0, blocked=(None, None), load=1.0, max_load=1.0, effort=10.0, **changes):
    known = {"joint": "FL_thigh_joint", "units": REVOLUTE, "limits": (0.0, 2.0)}
    fields = {"reached": (0.0, 2 * share), "blocked": blocked, "load": load, "max_load": max_load}
    return SweepResult(**known | fields | {"effort": effort} | changes)


@pytest.mark.parametrize(
    ("result", "severities"),
    [
        (sweep(), []),
        (sweep(0.99, BOTH), []),
        (sweep(0.98, BOTH), ["note"]),
        (sweep(0.1, OWN), ["note"]),
        (sweep(0.09, OWN), ["warning", "note"]),
        (sweep(0.09, BOTH), ["note"]),  # two legs that meet
        (sweep(0.09, (OWN[0], None)), ["note"]),
        (sweep(load=10.0, max_load=10.0), []),
        (sweep(load=10.0, max_load=10.1), ["note"]),
        (sweep(load=10.1, max_load=10.1), ["warning", "note"]),
    ],
)
def test_unreachable_limits_severity(monkeypatch, result, severities):
    monkeypatch.setattr(joint_sweep, "joint_sweep", lambda _: [result])
    found = check("DYN003")
    assert [violation.severity or "note" for violation in found] == severities
    assert all(f"joint {result.joint}" in violation.message for violation in found[:-1])


def test_unreachable_limits_name_the_worst_joints(monkeypatch):
    slide = {"joint": "slide", "units": PRISMATIC}
    results = [
        sweep(0.9, BOTH),
        sweep(0.5, BOTH, joint="FR_thigh_joint"),
        sweep(max_load=20.0),
        sweep(max_load=9.81, effort=3.0, **slide),
    ]
    monkeypatch.setattr(joint_sweep, "joint_sweep", lambda _: results)
    (violation,) = check("DYN003")
    assert violation.message == (
        "2 of 4 joints collide before reaching a limit when moved alone from the default pose; "
        "worst: FR_thigh_joint, which reaches 0.00 to 1.00 of 0.00 to 2.00 rad, where FL_hip "
        "collides with FR_hip; 2 of 4 joints too weak to lift the limb over the whole range; "
        "worst: slide, which needs 9.81 N with an effort limit of 3 N"
    )
    assert violation.measured == {"short": 2, "weak": 2}


@pytest.mark.parametrize(
    ("share", "path", "severity"),
    [(0.003, QUADRUPED, "note"), (0.0029, QUADRUPED, "warning"), (0.0029, BIPED, "warning")],
)
def test_low_joint_inertia_severity(monkeypatch, gains, share, path, severity):
    given = {"stiffness": 100.0, "armature": 0.02}
    monkeypatch.setattr(time_step, "suggest_gains", lambda robot: gains(robot, **given))
    monkeypatch.setattr(time_step, "max_stable_stiffness", lambda _: 100.0 * share)
    (violation,) = check("DYN004", path)
    assert violation.severity == severity
    assert violation.measured["joints"] == 12
    assert violation.message.endswith(
        "as with an armature of 0.02 kg m2; the same applies to 11 other joints"
    )


def test_low_joint_inertia_of_sliding_joint_is_a_mass(sliding_shanks):
    (violation,) = check("DYN004", sliding_shanks)
    assert re.search(r"_calf_joint \(kp .*, mass 0\.[0-9]+ kg\): got ", violation.message)
    assert re.search(r"an armature of [0-9.]+ kg; the same applies to ", violation.message)
