import math
from dataclasses import replace

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.simulation.assessment import judge
from terrainkit_robots.simulation.pd_gains import suggest_gains
from terrainkit_robots.simulation.sim_model import plant, plant_of
from terrainkit_robots.simulation.standing import footholds, stand_still


def test_one_that_stands(stood):
    verdict = judge(stood)
    assert verdict.stands
    assert (verdict.faults, verdict.degree) == ((), 0)


@pytest.mark.parametrize(
    ("changes", "fault", "degree"),
    [
        ({"tilt": math.radians(3.6)}, "it tilts by 3.6 degrees; wanted at most 3", 0),
        ({"tilt": math.radians(12)}, "it tilts by 12.0 degrees; wanted at most 3", 1),
        ({"tilt": math.radians(90)}, "it tilts by 90.0 degrees; wanted at most 3", 2),
        ({"sink": 0.15}, "its base sinks by 0.150 m; wanted at most 0.100", 1),
        ({"sink": 9.0}, "its base sinks by 9.000 m; wanted at most 0.100", 2),
        ({"drift": 0.2}, "it drifts by 0.200 m; wanted at most 0.100", 1),
        ({"touching": ("calf",)}, "calf touches the ground; wanted feet alone", 1),
        ({"touching": tuple("abcdef")}, "a, b, c, d and 2 more touch the ground; wanted feet", 1),
        ({"lifted": ("toe",)}, "toe does not touch the ground; wanted every foot", 1),
        ({"lifted": ("a", "b")}, "a, b do not touch the ground; wanted every foot", 1),
        ({"saturation": 0.98}, "knee gives 98% of its effort; wanted at most 95%", 1),
        ({"blew_up": True, "seconds": 0.5}, "its state blew up after 0.50 s", 2),
    ],
)
def test_each_fault_has_its_number_and_its_limit(stood, changes, fault, degree):
    verdict = judge(replace(stood, **changes))
    assert not verdict.stands
    assert len(verdict.faults) == 1
    assert verdict.faults[0].startswith(fault)
    assert verdict.degree == degree


def test_what_blew_up_is_asked_nothing_else_and_others_everything(stood):
    wrong = {"tilt": 1.0, "sink": 0.3, "drift": 0.3, "touching": ("base",), "lifted": ("foot",)}
    assert len(judge(replace(stood, **wrong)).faults) == 5
    assert len(judge(replace(stood, **wrong, blew_up=True)).faults) == 1


@pytest.fixture(scope="module")
def quadruped():
    return Facts(load_robot(bundled.find("quadruped")))


def judged(facts, scene):
    return judge(
        stand_still(scene, suggest_gains(facts), positions=facts.positions, feet=footholds(facts))
    )


def test_one_that_falls_through_the_floor_does_not_stand(quadruped):
    """It falls upright, and nothing of it touches what its bits do not meet."""
    model = plant(quadruped).model.__copy__()
    model.geom_contype[:] = model.geom_conaffinity[:] = 2
    model.geom_contype[0] = model.geom_conaffinity[0] = 1
    assert model.geom_bodyid[0] == 0
    verdict = judged(quadruped, plant_of(model, base="base"))
    assert verdict.degree == 2
    assert any("its base sinks by" in fault for fault in verdict.faults)
    assert any("RL_foot, RR_foot do not touch the ground" in fault for fault in verdict.faults)


def test_feet_in_the_air_are_told(quadruped):
    """It tips over a leg that nothing stops."""
    model = plant(quadruped).model.__copy__()
    for geom in range(model.ngeom):
        if model.body(model.geom_bodyid[geom]).name in ("RR_calf", "RR_foot"):
            model.geom_contype[geom] = model.geom_conaffinity[geom] = 0
    faults = judged(quadruped, plant_of(model, base="base")).faults
    assert "FL_foot, RR_foot do not touch the ground; wanted every foot" in faults


def test_one_that_stands_does_so_on_every_foot(quadruped):
    assert judged(quadruped, plant(quadruped)).stands
