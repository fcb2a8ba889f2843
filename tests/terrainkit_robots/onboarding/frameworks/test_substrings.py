import random

import pytest

from terrainkit_robots.onboarding.frameworks.substrings import common_key, gain_keys, keys_for

LEGS = ("FL", "FR", "RL", "RR")
BODIES = ("base", *(f"{leg}_{part}" for leg in LEGS for part in ("hip", "thigh", "calf", "foot")))


@pytest.mark.parametrize(
    ("targets", "others", "key"),
    [
        (["FL_foot", "FR_foot"], ["FL_calf", "base"], "foot"),
        (["LF_FOOT", "RH_FOOT"], ["LF_SHANK", "base"], "FOOT"),
        (["l_ankle_roll_link", "r_ankle_roll_link"], ["l_ankle_pitch_link"], "roll"),
        (["l_foot", "r_foot"], ["l_foot_roll"], None),
        (["LFoot", "RFoot"], ["LKnee"], "Foot"),
        (["l_foot", "r_foot"], ["football"], "_foot"),
        (["toe_l", "heel_r"], ["base"], None),
        (["foot"], [], "foot"),
        (["x" * 5000 + "_foot", "y_foot"], ["knee"], "foot"),
    ],
)
def test_common_key_of_feet(targets, others, key):
    assert common_key(targets, [*targets, *others]) == key


@pytest.mark.parametrize(
    ("targets", "bodies", "keys", "clashes"),
    [
        ([f"{leg}_{p}" for leg in LEGS for p in ("thigh", "calf")], BODIES, ("thigh", "calf"), ()),
        (["base"], BODIES, ("base",), ()),
        ([], BODIES, (), ()),
        (["FL_thigh", "RR_hip"], BODIES, ("FL_thigh", "RR_hip"), ()),
        (["base"], ["base", "base_imu"], ("base",), (("base", "base_imu"),)),
    ],
)
def test_keys_for_match_each_body_once(targets, bodies, keys, clashes):
    result = keys_for(targets, bodies)
    assert (result.keys, result.clashes) == (keys, clashes)


def test_keys_for_random_bodies():
    rng = random.Random(0)
    for _ in range(300):
        words = ["arm", "hip", "l", "r", "link", "1", "2", "12"]
        names = ("_".join(rng.choices(words, k=rng.randint(1, 3))) for _ in range(9))
        bodies = list(dict.fromkeys(names))
        targets = rng.sample(bodies, rng.randint(1, len(bodies)))
        result = keys_for(targets, bodies)
        matches = [name for key in result.keys for name in bodies if key in name]
        assert set(targets) <= set(matches)
        assert (sorted(matches) == sorted(targets)) == (not result.clashes)


@pytest.mark.parametrize(
    ("gains", "keys", "clashes"),
    [
        (
            {"joint10": 1.0, "joint1": 2.0, "joint2": 3.0, "joint1_a": 2.0},
            ("joint1", "joint2", "joint10"),
            (("joint1", "joint10"),),
        ),
        ({"b_long_nme": 1, "c": 2}, ("b_long_nme", "c"), ()),
        ({"b_long_name": 1, "a": 1}, ("a",), ()),
    ],
)
def test_last_gain_key_of_a_joint_is_correct(gains, keys, clashes):
    result = gain_keys(tuple(gains), gains)
    assert (result.keys, result.clashes) == (keys, clashes)
    for joint, gain in gains.items():
        assert gains[[key for key in keys if key in joint][-1]] == gain
