import pytest

from terrainkit_robots.analysis.simulator_conventions.fixed_joints import (
    KEEP_LINK_OPTIONS,
    SIMULATORS,
    find_merged_feet,
    merge_joints,
    merged_joints,
)
from terrainkit_robots.description import bundled
from tests.small_robots import chain, facts, joint, link, mjcf, tree_text


def merged_tree(robot, simulator):
    merged = merged_joints(robot.fixed_joints, simulator)
    return merge_joints(robot.tree, robot.bodies, merged)


def merged_feet(robot):
    return find_merged_feet(robot.tree, robot.bodies, robot.legs, robot.fixed_joints)


@pytest.mark.parametrize(
    ("simulator", "bodies"),
    [("MuJoCo", "baaaa"), ("Genesis", "baaaa"), ("Isaac Gym", "baatt"), ("Isaac Lab", "baatt")],
)
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


@pytest.mark.parametrize(
    ("old", "simulators"), [("", ["MuJoCo", "Genesis"]), ('dont_collapse="true"', SIMULATORS)]
)
def test_merged_feet_of_bundled_quadruped(old, simulators):
    merges = merged_feet(facts(bundled.urdf_path("quadruped").read_text().replace(old, "")))
    assert [each.foot for each in merges] == ["FL_foot", "FR_foot", "RL_foot", "RR_foot"]
    for each in merges:
        calf = each.foot.replace("foot", "calf")
        assert each.merged_body == dict.fromkeys(simulators, calf)
        assert each.joint.child == each.foot


def test_feet_without_shapes_or_of_separate_bodies_are_not_merged(bundled):
    legs = [chain(name, f"0 {y} 0", (0.3, 0.3)) for name, y in (("a_leg", 0.1), ("b_leg", -0.1))]
    for each in ("a", "b"):
        legs += [link(f"{each}_foot"), joint(f"{each}_leg1", f"{each}_foot", kind="fixed")]
    robot = facts(link("trunk"), *legs)
    assert len(robot.legs) == 2
    for unmerged in (robot, bundled("biped.urdf"), bundled("quadruped.xml"), facts("")):
        assert merged_feet(unmerged) == ()


def test_keep_link_options_cover_every_simulator():
    assert list(KEEP_LINK_OPTIONS) == list(SIMULATORS)
