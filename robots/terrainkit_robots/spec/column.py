"""Columns: a value of each joint, with its provenance."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from terrainkit_robots.spec.name_patterns import by_pattern
from terrainkit_robots.spec.robot_spec import Provenance


def rounded(value: float, digits: int = 6) -> float:
    """Return a value with so many significant digits; 0 for numerical noise."""
    return 0.0 if abs(value) < 1e-9 else float(f"{value:.{digits}g}")


def rounded_length(value: float) -> float:
    """Return a length with three significant digits, or in whole millimeters if finer [m]."""
    return round(value, 3) if abs(value) > 0.1 else rounded(value, 3)


@dataclass(kw_only=True)
class Column:
    """A table by joint that is filled one joint at a time."""

    values: dict[str, float] = field(default_factory=dict)
    """Value of each joint, by name or pattern."""

    origins: dict[str, Provenance] = field(default_factory=dict)
    """Provenance of each value."""

    def add(self, joint: str, value: float, origin: Provenance) -> None:
        """Add the value of a joint."""
        self.values[joint] = value
        self.origins[joint] = origin

    def by_pattern(self) -> "Column":
        """Return a column whose keys are patterns of joints with the same value and provenance."""
        table = {joint: (value, self.origins[joint]) for joint, value in self.values.items()}
        patterns = by_pattern(table, list(table))
        return Column(
            values={key: value for key, (value, _) in patterns.items()},
            origins={key: origin for key, (_, origin) in patterns.items()},
        )

    def provenance(self, name: str) -> Iterator[tuple[str, Provenance]]:
        """Yield the most common provenance by the name of the table, and the others by joint.

        Args:
            name: Name of the table.
        """
        if not self.origins:
            return
        (common, count), *_ = Counter(self.origins.values()).most_common(1)
        if 2 * count < len(self.origins):  # no reason holds for most joints
            common = Provenance(origin=common.origin, reason="by joint")
        yield name, common
        for joint, origin in self.origins.items():
            if origin != common:
                yield f"{name}.{joint}", origin


def collect_provenance(columns: Mapping[str, Column]) -> dict[str, Provenance]:
    """Return the provenance of the values of all columns, as a spec has it."""
    return {
        key: origin for name, column in columns.items() for key, origin in column.provenance(name)
    }
