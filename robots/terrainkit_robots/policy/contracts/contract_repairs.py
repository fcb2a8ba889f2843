"""Changes of a contract that undo common faults: of order, sign, unit, scale, history and gains."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations, permutations
from typing import Any

from terrainkit_robots.policy.contracts.contract import (
    DEFAULT_STEP_DT,
    PER_JOINT,
    TERM_NAMES,
    Contract,
    own_name,
)
from terrainkit_robots.spec.robot_arrays import Robot

_DEGREES = 180 / math.pi
_UNITS = {_DEGREES: " (degrees)", 1 / _DEGREES: " (radians for degrees)"}

_FACTORS: dict[str, tuple[float, ...]] = {
    "base_ang_vel": (0.25, 4, 0.2, 5, *_UNITS),
    "base_lin_vel": (2, 0.5),
    "commands": (2, 0.5, 0.25, 4),
    "dof_pos": (2, 0.5, *_UNITS),
    "dof_vel": (0.05, 20, 0.1, 10, *_UNITS),
    "actions": (0.25, 4, 0.5, 2),
    "height_scan": (5, 0.2),
}
"""Factors by which the scales of projects differ, by term."""

_COMMAND_SCALES = (2.0, 2.0, 0.25), (1.0, 1.0, 1.0)

_WIDTHS = {"base_lin_vel": 3, "base_ang_vel": 3, "projected_gravity": 3, "commands": 3}
_WIDTHS |= {"gait_phase": 2, "running_gait_phase": 2}
"""Width of the terms whose numbers may be exchanged or have another sign."""

_OTHER_KINDS = {
    "dof_pos": ("absolute_dof_pos", "the joint positions are absolute in"),
    "absolute_dof_pos": ("dof_pos", "the joint positions are relative in"),
    "projected_gravity": ("xyzw_projected_gravity", "the quaternion is read as xyzw in"),
    "xyzw_projected_gravity": ("projected_gravity", "the quaternion is wxyz in"),
}
"""Terms that are mistaken for each other, and what is then true."""

MAX_PAIRS = 100
"""Largest number of pairs of joints that are exchanged; of more, neighbors and mirror images."""


@dataclass(frozen=True)
class Repair:
    """A change of a contract: code and text of the fault that it undoes, and the new contract."""

    code: str
    text: str
    contract: Contract


def repairs(contract: Contract, robot: Robot) -> Iterator[Repair]:
    """Yield contracts with one change each, which need no other simulation."""
    names = [own_name(contract.style, term.name, [term.name]) for term in contract.terms]
    for k, name in enumerate(names):
        yield from _term_repairs(contract, k, name)
        others = [*contract.terms[:k], *contract.terms[k + 1 :]]
        for place in range(len(names)):
            if place != k:
                moved = (*others[:place], contract.terms[k], *others[place:])
                text = f"{contract.terms[k].name} is number {place + 1} of the terms"
                yield Repair("POL024", text, replace(contract, terms=moved))
    for i, j in combinations(range(len(names)), 2):
        terms = list(contract.terms)
        terms[i], terms[j] = terms[j], terms[i]
        text = f"{terms[i].name} and {terms[j].name} are exchanged"
        yield Repair("POL024", text, replace(contract, terms=tuple(terms)))
    if max(term.history for term in contract.terms) > 1:
        first, mixed = not contract.newest_first, not contract.is_interleaved
        text = f"the {'newest' if first else 'oldest'} step of the history is first"
        yield Repair("POL025", text, replace(contract, newest_first=first))
        text = f"the history consists of whole {'observations' if mixed else 'terms'}"
        yield Repair("POL025", text, replace(contract, is_interleaved=mixed))
    for factor in (0.5, 2, 0.25, 4, *_UNITS):
        scale = tuple(factor * value for value in contract.action_scale)
        text = f"the action scale is {scale[0]:.4g}{_UNITS.get(factor, '')}"
        yield Repair("POL027", text, replace(contract, action_scale=scale))
    for order in _orders(contract, robot):
        joints = tuple(contract.joints[k] for k in order)
        moved_names = [a for a, b in zip(joints, contract.joints, strict=True) if a != b]
        more = ", ..." if len(moved_names) > 2 else ""
        text = f"the joints {', '.join(moved_names[:2])}{more} are exchanged"
        yield Repair("POL020", text, replace(contract, joints=joints))
        rows: dict[str, Any] = {
            key: tuple(getattr(contract, key)[k] for k in order) for key in PER_JOINT
        }
        if any(rows[key] != getattr(contract, key) for key in PER_JOINT):
            text = f"{text}, with their values"
            yield Repair("POL020", text, replace(contract, joints=joints, **rows))


def _term_repairs(contract: Contract, k: int, name: str) -> Iterator[Repair]:
    """Yield contracts with another scale, sign, order or kind of one term."""
    term, width = contract.terms[k], _WIDTHS.get(name, 0)

    def change(code: str, text: str, **changes: Any) -> Repair:
        terms = list(contract.terms)
        terms[k] = replace(term, **changes)
        return Repair(code, f"{text} {term.name}", replace(contract, terms=tuple(terms)))

    for factor in _FACTORS.get(name, ()):
        scale = tuple(factor * value for value in term.scale)
        code = "POL022" if factor in _UNITS else "POL021"
        yield change(
            code, f"the scale {scale[0]:.4g}{_UNITS.get(factor, '')} is that of", scale=scale
        )
    for scale in _COMMAND_SCALES if name == "commands" else ():
        yield change("POL021", f"the scale {list(scale)} is that of", scale=scale)
    full = term.scale * (width if len(term.scale) == 1 else 1)
    for axis in range(width):
        scale = tuple(-value if j == axis else value for j, value in enumerate(full))
        yield change("POL023", f"number {axis + 1} has the other sign in", scale=scale)
    for order in permutations(range(width)):
        if order == (term.columns or (*range(width),)):
            continue
        yield change("POL024", f"the order {[j + 1 for j in order]} is that of", columns=order)
    if name in _OTHER_KINDS:
        other, text = _OTHER_KINDS[name]
        yield change("POL026", text, name=TERM_NAMES[other][contract.style])


def other_simulations(contract: Contract, robot: Robot) -> Iterator[Repair]:
    """Yield contracts with other gains, timing or gait, each of which needs its own simulation."""
    for name, factors in (("stiffness", (0.5, 2, 4, 0.25)), ("damping", (0.25, 4, 10, 0.1))):
        for factor in factors:
            changed: Any = {name: tuple(factor * value for value in getattr(contract, name))}
            text = f"the {name} is {factor:g} times as large"
            yield Repair("POL028", text, replace(contract, **changed))
    own: Any = {
        name: tuple(robot.spec.per_joint(name)[joint] for joint in contract.joints)
        for name in ("stiffness", "damping")
    }
    yield Repair("POL028", "the gains are those of robot.toml", replace(contract, **own))
    for factor in (0.5, 2):
        step = factor * (contract.step_dt or DEFAULT_STEP_DT)
        yield Repair("POL003", f"step_dt is {step:g} s", replace(contract, step_dt=step))
        terms = tuple(
            replace(term, params={**term.params, "period": factor * term.params["period"]})
            if "period" in term.params
            else term
            for term in contract.terms
        )
        if terms != contract.terms:
            text = f"the period of the gait is {factor:g} times as long"
            yield Repair("POL029", text, replace(contract, terms=terms))


def _orders(contract: Contract, robot: Robot) -> Iterator[list[int]]:
    """Yield orders of the joints: other orders of legs, by kind, and with two joints exchanged."""
    count, legs = len(contract.joints), len(robot.spec.feet)
    if count % legs == 0:
        size = count // legs
        starts = range(0, count, size)
        for order in [*permutations(starts)][1:24]:
            yield [start + k for start in order for k in range(size)]
        by_kind = [start + k for k in range(size) for start in starts]
        yield by_kind
        yield [by_kind.index(k) for k in range(count)]
    mirror = {joint: image.joint for joint, image in robot.spec.mirror.items()}
    joints = contract.joints
    pairs = list(combinations(range(count), 2))
    for i, j in pairs:
        is_likely = j == i + 1 or mirror.get(joints[i]) == joints[j]
        if len(pairs) <= MAX_PAIRS or is_likely:
            yield [j if k == i else i if k == j else k for k in range(count)]
