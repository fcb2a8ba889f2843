"""Columns: a value of each joint, with its provenance."""

from collections import Counter
from collections.abc import Iterator, Mapping

from terrainkit_robots.spec.robot_spec import Provenance

Column = dict[str, tuple[float, Provenance]]
"""Value of each joint with its provenance, by name or pattern."""


def rounded(value: float, digits: int = 6) -> float:
    """Return a value with so many significant digits; 0 for numerical noise."""
    return 0.0 if abs(value) < 1e-9 else float(f"{value:.{digits}g}")


def rounded_length(value: float) -> float:
    """Return a length with three significant digits, or in whole millimeters if finer [m]."""
    return round(value, 3) if abs(value) > 0.1 else rounded(value, 3)


def collect_provenance(columns: Mapping[str, Column]) -> dict[str, Provenance]:
    """Return the provenance of the values of all columns, as a spec has it."""
    return {key: origin for name in columns for key, origin in _provenance(name, columns[name])}


def _provenance(name: str, column: Column) -> Iterator[tuple[str, Provenance]]:
    """Yield the most common provenance by the name of the table, and the others by joint."""
    if not column:
        return
    (common, count), *_ = Counter(origin for _, origin in column.values()).most_common(1)
    if 2 * count < len(column):  # no reason holds for most joints
        common = Provenance(origin=common.origin, reason="by joint")
    yield name, common
    for joint, (_, origin) in column.items():
        if origin != common:
            yield f"{name}.{joint}", origin
