import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit.errors import ConfigError
from terrainkit_robots.spec.per_joint import by_joint, match_joints

JOINTS = ("FL_hip_joint", "FL_calf_joint", "FR_hip_joint", "FR_calf_joint")


def test_names_and_patterns_give_each_joint_its_value_in_order():
    table = {"FR_calf_joint": 3.0, "FL_calf_joint": 2.0, ".*_hip_joint": 1.0}
    assert list(by_joint(table, JOINTS).items()) == list(
        zip(JOINTS, (1.0, 2.0, 1.0, 3.0), strict=True)
    )


def test_values_may_be_anything():
    assert by_joint({"a": (0.0, 1.0), "b": (2.0, 3.0)}, ["b", "a"]) == {
        "b": (2.0, 3.0),
        "a": (0.0, 1.0),
    }


def test_no_joints_need_no_keys():
    assert by_joint({}, ()) == {}


def test_a_key_that_is_a_name_is_no_pattern():
    assert by_joint({"a.b": 1.0, "axb": 2.0}, ["a.b", "axb"]) == {"a.b": 1.0, "axb": 2.0}


def test_a_pattern_matches_the_whole_name():
    with pytest.raises(ConfigError, match="matches no joint"):
        by_joint({"hip": 1.0}, JOINTS)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            {".*_hip_joint": 1.0},
            "joints FL_calf_joint, FR_calf_joint are matched by no key of stiffness; "
            "expected one key per joint",
        ),
        (
            {"FL.*": 1.0, "FR_hip_joint": 1.0},
            "joint FR_calf_joint is matched by no key of stiffness; expected one key per joint",
        ),
        (
            {".*": 1.0, "FL_hip_joint": 2.0},
            'joint FL_hip_joint is matched by ".*" and FL_hip_joint of stiffness; expected one key',
        ),
        (
            {".*": 1.0, "FL_hip_jiont": 2.0},
            "stiffness.FL_hip_jiont matches no joint; did you mean FL_hip_joint?",
        ),
        ({".*": 1.0, "x": 2.0}, "stiffness.x matches no joint"),
        (
            {".*": 1.0, "*_x": 2.0},
            'stiffness."*_x": not a regular expression: nothing to repeat at position 0',
        ),
        (
            {".*": 1.0, "(a+)+": 2.0},
            'stiffness."(a+)+": quantifier + of a group: expected ?',
        ),
    ],
)
def test_an_error_names_the_key_the_joint_and_the_clash(table, message):
    with pytest.raises(ConfigError, match=re.escape(message) + "$"):
        by_joint(table, JOINTS, "stiffness")


def test_patterns_that_would_take_long_are_refused_together():
    names = [f"{'a' * 30}{k}" for k in range(20)]
    slow = {f".*.*.*{k}": 1.0 for k in range(20)}
    matching = match_joints({**slow, "a+b": 2.0}, names)
    assert 0 < len(matching.invalid) < 20
    assert "a+b" in matching.unused
    assert {"slow to match against all joints; use names instead"} == set(matching.invalid.values())


def test_thousands_of_keys_and_joints_are_no_trouble():
    names = [f"joint_{k}" for k in range(10_000)]
    matching = match_joints({name.upper(): 1.0 for name in names}, names)
    assert len(matching.unmatched) == 10_000
    assert len(matching.unused) + len(matching.invalid) == 10_000


def test_all_clashes_are_told():
    matching = match_joints({"FL.*": 1.0, "FL_hip.*": 2.0, "x": 3.0, "(": 4.0}, JOINTS)
    assert matching.values == {"FL_calf_joint": 1.0}
    assert matching.unmatched == ("FR_hip_joint", "FR_calf_joint")
    assert matching.ambiguous == {"FL_hip_joint": ("FL.*", "FL_hip.*")}
    assert matching.unused == {"x": ""}
    subjects = [problem.subject for problem in matching.problems("t")]
    assert subjects == ["(", "x", "FL_hip_joint", "FR_hip_joint"]
    assert [problem.subject for problem in matching.problems("t", allow_missing=True)] == subjects[
        :3
    ]


@given(st.lists(st.text(min_size=1), unique=True, max_size=6))
def test_a_table_of_names_is_itself(names):
    table = {name: float(k) for k, name in enumerate(names)}
    assert by_joint(table, names) == table
