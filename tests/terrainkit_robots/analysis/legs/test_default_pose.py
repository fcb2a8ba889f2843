from dataclasses import replace

import pytest

from terrainkit_robots.onboarding.derive_spec.derive import derive_spec
from tests.small_robots import joint, link


@pytest.mark.parametrize(
    ("pose", "changed"),
    [
        ({".*_thigh_joint": 1.2, ".*_calf_joint": -2.4}, {"thigh": 1.2, "calf": -2.4}),
        ({"FL_hip_joint": 0.2}, {"FL_hip": 0.2}),
        ({"(": 1.0, "x": 2.0}, {}),  # matches nothing
    ],
)
def test_positions_of_spec_define_stance(bundled, gains, pose, changed):
    plain = bundled("quadruped.urdf")
    spec = derive_spec(plain, gains=gains(plain), floating=True)
    robot = bundled("quadruped.urdf", spec=replace(spec, default_pose=pose))
    expected = {
        name: next((q for part, q in changed.items() if part in name), position)
        for name, position in plain.default_pose.items()
    }
    assert robot.default_pose == robot.stance.positions == expected
    assert (robot.stance.height < plain.stance.height - 0.1) == ("thigh" in changed)


@pytest.mark.parametrize("name", ["quadruped.urdf", "biped.xml"])
def test_positions_of_derived_spec_equal_solved_pose(bundled, gains, name):
    plain = bundled(name)
    robot = bundled(name, spec=derive_spec(plain, gains=gains(plain), floating=True))
    assert robot.default_pose == pytest.approx(plain.default_pose, abs=1e-5)


MIMICS = ('joint="l2_joint" multiplier="-2"', 'joint="l3_joint" offset="0.5"')
CHAIN = (
    *(link(f"l{k}") for k in range(4)),
    *(joint(f"l{k}", f"l{k + 1}", more=f"<mimic {mimic}/>") for k, mimic in enumerate(MIMICS)),
    joint("l2", "l3", limits=(1, 2)),
)


@pytest.mark.parametrize(
    ("pose", "expected"),
    [
        (None, {"l3_joint": 1.0, "l2_joint": 1.5, "l1_joint": -3.0}),
        (2.0, {"l3_joint": 2.0, "l2_joint": 2.5, "l1_joint": -5.0}),
        (3.0, {"l3_joint": 3.0, "l2_joint": 3.5, "l1_joint": -7.0}),  # beyond the limits
    ],
)
def test_positions_of_mimic_joints_follow(robot, spec, pose, expected):
    given = pose and spec(joint_order=("l3_joint",), default_pose={"l3_joint": pose})
    assert robot(f'<robot name="r">{"".join(CHAIN)}</robot>', spec=given).default_pose == expected
