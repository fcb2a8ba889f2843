import mujoco
import pytest

from terrainkit_robots.analysis.simulator_conventions.loaded_robot import (
    dropped_mass,
    loaded_robots,
)
from terrainkit_robots.description import bundled
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from tests.small_robots import box, facts, floating, joint, link

QUADRUPED = bundled.urdf_path("quadruped").read_text()
MJCF = bundled.urdf_path("quadruped").with_suffix(".xml").read_text()
FUSED = QUADRUPED.replace('fusestatic="false"', "")


def loaded(robot):
    return {each.order.key: each for each in loaded_robots(robot)}


@pytest.mark.parametrize(
    ("text", "dropped"),
    [
        (QUADRUPED, 0.0),
        (FUSED, 6.921),
        (floating(FUSED, "base"), 0.0),
        (MJCF, 0.0),
    ],
)
def test_mujoco_is_as_its_compiler_loads_the_file(text, dropped):
    robot = facts(text)
    assert dropped_mass(robot) == pytest.approx(dropped)
    with quiet_mujoco():
        compiled = mujoco.MjModel.from_xml_string(text)
    found = loaded(robot)["mujoco"]
    assert found.mass == pytest.approx(float(compiled.body_mass.sum()))
    assert found.mass == pytest.approx(robot.total_mass - dropped)
    assert list(found.bodies) == [compiled.body(i).name for i in range(1, compiled.nbody)]


# A base of 5 kg with a head of 1 kg, a leg of 2 kg with a foot: a cube of 0.1 m without <inertial>.

SMALL = (
    link("base", mass=5),
    link("head", mass=1),
    link("leg", mass=2),
    link("foot", box("0.1 0.1 0.1"), mass=None),
    joint("base", "head", kind="fixed"),
    joint("base", "leg", limits=(-1, 1)),
    joint("leg", "foot", kind="fixed", more="").replace("<joint", '<joint dont_collapse="true"'),
)


def test_loaded_robots_by_hand():
    found = loaded(facts(*SMALL))
    assert {key: (each.mass, each.bodies) for key, each in found.items()} == {
        "mujoco": (pytest.approx(3), ("leg",)),  # 2 kg and 1 kg of water
        "isaac_gym": (8, ("base", "leg", "foot")),
        "isaac_lab": (8, ("base", "leg", "foot")),
        "genesis": (8, ("base", "leg")),
        "pybullet": (9, ("base", "head", "leg", "foot")),  # as pybullet 3.2.7
    }
    assert found["mujoco"].merged == {"base": "world", "head": "world", "foot": "leg"}
    assert found["isaac_gym"].merged == {"head": "base"}
    assert found["mujoco"].losses[0] == "base is welded to the world, which drops its 6 kg"
    assert found["pybullet"].losses[0] == "links without <inertial> get 1 kg each (1)"
    assert found["genesis"].losses == ("joints without armature get 0.1 kg m2",)


@pytest.mark.parametrize(
    ("old", "simulators"),
    [
        ("", ["Genesis"]),
        ('fusestatic="false"', ["MuJoCo", "Genesis"]),
        ('dont_collapse="true"', ["Isaac Gym", "Isaac Lab", "Genesis"]),
    ],
)
def test_merged_feet_of_bundled_quadruped(old, simulators):
    found = loaded_robots(facts(QUADRUPED.replace(old, "")))
    calves = {f"{leg}_foot": f"{leg}_calf" for leg in ("FL", "FR", "RL", "RR")}
    merging = {each.order.simulator: each.merged for each in found if not each.feet}
    assert list(merging) == simulators
    for merged in merging.values():
        assert {foot: merged[foot] for foot in calves} == calves


def test_robots_without_links_or_of_mjcf():
    assert loaded_robots(facts("")) == ()
    mjcf = loaded(facts(MJCF))
    assert list(mjcf) == ["mujoco", "isaac_gym", "isaac_lab", "genesis"]
    assert {each.merged == {} for each in mjcf.values()} == {True}
