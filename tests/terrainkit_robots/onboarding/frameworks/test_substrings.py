import random

import pytest

from terrainkit_robots.onboarding.frameworks.substrings import common_key, gain_keys, keys_for

LEGS = ("FL", "FR", "RL", "RR")
BODIES = ("base", *(f"{leg}_{part}" for leg in LEGS for part in ("hip", "thigh", "calf", "foot")))


@pytest.mark.parametrize(
    ("wanted", "others", "key"),
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
def test_one_substring_for_all_feet(wanted, others, key):
    assert common_key(wanted, [*wanted, *others]) == key


def test_few_substrings_that_hit_each_body_once():
    wanted = [f"{leg}_{part}" for leg in LEGS for part in ("thigh", "calf")]
    assert keys_for(wanted, BODIES).keys == ("thigh", "calf")
    assert keys_for(["base"], BODIES).keys == ("base",)
    assert keys_for([], BODIES).keys == ()
    assert keys_for(["FL_thigh", "RR_hip"], BODIES).keys == ("FL_thigh", "RR_hip")


def test_what_cannot_be_told_apart_is_told():
    found = keys_for(["base"], ["base", "base_imu"])
    assert (found.keys, found.clashes) == (("base",), (("base", "base_imu"),))


def test_keys_of_any_bodies_hit_what_they_should():
    chance = random.Random(0)
    for _ in range(300):
        words = ["arm", "hip", "l", "r", "link", "1", "2", "12"]
        bodies = list(
            dict.fromkeys("_".join(chance.choices(words, k=chance.randint(1, 3))) for _ in range(9))
        )
        wanted = chance.sample(bodies, chance.randint(1, len(bodies)))
        found = keys_for(wanted, bodies)
        hits = [name for key in found.keys for name in bodies if key in name]
        assert set(wanted) <= set(hits)
        if not found.clashes:
            assert sorted(hits) == sorted(wanted)
        else:
            assert sorted(hits) != sorted(wanted)


def test_the_last_gain_that_fits_is_right():
    joints = ("joint10", "joint1", "joint2", "joint1_a")
    gains = {"joint10": 1.0, "joint1": 2.0, "joint2": 3.0, "joint1_a": 2.0}
    found = gain_keys(joints, gains)
    assert found.keys == ("joint1", "joint2", "joint10")
    assert found.clashes == (("joint1", "joint10"),)
    for joint in joints:
        assert [gains[key] for key in found.keys if key in joint][-1] == gains[joint]


def test_gains_keep_the_order_of_the_joints():
    joints = ("b_long_name", "a")
    assert gain_keys(("b_long_nme", "c"), {"b_long_nme": 1, "c": 2}).keys == ("b_long_nme", "c")
    assert gain_keys(joints, dict.fromkeys(joints, 1)).keys == ("a",)
    assert gain_keys(joints, dict.fromkeys(joints, 1)).clashes == ()
