import re
from types import SimpleNamespace

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.simulation.pd_gains import suggest_gains
from terrainkit_robots.simulation.sim_model import make_sim_model
from terrainkit_robots.simulation.stiffness import _max_gravity_load, leg_gain_target
from tests.small_robots import facts, joint, link

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


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_gravity_load_is_that_of_all_bodies_below_a_joint(kind):
    """An arm of 2 kg and 1 kg beside one of 4 kg, which does not count."""
    links = {"base": (0, 9), "other": (0.1, 4), "upper": (0.3, 2), "fore": (0.2, 1)}
    inertia = "0.01 0.01 0.01 0 0 0"
    parts = [
        link(name, mass=mass, center=f"{com} 0 0", inertia=inertia)
        for name, (com, mass) in links.items()
    ]
    for parent, child, x in (("base", "upper", 0.1), ("upper", "fore", 0.5), ("base", "other", -1)):
        parts.append(joint(parent, child, f"{x} 0 0", kind=kind, limits=(-1, 1)))
    sim = make_sim_model(facts(*parts))
    loads = [_max_gravity_load(sim, f"{name}_joint") / 9.81 for name in ("upper", "fore", "other")]
    expected = [2 * 0.3 + 1 * (0.5 + 0.2), 0.2, 0.4] if kind == "revolute" else [3, 1, 4]
    assert loads == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("effort", "gain_set", "factor", "inertia", "limit"),
    [
        ("139", "stand", 1.5 / 2, 0.1, 139),  # by its effort at 1 rad
        ("900", "stand", 1.5 / 2, 0.1, 900),
        ("900", "train", 0.36, 0.1, 900),
        ("900", "train", 0.36, 10, 1800),  # by its effort at 0.5 rad
        ("300", "stand", 0.75, 10, 600),
    ],
)
def test_knees_of_a_biped_are_stiff_and_fast(effort, gain_set, factor, inertia, limit):
    file = bundled.urdf_path("biped")
    text = file.read_text().replace('effort="139"', f'effort="{effort}"')
    biped = Facts(load_robot(file, contents={file: text.encode()}))
    names = "left_knee_joint", "right_knee_joint"
    both = {name: SimpleNamespace(free=inertia, locked=inertia) for name in names}
    target = leg_gain_target(biped, make_sim_model(biped), both, names, gain_set)
    length = sum(leg.length for leg in biped.legs) / 2
    # For its weight, and for a natural frequency of 3 sqrt(g / leg length).
    expected = max(factor * biped.total_mass * 9.81 * length, 9 * 9.81 / length * inertia)
    assert (target.stiffness, target.joints) == (pytest.approx(min(expected, limit)), names)
    assert not target.extra_armature
