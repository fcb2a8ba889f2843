"""Results of a measurement, such as an evaluation, as rows and as JSON."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Generic, TypeVar

Row = TypeVar("Row")


@dataclass(frozen=True, kw_only=True)
class ResultTable(Generic[Row]):
    """Results of a measurement: what was measured, and rows of results.

    Attributes:
        about: Values of the JSON before the rows, such as robot, checkpoint and settings.
        tables: Rows by name of their table; a row is a dataclass.
        remarks: Values of the JSON after the rows.
        schema_version: Version of the JSON; it changes when a key changes its meaning or is
            removed. None where the JSON has none.
    """

    about: Mapping[str, Any]
    tables: Mapping[str, Sequence[Row]]
    remarks: Mapping[str, Any] = field(default_factory=dict)
    schema_version: int | None = 1

    def __getitem__(self, name: str) -> Sequence[Row]:
        """Return the rows of a table."""
        return self.tables[name]

    def as_dict(self) -> dict[str, Any]:
        """Return the results by name."""
        version = {} if self.schema_version is None else {"schema_version": self.schema_version}
        return {**version, **self.about, **self.tables, **self.remarks}

    def to_json(self, indent: int = 1) -> str:
        """Return the results as JSON; equal results give equal bytes."""
        return json.dumps(self.as_dict(), indent=indent, default=_values) + "\n"


def _values(value: Any) -> dict[str, Any]:
    """Return the values of a table or a dataclass; of others, JSON has no values."""
    values: dict[str, Any] = value.as_dict() if hasattr(value, "as_dict") else asdict(value)
    return values
