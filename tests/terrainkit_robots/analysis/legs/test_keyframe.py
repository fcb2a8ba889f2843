from dataclasses import replace

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.keyframe import (
    _lower_leg,
    is_standing_keyframe,
    keyframe_defect,
)
from terrainkit_robots.analysis.legs.standing_pose import solve_standing_pose

LEG = {"hip": 0.0, "thigh": 0.9, "calf": -1.8}


def quadruped(bundled, **changes):
    """Return the quadruped with a keyframe that differs from its own, by FL_calf and so on."""
    facts = bundled("quadruped.xml")
    keyframe = {
        f"{side}_{part}_joint": changes.get(f"{side}_{part}", changes.get(part, q))
        for side in ("FL", "FR", "RL", "RR")
        for part, q in LEG.items()
    }
    return Facts(replace(facts.model, keyframe=keyframe), facts.meshes)


@pytest.mark.parametrize(
    ("changes", "defect"),
    [
        ({}, ""),
        ({"thigh": 2.6, "calf": -2.6}, "base lies on the ground"),
        ({"FL_thigh": 1.2, "FL_calf": -2.5}, "FL_foot is 0.1"),
        ({"thigh": -0.5, "calf": -1.0}, "the center of mass is 0.09"),
    ],
)
def test_keyframe_defect_names_cause(bundled, changes, defect):
    facts = quadruped(bundled, **changes)
    found = keyframe_defect(facts.leg_model)
    assert found.startswith(defect) if defect else not found
    assert is_standing_keyframe(facts.leg_model) == (not defect)


def test_keyframe_that_does_not_stand_is_replaced(bundled):
    crouching = quadruped(bundled, thigh=2.6, calf=-2.6)
    without = Facts(replace(crouching.model, keyframe={}), crouching.meshes)
    assert solve_standing_pose(crouching.leg_model) == solve_standing_pose(without.leg_model)


def test_keyframe_without_all_joints_has_no_defect(bundled):
    facts = bundled("quadruped.xml")
    partial = Facts(replace(facts.model, keyframe={"FL_calf_joint": -2.6}), facts.meshes)
    assert not keyframe_defect(partial.leg_model)
    assert not is_standing_keyframe(partial.leg_model)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("quadruped.xml", ["FL_calf"]),
        ("biped.xml", ["left_knee_link", "left_ankle_pitch_link", "left_ankle_roll_link"]),
    ],
)
def test_lower_leg_is_what_the_knee_moves(bundled, name, expected):
    robot = bundled(name).leg_model
    leg = robot.legs[0]
    assert [robot.bodies[index].name for index in _lower_leg(leg, robot)] == expected
