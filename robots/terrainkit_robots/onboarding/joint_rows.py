"""The joint table of a report: what is known of each joint that a motor drives."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from terrainkit_robots.spec.per_joint import match_joints

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts
    from terrainkit_robots.spec.robot_spec import RobotSpec

_COLUMNS: Mapping[str, tuple[str, str, str]] = {
    "default_pose": ("default", "rad", "m"),
    "stiffness": ("kp", "N m/rad", "N/m"),
    "damping": ("kd", "N m s/rad", "N s/m"),
    "armature": ("armature", "kg m2", "kg"),
    "effort": ("effort", "N m", "N"),
    "velocity": ("velocity", "rad/s", "m/s"),
}
"""Tables of the spec that are shown: title, unit of a hinge, unit of a slide."""

_NOTHING = 1e-9
"""Smaller torques are what rounding leaves [N m]."""

_SMALL, _LARGE = 1e-4, 1e4
"""Numbers beyond these are shown in powers of ten."""


def joint_rows(facts: "Facts", spec: "RobotSpec") -> list[tuple[str, ...]]:
    """Return rows of cells: the header with units, then one row a joint in the order of the spec.

    `holds` is the torque that stands the robot up, and its share of the effort.
    """
    joints = {joint.name: joint for joint in facts.joints}
    order = spec.joint_order
    kinds = {joints[name].kind == "prismatic" for name in order if name in joints}
    values = {name: match_joints(getattr(spec, name), order).values for name in _COLUMNS}
    roles = _roles(facts)
    torques = {} if facts.stance is None else facts.stance.torques
    rows = [_header(kinds, legs=bool(facts.legs))]
    for index, name in enumerate(order):
        joint = joints.get(name)
        cells = [str(index), name]
        if facts.legs:
            cells.append(roles.get(name, ""))
        cells.append("" if joint is None else _range(joint.range))
        cells += [shown(values[table].get(name)) for table in _COLUMNS]
        if facts.legs:
            cells.append(_holds(torques.get(name), values["effort"].get(name)))
        rows.append(tuple(cells))
    return rows


def _header(kinds: set[bool], *, legs: bool) -> tuple[str, ...]:
    def titled(title: str, hinge: str, slide: str) -> str:
        units = [unit for unit, slides in ((hinge, False), (slide, True)) if slides in kinds]
        return f"{title} [{' or '.join(units)}]" if units else title

    titles = ["#", "joint", *(["role"] if legs else []), titled("limits", "rad", "m")]
    titles += [titled(*column) for column in _COLUMNS.values()]
    return (*titles, titled("holds", "N m", "N")) if legs else tuple(titles)


def _roles(facts: "Facts") -> dict[str, str]:
    return {
        joint.name: role
        for leg in facts.legs
        for joint, role in zip(leg.joints, leg.roles, strict=True)
    }


def _range(limits: tuple[float, float] | None) -> str:
    return "none" if limits is None else f"{shown(limits[0])} to {shown(limits[1])}"


def _holds(torque: float | None, effort: float | None) -> str:
    if torque is None or not math.isfinite(torque):
        return ""
    size = abs(torque) if abs(torque) > _NOTHING else 0.0
    if effort is None or not 0 < effort < math.inf:
        return shown(size, 2)
    return f"{shown(size, 2)} ({min(size / effort, 99):.0%})"


def shown(value: float | None, digits: int = 3) -> str:
    """Return a number in so many significant digits; nothing where there is none."""
    if value is None or math.isnan(value):
        return ""
    if math.isinf(value):
        return "unlimited"
    if value == 0 or not _SMALL <= abs(value) < _LARGE:
        return f"{value + 0.0:.{digits}g}"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    text = f"{value:.{decimals}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
