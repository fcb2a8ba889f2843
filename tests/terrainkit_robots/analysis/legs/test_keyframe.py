from dataclasses import replace

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.keyframe import (
    _lower_leg,
    is_standing_keyframe,
    keyframe_defect,
)
from terrainkit_robots.analysis.legs.standing_pose import solve_standing_pose
from tests.small_robots import box, chain, facts, link
from tests.tables import read_table

ROOTS = {"FL": (0.3, 0.2), "FR": (0.3, -0.2), "RL": (-0.3, 0.2), "leg": (-0.3, -0.2)}


def table(knee=0.0, trunk_z=0.0, lift=0.0, com=0.0, joints=slice(None)):
    """Return a quadruped with a keyframe of straight legs of 0.62 m.

    Its trunk is a box of 0.1 m at `trunk_z`, one leg is raised by `lift`, and the center of mass is
    `com` ahead of the middle.
    """
    legs = [
        chain(name, f"{x} {y} {lift if name == 'leg' else 0}", (0.3, 0.3))
        for name, (x, y) in ROOTS.items()
    ]
    trunk = link("trunk", box("0.1 0.1 0.1", f"0 0 {trunk_z}"), mass=1e7, center=f"{com} 0 0")
    model = facts(trunk, *legs).model
    positions = {f"{name}{k}_joint": k * knee for name in ROOTS for k in range(2)}
    return Facts(replace(model, keyframe=dict(list(positions.items())[joints])))


@pytest.mark.parametrize(("changes", "defect"), read_table(__file__, "keyframe_defect_names_cause"))
def test_keyframe_defect_names_cause(changes, defect):
    robot = table(**changes)
    assert keyframe_defect(robot) == defect
    assert is_standing_keyframe(robot) == (not defect)


def test_keyframe_is_the_standing_pose_unless_it_has_a_defect():
    found = [solve_standing_pose(table(0.5, lift=lift))["FL1_joint"] for lift in (0.0, 0.08)]
    assert found[0] == 0.5
    assert found[1] == solve_standing_pose(table(lift=0.08, joints=slice(0)))["FL1_joint"] != 0.5


def test_keyframe_without_all_joints_has_no_defect():
    partial = table(lift=0.08, joints=slice(1, None))
    assert not keyframe_defect(partial)
    assert not is_standing_keyframe(partial)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("quadruped.xml", ["FL_calf"]),
        ("biped.xml", ["left_knee_link", "left_ankle_pitch_link", "left_ankle_roll_link"]),
    ],
)
def test_lower_leg_is_what_the_knee_moves(bundled, name, expected):
    robot = bundled(name)
    leg = robot.legs[0]
    assert [robot.bodies[index].name for index in _lower_leg(leg, robot)] == expected
