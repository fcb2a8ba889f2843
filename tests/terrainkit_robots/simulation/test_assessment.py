import math
from dataclasses import replace

import pytest

from terrainkit_robots.simulation.assessment import assess
from terrainkit_robots.simulation.pd_gains import suggest_gains
from terrainkit_robots.simulation.sim_model import SimModel, make_sim_model
from terrainkit_robots.simulation.standing import contact_areas, stand_test


def test_assess_accepts_standing_robot(stood):
    assessment = assess(stood)
    assert (assessment.stands, assessment.failures, assessment.degree) == (True, (), 0)


@pytest.mark.parametrize(
    ("changes", "fault", "degree"),
    [
        ({"tilt": math.radians(3.6)}, "it tilts by 3.6 deg (expected at most 3 deg)", 0),
        ({"tilt": math.radians(12)}, "it tilts by 12.0 deg (expected at most 3 deg)", 1),
        ({"tilt": math.radians(90)}, "it tilts by 90.0 deg (expected at most 3 deg)", 2),
        ({"height_loss": 0.15}, "its base sinks by 0.150 m (expected at most 0.100 m)", 1),
        ({"height_loss": 9.0}, "its base sinks by 9.000 m (expected at most 0.100 m)", 2),
        ({"drift": 0.2}, "it drifts by 0.200 m (expected at most 0.100 m)", 1),
        ({"other_contacts": ("calf",)}, "calf touches the ground (expected only feet)", 1),
        ({"other_contacts": tuple("abcdef")}, "a, b, c, d and 2 more touch the ground (expec", 1),
        ({"lifted_feet": ("toe",)}, "toe does not touch the ground (expected all feet)", 1),
        ({"lifted_feet": ("a", "b")}, "a, b do not touch the ground (expected all feet)", 1),
        ({"saturation": 0.98}, "knee needs 98% of its effort limit (expected at most 95%)", 1),
        ({"diverged": True, "seconds": 0.5, "drift": 9}, "its simulation diverged after 0.50 s", 2),
    ],
)
def test_assess_reports_value_and_limit(stood, changes, fault, degree):
    assessment = assess(replace(stood, **changes))
    (failure,) = assessment.failures
    assert (assessment.stands, failure[: len(fault)], assessment.degree) == (False, fault, degree)


def test_assess_reports_shank_on_ground_once(stood):
    contacts = {"other_contacts": ("trunk", "shin"), "lifted_feet": ("shin", "toe")}
    assert assess(replace(stood, **contacts)).failures == (
        "shin rests on the ground beside its tip (expected only tips)",
        "trunk touches the ground (expected only feet)",
        "toe does not touch the ground (expected all feet)",
    )


def stand(facts, sim):
    return assess(
        stand_test(
            sim, suggest_gains(facts), positions=facts.default_pose, areas=contact_areas(facts)
        )
    )


def test_assess_reports_lifted_feet(bundled):
    """One leg has no contacts, so the robot tips over it."""
    quadruped = bundled("quadruped.urdf")
    sim = make_sim_model(quadruped)
    assert stand(quadruped, sim).stands
    model = sim.model.__copy__()
    for geom in range(model.ngeom):
        if model.body(model.geom_bodyid[geom]).name in ("RR_calf", "RR_foot"):
            model.geom_contype[geom] = model.geom_conaffinity[geom] = 0
    faults = stand(quadruped, SimModel.from_mujoco(model, base="base")).failures
    assert "FL_foot, RR_foot do not touch the ground (expected all feet)" in faults
