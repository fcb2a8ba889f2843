import math

import pytest

from terrainkit_robots.analysis.facts import Facts, cached_fact
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from tests.small_robots import facts, joint, link, mjcf
from tests.tables import read_table

PARTS = (
    link("a"),
    link("b", mass=2),
    link("c", mass=3),
    link("d", mass=4),
    joint("a", "b", kind="fixed"),
    joint("b", "c", limits=(0.2, 1)),
    joint("a", "d", kind="prismatic", more='<mimic joint="c_joint" multiplier="2"/>'),
)


def names(parts):
    return [part.name for part in parts]


def test_facts_of_small_robot():
    robot = facts(*PARTS)
    assert names(robot.bodies) == ["b", "c", "d"]
    assert names(robot.links) == ["a", "b", "c", "d"]
    assert names(robot.joints) == list(robot.body_of_joint) == ["c_joint", "d_joint"]
    assert names(robot.actuated) == names(robot.actuated_hinges) == ["c_joint"]
    assert robot.total_mass == 10
    indices = {name: body.index for name, body in robot.body_of.items()}
    assert indices == {"a": 0, "b": 0, "c": 1, "d": 2}
    assert robot.limbs == robot.legs == ()
    assert robot.stance is None
    assert robot.default_pose == {"c_joint": 0.2, "d_joint": 0.4}


@pytest.mark.parametrize(("text", "is_broken"), [('<robot name="r"/>', False), ("<robot", True)])
def test_facts_of_empty_robot(text, is_broken):
    robot = facts(text)
    assert robot.bodies == robot.links == robot.joints == robot.actuated == ()
    assert robot.body_of == robot.default_pose == {}
    assert robot.limbs == robot.legs == robot.mirror.pairs == ()
    assert (robot.total_mass, robot.stance) == (0, None)
    assert bool(robot.model.problems) == is_broken


def test_facts_are_cached():
    robot = facts(*PARTS)
    for name in ("tree", "bodies", "limbs", "legs", "mirror", "overlap_scene", "body_bounds"):
        assert getattr(robot, name) is getattr(robot, name)


def test_disconnected_links_do_not_count():
    robot = facts(*PARTS, link("stray", mass=100))
    assert robot.total_mass == 10
    assert "stray" not in robot.body_of


@pytest.mark.parametrize("mass", ["", "x", "1e308"])
def test_total_mass_ignores_invalid_masses(mass):
    assert facts(*PARTS[:3], link("d", mass=mass), *PARTS[4:]).total_mass == 6


def test_total_mass_derived_from_mesh_is_nan():
    def robot(geom):
        body = f'<body name="b"><joint name="j"/><geom {geom}/></body>'
        text = f'<body name="a"><freejoint/><geom size="0.1" mass="2"/>{body}</body>'
        return mjcf(text, '<asset><mesh name="m" file="lost.stl"/></asset>')

    assert math.isnan(robot('type="mesh" mesh="m"').total_mass)
    assert robot('size="0.1" mass="1"').total_mass == 3


@pytest.mark.parametrize(("actuators", "driven"), read_table(__file__, "actuated_joints_of_mjcf"))
def test_actuated_joints_of_mjcf(actuators, driven):
    robot = mjcf(
        '<body name="a"><freejoint/><geom size="0.1"/><body name="b"><joint name="i"/>'
        '<geom size="0.1"/><body name="c"><joint name="j" type="slide"/><geom size="0.1"/></body>'
        "</body></body>",
        '<tendon><fixed name="t"><joint joint="i" coef="1"/></fixed></tendon>'
        f"<actuator>{actuators}</actuator>",
    )
    assert names(robot.actuated) == driven
    assert names(robot.actuated_hinges) == [name for name in driven if name == "i"]


def test_meshes_are_opened_late_and_twice_at_most(tmp_path):
    text = bundled.urdf_path("quadruped").read_text()
    foot = 'radius="0.022"/>'
    assert text.count(f"<sphere {foot}") > 4
    text = text.replace(f"<sphere {foot}", '<mesh filename="foot.obj"/>')
    corners = "v 0 0 0\nv 0.02 0 0\nv 0 0.02 0\nv 0 0 -0.02\n"
    (tmp_path / "foot.obj").write_text(f"{corners}f 1 2 3\nf 1 2 4\n")
    (tmp_path / "robot.urdf").write_text(text)
    robot = Facts(load_robot(tmp_path / "robot.urdf"))
    assert (len(robot.bodies), robot.total_mass > 10) == (13, True)
    assert not robot.meshes.opened
    assert robot.stance is not None
    assert robot.meshes.opened == {tmp_path / "foot.obj": 2}  # its header, and all of it


def test_cached_fact_is_computed_once_for_each_robot():
    computed = []

    @cached_fact
    def number_of_links(robot):
        """Return the number of links."""
        computed.append(robot)
        return len(robot.links)

    robots = [facts(link("a")), facts(link("b"))]
    assert [number_of_links(robot) for robot in (*robots, *robots)] == [1, 1, 1, 1]
    assert computed == robots
    assert number_of_links.__doc__ == "Return the number of links."
