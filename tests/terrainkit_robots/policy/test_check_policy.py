from dataclasses import replace

import pytest

from terrainkit_robots.policy import check_policy
from terrainkit_robots.policy.check_policy import check_contract, check_values
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


def test_contracts_for_other_networks_are_found(found, contract, robot):
    fewer = replace(contract, terms=contract.terms[1:])
    (finding,) = check_contract(fewer, found.policy, robot, get_task("quadruped").task)
    assert (finding.code, finding.got) == ("POL001", "got a network for 141 observations")
