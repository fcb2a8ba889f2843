"""Robots for comparisons: edited bundled robots, and small ones."""

from pathlib import Path

import pytest

import terrainkit_robots
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot

BUNDLED = Path(terrainkit_robots.__file__).parent / "description/bundled"


@pytest.fixture
def robot_of(tmp_path):
    """Return a function that makes a robot from XML, or from an edited bundled robot."""
    count = 0

    def make(text, *edits):
        nonlocal count
        if "<" not in text:
            suffix, text = Path(text).suffix, (BUNDLED / Path(text).stem / text).read_text()
        else:
            suffix = ".xml" if "<mujoco" in text else ".urdf"
        for old, new in edits:
            assert old in text
            text = text.replace(old, new, 1)
        count += 1
        path = tmp_path / f"robot{count}{suffix}"
        path.write_text(text)
        return Facts(load_robot(path))

    return make
