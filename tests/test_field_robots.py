"""Tests of the list of robots in docs/field_robots.toml."""

import tomllib
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"
PACKAGES = tomllib.loads((DOCS / "field_robots.toml").read_text())
NAMED = ("genesis-world", "mjlab", "playground", "dm-control", "gymnasium-robotics")


def test_field_robots_are_unique_and_listed_on_the_page():
    rows = [row for table in PACKAGES.values() for row in table["robots"]]
    page = (DOCS / "field_robots.md").read_text()
    for row in rows:
        assert set(row) == {"file", "kind"}
        assert row["file"].endswith((".urdf", ".xml"))
        assert f"| {row['file']} | {row['kind']} |" in page
    assert len({row["file"] for row in rows}) == len(rows)
    assert sum(len(PACKAGES[name]["robots"]) for name in NAMED) >= 20
