"""The bundled robots."""

import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

import torch

from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.spec.robot import Robot

torch.set_num_threads(1)


@pytest.fixture(scope="session")
def quadruped() -> Robot:
    return Robot.load(get_task("quadruped").folder)


@pytest.fixture(scope="session")
def biped() -> Robot:
    return Robot.load(get_task("biped").folder)
