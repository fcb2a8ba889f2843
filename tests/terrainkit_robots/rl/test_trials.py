import numpy as np
import pytest
import torch

from terrainkit_robots.policy.evaluate import Asked, evaluation_task, prepared
from terrainkit_robots.policy.score import score_of
from terrainkit_robots.policy.trials import SETTLING, roll_out
from terrainkit_robots.rl.config import Commands, Control, Sim
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.terrain import Plane


def still(env):
    return lambda _: torch.zeros(env.num_envs, env.num_actions)


def limp(env):
    """Return a policy that lets the legs of the first robot collapse, and no others."""
    actions = torch.zeros(env.num_envs, env.num_actions)
    actions[0] = 100.0
    return lambda _: actions


class Sliding(LeggedEnv):
    """Robots whose bases move as they are told, whatever they do."""

    moves = np.zeros((1, 3), np.float32)
    """Speed forward and to the left [m/s], turning speed [rad/s], of each robot, shape (n, 3)."""

    falls = np.zeros(1)
    """When each robot falls [s]; 0: never. Shape (n,)."""

    def step(self, actions):
        observed, rewards, _, _ = super().step(actions)
        dt, n = self.cfg.dt, self.num_envs
        self.now = getattr(self, "now", 0) + 1
        state = self.state
        state.base_lin_vel[:, :2], state.base_ang_vel[:, 2] = self.moves[:, :2], self.moves[:, 2]
        way = self.moves[:, 0] * np.float32(self.now * dt)
        state.base_pos[:, :2] = self.start + np.column_stack([way, np.zeros(n)])
        dones = torch.from_numpy(np.isclose(self.falls, self.now * dt))
        return observed, rewards, dones, {"time_outs": torch.zeros(n, dtype=torch.bool)}


@pytest.fixture
def sliding(quadruped, calm):
    def make(moves, falls=None, ground=None, **sections):
        moves = np.array(moves, np.float32)
        # What the physics does is of no account, so it is done in one step.
        coarse = calm(len(moves), sim=Sim(dt=0.02), control=Control(decimation=1), **sections)
        task = evaluation_task(coarse, len(moves))
        env = Sliding(task, quadruped, ground or Plane())
        env.moves = moves
        env.falls = np.zeros(len(moves)) if falls is None else np.array(falls)
        return env

    return make


def test_errors_are_those_of_the_time_after_settling(sliding):
    env = sliding([[0.6, 0.3, 0.5], [1, 0, 0]])
    commands = np.array([[1, 0, 0.3], [1, 0, 0]], np.float32)
    outcome = roll_out(env, still(env), 4.0, commands)
    first = score_of(outcome, np.array([True, False]), patches=False)
    assert first.lin_vel_error == pytest.approx(0.5)
    assert first.lin_vel_error_1s == pytest.approx(0.5)
    assert first.ang_vel_error == pytest.approx(0.2)
    assert first.success is None
    both = score_of(outcome, np.ones(2, bool), patches=False)
    assert both.lin_vel_error == pytest.approx(0.25)
    steps = round((4.0 - SETTLING) / env.cfg.dt)
    assert outcome.counts.tolist() == [[steps] * 2, [steps - 49] * 2] * 2


def test_swaying_cancels_out_over_a_second(sliding):
    env = sliding([[1, 0, 0]])
    before = env.step

    def swaying(actions):
        env.moves = np.array([[1, 0.4 * (-1) ** env.steps_since_reset[0], 0]], np.float32)
        return before(actions)

    env.step = swaying
    outcome = roll_out(env, still(env), 4.0, np.array([[1, 0, 0]], np.float32))
    score = score_of(outcome, np.ones(1, bool), patches=False)
    assert score.lin_vel_error == pytest.approx(0.4)
    assert score.lin_vel_error_1s == pytest.approx(0, abs=1e-6)


def test_each_new_command_has_its_time_to_settle(sliding):
    env = sliding([[1, 0, 0]])
    commands = np.array([[[1, 0, 0]], [[0, 0, 0]]], np.float32)
    outcome = roll_out(env, still(env), 6.0, commands)
    assert outcome.counts[0].item() == 2 * round((3 - SETTLING) / env.cfg.dt)
    assert outcome.sums[0].item() / outcome.counts[0].item() == pytest.approx(0.5)


def test_a_heading_changes_the_turning_speed_and_is_no_new_command(sliding):
    commands = Commands(heading_command=True, min_norm=0.0, standing=0.0)
    env = sliding([[1, 0, 0]], commands=commands)
    turning = []
    outcome = roll_out(
        env, still(env), 3.0, None, lambda _: turning.append(float(env.commands[0, 2]))
    )
    assert len(set(turning)) > 1
    assert outcome.counts[0].item() == round((3 - SETTLING) / env.cfg.dt)


def test_a_turning_speed_that_is_held_is_a_command_even_where_headings_are_asked_for(sliding):
    env = sliding([[1, 0, 0]], commands=Commands(heading_command=True))
    commands = np.array([[[1, 0, 0]], [[1, 0, 0.5]]], np.float32)
    outcome = roll_out(env, still(env), 6.0, commands)
    assert outcome.counts[0].item() == 2 * round((3 - SETTLING) / env.cfg.dt)


def test_a_fall_counts_once_and_ends_the_measuring(sliding):
    env = sliding([[0, 0, 0], [0, 0, 0], [0, 0, 0]], falls=[0, 3.0, 1.0])
    before = env.step

    def again(actions):
        if env.now == 160:
            env.falls = np.array([0, 3.2, 3.2])  # and once more, after a new start
        return before(actions)

    env.now, env.step = 0, again
    outcome = roll_out(env, still(env), 4.0, np.tile(np.float32([1, 0, 0]), (3, 1)))
    assert outcome.fell.tolist() == [False, True, True]
    assert outcome.counts[0].tolist() == [100, 49, 0]
    lost = score_of(outcome, np.array([False, False, True]), patches=False)
    assert (lost.falls, lost.robots, lost.lin_vel_error) == (1, 1, None)


def test_falls_of_the_physics_are_seen(run_of):
    run = run_of()
    env, commands = prepared(run, Asked(num_envs=2, command=(0, 0, 0), seconds=1))
    outcome = roll_out(env, limp(env), 1.0, commands)
    assert outcome.fell.tolist() == [True, False]


def test_who_crosses_half_a_patch_succeeds_and_is_judged_no_longer(sliding, map_ground):
    # Patches are 6 m long: half is crossed after 3 s at 1 m/s, before the falls after that.
    moves = [[1, 0, 0], [1, 0, 0], [0.3, 0, 0], [0.7, 0, 0], [1, 0, 0]]
    env = sliding(moves, falls=[0, 3.5, 0, 0, 2.0], ground=map_ground)
    outcome = roll_out(env, still(env), 4.0, np.tile(np.float32([1, 0, 0]), (5, 1)))
    assert outcome.fell.tolist() == [False, False, False, False, True]
    # The third came not half as far as it was asked to, the fourth did.
    assert outcome.success.tolist() == [True, True, False, True, False]
    assert outcome.counts[0, 1] == outcome.counts[0, 0] < 100
    score = score_of(outcome, np.ones(5, bool), patches=True)
    assert (score.success, score.falls) == (0.6, 1)


def test_it_ends_when_every_trial_has(sliding, map_ground):
    done = []
    env = sliding([[0, 0, 0]], falls=[0.1], ground=map_ground)
    roll_out(env, still(env), 4.0, np.zeros((1, 3), np.float32), done.append)
    assert len(done) == 5
    env = sliding([[0, 0, 0]], falls=[0.1], ground=map_ground)
    roll_out(env, still(env), 0.4, np.zeros((1, 3), np.float32), done.append, to_the_end=True)
    assert len(done) == 25
    assert done[-1] == 1
