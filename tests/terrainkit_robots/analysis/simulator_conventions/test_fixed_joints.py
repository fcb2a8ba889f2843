import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.simulator_conventions.fixed_joints import (
    KEEP_LINK_OPTIONS,
    SIMULATORS,
    find_merged_feet,
    merge_joints,
    merged_joints,
)
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot


def merged_tree(facts, simulator):
    merged = merged_joints(facts.fixed_joints, simulator)
    return merge_joints(facts.tree, facts.bodies, merged)


def body_of(facts, simulator):
    return dict(merged_tree(facts, simulator).body_of)


def merged_feet(facts):
    return find_merged_feet(facts.tree, facts.bodies, facts.legs, facts.fixed_joints)


def test_what_is_merged_and_into_what(urdf):
    # tip is kept where the attribute counts; what hangs below it by a fixed joint goes into it.
    facts = urdf("ja: b > a", "jm!: a > mid", "jt!*: mid > tip", "jc!: tip > cap")
    assert [joint.name for joint in facts.fixed_joints] == ["jm", "jt", "jc"]
    for simulator in ("MuJoCo", "Genesis"):
        assert body_of(facts, simulator) == {"b": "b", "a": "a", "mid": "a", "tip": "a", "cap": "a"}
    for simulator in ("Isaac Gym", "Isaac Lab"):
        kept = {"b": "b", "a": "a", "mid": "a", "tip": "tip", "cap": "tip"}
        assert body_of(facts, simulator) == kept


def test_a_merged_link_leaves_its_children_in_its_place(urdf):
    facts = urdf("ja: b > a", "jm!: b > m", "jz: b > z", "jx: m > x", "jy: m > y")
    tree = merged_tree(facts, "MuJoCo")
    assert [joint.name for joint in tree.child_joints["b"]] == ["ja", "jx", "jy", "jz"]


def test_the_bodies_of_mjcf_are_not_merged(mjcf):
    geom = '<geom size="0.1" mass="1"/>'
    facts = mjcf(f'<body name="b"><freejoint/>{geom}<body name="f">{geom}</body></body>')
    assert facts.fixed_joints == ()
    assert body_of(facts, "Genesis") == {"b": "b", "f": "f"}


@pytest.mark.parametrize("name", ["quadruped.urdf", "quadruped.xml"])
def test_feet_are_merged_into_shanks_where_nothing_keeps_them(name):
    merges = merged_feet(Facts(load_robot(bundled.find("quadruped").with_name(name))))
    if name.endswith("xml"):
        assert merges == ()
        return
    assert [each.foot for each in merges] == ["FL_foot", "FR_foot", "RL_foot", "RR_foot"]
    assert all(each.joint.dont_collapse for each in merges)
    assert dict(merges[0].merged_body) == {"MuJoCo": "FL_calf", "Genesis": "FL_calf"}


def test_feet_without_the_attribute_are_merged_everywhere(tmp_path):
    text = bundled.find("quadruped").read_text().replace('dont_collapse="true"', "")
    (tmp_path / "robot.urdf").write_text(text)
    merges = merged_feet(Facts(load_robot(tmp_path / "robot.urdf")))
    assert {simulator for each in merges for simulator in each.merged_body} == set(SIMULATORS)


def test_feet_that_are_the_last_body_are_never_merged():
    assert merged_feet(Facts(load_robot(bundled.find("biped")))) == ()


def test_each_simulator_has_its_own_way_to_keep_a_link():
    assert list(KEEP_LINK_OPTIONS) == list(SIMULATORS)


def test_no_links(tmp_path):
    (tmp_path / "robot.urdf").write_text('<robot name="r"/>')
    facts = Facts(load_robot(tmp_path / "robot.urdf"))
    assert merged_feet(facts) == ()
