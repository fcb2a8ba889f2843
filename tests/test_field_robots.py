"""Tests of the list of robots in docs/field_robots.toml."""

import tomllib
from pathlib import Path

PACKAGES = tomllib.loads(Path(__file__).parents[1].joinpath("docs/field_robots.toml").read_text())
NAMED = ("genesis-world", "mjlab", "playground", "dm-control", "gymnasium-robotics")


def test_field_robots_are_unique_and_complete():
    rows = [row for table in PACKAGES.values() for row in table["robots"]]
    assert all(set(row) == {"file", "kind"} and row["kind"] for row in rows)
    assert all(row["file"].endswith((".urdf", ".xml")) for row in rows)
    assert len({row["file"] for row in rows}) == len(rows)


def test_field_robots_include_twenty_of_simulators():
    assert sum(len(PACKAGES[name]["robots"]) for name in NAMED) >= 20


def test_field_robots_page_lists_each_robot():
    page = Path(__file__).parents[1].joinpath("docs/field_robots.md").read_text()
    for table in PACKAGES.values():
        for row in table["robots"]:
            assert f"| {row['file']} | {row['kind']} |" in page
