import math
from pathlib import Path

import pytest

from terrainkit_robots.analysis.facts import Facts, cached_fact
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.selection import lint_selected
from terrainkit_robots.lint.settings import Settings
from terrainkit_robots.mesh.mesh_cache import Meshes

URDF, MJCF = Path("/robots/robot.urdf"), Path("/robots/robot.xml")


def facts(text, file=URDF):
    return Facts(load_robot(file, contents={file: text.encode()}))


def link(name, mass=1.0):
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    return f'<link name="{name}"><inertial><mass value="{mass}"/>{inertia}</inertial></link>'


def joint(name, parent, child, kind="revolute", more=""):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f"{more}</joint>"
    )


ROBOT = (
    '<robot name="r">'
    + link("a")
    + link("b", 2)
    + link("c", 3)
    + link("d", 4)
    + joint("ab", "a", "b", "fixed")
    + joint("bc", "b", "c", more='<limit lower="0.2" upper="1"/>')
    + joint("ad", "a", "d", "prismatic", '<mimic joint="bc" multiplier="2"/>')
    + "</robot>"
)


def test_facts_of_small_robot():
    robot = facts(ROBOT)
    assert [body.name for body in robot.bodies] == ["b", "c", "d"]
    assert [each.name for each in robot.links] == ["a", "b", "c", "d"]
    assert [each.name for each in robot.joints] == ["bc", "ad"]
    assert [each.name for each in robot.actuated] == ["bc"]
    assert robot.total_mass == 10
    assert {name: body.index for name, body in robot.body_of.items()} == {
        "a": 0,
        "b": 0,
        "c": 1,
        "d": 2,
    }
    assert robot.limbs == robot.legs == ()
    assert robot.stance is None
    assert robot.default_pose["bc"] == 0.2


def test_facts_of_empty_robot():
    robot = facts('<robot name="r"/>')
    assert robot.bodies == robot.links == robot.joints == robot.actuated == ()
    assert robot.body_of == robot.default_pose == {}
    assert robot.total_mass == 0
    assert robot.limbs == robot.legs == robot.mirror.pairs == ()
    assert robot.stance is None
    assert robot.overlap_scene.detect({}) == []


def test_facts_of_malformed_file():
    robot = facts("nothing of the kind")
    assert robot.bodies == robot.legs == ()
    assert robot.model.problems


def test_facts_are_cached():
    robot = facts(ROBOT)
    for name in (
        "tree",
        "bodies",
        "limbs",
        "legs",
        "mirror",
        "default_pose",
        "overlap_scene",
    ):
        assert getattr(robot, name) is getattr(robot, name)


def test_facts_exclude_disconnected_links():
    robot = facts(ROBOT.replace("</robot>", link("stray", 100) + "</robot>"))
    assert robot.total_mass == 10
    assert "stray" not in robot.body_of


@pytest.mark.parametrize("mass", ["", "x", "1e308"])
def test_total_mass_ignores_invalid_masses(mass):
    assert facts(ROBOT.replace('<mass value="4"/>', f'<mass value="{mass}"/>')).total_mass == 6


def test_total_mass_derived_from_mesh_is_nan():
    text = (
        '<mujoco><asset><mesh name="m" file="lost.stl"/></asset><worldbody><body name="a">'
        '<freejoint/><geom size="0.1" mass="2"/><body name="b"><joint name="j"/>'
        '<geom type="mesh" mesh="m"/></body></body></worldbody></mujoco>'
    )
    assert math.isnan(facts(text, MJCF).total_mass)
    assert facts(text.replace('type="mesh" mesh="m"', 'size="0.1" mass="1"'), MJCF).total_mass == 3


# Actuators of MJCF


def mjcf(actuators):
    return (
        '<mujoco><worldbody><body name="a"><freejoint/><geom size="0.1"/><body name="b">'
        '<joint name="i"/><geom size="0.1"/><body name="c"><joint name="j"/><geom size="0.1"/>'
        '</body></body></body></worldbody><tendon><fixed name="t"><joint joint="i" coef="1"/>'
        f"</fixed></tendon><actuator>{actuators}</actuator></mujoco>"
    )


@pytest.mark.parametrize(
    ("actuators", "driven"),
    [
        ("", ["i", "j"]),
        ('<motor joint="j"/>', ["j"]),
        ('<motor joint="j"/><position joint="i"/>', ["i", "j"]),
        ('<motor tendon="t"/>', ["i", "j"]),
        ('<motor tendon="t"/><motor joint="i"/>', ["i"]),
    ],
)
def test_actuated_joints_of_mjcf(actuators, driven):
    assert [each.name for each in facts(mjcf(actuators), MJCF).actuated] == driven


def test_positions_equal_keyframe():
    path = bundled.urdf_path("quadruped").with_suffix(".xml")
    robot = Facts(load_robot(path))
    assert robot.default_pose == {
        each.name: robot.model.keyframe[each.name] for each in robot.joints
    }
    assert robot.stance.positions == robot.default_pose


# Meshes


def test_facts_open_no_mesh_early(robot_file):
    meshes = Meshes()
    robot = Facts(load_robot(robot_file("g1/g1_29dof.urdf")), meshes)
    assert len(robot.bodies) == 30
    assert robot.total_mass > 30
    assert not meshes.opened


def test_facts_open_each_mesh_twice_at_most(robot_file):
    meshes = Meshes()
    robot = Facts(load_robot(robot_file("g1/g1_29dof.urdf")), meshes)
    assert robot.stance is not None
    assert meshes.opened
    assert max(meshes.opened.values()) <= 2


# Size


def test_facts_of_thousands_of_links():
    # Two mirrored chains of 1,000 links with shapes.
    parts = [link("trunk")]
    for side, y in (("left", 0.01), ("right", -0.01)):
        at = "trunk"
        for k in range(1000):
            name = f"{side}_{k}"
            parts.append(
                link(name).replace(
                    "</link>",
                    '<collision><geometry><sphere radius="0.01"/></geometry></collision></link>',
                )
            )
            parts.append(joint(f"{name}_joint", at, name, more=f'<origin xyz="0 {y} 0"/>'))
            at = name
    robot = facts(f'<robot name="r">{"".join(parts)}</robot>')
    assert robot.legs == ()
    assert len(robot.mirror.pairs) == 1000
    assert robot.default_pose


@pytest.mark.parametrize("value", ["1e29", "-1e29", "1e-300", "0"])
@pytest.mark.parametrize("attribute", ["mass value", "xyz", "rpy", "radius", "lower", "ixx"])
def test_facts_and_rules_survive_extreme_numbers(value, attribute):
    text = bundled.urdf_path("quadruped").read_text()
    name = attribute.split()[-1]
    start = text.index(f"<mass {name}=" if " " in attribute else f"{name}=", text.index("<joint"))
    begin = text.index('"', start) + 1
    end = text.index('"', begin)
    count = len(text[begin:end].split())
    robot = facts(text[:begin] + " ".join([value] * count) + text[end:])
    report = lint_selected(robot, Settings())
    assert report.crashed == ()


def test_cached_fact_is_computed_once_for_each_robot():
    computed = []

    @cached_fact
    def number_of_links(robot):
        """Return the number of links."""
        computed.append(robot)
        return len(robot.links)

    robots = [facts(f'<robot name="r">{"".join(map(link, names))}</robot>') for names in ("a", "b")]
    assert [number_of_links(robot) for robot in (*robots, *robots)] == [1, 1, 1, 1]
    assert computed == robots
    assert number_of_links.__doc__ == "Return the number of links."
