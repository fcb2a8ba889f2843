from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

from terrainkit import MapConfig, SubTerrain, generate, make_patch
from terrainkit_robots.policy.evaluate import EvaluationConfig
from terrainkit_robots.report_card.crossing import CROSSED, OUTCOMES, Attempts, Crossing
from terrainkit_robots.rl.config import Commands
from terrainkit_robots.rl.run import open_run

PATCH = make_patch(
    MapConfig(
        rows=1, cols=1, patch_size=(5.0, 5.0), border=0.0, terrains=(SubTerrain(terrain="flat"),)
    ),
    0,
    0,
)
"""The routes lead from the center to x = 5, y = 5, x = 0 and y = 0."""


@pytest.fixture
def make_progress():
    """Return a function that makes the progress of robots at the center, and their environment."""

    def make(number):
        state = SimpleNamespace(
            base_pos=np.full((number, 3), 2.5), base_quat=np.tile([1.0, 0, 0, 0], (number, 1))
        )
        cfg = SimpleNamespace(commands=Commands(), dt=0.5)
        progress = SimpleNamespace(start=np.full((number, 2), 2.5))
        env = SimpleNamespace(state=state, curriculum=SimpleNamespace(progress=progress), cfg=cfg)
        return Attempts(env, [PATCH] * number, 0.75), env

    return make


def outcomes(progress):
    return [OUTCOMES[each] for each in progress.outcomes]


def test_robots_take_the_routes_in_turn(make_progress):
    progress, env = make_progress(5)
    env.state.base_pos[:, :2] = [[4.7, 2.5], [2.5, 4.7], [0.3, 2.5], [2.5, 0.3], [2.5, 4.7]]
    progress.update(np.zeros(5, bool))
    crossed = [each == "crossed" for each in outcomes(progress)]
    assert sum(crossed) == 4
    assert not crossed[4]  # it has the route of the first robot
    assert progress.seconds[crossed].tolist() == [0.5] * 4
    assert np.isnan(progress.seconds[4])


def test_outcomes(make_progress):
    """Robots that fall, leave the patch, and stop; the last one crosses later."""
    progress, env = make_progress(4)
    next(progress.schedule())
    fell = np.array([True, False, False, False])
    env.state.base_pos[1, :2] = 2.5, -0.01
    progress.update(fell)
    assert outcomes(progress)[:2] == ["fell", "left"]
    goal = progress._waypoints.goals[3, 0]
    env.state.base_pos[:, :2] = goal  # neither the fallen robot nor the one that left crosses
    env.state.base_pos[2, :2] = 2.5
    progress.update(np.zeros(4, bool))
    assert outcomes(progress) == ["fell", "left", "timed out", "crossed"]
    assert progress.seconds[3] == 1.0
    # 1.5 * 2.5 m / 0.75 m/s, pi rad / 1 rad/s and 5 s in steps of 0.5 s.
    steps = 2
    for _ in progress.schedule():
        progress.update(np.zeros(4, bool))
        steps += 1
    assert steps == round((5.0 + np.pi + 5.0) / 0.5)
    assert outcomes(progress) == ["fell", "left", "timed out", "crossed"]


def test_a_fall_at_the_goal_is_a_fall(make_progress):
    progress, env = make_progress(1)
    env.state.base_pos[:, :2] = progress._waypoints.goals[0, 0]
    progress.update(np.ones(1, bool))
    assert outcomes(progress) == ["fell"]


def test_commands_turn_to_the_goal_at_the_speed(make_progress):
    """The second robot has to turn left by a quarter turn, at most at 1 rad/s."""
    progress, env = make_progress(3)
    env.state.base_quat[2] = [np.cos(0.1), 0, 0, np.sin(0.1)]
    env.state.base_pos[2, :2] = [2.5, 2.5]
    progress._waypoints.goals[2, 0] = [5.0, 2.5]
    commands = next(progress.schedule())
    assert commands[0] == pytest.approx([0.75, 0, 0], abs=1e-6)
    assert commands[1, 2] == pytest.approx(1.0)
    assert commands[2, 2] == pytest.approx(-0.2, abs=1e-6)


@pytest.mark.parametrize(("x", "is_inside"), [(4.99, True), (5.01, False), (0.01, True)])
def test_robot_leaves_the_patch_at_its_border(make_progress, x, is_inside):
    progress, env = make_progress(4)
    env.state.base_pos[3, 0] = x
    progress.update(np.zeros(4, bool))
    assert outcomes(progress)[3] == ("timed out" if is_inside else "left")


def test_a_bar_stops_a_robot_of_which_only_the_feet_collide(quadruped_of_feet):
    """The bar is 0.25 m above the ground; the base is 0.3 m high."""
    spec = replace(open_run("quadruped"), robot=quadruped_of_feet)
    crossed = []
    for clearance in (0.25, 0.6):
        bar = {"start": 1.2, "clearance": clearance, "min_depth": 0.2, "max_depth": 0.2}
        terrains = (SubTerrain(terrain="crawl", parameters=bar | {"spacing": 1.0}),)
        config = MapConfig(rows=1, cols=1, patch_size=(4.0, 2.0), border=1.0, terrains=terrains)
        crossing = Crossing(spec, generate(config), 3, EvaluationConfig())
        attempts = crossing.attempt(np.zeros(3, np.int64), np.zeros(3, np.int64))
        crossed.append((attempts.outcomes == CROSSED).tolist())
    assert crossed == [[False] * 3, [True] * 3]


def test_every_attempt_starts_with_the_initial_state_of_a_recurrent_policy():
    torch = pytest.importorskip("torch")

    class Statue:
        state = torch.zeros(1)
        seen = ()

        def __call__(self, obs):
            self.seen = (*self.seen, int(self.state))
            self.state = self.state + 1
            return np.zeros((len(obs), 12))

        def reset(self, dones):
            self.state[dones] = 0  # in place, as in rsl_rl

    policy = Statue()
    terrains = (SubTerrain(terrain="flat"),)
    config = MapConfig(rows=1, cols=1, patch_size=(4.0, 2.0), border=1.0, terrains=terrains)
    spec = replace(open_run("quadruped"), policy=policy)
    crossing = Crossing(spec, generate(config), 1, EvaluationConfig())
    for _ in range(2):
        crossing.attempt(np.zeros(1, np.int64), np.zeros(1, np.int64))
    assert policy.seen.count(0) == 2
