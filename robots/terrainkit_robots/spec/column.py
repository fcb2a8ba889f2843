"""Columns: a value of each joint, with its provenance."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from terrainkit_robots.spec.robot_spec import Provenance


def rounded(value: float, digits: int = 6) -> float:
    """Return a value with so many significant digits; 0 for numerical noise."""
    return 0.0 if abs(value) < 1e-9 else float(f"{value:.{digits}g}")


@dataclass(kw_only=True)
class Column:
    """A table by joint that is filled one joint at a time."""

    values: dict[str, float] = field(default_factory=dict)
    """Value of each joint."""

    origins: dict[str, Provenance] = field(default_factory=dict)
    """Provenance of each value."""

    def add(self, joint: str, value: float, origin: Provenance) -> None:
        """Add the value of a joint."""
        self.values[joint] = value
        self.origins[joint] = origin

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
