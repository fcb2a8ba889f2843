import json
import math
import re

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.report.facts_json import facts_json, number
from tests.robots import QUADRUPED
from tests.small_robots import facts, joint, link


def record(path):
    made = facts_json(Facts(load_robot(path)))
    json.dumps(made, allow_nan=False)
    return made


def test_facts_json_quadruped():
    facts = record(QUADRUPED)
    assert facts["total_mass"] == 15.017  # 6.921 + 4 (0.678 + 1.152 + 0.154 + 0.04)
    assert (facts["links"], facts["bodies"], facts["joints"]) == (17, 13, 12)
    assert facts["feet"] == ["FL_foot", "FR_foot", "RL_foot", "RR_foot"]
    assert facts["simulators"]["genesis"] == {
        "total_mass": 15.017,
        "bodies": 13,
        "merged": {f"{leg}_foot": f"{leg}_calf" for leg in ("FL", "FR", "RL", "RR")},
        "feet": [],
        "lost": ["joints without armature get 0.1 kg m2"],
    }
    assert facts["legs"][0]["joints"] == [
        {"name": "FL_hip_joint", "role": "roll"},
        {"name": "FL_thigh_joint", "role": "hip"},
        {"name": "FL_calf_joint", "role": "knee"},
    ]
    # Two bones of 0.213 m, and the foot's radius of 0.022 m below.
    assert facts["leg_length"] == pytest.approx(0.448, abs=1e-3)
    # The hips are 2 (0.0465 + 0.0955) m apart, and the feet are below them.
    assert facts["standing_width"] == pytest.approx(0.284, abs=1e-3)
    assert facts["spawn_height"] == pytest.approx(facts["standing_height"] + 0.01)
    assert set(facts["holding_torques"]) == set(facts["standing_pose"])
    assert {"left": "FL_hip_joint", "right": "FR_hip_joint", "sign": -1} in facts["mirrored_joints"]
    # legged_gym's A1: 12 actions, 48 observations without the height scan.
    assert (facts["action_size"], facts["observation_size"]) == (12, 48)


def test_facts_json_without_legs_has_same_keys(tmp_path):
    file = tmp_path / "arm.urdf"
    file.write_text('<robot name="arm"><link name="only"/></robot>')
    facts = record(file)
    assert facts.keys() == record(QUADRUPED).keys()
    assert (facts["legs"], facts["feet"], facts["leg_length"]) == ([], [], None)
    assert facts["standing_pose"] is facts["spawn_height"] is facts["holding_torques"] is None
    file.write_text('<robot name="r"/>')
    assert facts_json(Facts(load_robot(file)), may_simulate=True)["suggested_gains"] is None


def test_facts_json_joint_orders_by_simulator(tmp_path):
    """The right legs come first in the file."""
    other = {"FL_": "FR_", "FR_": "FL_", "RL_": "RR_", "RR_": "RL_"}
    file = tmp_path / "robot.urdf"
    file.write_text(re.sub("|".join(other), lambda m: other[m[0]], QUADRUPED.read_text()))
    orders = record(file)["joint_orders"]
    assert list(orders) == ["file", "mujoco", "isaac_gym", "isaac_lab", "genesis", "pybullet"]
    legs = {name: [joint[:2] for joint in orders[name]["joints"]] for name in list(orders)[1:]}
    assert [joint[:2] for joint in orders["file"]][::3] == ["FR", "FL", "RR", "RL"]
    assert legs["mujoco"][::3] == legs["genesis"][::3] == ["FR", "FL", "RR", "RL"]
    assert legs["isaac_gym"][::3] == legs["isaac_lab"][:4] == ["FL", "FR", "RL", "RR"]
    assert orders["mujoco"]["bodies"][:5] == ["base", "FR_hip", "FR_thigh", "FR_calf", "FR_foot"]
    assert orders["mujoco"]["certain"] is True
    assert all(orders[name]["reason"] for name in legs)


@pytest.mark.parametrize("mass", ["1e308", "1e400", "nan", "-1"])
def test_facts_json_extreme_mass_is_none_or_finite(tmp_path, mass):
    file = tmp_path / "robot.urdf"
    inertial = f'<inertial><mass value="{mass}"/></inertial>'
    file.write_text(f'<robot name="r"><link name="a">{inertial}</link></robot>')
    total = record(file)["total_mass"]
    assert total is None or math.isfinite(total)


@pytest.mark.parametrize(("kind", "signs"), [("revolute", [1]), ("planar", [])])
def test_mirrored_joints_have_one_degree_of_freedom(kind, signs):
    sides = {"left": "0 0.2 0", "right": "0 -0.2 0"}
    parts = [link(side) + joint("trunk", side, at, kind=kind) for side, at in sides.items()]
    robot = facts(link("trunk"), *parts)
    assert len(robot.mirror.pairs) == 1
    assert [each["sign"] for each in facts_json(robot)["mirrored_joints"]] == signs


def test_number_keeps_six_digits():
    values = (1 / 3, 1234567.8, 0.0, math.inf, math.nan)
    assert [number(value) for value in values] == [0.333333, 1234570.0, 0.0, None, None]


def test_suggested_gains_require_simulation():
    robot = Facts(load_robot(QUADRUPED))
    assert facts_json(robot)["suggested_gains"] is None
    gains = facts_json(robot, may_simulate=True)["suggested_gains"]
    assert list(gains) == [joint.name for joint in robot.actuated]
    assert gains["FL_calf_joint"]["stiffness"] == 60
    assert gains["FL_calf_joint"]["reason"]
