import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit.errors import ConfigError
from terrainkit_robots.spec.per_joint import by_joint, match_joints

JOINTS = ("FL_hip_joint", "FL_calf_joint", "FR_hip_joint", "FR_calf_joint")


def test_by_joint_accepts_names_and_patterns():
    table = {"FR_calf_joint": 3.0, "FL_calf_joint": 2.0, ".*_hip_joint": 1.0}
    assert list(by_joint(table, JOINTS).items()) == list(
        zip(JOINTS, (1.0, 2.0, 1.0, 3.0), strict=True)
    )


def test_by_joint_accepts_any_values():
    assert by_joint({"a": (0.0, 1.0), "b": (2.0, 3.0)}, ["b", "a"]) == {
        "b": (2.0, 3.0),
        "a": (0.0, 1.0),
    }


def test_by_joint_without_joints():
    assert by_joint({}, ()) == {}


def test_joint_name_is_not_a_pattern():
    assert by_joint({"a.b": 1.0, "axb": 2.0}, ["a.b", "axb"]) == {"a.b": 1.0, "axb": 2.0}


def test_pattern_matches_whole_name():
    with pytest.raises(ConfigError, match="matches no joint"):
        by_joint({"hip": 1.0}, JOINTS)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            {".*_hip_joint": 1.0},
            "joints FL_calf_joint, FR_calf_joint are matched by no key of stiffness; "
            "expected one key for each joint",
        ),
        (
            {"FL.*": 1.0, "FR_hip_joint": 1.0},
            "joint FR_calf_joint is matched by no key of stiffness; expected one key for each "
            "joint",
        ),
        (
            {".*": 1.0, "FL_hip_joint": 2.0},
            'joint FL_hip_joint is matched by ".*" and FL_hip_joint of stiffness; '
            "expected one of them",
        ),
        (
            {".*": 1.0, "FL_hip_jiont": 2.0},
            "stiffness.FL_hip_jiont matches no joint; did you mean FL_hip_joint?",
        ),
        ({".*": 1.0, "x": 2.0}, "stiffness.x matches no joint"),
        (
            {".*": 1.0, "*_x": 2.0},
            'stiffness."*_x" is not a regular expression: nothing to repeat at position 0',
        ),
        (
            {".*": 1.0, "(a+)+": 2.0},
            'stiffness."(a+)+" is a group that is repeated by +; only ? may follow one',
        ),
    ],
)
def test_by_joint_error_names_key_and_joint(table, message):
    with pytest.raises(ConfigError, match=re.escape(message) + "$"):
        by_joint(table, JOINTS, "stiffness")


def test_slow_patterns_are_rejected():
    names = [f"{'a' * 30}{k}" for k in range(20)]
    slow = {f".*.*.*{k}": 1.0 for k in range(20)}
    matching = match_joints({**slow, "a+b": 2.0}, names)
    assert 0 < len(matching.invalid) < 20
    assert "a+b" in matching.unused
    assert {"slow to match against all joints; use names instead"} == set(matching.invalid.values())


def test_match_joints_with_thousands_of_keys():
    names = [f"joint_{k}" for k in range(10_000)]
    matching = match_joints({name.upper(): 1.0 for name in names}, names)
    assert len(matching.unmatched) == 10_000
    assert len(matching.unused) + len(matching.invalid) == 10_000


def test_errors_lists_all_errors():
    matching = match_joints({"FL.*": 1.0, "FL_hip.*": 2.0, "x": 3.0, "(": 4.0}, JOINTS)
    assert matching.values == {"FL_calf_joint": 1.0}
    assert matching.unmatched == ("FR_hip_joint", "FR_calf_joint")
    assert matching.duplicate == {"FL_hip_joint": ("FL.*", "FL_hip.*")}
    assert matching.unused == {"x": ""}
    subjects = [error.name for error in matching.errors("t")]
    assert subjects == ["(", "x", "FL_hip_joint", "FR_hip_joint"]
    assert [error.name for error in matching.errors("t", partial=True)] == subjects[:3]


@given(st.lists(st.text(min_size=1), unique=True, max_size=6))
def test_by_joint_of_names_is_identity(names):
    table = {name: float(k) for k, name in enumerate(names)}
    assert by_joint(table, names) == table
