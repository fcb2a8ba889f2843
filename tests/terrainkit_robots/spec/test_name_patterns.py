import random
import re

import pytest

from terrainkit_robots.spec.name_patterns import by_pattern, find_patterns
from terrainkit_robots.spec.per_joint import by_joint

DOG = [f"{leg}_{part}_joint" for leg in ("FL", "FR", "RL", "RR") for part in ("hip", "thigh")]
ANYMAL = [f"{leg}_{part}" for leg in ("LF", "LH", "RF", "RH") for part in ("HAA", "HFE")]
HUMANOID = [
    *(f"{s}_hip_{axis}_joint" for s in ("left", "right") for axis in ("pitch", "roll", "yaw")),
    *(f"{side}_knee_joint" for side in ("left", "right")),
    "waist_yaw_joint",
]
HOSTILE = ["a.b", "a+b", "axb", ".*", "(c", "", "x y"]


@pytest.mark.parametrize(
    ("names", "all_names", "expected"),
    [
        (DOG, DOG, [".*"]),
        (DOG[:1], DOG, DOG[:1]),
        ([n for n in DOG if "hip" in n], DOG, [".*_hip_joint"]),
        ([n for n in DOG if "thigh" in n and n[0] == "R"], DOG, ["R.*_thigh_joint"]),
        ([n for n in DOG if n != "RR_hip_joint"], DOG, [".*L_hip_joint", ".*_thigh_joint", DOG[2]]),
        ([n for n in ANYMAL if n.endswith("F_HFE")], ANYMAL, [".*F_HFE"]),
        ([n for n in HUMANOID if "hip" in n], HUMANOID, [".*_hip_.*"]),
        ([n for n in HUMANOID if n[0] == "l"], HUMANOID, ["left_.*"]),
        (["hipLeft", "hipRight"], ["hipLeft", "hipRight", "kneeLeft"], ["hip.*"]),
    ],
)
def test_find_patterns_of_robots(names, all_names, expected):
    assert find_patterns(names, all_names) == expected


@pytest.mark.parametrize("names", [DOG, ANYMAL, HUMANOID, HOSTILE, ["", "a", "aa", "a_a", "a_a_a"]])
def test_by_pattern_keeps_all_values(names):
    generator = random.Random(0)
    for _ in range(50):
        table = {name: generator.randrange(3) for name in names if generator.random() < 0.9}
        patterns = by_pattern(table, names)
        assert len(patterns) <= len(table)
        assert by_joint(patterns, list(table)) == table
        others = set(names) - set(table)
        matched = {n for n in others for key in patterns if key not in table and re.match(key, n)}
        assert not matched


@pytest.mark.parametrize(("count", "expected"), [(199, [".*"]), (200, [".*"]), (201, None)])
def test_find_patterns_lists_many_names(count, expected):
    names = [f"j_{index}" for index in range(count)]
    assert find_patterns(names, names) == (expected or names)
