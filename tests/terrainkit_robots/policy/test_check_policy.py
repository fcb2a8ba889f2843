from dataclasses import replace

import numpy as np
import pytest

from terrainkit_robots.policy import check_policy
from terrainkit_robots.policy.check_policy import (
    check_contract,
    check_values,
    find_causes,
    judge_motion,
)
from terrainkit_robots.policy.contracts.contract_repairs import Repair
from terrainkit_robots.policy.open_policy import find_contract, read_contract
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.spec.robot_arrays import Robot
from tests.tables import read_table


@pytest.fixture
def found(all_forms):
    return find_contract(all_forms / "yaml" / "policy.onnx")


@pytest.fixture
def robot():
    return Robot.load(get_task("quadruped").folder)


@pytest.fixture
def contract(found, robot):
    return read_contract(found, robot)


@pytest.mark.parametrize(("changes", "code", "got"), read_table(__file__, "values_that_do_not_fit"))
def test_values_that_do_not_fit_are_found(contract, robot, changes, code, got):
    assert list(check_values(contract, robot)) == []
    findings = list(check_values(replace(contract, **changes), robot))
    assert any(each.code == code and each.got.startswith(got) for each in findings)


def test_change_with_which_the_robot_walks_names_the_fault(found, contract, robot, monkeypatch):
    task = get_task("quadruped").task
    assert check_contract(contract, found.policy, robot, task) == []
    wrong = replace(
        contract, joints=contract.joints[3:6] + contract.joints[:3] + contract.joints[6:]
    )

    def candidates(given, _):
        yield Repair("POL027", "half", replace(given, action_scale=(0.12,) * 12))
        yield Repair("POL020", "front legs", replace(given, joints=contract.joints))

    monkeypatch.setattr(check_policy, "repairs", candidates)
    monkeypatch.setattr(check_policy, "other_simulations", lambda *_: iter(()))
    assert wrong.joints[0] == "FR_hip_joint"
    motion, cause = check_contract(wrong, found.policy, robot, task)
    assert (motion.code, cause.code, cause.expected) == ("POL010", "POL020", "front legs")


@pytest.mark.parametrize(
    ("velocity", "fell", "score", "is_followed"),
    [
        ((0.3, 0, 0.4), False, 0.5, True),  # the error is 0.5 of a command of 1.0
        ((0.3, 0, 0), False, 1 - 0.73**0.5, False),  # walks, and ignores that it should turn
        ((0.6, 0, 1.36), False, 0.44, False),  # turns 1.7 times as fast
        ((0.6, 0.8, 0.8), False, 0.2, True),  # a velocity that is not commanded only costs score
        ((0.6, 0, 0.8), True, 0, False),
    ],
)
def test_each_commanded_velocity_is_followed_by_half(velocity, fell, score, is_followed):
    command = np.array([[0.6, 0, 0.8]])
    found, faults = judge_motion(command, np.array([velocity]), np.array([fell]))
    assert found == pytest.approx(score)
    assert (faults == []) == is_followed


def test_robot_commanded_to_stand_may_drift_slowly():
    for drift, is_still in ((-0.25, True), (0.26, False)):
        mean = np.array([[0, drift, 0]])
        score, faults = judge_motion(np.zeros((1, 3)), mean, np.array([False]))
        assert score == pytest.approx(1 - abs(drift) / 0.5)
        assert (faults == []) == is_still


def test_changes_that_follow_all_commands_with_half_the_error_are_causes(contract):
    changes = [Repair("POL021", text, contract) for text in "abcdef"]
    ignored = ["commanded 0.38, 0.00, 0.75, it moves with 0.38, 0.00, 0.00"]

    def named(*results):
        causes = find_causes(0.7, changes[: len(results)], results)
        return [cause.expected for cause in causes]

    assert named((0.84, []), (0.99, ignored)) == []
    assert named((0.86, []), (0.9, []), (0.89, ignored)) == ["b", "a"]  # an error below 0.15
    assert named((0.86, []), (0.92, [])) == ["b"]
    assert named(*[(0.9, [])] * 4) == ["a", "b", "c"]
    assert named((0.98, ignored), (0.92, [])) == ["b"]
    assert named() == []


def test_contracts_for_other_networks_are_found(found, contract, robot):
    fewer = replace(contract, terms=contract.terms[1:])
    (finding,) = check_contract(fewer, found.policy, robot, get_task("quadruped").task)
    assert (finding.code, finding.got) == ("POL001", "got a network for 141 observations")
