"""Robots of other people, which the tests read where they lie."""

import os
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from terrainkit_robots.description import bundled
from terrainkit_robots.simulation.standing import Standing

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


@pytest.fixture(scope="session")
def sliding_shanks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the URDF of a quadruped whose shanks slide along themselves instead of turning."""
    text, count = re.subn(
        r'(<joint name="\w\w_calf_joint" type=)"revolute"(.*?)'
        r'<axis xyz="0 1 0"/>(\s*)<limit [^>]*/>',
        r'\1"prismatic"\2<axis xyz="0 0 1"/>\3'
        '<limit lower="-0.05" upper="0.1" effort="500" velocity="2"/>',
        bundled.find("quadruped").read_text(),
        flags=re.DOTALL,
    )
    assert count == 4
    path = tmp_path_factory.mktemp("sliding") / "robot.urdf"
    path.write_text(text)
    return path


@pytest.fixture
def stood() -> Standing:
    """Return how a robot with four legs stood that is as it should be."""
    return Standing(
        tilt=0.01,
        largest_tilt=0.7,
        height=0.3,
        sink=0.02,
        drift=0.03,
        leg_length=0.4,
        touching=(),
        lifted=(),
        saturation=0.2,
        saturated="knee",
        joint_error=0.05,
        blew_up=False,
        seconds=5.0,
    )
