import re

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.spec.per_joint import by_joint, match_joints
from tests.tables import read_table

JOINTS = ("FL_hip_joint", "FL_calf_joint", "FR_hip_joint", "FR_calf_joint")


@pytest.mark.parametrize(
    ("table", "joints", "values"),
    [
        ({"FR_calf_joint": 3, "FL_calf_joint": 2, ".*_hip_joint": 1}, JOINTS, (1, 2, 1, 3)),
        ({"a": (0.0, 1.0), "b": (2.0, 3.0)}, ("b", "a"), ((2.0, 3.0), (0.0, 1.0))),
        ({}, (), ()),
        ({"a.b": 1, "axb": 2}, ("a.b", "axb"), (1, 2)),  # a name is not a pattern
    ],
)
def test_by_joint_accepts_names_and_patterns(table, joints, values):
    assert list(by_joint(table, joints).items()) == list(zip(joints, values, strict=True))


def test_pattern_matches_whole_name():
    with pytest.raises(ConfigError, match="matches no joint"):
        by_joint({"hip": 1.0}, JOINTS)


@pytest.mark.parametrize(("table", "message"), read_table(__file__, "by_joint_error_names_key"))
def test_by_joint_error_names_key_and_joint(table, message):
    expected = re.escape(message).replace(r"\$", "$")
    with pytest.raises(ConfigError, match=expected):
        by_joint(table, JOINTS, "gain")


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
