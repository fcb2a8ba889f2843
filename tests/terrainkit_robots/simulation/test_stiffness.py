import re

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.simulation.pd_gains import suggest_gains

LEGS = ("FL", "FR", "RL", "RR")


@pytest.fixture
def sliding(sliding_shanks):
    return Facts(load_robot(sliding_shanks))


def test_stiffness_of_hinges_ignores_loads_of_slides(sliding):
    held = {
        joint.name: abs(sliding.stance.torques[joint.name])
        for leg in sliding.legs
        for joint in leg.joints
    }
    turning = max(force for name, force in held.items() if "calf" not in name)
    pushed = max(force for name, force in held.items() if "calf" in name)
    assert pushed > 5 * turning  # N compared with N m
    weight, length = sliding.total_mass * 9.81, sliding.legs[0].length
    needed = max(turning / 0.09, 1.5 * weight * length / 4)
    found = suggest_gains(sliding)
    for leg in LEGS:
        for part in ("hip", "thigh"):
            gain = found[f"{leg}_{part}_joint"]
            assert gain.stiffness == pytest.approx(needed, rel=0.2)
            assert f" {pushed:.2g} " not in gain.reason


def test_stiffness_of_slides_limits_sag(sliding):
    pushed = max(abs(sliding.stance.torques[f"{leg}_calf_joint"]) for leg in LEGS)
    gain = suggest_gains(sliding)["FL_calf_joint"]
    assert gain.stiffness == pytest.approx(pushed / 0.009, rel=0.12)
    assert f"to hold {pushed:.2g} N in the standing pose within 0.009 m" in gain.reason
    assert not re.search(r"N m|rad|kg m2", gain.reason)
