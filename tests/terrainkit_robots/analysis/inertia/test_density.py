import pytest
import trimesh

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.density import (
    check_max_density,
    check_min_density,
    has_derived_mass,
    shape_volume,
)
from terrainkit_robots.description.load import load_robot
from tests.small_robots import ball, box, facts, joint, link, mjcf, shape


@pytest.mark.parametrize(("mass", "expected"), [(19.9, None), (20.1, (pytest.approx(1e-3), 2e4))])
def test_body_is_lighter_than_gold(mass, expected):
    robot = facts(link("a", box("0.1 0.1 0.1"), mass=mass))
    assert check_max_density(robot.bodies[0], robot.body_bounds) == expected


@pytest.mark.parametrize(("mass", "expected"), [(9.9, (1.0, 10.0)), (10.1, None)])
def test_body_is_heavier_than_foam(mass, expected):
    robot = facts(link("a", box("1 1 1"), ball(0.1, "0.3 0 0"), mass=mass))
    assert check_min_density(robot.bodies[0], robot.body_bounds, robot.meshes) == expected


@pytest.mark.parametrize(("mass", "is_opened"), [(1.24, True), (1.26, False)])
def test_visual_mesh_is_opened_for_a_light_body(tmp_path, mass, is_opened):
    # A limb of 0.5 m with 200 kg/m3 and a slenderness of 20 has 200 * 0.5^3 / 20 = 1.25 kg.
    trimesh.creation.box([1, 1, 1]).export(tmp_path / "a.stl")
    part = link("b", shape('mesh filename="a.stl"', kind="visual"), mass=mass)
    text = f'<robot name="r">{link("a")}{part}{joint("a", "b", "0 0 0.5")}</robot>'
    (tmp_path / "robot.urdf").write_text(text)
    robot = Facts(load_robot(tmp_path / "robot.urdf"))
    found = check_min_density(robot.bodies[1], robot.body_bounds, robot.meshes)
    assert found == ((pytest.approx(1.0), 10.0) if is_opened else None)
    assert bool(robot.meshes.opened) == is_opened


def test_volume_of_a_shape_without_bounds_is_zero():
    robot = facts(link("a", box("1 2 3"), shape("sdf"), box("1 -2 3")))
    volumes = [shape_volume(each.geometry, robot.meshes) for each in robot.bodies[0].collisions]
    assert volumes == [6.0, 0.0, 0.0]


def test_mass_is_derived_without_an_inertial():
    given = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    for inertial, is_derived in (("", True), (given, False)):
        robot = mjcf(f'<body name="a"><freejoint/>{inertial}<geom size="0.1"/></body>')
        assert has_derived_mass(robot.bodies[0]) == is_derived
