"""The joint table of report.md: limits, gains and torques of each actuated joint."""

import math
from collections.abc import Mapping, Sequence

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.simulation.declared_gains import declared_gains
from terrainkit_robots.simulation.gain import Gain
from terrainkit_robots.simulation.pd_gains import suggest_gains
from terrainkit_robots.spec.per_joint import match_joints
from terrainkit_robots.spec.robot_spec import RobotSpec

_COLUMNS: Mapping[str, tuple[str, str, str]] = {
    "default_pose": ("default", "rad", "m"),
    "stiffness": ("kp", "N m/rad", "N/m"),
    "damping": ("kd", "N m s/rad", "N s/m"),
    "armature": ("armature", "kg m2", "kg"),
    "effort": ("effort", "N m", "N"),
    "velocity": ("velocity", "rad/s", "m/s"),
}
"""Fields of the spec in the table: title, unit of a revolute and of a prismatic joint."""

_MIN_TORQUE = 1e-9
"""Smaller torques are rounding errors [N m]."""

_MIN_DECIMAL, _MAX_DECIMAL = 1e-4, 1e4
"""Numbers beyond these limits are written in scientific notation."""


def joint_table(facts: Facts, spec: RobotSpec) -> list[tuple[str, ...]]:
    """Return the rows of the table: a header with units, and one row per joint of the spec.

    The holding torque is the torque at the default pose, and its share of the effort.
    """
    joints = {joint.name: joint for joint in facts.joints}
    order = spec.joint_order
    kinds = {joints[name].kind for name in order if name in joints}
    values = {name: match_joints(getattr(spec, name), order).values for name in _COLUMNS}
    limits = {
        name: "none" if joint.range is None else " to ".join(map(format_number, joint.range))
        for name, joint in joints.items()
    }
    columns = [["#", *map(str, range(len(order)))], ["joint", *order]]
    if facts.legs:
        roles = {
            joint.name: role
            for leg in facts.legs
            for joint, role in zip(leg.joints, leg.roles, strict=True)
        }
        columns.append(["role", *(roles.get(name, "") for name in order)])
    title = _with_units("limits", ("rad", "m"), kinds)
    columns.append([title, *(limits.get(name, "") for name in order)])
    for field, (title, *units) in _COLUMNS.items():
        cells = (format_number(values[field].get(name)) for name in order)
        columns.append([_with_units(title, units, kinds), *cells])
    if any(joint.position_gains is not None for joint in facts.actuated):
        declared, suggested = declared_gains(facts).gains, suggest_gains(facts)
        for title, gains in (("declared kp, kd", declared), ("suggested kp, kd", suggested)):
            columns.append([title, *(_format_gain(gains.get(name)) for name in order)])
    if facts.legs:
        torques = {} if facts.stance is None else facts.stance.torques
        efforts = values["effort"]
        cells = (_format_torque(torques.get(name), efforts.get(name)) for name in order)
        columns.append([_with_units("holding torque", ("N m", "N"), kinds), *cells])
    return list(zip(*columns, strict=True))


def _with_units(title: str, units: Sequence[str], kinds: set[str]) -> str:
    """Return a title with the units of revolute and prismatic joints, where there are any."""
    revolute, prismatic = units
    used = [revolute] if kinds - {"prismatic"} else []
    if "prismatic" in kinds:
        used.append(prismatic)
    return f"{title} [{' or '.join(used)}]" if used else title


def _format_gain(gain: Gain | None) -> str:
    return "" if gain is None else f"{format_number(gain.stiffness)}, {format_number(gain.damping)}"


def _format_torque(torque: float | None, effort: float | None) -> str:
    if torque is None or not math.isfinite(torque):
        return ""
    size = abs(torque) if abs(torque) > _MIN_TORQUE else 0.0
    if effort is None or not 0 < effort < math.inf:
        return format_number(size, 2)
    return f"{format_number(size, 2)} ({min(size / effort, 99):.0%})"


def format_number(value: float | None, digits: int = 3) -> str:
    """Return a number with a number of significant digits; an empty string for None and NaN."""
    if value is None or math.isnan(value):
        return ""
    if math.isinf(value):
        return "unlimited"
    if value == 0 or not _MIN_DECIMAL <= abs(value) < _MAX_DECIMAL:
        return f"{value + 0.0:.{digits}g}"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    text = f"{value:.{decimals}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
