"""Columns: one value for each joint, each with where it came from."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from terrainkit_robots.spec.robot_spec import Provenance

_DIGITS = 6
"""Significant digits of what a file declares: more than any robot is built to."""


def rounded(value: float, digits: int = _DIGITS) -> float:
    """Return a value with so many significant digits; 0 for what is left of a calculation."""
    return 0.0 if abs(value) < 1e-9 else float(f"{value:.{digits}g}")


@dataclass(kw_only=True)
class Column:
    """A table by joint in the making."""

    values: dict[str, float] = field(default_factory=dict)
    """Value of each joint."""

    origins: dict[str, Provenance] = field(default_factory=dict)
    """Where each one came from."""

    def add(self, joint: str, value: float, origin: Provenance) -> None:
        """Add the value of a joint."""
        self.values[joint] = value
        self.origins[joint] = origin

    def provenance(self, name: str) -> Iterator[tuple[str, Provenance]]:
        """Yield the origin of most values under the table's name, and of others by joint.

        Args:
            name: Name of the table.
        """
        if not self.origins:
            return
        (usual, count), *_ = Counter(self.origins.values()).most_common(1)
        if 2 * count < len(self.origins):  # no reason is that of most: each joint has its own
            usual = Provenance(origin=usual.origin, reason="by joint")
        yield name, usual
        for joint, origin in self.origins.items():
            if origin != usual:
                yield f"{name}.{joint}", origin


def collect_provenance(columns: Mapping[str, Column]) -> dict[str, Provenance]:
    """Return where the values of all columns came from, as a spec has it."""
    return {
        key: origin for name, column in columns.items() for key, origin in column.provenance(name)
    }
