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


def test_merge_joints_depends_on_simulator(urdf):
    # tip is kept where the attribute is read; links fixed to it are then merged into it.
    facts = urdf("ja: b > a", "jm!: a > mid", "jt!*: mid > tip", "jc!: tip > cap")
    assert [joint.name for joint in facts.fixed_joints] == ["jm", "jt", "jc"]
    for simulator in ("MuJoCo", "Genesis"):
        assert body_of(facts, simulator) == {"b": "b", "a": "a", "mid": "a", "tip": "a", "cap": "a"}
    for simulator in ("Isaac Gym", "Isaac Lab"):
        kept = {"b": "b", "a": "a", "mid": "a", "tip": "tip", "cap": "tip"}
        assert body_of(facts, simulator) == kept


def test_merge_joints_replaces_link_by_children(urdf):
    facts = urdf("ja: b > a", "jm!: b > m", "jz: b > z", "jx: m > x", "jy: m > y")
    tree = merged_tree(facts, "MuJoCo")
    assert [joint.name for joint in tree.child_joints["b"]] == ["ja", "jx", "jy", "jz"]


def test_merge_joints_keeps_mjcf_bodies(mjcf):
    geom = '<geom size="0.1" mass="1"/>'
    facts = mjcf(f'<body name="b"><freejoint/>{geom}<body name="f">{geom}</body></body>')
    assert facts.fixed_joints == ()
    assert body_of(facts, "Genesis") == {"b": "b", "f": "f"}


@pytest.mark.parametrize("name", ["quadruped.urdf", "quadruped.xml"])
def test_merged_feet_of_bundled_quadruped(name):
    merges = merged_feet(Facts(load_robot(bundled.urdf_path("quadruped").with_name(name))))
    if name.endswith("xml"):
        assert merges == ()
        return
    assert [each.foot for each in merges] == ["FL_foot", "FR_foot", "RL_foot", "RR_foot"]
    assert all(each.joint.dont_collapse for each in merges)
    assert dict(merges[0].merged_body) == {"MuJoCo": "FL_calf", "Genesis": "FL_calf"}


def test_merged_feet_without_attribute(tmp_path):
    text = bundled.urdf_path("quadruped").read_text().replace('dont_collapse="true"', "")
    (tmp_path / "robot.urdf").write_text(text)
    merges = merged_feet(Facts(load_robot(tmp_path / "robot.urdf")))
    assert {simulator for each in merges for simulator in each.merged_body} == set(SIMULATORS)


def test_merged_feet_of_separate_bodies_is_empty():
    assert merged_feet(Facts(load_robot(bundled.urdf_path("biped")))) == ()


def test_keep_link_options_cover_every_simulator():
    assert list(KEEP_LINK_OPTIONS) == list(SIMULATORS)


def test_merged_feet_without_links(tmp_path):
    (tmp_path / "robot.urdf").write_text('<robot name="r"/>')
    facts = Facts(load_robot(tmp_path / "robot.urdf"))
    assert merged_feet(facts) == ()
