"""Plant forty faults in the contracts of the bundled policies, and count which ones are named.

usage: python benchmarks/policy_faults.py [--only TEXT]
"""

import argparse
import re
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import torch

from terrainkit_robots.policy.contracts.check import check_contract
from terrainkit_robots.policy.contracts.contract import Contract
from terrainkit_robots.policy.export import export_policy
from terrainkit_robots.policy.open_policy import find_contract, read_contract
from terrainkit_robots.rl.run import open_run
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.spec.robot_arrays import Robot

Edit = Callable[[Contract], Contract]


def table(name: str, change: Callable[[list], list]) -> Edit:
    """Change a list by joint."""
    return lambda c: replace(c, **{name: tuple(change(list(getattr(c, name))))})


def term(own: str, **changes: object) -> Edit:
    """Change a term."""
    return lambda c: replace(
        c, terms=tuple(replace(t, **changes) if t.name == own else t for t in c.terms)
    )


def scaled(own: str, factor: float) -> Edit:
    """Multiply the scale of a term."""
    return lambda c: replace(
        c,
        terms=tuple(
            replace(t, scale=tuple(factor * v for v in t.scale)) if t.name == own else t
            for t in c.terms
        ),
    )


def exchange(name: str, *pairs: tuple[int, int]) -> Edit:
    """Exchange entries of a tuple."""

    def edit(contract: Contract) -> Contract:
        values = list(getattr(contract, name))
        for i, j in pairs:
            values[i], values[j] = values[j], values[i]
        return replace(contract, **{name: tuple(values)})

    return edit


def exchange_terms(first: str, second: str) -> Edit:
    """Exchange two terms."""

    def edit(contract: Contract) -> Contract:
        names = [t.name for t in contract.terms]
        return exchange("terms", (names.index(first), names.index(second)))(contract)

    return edit


def rows(order: list[int]) -> Edit:
    """Reorder the joints with all their values."""
    names = "joints", "default_pose", "stiffness", "damping", "action_scale", "action_offset"
    return lambda c: replace(c, **{n: tuple(getattr(c, n)[k] for k in order) for n in names})


def move(own: str, place: int) -> Edit:
    """Move a term."""

    def edit(contract: Contract) -> Contract:
        moved = next(t for t in contract.terms if t.name == own)
        others = [t for t in contract.terms if t.name != own]
        return replace(contract, terms=(*others[:place], moved, *others[place:]))

    return edit


def times(factor: float) -> Callable[[list], list]:
    """Multiply all values of a list."""
    return lambda values: [factor * v for v in values]


DEGREES = 57.29578
LEGS = [(0, 3), (1, 4), (2, 5), (6, 9), (7, 10), (8, 11)]
BY_KIND = [leg * 3 + joint for joint in range(3) for leg in range(4)]
FAULTS: list[tuple[str, str, str, Edit]] = [
    ("quadruped", "pose in degrees", "POL004", table("default_pose", times(DEGREES))),
    ("quadruped", "action scale in degrees", "POL007", table("action_scale", times(DEGREES))),
    ("quadruped", "offset of the action left out", "POL005", table("action_offset", times(0))),
    ("quadruped", "sign of a joint", "POL006", table("action_scale", lambda v: [-v[0], *v[1:]])),
    ("quadruped", "sign of gravity", "POL006", term("projected_gravity", scale=(1.0, -1.0, 1.0))),
    (
        "quadruped",
        "stiffness and damping exchanged",
        "POL008",
        lambda c: replace(c, stiffness=c.damping, damping=c.stiffness),
    ),
    ("quadruped", "step in milliseconds", "POL003", lambda c: replace(c, step_dt=20.0)),
    ("quadruped", "physics step as step", "POL003", lambda c: replace(c, step_dt=0.002)),
    ("quadruped", "gains of a larger robot", "POL008", table("stiffness", times(8))),
    (
        "quadruped",
        "two values of the pose exchanged",
        "POL004 POL009",
        exchange("default_pose", (1, 2)),
    ),
    ("quadruped", "gain of one joint", "POL009", table("stiffness", lambda v: [*v[:-1], 20.0])),
    (
        "quadruped",
        "joint name of another robot",
        "POL001",
        lambda c: replace(c, joints=("LF_HAA", *c.joints[1:])),
    ),
    ("quadruped", "term left out", "POL001", lambda c: replace(c, terms=c.terms[:-1])),
    (
        "quadruped",
        "quaternion read as xyzw",
        "POL026",
        term("projected_gravity", name="xyzw_projected_gravity"),
    ),
    ("quadruped", "left and right legs exchanged", "POL020", exchange("joints", *LEGS)),
    ("quadruped", "thigh and calf exchanged", "POL020 POL004 POL009", exchange("joints", (1, 2))),
    ("quadruped", "left and right thigh exchanged", "POL020", exchange("joints", (1, 4))),
    ("quadruped", "two calves exchanged", "POL020", exchange("joints", (5, 8))),
    ("quadruped", "joints by kind instead of by leg", "POL020", rows(BY_KIND)),
    ("quadruped", "angular velocity not scaled", "POL021", scaled("base_ang_vel", 4)),
    ("quadruped", "joint velocities not scaled", "POL021", scaled("joint_vel_rel", 20)),
    ("quadruped", "commands not scaled", "POL021", term("velocity_commands", scale=(1.0,))),
    ("quadruped", "joint positions in degrees", "POL022", scaled("joint_pos_rel", DEGREES)),
    ("quadruped", "angular velocity in degrees", "POL022", scaled("base_ang_vel", DEGREES)),
    (
        "quadruped",
        "gravity and angular velocity exchanged",
        "POL024",
        exchange_terms("projected_gravity", "base_ang_vel"),
    ),
    (
        "quadruped",
        "positions and velocities exchanged",
        "POL024",
        exchange_terms("joint_pos_rel", "joint_vel_rel"),
    ),
    ("quadruped", "commands last", "POL024", move("velocity_commands", 6)),
    ("quadruped", "absolute joint positions", "POL026", term("joint_pos_rel", name="joint_pos")),
    ("quadruped", "action scale 0.5 for 0.25", "POL027", table("action_scale", times(2))),
    ("quadruped", "action scale 1 for 0.25", "POL027", table("action_scale", times(4))),
    ("quadruped", "step of 0.1 s", "POL003", lambda c: replace(c, step_dt=0.1)),
    ("quadruped", "physics step of 0.005 s", "POL003", lambda c: replace(c, step_dt=0.005)),
    (
        "biped",
        "axes of gravity exchanged",
        "POL024",
        term("projected_gravity", columns=(1, 0, 2)),
    ),
    (
        "quadruped",
        "history reversed",
        "POL025",
        lambda c: replace(c, newest_first=not c.newest_first),
    ),
    (
        "quadruped",
        "history by step for by term, or reverse",
        "POL025",
        lambda c: replace(c, is_interleaved=not c.is_interleaved),
    ),
    (
        "quadruped",
        "period of the gait doubled",
        "POL029",
        term("moving_gait_phase", params={"period": 1.0}),
    ),
    ("quadruped", "cosine before sine", "POL024", term("moving_gait_phase", columns=(1, 0))),
    (
        "biped",
        "gravity and commands exchanged",
        "POL024",
        exchange_terms("projected_gravity", "velocity_commands"),
    ),
    (
        "biped",
        "left and right leg exchanged",
        "POL020",
        exchange("joints", *[(k, k + 6) for k in range(6)]),
    ),
    ("biped", "action scale 0.5 times", "POL027", table("action_scale", times(0.5))),
]


def healthy(folder: Path) -> Iterator[tuple[str, Contract, Callable, Robot]]:
    """Yield the bundled policies."""
    for name in ("quadruped", "biped"):
        export_policy(open_run(name), folder / name, deploy_yaml=True)
        robot = Robot.load(get_task(name).folder)
        found = find_contract(folder / name / "policy.onnx", folder / name / "deploy.yaml")
        yield name, read_contract(found, robot), found.policy, robot


def main() -> int:
    """Print what is found for each fault; return 1 if fewer than 38 of 40 are named."""
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
        for robot_name, fault, codes, edit in FAULTS:
            if not re.search(only, fault):
                continue
            contract, policy, robot = policies[robot_name]
            start = time.time()
            found = check_contract(edit(contract), policy, robot, get_task(robot_name).task)
            is_named = bool({f.code for f in found} & set(codes.split()))
            tested, named = tested + 1, named + is_named
            what = "; ".join(f"{f.code} {f.got[:70]}" for f in found[:4])
            word, seconds = "ok  " if is_named else "MISS", time.time() - start
            line = f"{word} {seconds:4.0f} s {robot_name}: {fault} ({codes}): {what}"
            print(line, flush=True)
    print(f"{named} of {tested} faults named, {false} findings on healthy policies")
    return int(named < tested - 2 or false > 0)


if __name__ == "__main__":
    sys.exit(main())
