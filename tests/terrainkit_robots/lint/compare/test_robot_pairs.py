import numpy as np
import pytest

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.lint.compare.robot_pairs import pair_robots, trunk_pose_in_link
from tests.tables import read_table

TWO = read_table(__file__, "two")


@pytest.mark.parametrize("name", ["quadruped", "biped"])
def test_bundled_urdf_and_mjcf_match_completely(robot_of, name):
    one, other = robot_of(f"{name}.urdf"), robot_of(f"{name}.xml")
    pairs = pair_robots(one, other)
    assert pairs.joint_names.only_first == pairs.joint_names.only_second == ()
    assert pairs.base == (one.bodies[0].top.name,) * 2
    assert [a for a, _ in pairs.links] == [link.name for link in one.links]
    assert (len(pairs.joints), len(pairs.bodies)) == (12, 13)
    assert all(a.name == b.name for a, b in (*pairs.joints, *pairs.bodies))


def test_renamed_links_match_below_their_joints(robot_of):
    other = robot_of(TWO.replace('"base"', '"trunk"').replace('"b"', '"shank"'))
    pairs = pair_robots(robot_of(TWO), other)
    assert pairs.base == ("base", "trunk")
    assert pairs.links == (("base", "trunk"), ("b", "shank"), ("tip", "tip"))


def test_base_is_a_common_trunk_link(robot_of):
    footprint = TWO.replace(
        '<link name="base"/>',
        '<link name="footprint"/><link name="base"/><joint name="up" type="fixed">'
        '<parent link="footprint"/><child link="base"/><origin xyz="0 0 0.3"/></joint>',
    )
    one = robot_of(footprint)
    pairs = pair_robots(one, robot_of(TWO))
    assert one.bodies[0].top.name == "footprint"
    assert pairs.base == ("base", "base")
    np.testing.assert_allclose(trunk_pose_in_link(one, "base")[:3, 3], [0, 0, -0.3])


def test_body_with_unmatched_joints_is_unmatched(robot_of):
    fixed = TWO.replace('name="on" type="fixed"', 'name="on" type="continuous"')
    pairs = pair_robots(robot_of(TWO), robot_of(fixed))
    assert pairs.joint_names.only_second == ("on",)
    assert [a.top.name for a, _ in pairs.bodies] == ["base"]


def test_virtual_links_are_not_matched(robot_of):
    planar = robot_of(
        '<mujoco><worldbody><body name="base"><joint name="x" type="slide"/><joint name="turn"/>'
        '<geom size="0.1"/><body name="b"><joint name="j" axis="1 0 0"/><geom size="0.1"/></body>'
        "</body></worldbody></mujoco>"
    )
    assert pair_robots(planar, robot_of(TWO)).links == (("base", "base"), ("b", "b"))


def test_no_links_no_pairs(robot_of):
    empty = robot_of('<robot name="r"></robot>')
    for pair in ((empty, robot_of(TWO)), (robot_of(TWO), empty)):
        with pytest.raises(CannotCheckError, match="has no links"):
            pair_robots(*pair)
