from contextlib import nullcontext

import numpy as np
import pytest
import yaml

from terrainkit.errors import ConfigError, ExportError
from terrainkit_robots.policy.contracts.contract import MJLAB, UNITREE
from terrainkit_robots.policy.contracts.deploy_yaml import read_yaml, write_deploy_yaml
from terrainkit_robots.policy.contracts.mjlab_metadata import read_metadata, write_metadata
from terrainkit_robots.policy.contracts.policy_json import check_policy_json, to_contract
from terrainkit_robots.policy.export import describe_policy
from terrainkit_robots.rl.config import Commands, Control, Env, Observations, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.terrain import Plane

DOGS = [f"{leg}_{part}_joint" for leg in ("FL", "FR") for part in ("hip", "thigh", "calf")]


def deploy(**changes):
    """A file for six joints, in the order FL, FR of a policy; a motor order has FR first."""
    document = {
        "joint_ids_map": [3, 4, 5, 0, 1, 2],
        "step_dt": 0.02,
        "stiffness": [10, 20, 30, 40, 50, 60],
        "damping": [1, 2, 3, 4, 5, 6],
        "default_joint_pos": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6],
        "actions": {"JointPositionAction": {"scale": 0.5, "offset": None, "joint_ids": None}},
        "observations": {"joint_pos_rel": {"scale": [2.0] * 6, "history_length": 0}},
    }
    return yaml.safe_dump(document | changes).encode()


def test_gains_have_the_order_of_the_motors():
    contract = read_yaml(deploy(), DOGS, DOGS)
    assert contract.joints == tuple(DOGS)  # motor 3 is the first of FL
    assert contract.stiffness == (40, 50, 60, 10, 20, 30)
    assert contract.default_pose == (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
    assert (contract.action_scale, contract.action_offset) == ((0.5,) * 6, (0,) * 6)
    assert (contract.terms[0].history, contract.doubts) == (1, ())


def test_fewer_gains_than_motors_are_noted():
    """As in unitree_rl_mjlab's file for the g1 with 23 joints."""
    contract = read_yaml(deploy(joint_ids_map=[3, 4, 5, 9, 10, 11]), [*DOGS, *RIGHT], DOGS)
    assert contract.joints[3:] == tuple(RIGHT)
    assert contract.stiffness == (10, 20, 30, 40, 50, 60)
    assert "stiffness: got 6 values for motors up to 11" in contract.doubts[0].got


RIGHT = [f"RL_{part}_joint" for part in ("hip", "thigh", "calf")]


def test_names_in_the_file_decide():
    action = {"JointPositionAction": {"joint_names": ["a", "b", "c", "d", "e", "f"]}}
    names = read_yaml(deploy(actions=action), list("fedcba"), []).joints
    assert names == tuple("abcdef")
    with pytest.raises(ConfigError, match=r"motors of an unknown robot; .*joint_names: \[x, y, "):
        read_yaml(deploy(), ["x", "y"], [])


def test_configurations_of_unitree_rl_gym_are_read():
    config = {
        "simulation_dt": 0.002,
        "control_decimation": 10,
        "kps": [100] * 6,
        "kds": [2] * 6,
        "default_angles": [0.1] * 6,
        "ang_vel_scale": 0.25,
        "dof_pos_scale": 1.0,
        "dof_vel_scale": 0.05,
        "action_scale": 0.25,
        "cmd_scale": [2.0, 2.0, 0.25],
        "num_obs": 29,
    }
    contract = read_yaml(yaml.safe_dump(config).encode(), DOGS, DOGS[::-1])
    assert (contract.joints, contract.step_dt) == (tuple(DOGS[::-1]), pytest.approx(0.02))
    names = "base_ang_vel projected_gravity velocity_commands joint_pos_rel joint_vel_rel"
    assert [term.name for term in contract.terms] == [*names.split(), "last_action", "gait_phase"]
    assert contract.terms[2].scale == (2.0, 2.0, 0.25)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"a: !!python/object/apply:os.system [ls]", "could not determine a constructor"),
        (b"a: &a {x: 1}\nb: {<<: [*a, *a]}", "got a merge key"),
        (b"[" * 5000, "recursion"),
        (b"a: 1\n" * 100_000, "got 500000 bytes; expected at most"),
        (deploy(step_dt="x"), "float"),
        (deploy(step_dt=0), "got step_dt 0"),
        (deploy(stiffness=[float("nan")] * 6), "not finite"),
        (deploy(joint_ids_map=[]), "joint_ids_map: got"),
        (deploy(default_joint_pos=[1]), "default_pose: got 1 values for 6 joints"),
        (deploy(actions={"JointVelocityAction": {}}), "unknown field .JointVelocityAction"),
        (deploy(observations={"a": {"history_length": 101}}), "history up to 100"),
        (deploy(observations={}), "0 observation terms"),
    ],
)
def test_damaged_files_are_rejected(data, message):
    with pytest.raises(ConfigError, match=message):
        read_yaml(data, DOGS, DOGS)


def describe(quadruped, **sections):
    task = Task(env=Env(num_envs=1, num_threads=1), **sections)
    document = describe_policy(LeggedEnv(task, quadruped, Plane()))
    return document | {"task": {"commands": vars(task.commands)}}


def test_written_files_say_the_same(quadruped):
    document = describe(quadruped)
    for style in (UNITREE, MJLAB):
        contract = to_contract(document, style)
        if style == UNITREE:
            again = read_yaml(write_deploy_yaml(contract).encode(), contract.joints, [])
        else:
            again = read_metadata(write_metadata(contract))
        for name in ("joints", "default_pose", "stiffness", "damping", "action_scale"):
            assert getattr(again, name) == getattr(contract, name)
        for mine, read in zip(contract.terms, again.terms, strict=True):
            assert (read.name, read.clip, read.history) == (mine.name, mine.clip, 3)
            np.testing.assert_allclose(read.scale, mine.scale)


def test_what_a_reader_would_misread_is_refused(quadruped):
    document = describe(quadruped, control=Control(control_type="T"))
    with pytest.raises(ExportError, match="control_type: got T; expected P"):
        to_contract(document, UNITREE)


@pytest.mark.parametrize("observed", [True, False])
def test_velocity_of_another_point_than_the_frame_is_refused(quadruped, observed):
    document = describe(quadruped, observations=Observations(base_lin_vel=observed))
    assert document["robot"]["center"] == [0, 0, 0]
    to_contract(document, MJLAB)
    document["robot"]["center"] = [0, -0.06, 0]
    refused = pytest.raises(
        ExportError, match=r"base_lin_vel: got of robot\.center; expected of the"
    )
    with refused if observed else nullcontext():
        to_contract(document, MJLAB)
    with pytest.raises(ConfigError, match=r"robot\.center: got \[0, -0\.06, 0\]; expected \[0"):
        check_policy_json(document, describe(quadruped))


def test_terms_that_differ_have_names_that_no_reader_knows(quadruped):
    document = describe(quadruped, commands=Commands(gait_period=0.5))
    names = [term.name for term in to_contract(document, UNITREE).terms]
    assert names[-1] == "moving_gait_phase"
    assert names[:2] == ["velocity_commands", "projected_gravity"]
