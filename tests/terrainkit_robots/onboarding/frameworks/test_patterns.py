import re

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.onboarding.frameworks.patterns import mjlab_patterns, usd_patterns

NAMES = ("FL_hip_joint", "FL_hip", "left.knee-2", "1st", "_tail", "\u5173\u8282", "a+b")


def test_patterns_match_the_name_and_what_usd_makes_of_it(robots):
    patterns = usd_patterns(NAMES)
    for spelled in (NAMES, tuple(map(robots.in_usd, NAMES))):
        for name, own in zip(NAMES, spelled, strict=True):
            hits = [other for other in spelled if re.fullmatch(patterns[name], other)]
            assert hits == [own]
    assert patterns["FL_hip_joint"] == "FL_hip_joint"


def test_names_that_usd_makes_one_are_an_error():
    with pytest.raises(ConfigError, match=r"'a\.b' and 'a_b' are one name in USD"):
        usd_patterns(("a.b", "a_b"))
    with pytest.raises(ConfigError, match="are one name in USD"):
        usd_patterns(("\u00e9_x", "___x"))
    with pytest.raises(ConfigError, match="without a name"):
        usd_patterns(("",))


def test_no_names_take_for_ever_to_be_told_apart():
    names = ("\u00e9_" * 12 + "\u00e9", "_" * 40 + "x")
    assert set(usd_patterns(names)) == set(names)


def test_patterns_of_mjlab_match_one_name_even_by_its_beginning():
    names = (*NAMES, "robot/arm")
    seen = (*NAMES, "arm")
    patterns = mjlab_patterns(names)
    assert patterns["FL_hip"] == "FL_hip$"
    for matches in (re.match, re.fullmatch):
        for name, own in zip(names, seen, strict=True):
            assert [other for other in seen if matches(patterns[name], other)] == [own]
    with pytest.raises(ConfigError, match="one name in mjlab"):
        mjlab_patterns(("a/x", "b/x"))
