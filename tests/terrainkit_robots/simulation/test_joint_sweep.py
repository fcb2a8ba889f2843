import math

import pytest

from terrainkit_robots.simulation.joint_sweep import joint_sweep
from terrainkit_robots.simulation.sim_model import make_sim_model
from tests.small_robots import ball, box, facts, joint, link

LINK = {"inertia": "0.1 0.1 0.1 0 0 0"}
CRANE = (
    link("mast", box("1 0.02 0.2", "0 0.5 0"), mass=None)
    + link("turntable", **LINK)
    + joint("mast", "turntable", axis="1 0 0", limits=(-0.1, 0.1))
    + link("boom", ball(0.01, "0.6 0 0"), mass=3, center="0.6 0 0", **LINK)
    + joint("turntable", "boom", axis="0 0 1", limits=(-1.5, 1.5))
    + link("hook", mass=0.5, center="0.2 0 0", **LINK)
    + joint("boom", "hook", "0.6 0 0", limits=(-1, 2))
)


def sweep(text):
    """Return the sweeps of the joints of a robot, by the link that each moves."""
    found = joint_sweep(make_sim_model(facts(text)))
    return {each.joint.removesuffix("_joint"): each for each in found}


@pytest.fixture(scope="module")
def crane():
    return sweep(CRANE)


def test_joint_sweep_stops_at_collision(crane):
    swing = crane["boom"]
    # The tip has a radius of 0.6 m, and the wall is at y = 0.49: contact from asin(0.48 / 0.6) on.
    assert swing.reached[1] == pytest.approx(math.asin(0.48 / 0.6), abs=3 / 40)
    assert swing.reached[0] == pytest.approx(-1.5)
    assert swing.blocked[0] is None
    assert set(swing.blocked[1]) == {"mast", "boom"}
    assert swing.share == pytest.approx((swing.reached[1] + 1.5) / 3)


def test_joint_sweep_measures_gravity_load(crane):
    hook = crane["hook"]
    load = pytest.approx(0.5 * 9.81 * 0.2)
    assert (hook.load, hook.max_load, hook.effort, hook.share) == (load, load, 50, 1)
    assert crane["boom"].max_load == pytest.approx(0, abs=1e-9)


def test_joint_sweep_follows_actuator_order(bundled):
    sim = make_sim_model(bundled("biped.urdf"))
    results = joint_sweep(sim)
    assert tuple(result.joint for result in results) == sim.actuated
    assert results == joint_sweep(sim)
    for result in results:
        assert result.limits[0] <= result.reached[0] <= result.reached[1] <= result.limits[1]
        assert result.load < result.effort


def test_joint_sweep_is_symmetric(bundled):
    results = {r.joint: r for r in joint_sweep(make_sim_model(bundled("quadruped.urdf")))}
    left, right = results["FL_hip_joint"], results["FR_hip_joint"]
    assert left.reached[0] == pytest.approx(-right.reached[1], abs=1e-9)
    assert left.share < 0.9  # the feet meet under the trunk
    assert set(left.blocked[0]) == {"FL_foot", "FR_foot"}


def test_joint_sweep_moves_mimic_joints():
    mimic = '<mimic joint="boom_joint" multiplier="0.5"/><parent link="boom"/>'
    results = sweep(CRANE.replace('<parent link="boom"/>', mimic))
    assert set(results) == {"turntable", "boom"}
    assert results["boom"].share < 1
