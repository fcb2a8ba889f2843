"""Findings on robots of other projects, which their folder has to contain."""

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.rule import rules
from terrainkit_robots.lint.runner import lint
from tests.robots import REAL_ROBOTS

PHYSICAL = [rule for rule in rules() if rule.family in ("INR", "JNT", "SYM")]
SIDES = ("front", "rear", "left", "right")
ANYMAL_JOINTS = [
    f"{leg}_{part}" for leg in ("LF", "RF", "LH", "RH") for part in ("HAA", "HFE", "KFE")
]

DEFECTS = {
    # The covers of the calves have shapes but no mass, so MuJoCo adds 1.3 % of the total mass.
    "go2/urdf/go2.urdf": [("INR011", "FL_calflower")],
    "anymal_c/urdf/anymal_c.urdf": [
        ("INR003", "hatch"),
        *(("INR004", f"depth_camera_{side}_camera") for side in SIDES),
        # The feet, of 0.25 kg, have the inertia of a body of twice their size.
        *(("INR006", f"{leg}_FOOT") for leg in ("LF", "LH", "RF", "RH")),
        *(("JNT006", joint) for joint in ANYMAL_JOINTS),
    ],
    "cassie/urdf/cassie.urdf": [
        ("INR001", "left_pelvis_abduction"),
        ("INR003", "base"),
        ("INR004", "left_toe"),
        ("INR004", "right_toe"),
    ],
}
"""Known errors and warnings of the rules on masses, joints and symmetry."""


@pytest.mark.parametrize("name", REAL_ROBOTS)
def test_real_robots_have_only_known_defects(robot_file, name):
    report = lint(Facts(load_robot(robot_file(name))), PHYSICAL)
    assert not report.crashed
    found = [(f.code, f.subject) for f in report.findings if f.severity != "note"]
    assert sorted(found) == sorted(DEFECTS.get(name, []))
