from dataclasses import replace

import numpy as np
import pytest
import torch

from terrainkit.perception.orientation import quat_to_yaw
from terrainkit_robots.rl.commands import Gait, VelocityCommand, sample_commands
from terrainkit_robots.rl.config import Commands, Env, Rewards
from terrainkit_robots.rl.rewards import REWARDS
from terrainkit_robots.rl.terrain import Plane

_ALL = Commands(min_norm=0.0, standing=0.0)


def draw(cfg, count=20_000, seed=0):
    return sample_commands(np.random.default_rng(seed), count, cfg)


class TestSampleCommands:
    def test_values_fill_their_ranges(self):
        ranges = {"lin_vel_x": (-0.5, 2), "lin_vel_y": (0.25, 0.5), "ang_vel_yaw": (-3, -1)}
        commands, heading = draw(replace(_ALL, **ranges, heading=(-1, 2)))
        values = np.column_stack([commands, heading])
        low, high = np.array([*ranges.values(), (-1, 2)]).T
        assert (values >= low).all()
        assert (values <= high).all()
        for quantile in (0.0, 0.25, 0.5, 0.75, 1.0):
            found = np.quantile(values, quantile, axis=0)
            expected = low + (high - low) * quantile
            np.testing.assert_allclose(found, expected, atol=0.03 * (high - low).max())

    def test_small_commands_become_zero(self):
        commands, _ = draw(replace(_ALL, lin_vel_y=(-1, 1), min_norm=0.4))
        speed, turn = np.hypot(commands[:, 0], commands[:, 1]), np.abs(commands[:, 2])
        assert (speed[speed > 0] >= 0.4).all()
        assert (turn[turn > 0] >= 0.4).all()
        # The area of a disk of radius 0.4 in a square of side 2, and 0.4 of the yaw range.
        assert (speed == 0).mean() == pytest.approx(np.pi * 0.16 / 4, abs=0.01)
        assert (turn == 0).mean() == pytest.approx(0.4, abs=0.015)
        assert ((speed == 0) & (turn > 0)).any()
        assert ((commands[:, 0] != 0) & (np.abs(commands[:, 0]) < 0.1)).any()  # the norm counts

    @pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
    def test_standing_fraction(self, share):
        commands, heading = draw(replace(_ALL, standing=share))
        stands = (commands == 0).all(axis=1)
        assert stands.mean() == pytest.approx(share, abs=0.015)
        np.testing.assert_array_equal(np.isnan(heading), stands)  # to stand has no heading


class TestHeading:
    @pytest.mark.parametrize(
        ("heading", "yaw", "cfg", "rate"),
        [
            (1.0, 0.2, Commands(), 0.4),
            (0.2, 1.0, Commands(), -0.4),
            (0.7, 0.7, Commands(), 0),
            (1.0, 0.2, Commands(heading_stiffness=1.0), 0.8),
            # The short way from 3 rad to -3 rad is 0.2832 rad to the left.
            (-3, 3, Commands(), 0.1416),
            (3, -3, Commands(), -0.1416),
            (3, 0, Commands(ang_vel_yaw=(-0.5, 0.75)), 0.75),
            (-3, 0, Commands(ang_vel_yaw=(-0.5, 0.75)), -0.5),
            (np.nan, 2, Commands(), 0),
        ],
    )
    def test_yaw_rate_by_hand(self, heading, yaw, cfg, rate):
        command = VelocityCommand(cfg, 1, 0.02, heading_command=True)
        command.heading[:] = heading
        command.update(np.float32([yaw]), np.zeros((1, 2), np.float32))
        assert command.values[0, 2] == pytest.approx(rate, abs=1e-4)

    def test_yaw_rate_of_fixed_commands(self):
        command = VelocityCommand(Commands(), 2, 0.02, heading_command=True)
        command.heading[:] = 1.0
        command.fixed = np.float32([[1, 0, 0.25], [0, 0, -0.5]])
        command.update(np.zeros(2, np.float32), np.zeros((2, 2), np.float32))
        assert command.yaw_rate(np.zeros(2, np.float32)).tolist() == [0.25, -0.5]

    @pytest.mark.parametrize(
        ("setting", "is_plane", "expected"),
        [(None, True, False), (None, False, True), (True, True, True), (False, False, False)],
    )
    def test_heading_is_commanded_on_uneven_ground(self, random_env, setting, is_plane, expected):
        ground = Plane()
        ground.is_plane = is_plane
        env = random_env(ground=ground, commands=Commands(heading_command=setting, standing=0.0))
        before = env.commands[:, 2].copy()
        yaw = quat_to_yaw(env.state.base_quat) + np.float32(0.5)
        env.velocity_command.update(yaw, env.state.base_pos[:, :2])
        assert (env.commands[:, 2] != before).any() == expected


def test_no_command_is_backward_in_the_first_steps():
    cfg = Commands(forward_steps=2, resampling_time=0.02)
    command, rng = VelocityCommand(cfg, 1000, 0.02, heading_command=False), np.random.default_rng(0)
    command.resample(rng, np.arange(1000))
    slowest = [command.values[:, 0].min()]
    for step in (1, 2, 3):
        command.resample_due(rng, np.full(1000, step))
        slowest.append(command.values[:, 0].min())
    assert slowest[:2] == [0, 0]
    np.testing.assert_allclose(slowest[2:], -1, atol=0.01)


class TestCurriculum:
    """Four robots; the range grows when as many episodes have ended."""

    @pytest.fixture
    def make(self):
        def make(low=-1.0, high=1.0, most=2.0, **options):
            cfg = Commands(lin_vel_x=(low, high), max_curriculum=most, **options)
            return VelocityCommand(cfg, 4, 0.02, heading_command=False)

        return make

    @pytest.mark.parametrize(("share", "expected"), [(0.49, [-1, 1]), (0.51, [-1.5, 1.5])])
    def test_range_grows_above_half_of_the_reward(self, make, share, expected):
        command = make(curriculum=True)
        command.end_episodes(np.full(3, share, np.float32))
        assert command.lin_vel_x.tolist() == [-1, 1]  # too few episodes
        command.end_episodes(np.full(1, share, np.float32))
        assert command.lin_vel_x.tolist() == expected
        command.end_episodes(np.full(4, 0.495, np.float32))  # the sums start again
        assert command.lin_vel_x.tolist() == expected

    def test_mean_of_all_episodes_counts(self, make):
        command = make(curriculum=True)
        command.end_episodes(np.float32([1, 0.25]))
        command.end_episodes(np.float32([0.25, 0.25, 0.7]))
        assert command.lin_vel_x.tolist() == [-1, 1]  # 2.45 / 5
        command.end_episodes(np.float32([1, 1, 1, 0.25]))
        assert command.lin_vel_x.tolist() == [-1.5, 1.5]

    def test_range_ends_at_max_curriculum(self, make):
        command = make(-0.25, 1.75, curriculum=True)
        for expected in ([-0.75, 2], [-1.25, 2], [-1.75, 2], [-2, 2], [-2, 2]):
            command.end_episodes(np.ones(4, np.float32))
            assert command.lin_vel_x.tolist() == expected

    def test_range_beyond_max_curriculum_is_kept(self, make):
        command = make(-1, 3, curriculum=True)
        command.end_episodes(np.ones(4, np.float32))
        assert command.lin_vel_x.tolist() == [-1.5, 3]

    def test_range_is_fixed_without_curriculum(self, make):
        command = make()
        command.end_episodes(np.ones(40, np.float32))
        assert command.lin_vel_x.tolist() == [-1, 1]

    def test_commands_are_sampled_from_the_range(self, make):
        command, rng = make(curriculum=True, standing=0, min_norm=0), np.random.default_rng(0)
        seen = []
        for _ in range(2):
            drawn = []
            for _ in range(200):
                command.resample(rng, np.arange(4))
                drawn.append(command.values[:, 0].copy())
            seen.append((np.min(drawn), np.max(drawn)))
            command.end_episodes(np.ones(4, np.float32))
        np.testing.assert_allclose(seen, [[-1, 1], [-1.5, 1.5]], atol=0.02)

    def test_episodes_report_their_share_of_the_tracking_reward(self, nominal_env, monkeypatch):
        """An episode that ends after a quarter of its time earned a quarter at most."""
        shares = []
        monkeypatch.setattr(VelocityCommand, "end_episodes", lambda _, each: shares.append(each))
        only = Rewards(**{**dict.fromkeys(REWARDS, 0.0), "tracking_lin_vel": 2.0})
        env = nominal_env(
            env=Env(num_envs=4, num_threads=1, episode_length_s=0.4),
            rewards=replace(only, tracking_sigma=1e9),
        )
        env.set_commands(np.zeros((4, 3), np.float32))
        run(env, 4)
        env.sim.qpos[1, 3:7] = (0, 1, 0, 0)
        run(env, 16)
        assert [len(each) for each in shares] == [1, 3]
        assert np.concatenate(shares) == pytest.approx([0.25, 1, 1, 1], abs=0.01)


class TestGait:
    FEET = np.float32([[1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]])
    SIX = np.float32([[x, y, 0] for x in (1, 0, -1) for y in (1, -1)])

    @pytest.mark.parametrize(
        ("feet", "offset", "period"),
        [
            (FEET, [0.5, 0, 0, 0.5], 2.3),  # a trot
            (FEET[:2], [0.5, 0], 3.0),
            (FEET[:2] - [0, 1, 0], [0.5, 0], 3.0),  # the frame of the base is at the left foot
            (np.add(FEET[1::-1], [0, 3, 0]), [0, 0.5], 3.0),
            (SIX, [0.5, 0, 0, 0.5, 0.5, 0], 2.3),  # tripods
        ],
    )
    def test_offsets_and_default_period(self, feet, offset, period):
        gait = Gait(Commands(), 9.81, feet)  # the unit of time is 1 s
        assert (gait.offset.tolist(), gait.period) == (offset, pytest.approx(period))
        assert Gait(Commands(), 9.81 / 4, feet).period == pytest.approx(period / 2)
        assert Gait(Commands(gait_period=0.4), 9.81, feet).period == 0.4

    def test_phases_by_hand(self):
        gait = Gait(Commands(gait_period=0.4, swing_fraction=0.5), 0.5, self.FEET)
        phase, swing = gait.phases(np.array([0.1, 0.3, 0.3]), np.array([True, True, False]))
        np.testing.assert_allclose(phase, [[1, 0], [-1, 0], [0, 0]], atol=1e-6)
        # A quarter of the period is half of a swing.
        expected = [[0, 0.5, 0.5, 0], [0.5, 0, 0, 0.5], [0, 0, 0, 0]]
        np.testing.assert_allclose(swing, expected, atol=1e-6)

    def test_no_period_is_no_gait(self):
        gait = Gait(Commands(gait_period=0), 0.5, self.FEET)
        assert not np.hstack(gait.phases(np.array([0.1]), np.array([True]))).any()


def run(env, steps):
    """Step the environment, and return the commands after each step."""
    seen = []
    for _ in range(steps):
        env.step(torch.zeros(env.num_envs, env.num_actions))
        seen.append(env.state.commands.copy())
    return seen


class TestResampling:
    def test_interval_is_the_tasks(self, nominal_env):
        assert Commands().resampling_time == 10
        env = nominal_env(commands=Commands(standing=0, resampling_time=0.1))
        # What is observed after step k is for step k + 1.
        seen = np.array([env.state.commands.copy(), *run(env, 12)])
        assert np.flatnonzero((np.diff(seen, axis=0) != 0).any(axis=(1, 2))).tolist() == [4, 9]

    def test_commands_are_resampled_at_reset(self, nominal_env):
        env = nominal_env(commands=Commands(standing=0, min_norm=0))
        first = env.state.commands.copy()
        env.sim.qpos[1, 3:7] = (0, 1, 0, 0)
        [after] = run(env, 1)
        assert (after != first).any(axis=1).tolist() == [False, True, False, False]

    def test_reward_is_that_of_the_previous_commands(self, nominal_env):
        """The reward must not use the commands that were just sampled for the next step."""
        only = Rewards(**{**dict.fromkeys(REWARDS, 0.0), "tracking_lin_vel": 1.0})
        commands = Commands(standing=0, min_norm=0, resampling_time=0.02)
        env = nominal_env(commands=commands, rewards=only)
        for _ in range(3):
            expected = env.commands.copy()
            _, rewards, *_ = env.step(torch.zeros(4, 12))
            error = np.square(expected - env.state.mean_vel)[:, :2].sum(axis=1)
            wide = 0.25 ** (error / np.square(expected[:, :2]).sum(axis=1))
            np.testing.assert_allclose(rewards, 0.02 * (wide + wide**8) / 2, rtol=1e-4)
            assert (env.commands != expected).any()
