"""Robots of other people, which the tests read where they lie."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

_PROJECT = Path(__file__).resolve().parents[2]
ROBOTS = Path(os.environ.get("TERRAINKIT_ROBOTS", _PROJECT.parent / "shared" / "robots"))


@pytest.fixture(scope="session")
def robot_file() -> Callable[[str], Path]:
    """Return the path of a robot file such as `go2/urdf/go2.urdf`; skips if it is not there."""

    def find(name: str) -> Path:
        if not (ROBOTS / name).exists():
            pytest.skip(f"{name} is not in {ROBOTS}; set TERRAINKIT_ROBOTS to a folder with robots")
        return ROBOTS / name

    return find
