import pytest

from terrainkit_robots.analysis.simulator_conventions.fixed_joints import (
    kept_bodies,
    merged_tree,
)
from tests.small_robots import facts, mjcf, tree_text
from tests.tables import read_table


@pytest.mark.parametrize(("simulator", "bodies"), read_table(__file__, "attribute_keeps_a_link"))
def test_attribute_keeps_a_link_where_it_is_read(simulator, bodies):
    # Links that are fixed to a link that is kept are merged into that.
    robot = facts(tree_text("ja: b > a", "jm!: a > m", "jt!*: m > t", "jc!: t > c"))
    assert [joint.name for joint in robot.fixed_joints] == ["jm", "jt", "jc"]
    found = merged_tree(robot, simulator)
    assert (found.base, found.body_of) == ("b", dict(zip("bamtc", bodies, strict=True)))


def test_children_of_a_merged_link_take_its_place():
    robot = facts(tree_text("ja: b > a", "jm!: b > m", "jz: b > z", "jx: m > x", "jy: m > y"))
    tree = merged_tree(robot, "MuJoCo")
    assert [joint.name for joint in tree.child_joints["b"]] == ["ja", "jx", "jy", "jz"]


def test_bodies_of_mjcf_are_kept():
    geom = '<geom size="0.1" mass="1"/>'
    robot = mjcf(f'<body name="b"><freejoint/>{geom}<body name="f">{geom}</body></body>')
    assert robot.fixed_joints == ()
    assert merged_tree(robot, "Genesis").body_of == {"b": "b", "f": "f"}


def test_kept_bodies_are_the_parts_below_dont_collapse():
    robot = facts(tree_text("ja: b > a", "jm!: a > m", "jt!*: m > t", "jc!: t > c", "jd!: a > d"))
    kept = kept_bodies(robot.tree, robot.bodies[1])
    assert [[link.name for link in body.links] for body in kept] == [["t", "c"]]
    assert kept_bodies(robot.tree, robot.bodies[0]) == ()
