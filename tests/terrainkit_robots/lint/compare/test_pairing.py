import numpy as np
import pytest

from terrainkit_robots.lint.compare.pairing import from_link, pair_robots

TWO = """
<robot name="r">
  <link name="base"/><link name="b"/><link name="tip"/>
  <joint name="j" type="continuous"><parent link="base"/><child link="b"/></joint>
  <joint name="on" type="fixed"><parent link="b"/><child link="tip"/></joint>
</robot>
"""


@pytest.mark.parametrize("name", ["quadruped", "biped"])
def test_a_urdf_and_its_mjcf_are_paired_whole(robot_of, name):
    one, other = robot_of(f"{name}.urdf"), robot_of(f"{name}.xml")
    pairing = pair_robots(one, other)
    assert pairing.joint_names.only_ours == pairing.joint_names.only_theirs == ()
    assert len(pairing.joints) == 12
    assert all(a.name == b.name for a, b in pairing.joints)
    assert pairing.base[0] == pairing.base[1] == one.bodies[0].top.name
    assert [a for a, _ in pairing.links] == [link.name for link in one.links]
    assert len(pairing.bodies) == 13
    assert all(a.name == b.name for a, b in pairing.bodies)


def test_links_of_other_names_are_paired_below_their_joints(robot_of):
    other = robot_of(TWO.replace('"base"', '"trunk"').replace('"b"', '"shank"'))
    pairing = pair_robots(robot_of(TWO), other)
    assert pairing.base == ("base", "trunk")
    assert pairing.links == (("base", "trunk"), ("b", "shank"), ("tip", "tip"))


def test_the_base_is_a_link_of_the_trunk_that_both_have(robot_of):
    footprint = TWO.replace(
        '<link name="base"/>',
        '<link name="footprint"/><link name="base"/><joint name="up" type="fixed">'
        '<parent link="footprint"/><child link="base"/><origin xyz="0 0 0.3"/></joint>',
    )
    one = robot_of(footprint)
    pairing = pair_robots(one, robot_of(TWO))
    assert one.bodies[0].top.name == "footprint"
    assert pairing.base == ("base", "base")
    np.testing.assert_allclose(from_link(one, "base")[:3, 3], [0, 0, -0.3])


def test_a_body_whose_joints_have_no_partner_has_none_either(robot_of):
    fixed = TWO.replace('name="on" type="fixed"', 'name="on" type="continuous"')
    pairing = pair_robots(robot_of(TWO), robot_of(fixed))
    assert pairing.joint_names.only_theirs == ("on",)
    assert [a.top.name for a, _ in pairing.bodies] == ["base"]


def test_the_links_between_the_joints_of_one_body_are_no_links(robot_of):
    planar = robot_of(
        '<mujoco><worldbody><body name="base">'
        '<joint name="x" type="slide" axis="1 0 0"/><joint name="turn" axis="0 1 0"/>'
        '<geom size="0.1"/><body name="b"><joint name="j" axis="1 0 0"/><geom size="0.1"/></body>'
        "</body></worldbody></mujoco>"
    )
    pairing = pair_robots(planar, robot_of(TWO))
    assert pairing.base == ("base", "base")
    assert pairing.links == (("base", "base"), ("b", "b"))


def test_without_links_there_is_nothing_to_pair(robot_of):
    empty = robot_of('<robot name="r"></robot>')
    assert pair_robots(empty, robot_of(TWO)) is None
    assert pair_robots(robot_of(TWO), empty) is None
