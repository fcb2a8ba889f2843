"""The robot in a few lines: what it weighs, what it stands on, and how."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from terrainkit_robots.analysis.legs.effort import effort_of
from terrainkit_robots.lint.report.facts_json import facts_json
from terrainkit_robots.text import count

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts
    from terrainkit_robots.lint.runner import Report


def robot_summary(report: "Report") -> Iterator[tuple[str, str]]:
    """Yield labels and what is to be said of them."""
    facts = report.facts
    record = facts_json(facts, simulated=report.simulated)
    kind = {"urdf": "URDF", "xacro": "xacro", "mjcf": "MJCF"}[facts.model.kind]
    yield "robot", f"{record['name'] or 'without a name'} ({kind})"
    yield "size", ", ".join(_size(record))
    if not record["legs"]:
        yield "legs", "none were found"
        return
    feet = ", ".join(record["feet"])
    yield "legs", f"{len(record['legs'])}, {_length(record['leg_length'])} long: {feet}"
    if record["standing_pose"] is None:
        return
    yield "stands", ", ".join(_stands(record))
    yield from _joints(record, _efforts(facts))


def _efforts(facts: "Facts") -> dict[str, float]:
    """Return the largest torque of each joint, where that is known."""
    efforts = {joint.name: effort_of(facts, joint) for joint in facts.joints}
    return {name: effort for name, effort in efforts.items() if effort is not None and effort > 0}


def _size(record: Mapping[str, Any]) -> Iterator[str]:
    mass = record["total_mass"]
    yield f"{mass:.4g} kg" if mass is not None else "a mass beyond all numbers"
    bodies = "body" if record["bodies"] == 1 else "bodies"
    yield f"{count(record['links'], 'link')} in {record['bodies']:,} rigid {bodies}"
    yield count(record["joints"], "joint")
    if record["actuated_joints"] != record["joints"]:
        yield f"{record['actuated_joints']:,} of them actuated"


def _stands(record: Mapping[str, Any]) -> Iterator[str]:
    yield f"{_length(record['standing_height'])} high"
    yield f"{_length(record['standing_width'])} wide"
    margin = record["support_margin"]
    if margin is not None:
        side = "inside" if margin >= 0 else "outside"
        yield f"its mass {_shown(abs(margin), 3)} m {side} the support"
    yield f"spawn at {_length(record['spawn_height'])}"


def _length(value: float | None) -> str:
    return "an unknown length" if value is None else f"{_shown(value, 3)} m"


def _shown(value: float, decimals: int) -> str:
    """Return a number with so many decimals; one out of all proportion in a few digits."""
    return f"{value:.{decimals}f}" if abs(value) < 1e4 else f"{value:.3g}"


def _joints(record: Mapping[str, Any], efforts: Mapping[str, float]) -> Iterator[tuple[str, str]]:
    """Yield each role with the positions and torques of its joints in all legs."""
    roles: dict[str, list[str]] = {}
    for leg in record["legs"]:
        seen: dict[str, int] = {}
        for joint in leg["joints"]:
            role = joint["role"]
            seen[role] = seen.get(role, 0) + 1
            label = role if seen[role] == 1 else f"{role} {seen[role]}"
            same = roles.setdefault(label, [])
            if joint["name"] not in same:  # a waist is a part of every leg
                same.append(joint["name"])
    for label, names in roles.items():
        unit = "m" if label.startswith("slide") else "rad"
        positions = [record["standing_pose"].get(name) for name in names]
        holding = {name: record["holding_torques"].get(name) for name in names}
        parts = [
            f"{_values(positions)} {unit}",
            *_torque(holding, efforts, unit),
            *_gains(record, names),
        ]
        yield f"  {label}", f"{', '.join(parts)}: {', '.join(names)}"


def _gains(record: Mapping[str, Any], names: Sequence[str]) -> Iterator[str]:
    """Yield what is suggested for the controllers of some joints."""
    gains = [gain for name, gain in (record["suggested_gains"] or {}).items() if name in names]
    for key, word in (("stiffness", "kp"), ("damping", "kd")):
        values = sorted({gain[key] for gain in gains} - {None})
        if values:
            yield f"{word} {' and '.join(f'{value:g}' for value in values)}"


def _values(numbers: Sequence[float | None]) -> str:
    """Return numbers, each once; their range where they are many."""
    known = sorted({round(n, 2) + 0.0 for n in numbers if n is not None})
    if len(known) > 2:
        return f"{_shown(known[0], 2)} to {_shown(known[-1], 2)}"
    return " and ".join(_shown(n, 2) for n in known) or "?"


def _torque(
    holding: Mapping[str, float | None], efforts: Mapping[str, float], unit: str
) -> Iterator[str]:
    """Yield the largest torque of some joints, and what share of its motor's it is."""
    known = {name: abs(torque) for name, torque in holding.items() if torque is not None}
    if not known:
        return
    shares = {name: torque / efforts[name] for name, torque in known.items() if name in efforts}
    name = max(shares, key=shares.__getitem__) if shares else max(known, key=known.__getitem__)
    share = f" ({min(shares[name], 99):.0%} of its effort limit)" if shares else ""
    yield f"holds {_shown(known[name], 1)} {'N' if unit == 'm' else 'N m'}{share}"
