import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.simulator_conventions.fixed_joints import (
    SIMULATORS,
    TO_KEEP,
    fixed_joints,
    foot_merges,
    merge,
    merged_joints,
)
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot


def homes(facts, simulator):
    return dict(merge(facts, merged_joints(facts, simulator)).home)


def test_what_is_merged_and_into_what(urdf):
    # tip is kept where the attribute counts; what hangs below it by a fixed joint goes into it.
    facts = urdf("ja: b > a", "jm!: a > mid", "jt!*: mid > tip", "jc!: tip > cap")
    assert [joint.name for joint in fixed_joints(facts)] == ["jm", "jt", "jc"]
    for simulator in ("MuJoCo", "Genesis"):
        assert homes(facts, simulator) == {"b": "b", "a": "a", "mid": "a", "tip": "a", "cap": "a"}
    for simulator in ("Isaac Gym", "Isaac Lab"):
        kept = {"b": "b", "a": "a", "mid": "a", "tip": "tip", "cap": "tip"}
        assert homes(facts, simulator) == kept


def test_a_merged_link_leaves_its_children_in_its_place(urdf):
    facts = urdf("ja: b > a", "jm!: b > m", "jz: b > z", "jx: m > x", "jy: m > y")
    tree = merge(facts, merged_joints(facts, "MuJoCo"))
    assert [joint.name for joint in tree.below["b"]] == ["ja", "jx", "jy", "jz"]


def test_the_bodies_of_mjcf_are_not_merged(mjcf):
    geom = '<geom size="0.1" mass="1"/>'
    facts = mjcf(f'<body name="b"><freejoint/>{geom}<body name="f">{geom}</body></body>')
    assert fixed_joints(facts) == ()
    assert homes(facts, "Genesis") == {"b": "b", "f": "f"}


@pytest.mark.parametrize("name", ["quadruped.urdf", "quadruped.xml"])
def test_feet_are_merged_into_shanks_where_nothing_keeps_them(name):
    merges = foot_merges(Facts(load_robot(bundled.find("quadruped").with_name(name))))
    if name.endswith("xml"):
        assert merges == ()
        return
    assert [each.foot for each in merges] == ["FL_foot", "FR_foot", "RL_foot", "RR_foot"]
    assert all(each.joint.dont_collapse for each in merges)
    assert dict(merges[0].into) == {"MuJoCo": "FL_calf", "Genesis": "FL_calf"}


def test_feet_without_the_attribute_are_merged_everywhere(tmp_path):
    text = bundled.find("quadruped").read_text().replace('dont_collapse="true"', "")
    (tmp_path / "robot.urdf").write_text(text)
    merges = foot_merges(Facts(load_robot(tmp_path / "robot.urdf")))
    assert {simulator for each in merges for simulator in each.into} == set(SIMULATORS)


def test_feet_that_are_the_last_body_are_never_merged():
    assert foot_merges(Facts(load_robot(bundled.find("biped")))) == ()


def test_each_simulator_has_its_own_way_to_keep_a_link():
    assert list(TO_KEEP) == list(SIMULATORS)


def test_no_links(tmp_path):
    (tmp_path / "robot.urdf").write_text('<robot name="r"/>')
    facts = Facts(load_robot(tmp_path / "robot.urdf"))
    assert merge(facts, set()) is None
    assert foot_merges(facts) == ()
