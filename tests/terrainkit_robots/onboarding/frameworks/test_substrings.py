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


def test_keys_for_match_each_body_once():
    targets = [f"{leg}_{part}" for leg in LEGS for part in ("thigh", "calf")]
    assert keys_for(targets, BODIES).keys == ("thigh", "calf")
    assert keys_for(["base"], BODIES).keys == ("base",)
    assert keys_for([], BODIES).keys == ()
    assert keys_for(["FL_thigh", "RR_hip"], BODIES).keys == ("FL_thigh", "RR_hip")


def test_keys_for_reports_ambiguous_names():
    result = keys_for(["base"], ["base", "base_imu"])
    assert (result.keys, result.clashes) == (("base",), (("base", "base_imu"),))


def test_keys_for_random_bodies():
    rng = random.Random(0)
    for _ in range(300):
        words = ["arm", "hip", "l", "r", "link", "1", "2", "12"]
        bodies = list(
            dict.fromkeys("_".join(rng.choices(words, k=rng.randint(1, 3))) for _ in range(9))
        )
        targets = rng.sample(bodies, rng.randint(1, len(bodies)))
        result = keys_for(targets, bodies)
        matches = [name for key in result.keys for name in bodies if key in name]
        assert set(targets) <= set(matches)
        if not result.clashes:
            assert sorted(matches) == sorted(targets)
        else:
            assert sorted(matches) != sorted(targets)


def test_gain_keys_last_match_is_correct():
    joints = ("joint10", "joint1", "joint2", "joint1_a")
    gains = {"joint10": 1.0, "joint1": 2.0, "joint2": 3.0, "joint1_a": 2.0}
    result = gain_keys(joints, gains)
    assert result.keys == ("joint1", "joint2", "joint10")
    assert result.clashes == (("joint1", "joint10"),)
    for joint in joints:
        assert [gains[key] for key in result.keys if key in joint][-1] == gains[joint]


def test_gain_keys_keep_joint_order():
    joints = ("b_long_name", "a")
    assert gain_keys(("b_long_nme", "c"), {"b_long_nme": 1, "c": 2}).keys == ("b_long_nme", "c")
    assert gain_keys(joints, dict.fromkeys(joints, 1)).keys == ("a",)
    assert gain_keys(joints, dict.fromkeys(joints, 1)).clashes == ()
