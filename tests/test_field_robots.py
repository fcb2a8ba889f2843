"""The list of robots that docs/field_robots.py brings in."""

import tomllib
from pathlib import Path

PACKAGES = tomllib.loads(Path(__file__).parents[1].joinpath("docs/field_robots.toml").read_text())
NAMED = ("genesis-world", "mjlab", "playground", "dm-control", "gymnasium-robotics")


def test_each_robot_is_there_once_and_said_to_be_something():
    rows = [row for table in PACKAGES.values() for row in table["robots"]]
    assert all(set(row) == {"file", "kind"} and row["kind"] for row in rows)
    assert all(row["file"].endswith((".urdf", ".xml")) for row in rows)
    assert len({row["file"] for row in rows}) == len(rows)


def test_packages_of_the_field_have_twenty_robots():
    assert sum(len(PACKAGES[name]["robots"]) for name in NAMED) >= 20


def test_the_page_has_each_robot():
    page = Path(__file__).parents[1].joinpath("docs/field_robots.md").read_text()
    for table in PACKAGES.values():
        for row in table["robots"]:
            assert f"| {row['file']} | {row['kind']} |" in page
