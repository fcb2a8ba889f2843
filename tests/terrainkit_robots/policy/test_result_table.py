import json
from dataclasses import dataclass
from types import SimpleNamespace

import pytest

from terrainkit_robots.policy.result_table import ResultTable


@dataclass(frozen=True)
class Lap:
    number: int
    seconds: tuple[float, ...]


@dataclass(frozen=True)
class Brief:
    number: int
    note: str | None = None

    def as_dict(self):
        return {"number": self.number}


def test_json_has_the_version_what_was_measured_the_rows_and_the_remarks():
    best = ResultTable(about={"best": Brief(2)}, tables={}, schema_version=7)
    table = ResultTable(
        about={"robot": "hare", "all": Brief(3, "slow")},
        tables={"laps": (Lap(1, (0.5, 1.5)), Lap(2, ()))},
        remarks={"record": best, "left_out": None},
    )
    document = json.loads(table.to_json())
    assert list(document) == ["schema_version", "robot", "all", "laps", "record", "left_out"]
    assert document == {
        "schema_version": 1,
        "robot": "hare",
        "all": {"number": 3},
        "laps": [{"number": 1, "seconds": [0.5, 1.5]}, {"number": 2, "seconds": []}],
        "record": {"schema_version": 7, "best": {"number": 2}},
        "left_out": None,
    }
    assert table["laps"][0].seconds == (0.5, 1.5)


def test_json_has_no_values_of_other_objects():
    table = ResultTable(about={"path": SimpleNamespace(number=1)}, tables={})
    with pytest.raises(TypeError, match="dataclass"):
        table.to_json()


def test_json_may_have_no_version():
    table = ResultTable(about={}, tables={"laps": []}, schema_version=None)
    assert table.to_json(indent=2) == '{\n  "laps": []\n}\n'
