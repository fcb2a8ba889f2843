import numpy as np
import pytest

from terrainkit_robots.lint.compare.body_mass import (
    body_difference,
    has_valid_inertial,
    relative_difference,
)
from terrainkit_robots.lint.compare.robot_pairs import pair_robots
from tests.small_robots import facts, joint, link, mjcf


def gaps(one, other):
    pairs = pair_robots(one, other)
    return {a.name: body_difference(one, other, pairs, a, b) for a, b in pairs.bodies}


@pytest.mark.parametrize("name", ["quadruped", "biped"])
def test_bundled_urdf_and_mjcf_have_equal_bodies(robot_of, name):
    found = gaps(robot_of(f"{name}.urdf"), robot_of(f"{name}.xml"))
    assert len(found) == 13
    for gap in found.values():
        assert gap.mass < 1e-9
        assert gap.center < 1e-6
        assert gap.inertia < 1e-4


def test_difference_of_one_body_is_measured(robot_of):
    thigh = (
        '<inertial pos="-0.00374 -0.0223 -0.0327" mass="1.152"',
        '<inertial pos="-0.00374 -0.0223 -0.0227" mass="1.28"',
    )
    found = gaps(robot_of("quadruped.urdf"), robot_of("quadruped.xml", thigh))
    assert found["FL_thigh"].mass == pytest.approx(0.1)
    assert found["FL_thigh"].center == pytest.approx(0.01)
    assert found["FL_calf"].mass == pytest.approx(0.0)
    cases = ("3 3 3", "3 3 4", 0.25), ("4 3 3", "3 3 3", 0.25), ("0 0 0", "0 0 0", 0.0)
    for one, other, inertia in cases:
        robots = (facts(link("a", inertia=f"{each} 0 0 0")) for each in (one, other))
        assert gaps(*robots)["a"].inertia == pytest.approx(inertia)


def test_trunks_are_compared_in_the_same_link():
    base, footprint = link("base", inertia="1 2 2.5 0 0 0"), link("footprint", mass=None)
    up = joint("footprint", "base", "0 0 0.3", rpy="0 0 1", kind="fixed")
    (gap,) = gaps(facts(base), facts(footprint, up, base)).values()
    assert gap.center < 1e-12
    assert gap.inertia < 1e-12


def test_relative_difference():
    pairs = ((1.0, 1.0), (0.0, 0.0), (1.0, 2.0), (4.0, 1.0), (np.nan, 1.0))
    found = [relative_difference(*pair) for pair in pairs]
    np.testing.assert_array_equal(found, [0.0, 0.0, 0.5, 0.75, np.nan])


def test_has_valid_inertial_needs_explicit_values(robot_of):
    assert all(has_valid_inertial(body) for body in robot_of("quadruped.urdf").bodies)
    bare = facts('<link name="a"><inertial><mass value="1"/></inertial></link>')
    assert not has_valid_inertial(bare.bodies[0])
    mesh = '<asset><mesh name="m" file="m.stl"/></asset>'
    meshed = mjcf('<body name="a"><geom type="mesh" mesh="m"/></body>', mesh)
    assert not has_valid_inertial(meshed.bodies[0])
