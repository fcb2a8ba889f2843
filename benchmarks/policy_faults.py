"""Plant forty faults in the contracts of the bundled policies, and count which ones are named.

The right contracts of the policies, and of policies with noise on their weights, may have no cause.

usage: python benchmarks/policy_faults.py [--only TEXT]
"""

import argparse
import re
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from terrainkit_robots.policy.check_policy import check_contract
from terrainkit_robots.policy.contracts.contract import Contract, ContractTerm
from terrainkit_robots.policy.export import export_policy
from terrainkit_robots.policy.open_policy import find_contract, read_contract
from terrainkit_robots.rl.run import open_run
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.spec.robot_arrays import Robot

FAULTS = tomllib.loads(Path(__file__).with_suffix(".toml").read_text())["fault"]
NOISES = 0.15, 0.3, 0.5
"""Noise on the weights of policies whose contracts are right."""

_OF_JOINTS = "joints", "default_pose", "stiffness", "damping", "action_scale", "action_offset"


def edited(contract: Contract, fault: dict[str, Any]) -> Contract:
    """Return a contract with a fault; policy_faults.toml describes its keys."""
    old, new = vars(contract), dict(fault.get("set", {}))
    for name, factors in fault.get("times", {}).items():
        new[name] = tuple(np.multiply(old[name], factors).tolist())
    for name, entries in fault.get("at", {}).items():
        new[name] = tuple(entries.get(str(k), value) for k, value in enumerate(old[name]))
    for name, source in fault.get("from", {}).items():
        new[name] = old[source]
    joint_order = fault.get("order_with_values")
    orders = dict.fromkeys(_OF_JOINTS, joint_order) if joint_order else fault.get("order", {})
    for name, order in orders.items():
        new[name] = tuple(old[name][k] for k in order)
    if own := fault.get("terms"):
        new["terms"] = tuple(_edited_term(term, own.get(term.name, {})) for term in old["terms"])
    return replace(contract, **new)


def _edited_term(term: ContractTerm, changes: dict[str, Any]) -> ContractTerm:
    values = {k: tuple(v) if isinstance(v, list) else v for k, v in changes.items()}
    if factor := values.pop("times", None):
        values["scale"] = tuple(factor * value for value in term.scale)
    return replace(term, **values)


def healthy(folder: Path) -> Iterator[tuple[str, Contract, Callable, Robot]]:
    """Yield the bundled policies."""
    for name in ("quadruped", "biped"):
        export_policy(open_run(name), folder / name, deploy_yaml=True)
        robot = Robot.load(get_task(name).folder)
        found = find_contract(folder / name / "policy.onnx", folder / name / "deploy.yaml")
        yield name, read_contract(found, robot), found.policy, robot


def imperfect(path: Path, noise: float) -> Callable[[torch.Tensor], torch.Tensor]:
    """Return a policy with noise on its weights.

    Args:
        path: The policy as TorchScript.
        noise: Standard deviation of the noise, relative to that of each matrix.
    """
    network = torch.jit.load(path)
    torch.manual_seed(0)
    with torch.no_grad():
        for weights in network.parameters():
            if weights.ndim == 2:
                weights += noise * weights.std() * torch.randn_like(weights)
    return lambda obs: network(obs).detach()


def main() -> int:
    """Print what is found; return 1 if fewer than 38 faults are named, or a cause is false."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="regular expression for the names of faults")
    only = parser.parse_args().only
    torch.set_num_threads(1)
    named = tested = false = 0
    with tempfile.TemporaryDirectory() as folder:
        policies = {name: rest for name, *rest in healthy(Path(folder))}
        for name, (contract, policy, robot) in policies.items():
            found = check_contract(contract, policy, robot, get_task(robot.spec.name).task)
            false += bool(found)
            print(f"healthy {name}: {len(found)} findings")
            for noise in NOISES:
                noisy = imperfect(Path(folder, name, "policy.pt"), noise)
                found = check_contract(contract, noisy, robot, get_task(name).task)
                causes = [finding for finding in found if finding.code != "POL010"]
                false += bool(causes)
                print(f"{name}, noise {noise}: {len(found)} findings, {len(causes)} causes")
        for fault in FAULTS:
            if not re.search(only, fault["name"]):
                continue
            contract, policy, robot = policies[fault["robot"]]
            task, start = get_task(fault["robot"]).task, time.time()
            found = check_contract(edited(contract, fault), policy, robot, task)
            is_named = bool({f.code for f in found} & set(fault["codes"]))
            tested, named = tested + 1, named + is_named
            what = "; ".join(f"{f.code} {f.got[:70]}" for f in found[:4])
            word, seconds = "ok  " if is_named else "MISS", time.time() - start
            about = f"{fault['robot']}: {fault['name']} ({' '.join(fault['codes'])})"
            print(f"{word} {seconds:4.0f} s {about}: {what}", flush=True)
    print(f"{named} of {tested} faults named, {false} right contracts with a fault")
    return int(named < tested - 2 or false > 0)


if __name__ == "__main__":
    sys.exit(main())
