import re

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.onboarding.frameworks.patterns import (
    merge_names,
    merge_patterns,
    mjlab_patterns,
    usd_patterns,
)
from tests.tables import read_table

NAMES = ("FL_hip_joint", "FL_hip", "left.knee-2", "1st", "_tail", "\u5173\u8282", "a+b")


def test_usd_patterns_match_original_and_usd_names(robots):
    patterns = usd_patterns(NAMES)
    for spelled in (NAMES, tuple(map(robots.in_usd, NAMES))):
        for name, expected in zip(NAMES, spelled, strict=True):
            matches = [other for other in spelled if re.fullmatch(patterns[name], other)]
            assert matches == [expected]
    assert patterns["FL_hip_joint"] == "FL_hip_joint"


@pytest.mark.parametrize(
    ("make", "names", "message"),
    [
        (usd_patterns, ("a.b", "a_b"), r"'a\.b' and 'a_b' have the same name in USD"),
        (usd_patterns, ("\u00e9_x", "___x"), "have the same name in USD"),
        (usd_patterns, ("",), "got an empty text"),
        (mjlab_patterns, ("a/x", "b/x"), "the same name in mjlab"),
    ],
)
def test_equal_and_empty_names_are_rejected(make, names, message):
    with pytest.raises(ConfigError, match=message):
        make(names)


def test_usd_patterns_have_no_exponential_matching():
    names = ("\u00e9_" * 12 + "\u00e9", "_" * 40 + "x")
    assert set(usd_patterns(names)) == set(names)


def test_mjlab_patterns_match_one_name_by_prefix():
    names = (*NAMES, "robot/arm")
    seen = (*NAMES, "arm")
    patterns = mjlab_patterns(names)
    assert patterns["FL_hip"] == "FL_hip$"
    for match in (re.match, re.fullmatch):
        for name, expected in zip(names, seen, strict=True):
            assert [other for other in seen if match(patterns[name], other)] == [expected]


@pytest.mark.parametrize(
    ("patterns", "values", "expected"),
    read_table(__file__, "joints_with_equal_values_share_patterns"),
)
def test_joints_with_equal_values_share_patterns(patterns, values, expected):
    assert merge_patterns(values, {name: name for name in values} | patterns) == expected


def test_names_have_patterns_that_match_no_others():
    names = ("FL_hip", "FR_hip", "FL_calf", "FR_calf")
    same = {name: name for name in names}
    assert merge_names(names[:2], same) == [".*_hip"]
    assert merge_names(names, same) == [".*"]
