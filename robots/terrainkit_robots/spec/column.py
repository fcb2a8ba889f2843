"""Build per-joint tables with the provenance of each value."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from terrainkit_robots.spec.robot_spec import Provenance

_DIGITS = 6
"""Significant digits of declared values."""


def round_digits(value: float, digits: int = _DIGITS) -> float:
    """Round a value to significant digits; rounding errors of zero become 0."""
    return 0.0 if abs(value) < 1e-9 else float(f"{value:.{digits}g}")


@dataclass(kw_only=True)
class Column:
    """A per-joint table and the provenance of its values."""

    values: dict[str, float] = field(default_factory=dict)
    """Value of each joint."""

    origins: dict[str, Provenance] = field(default_factory=dict)
    """Provenance of each value."""

    def add(self, joint: str, value: float, origin: Provenance) -> None:
        """Add the value of a joint."""
        self.values[joint] = value
        self.origins[joint] = origin

    def provenance(self, name: str) -> Iterator[tuple[str, Provenance]]:
        """Yield the most common provenance under the name of the table, and others per joint.

        Args:
            name: Name of the table.
        """
        if not self.origins:
            return
        (usual, count), *_ = Counter(self.origins.values()).most_common(1)
        if 2 * count < len(self.origins):  # no common reason
            usual = Provenance(origin=usual.origin, reason="by joint")
        yield name, usual
        for joint, origin in self.origins.items():
            if origin != usual:
                yield f"{name}.{joint}", origin


def collect_provenance(columns: Mapping[str, Column]) -> dict[str, Provenance]:
    """Return the provenance of all columns, in the format of a spec."""
    return {
        key: origin for name, column in columns.items() for key, origin in column.provenance(name)
    }
