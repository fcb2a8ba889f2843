"""Summarize a robot in a few lines: mass, size, legs, standing pose and joints."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from terrainkit_robots.analysis.simulator_conventions.loaded_robot import loaded_robots
from terrainkit_robots.lint.report.facts_json import facts_json
from terrainkit_robots.text import count, names, numbers

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts
    from terrainkit_robots.analysis.simulator_conventions.loaded_robot import LoadedRobot
    from terrainkit_robots.lint.runner import Report

_MASS_TOLERANCE = 1e-3
"""Relative difference of masses that rounding explains."""


def robot_summary(report: "Report") -> Iterator[tuple[str, str]]:
    """Yield the lines of the summary as pairs of label and text."""
    facts = report.facts
    data = facts_json(facts, may_simulate=report.may_simulate)
    kind = {"urdf": "URDF", "xacro": "xacro", "mjcf": "MJCF"}[facts.model.kind]
    yield "robot", f"{data['name'] or 'unnamed'} ({kind})"
    yield "size", ", ".join(_size(data))
    if not data["legs"]:
        yield "legs", "none detected; --feet names feet"
    else:
        yield from _legs(data, {joint.name: joint.effort for joint in facts.joints})
    if facts.joints:
        yield "loaded by", "simulators with their default options"
        for robot in loaded_robots(facts):
            yield f"  {robot.order.simulator:<9}", "; ".join(_loaded(robot, facts))


def _legs(data: Mapping[str, Any], limits: Mapping[str, float | None]) -> Iterator[tuple[str, str]]:
    """Yield the legs, the standing pose, and the joints by role."""
    feet = ", ".join(data["feet"])
    yield "legs", f"{len(data['legs'])}, {_length(data['leg_length'])} long; feet: {feet}"
    if data["standing_pose"] is None:
        return
    yield "standing", ", ".join(_standing(data))
    yield from _joints(data, {name: limit for name, limit in limits.items() if limit})


def _loaded(robot: "LoadedRobot", facts: "Facts") -> Iterator[str]:
    """Yield what a simulator makes of the file: mass, bodies, feet, joint order and losses."""
    total = facts.total_mass
    is_changed = abs(robot.mass - total) > _MASS_TOLERANCE * abs(total)
    declared = f" instead of {total:.4g} kg" if is_changed else ""
    mass = "unknown mass" if math.isnan(robot.mass) else f"{robot.mass:.4g} kg{declared}"
    yield f"{mass} in {len(robot.bodies)} bodies"
    merged = [leg.foot for leg in facts.legs if leg.foot in robot.merged]
    if merged:
        yield f"feet are part of {names(robot.merged[foot] for foot in merged)}"
    order = robot.order
    if order.joints != facts.file_order:
        yield f"joints reordered{'' if order.certain else ' (to be verified)'}"
    yield from robot.losses


def _size(data: Mapping[str, Any]) -> Iterator[str]:
    mass = data["total_mass"]
    yield f"{mass:.4g} kg" if mass is not None else "unknown mass"
    bodies = "body" if data["bodies"] == 1 else "bodies"
    yield f"{count(data['links'], 'link')} in {data['bodies']:,} rigid {bodies}"
    yield count(data["joints"], "joint")
    if data["actuated_joints"] != data["joints"]:
        yield f"{data['actuated_joints']:,} of them actuated"


def _standing(data: Mapping[str, Any]) -> Iterator[str]:
    yield f"base height {_length(data['standing_height'])}"
    yield f"stance width {_length(data['standing_width'])}"
    margin = data["support_margin"]
    if margin is not None:
        side = "inside" if margin >= 0 else "outside"
        yield f"center of mass {_number(abs(margin), 3)} m {side} the support polygon"
    yield f"spawn height {_length(data['spawn_height'])}"


def _length(value: float | None) -> str:
    return "unknown" if value is None else f"{_number(value, 3)} m"


def _number(value: float, decimals: int) -> str:
    """Return a number with a fixed number of decimals, or in scientific notation if it is huge."""
    return f"{value:.{decimals}f}" if abs(value) < 1e4 else f"{value:.3g}"


def _joints(data: Mapping[str, Any], limits: Mapping[str, float]) -> Iterator[tuple[str, str]]:
    """Yield each joint role with the positions and torques of its joints in all legs."""
    names_by_role: dict[str, list[str]] = {}
    for leg in data["legs"]:
        seen: dict[str, int] = {}
        for joint in leg["joints"]:
            role = joint["role"]
            seen[role] = seen.get(role, 0) + 1
            label = role if seen[role] == 1 else f"{role} {seen[role]}"
            names = names_by_role.setdefault(label, [])
            if joint["name"] not in names:  # a waist joint belongs to every leg
                names.append(joint["name"])
    for label, names in names_by_role.items():
        unit = "m" if label.startswith("slide") else "rad"
        positions = [data["standing_pose"].get(name) for name in names]
        torques = {name: data["holding_torques"].get(name) for name in names}
        parts = [
            f"{_values(positions)} {unit}",
            *_torque(torques, limits, unit),
            *_gains(data, names),
        ]
        yield f"  {label}", f"{', '.join(parts)}: {', '.join(names)}"


def _gains(data: Mapping[str, Any], names: Sequence[str]) -> Iterator[str]:
    """Yield the suggested PD gains of some joints."""
    gains = [gain for name, gain in (data["suggested_gains"] or {}).items() if name in names]
    for key, label in (("stiffness", "kp"), ("damping", "kd")):
        values = sorted({gain[key] for gain in gains} - {None})
        if values:
            yield f"{label} {numbers(values, sep=' and ')}"


def _values(numbers: Sequence[float | None]) -> str:
    """Return the distinct numbers, or their range if there are more than two."""
    distinct = sorted({round(n, 2) + 0.0 for n in numbers if n is not None})
    if len(distinct) > 2:
        return f"{_number(distinct[0], 2)} to {_number(distinct[-1], 2)}"
    return " and ".join(_number(n, 2) for n in distinct) or "?"


def _torque(
    torques: Mapping[str, float | None], limits: Mapping[str, float], unit: str
) -> Iterator[str]:
    """Yield the largest holding torque of some joints, with its share of the effort limit."""
    sizes = {name: abs(torque) for name, torque in torques.items() if torque is not None}
    if not sizes:
        return
    shares = {name: torque / limits[name] for name, torque in sizes.items() if name in limits}
    name = max(shares, key=shares.__getitem__) if shares else max(sizes, key=sizes.__getitem__)
    share = f" ({min(shares[name], 99):.0%} of the effort limit)" if shares else ""
    yield f"holds {_number(sizes[name], 1)} {'N' if unit == 'm' else 'N m'}{share}"
