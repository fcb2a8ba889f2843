import subprocess
import sys

import pytest

import terrainkit_robots
from tests.robots import QUADRUPED


@pytest.mark.parametrize("name", terrainkit_robots.__all__)
def test_public_name_can_be_imported(name):
    assert getattr(terrainkit_robots, name).__name__.rpartition(".")[2] == name
    assert name in dir(terrainkit_robots)


def test_unknown_name_is_attribute_error():
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        terrainkit_robots.nothing  # noqa: B018


def test_import_is_lazy():
    script = "import sys, terrainkit_robots; print('numpy' in sys.modules)"
    command = [sys.executable, "-c", script]
    run = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert run.stdout == "False\n"


def test_robots_are_checked_and_loaded_by_strings():
    report = terrainkit_robots.check_robot(str(QUADRUPED))
    assert report.verdict == "pass"
    assert report.facts.model.name == "quadruped"
    assert terrainkit_robots.load_robot(str(QUADRUPED)).name == "quadruped"
