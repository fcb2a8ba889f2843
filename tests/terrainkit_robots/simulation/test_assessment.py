from dataclasses import replace

import pytest

from terrainkit_robots.simulation.assessment import assess
from terrainkit_robots.simulation.pd_gains import suggest_gains
from terrainkit_robots.simulation.sim_model import SimModel, make_sim_model
from terrainkit_robots.simulation.standing import contact_areas, stand_test
from tests.tables import read_table


def test_assess_accepts_standing_robot(stood):
    assessment = assess(stood)
    assert (assessment.stands, assessment.failures, assessment.degree) == (True, (), 0)


@pytest.mark.parametrize(
    ("changes", "fault", "degree"),
    [
        *read_table(__file__, "assess_reports_value_and_limit"),
        ({"other_contacts": tuple("abcdef")}, "a, b, c, d and 2 more touch the ground (expec", 1),
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
