"""Velocity commands: sampling, heading control and resampling."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from terrainkit_robots.description import bundled
from terrainkit_robots.rl.commands import Gait, VelocityCommand, sample_commands
from terrainkit_robots.rl.config import Commands, Control, DomainRand, Env, InitState, Rewards, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.rewards import REWARDS
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.spec.robot import Robot
from terrainkit_robots.transforms import quat_to_yaw

torch.set_num_threads(1)

_MANY = 20_000
_ALL = Commands(min_norm=0.0, standing=0.0)


def draw(settings: Commands, count: int = _MANY, seed: int = 0) -> tuple[Any, Any]:
    return sample_commands(np.random.default_rng(seed), count, settings)


class TestSampleCommands:
    def test_values_fill_their_ranges(self) -> None:
        settings = replace(
            _ALL, lin_vel_x=(-0.5, 2), lin_vel_y=(0.25, 0.5), ang_vel_yaw=(-3, -1), heading=(-1, 2)
        )
        commands, heading = draw(settings)
        values = np.column_stack([commands, heading])
        low, high = np.array([(-0.5, 2), (0.25, 0.5), (-3, -1), (-1, 2)]).T
        assert (values >= low).all()
        assert (values <= high).all()
        for share, quantile in enumerate((0.0, 0.25, 0.5, 0.75, 1.0)):
            expected = low + (high - low) * share / 4
            found = np.quantile(values, quantile, axis=0)
            np.testing.assert_allclose(found, expected, atol=0.03 * (high - low).max())

    def test_shapes_and_dtypes(self) -> None:
        for count in (0, 1, 5):
            commands, heading = draw(Commands(), count)
            assert commands.shape == (count, 3)
            assert heading.shape == (count,)
            assert commands.dtype == heading.dtype == np.float32

    def test_zero_width_range_is_constant(self) -> None:
        settings = replace(_ALL, lin_vel_x=(0.5, 0.5), lin_vel_y=(0, 0), ang_vel_yaw=(0.3, 0.3))
        commands, _ = draw(settings, 3)
        np.testing.assert_allclose(commands, np.tile([0.5, 0, 0.3], (3, 1)), rtol=1e-6)

    def test_small_commands_become_zero(self) -> None:
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
    def test_standing_fraction(self, share: float) -> None:
        commands, heading = draw(replace(_ALL, standing=share))
        stands = (commands == 0).all(axis=1)
        assert stands.mean() == pytest.approx(share, abs=0.015)
        # A command to stand has no heading.
        np.testing.assert_array_equal(np.isnan(heading), stands)

    def test_same_seed_gives_same_values(self) -> None:
        one, other = draw(Commands(), seed=4), draw(Commands(), seed=4)
        np.testing.assert_array_equal(one[0], other[0])
        np.testing.assert_array_equal(one[1], other[1])
        assert (draw(Commands(), seed=5)[0] != one[0]).any()


class TestHeading:
    def turn(self, heading: float, yaw: float, **settings: Any) -> float:
        command = VelocityCommand(Commands(**settings), 1, 0.02, heading_command=True)
        command.heading[:] = heading
        command.update_heading(np.array([yaw], np.float32), np.zeros((1, 2), np.float32))
        return float(command.commands[0, 2])

    def test_by_hand(self) -> None:
        assert self.turn(1.0, 0.2) == pytest.approx(0.4)
        assert self.turn(0.2, 1.0) == pytest.approx(-0.4)
        assert self.turn(0.7, 0.7) == 0
        assert self.turn(1.0, 0.2, heading_stiffness=1.0) == pytest.approx(0.8)

    def test_yaw_rate_takes_the_short_way(self) -> None:
        # The short way from 3 rad to -3 rad is 0.2832 rad to the left.
        assert self.turn(-3, 3) == pytest.approx(0.5 * 0.2832, abs=1e-4)
        assert self.turn(3, -3) == pytest.approx(-0.5 * 0.2832, abs=1e-4)

    def test_yaw_rate_is_clipped(self) -> None:
        assert self.turn(3, 0, ang_vel_yaw=(-0.5, 0.75)) == 0.75
        assert self.turn(-3, 0, ang_vel_yaw=(-0.5, 0.75)) == -0.5

    def test_nan_heading_gives_zero_yaw_rate(self) -> None:
        assert self.turn(np.nan, 2) == 0

    def test_heading_control_converges(self) -> None:
        yaw = np.array([-3.0, 0.1, 2.5], np.float32)
        heading = np.array([3.0, -1.0, 0.0], np.float32)
        command = VelocityCommand(Commands(), 3, 0.02, heading_command=True)
        command.heading[:] = heading
        for _ in range(1000):
            command.update_heading(yaw, np.zeros((len(yaw), 2), np.float32))
            yaw += np.float32(0.02) * command.commands[:, 2]
        off = np.angle(np.exp(1j * (heading - yaw)))
        np.testing.assert_allclose(off, 0, atol=1e-3)


class TestHeadingCommand:
    @pytest.mark.parametrize(
        ("given", "level", "expected"),
        [(None, True, False), (None, False, True), (True, True, True), (False, False, False)],
    )
    def test_default_depends_on_flatness(
        self, given: bool | None, *, level: bool, expected: bool
    ) -> None:
        ground = Plane()
        ground.is_flat = level
        settings = Commands(heading_command=given, standing=0.0)
        env = make_env(ground=ground, commands=settings)
        assert env.velocity_command.heading_command == expected
        before = env.commands[:, 2].copy()
        yaw = quat_to_yaw(env.state.base_quat) + np.float32(0.5)
        env.velocity_command.update_heading(yaw, env.state.base_pos[:, :2])
        assert (env.commands[:, 2] != before).any() == expected


class TestGait:
    FEET = np.array([[1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]], np.float32)

    def test_four_legs_trot_and_two_walk(self) -> None:
        assert Gait(Commands(), 0.5, self.FEET).offset.tolist() == [0.5, 0, 0, 0.5]
        assert Gait(Commands(), 0.5, self.FEET[:2]).offset.tolist() == [0.5, 0]

    def test_six_legs_walk_in_tripods(self) -> None:
        feet = np.array([[x, y, 0] for x in (1, 0, -1) for y in (1, -1)], np.float32)
        assert Gait(Commands(), 0.5, feet).offset.tolist() == [0.5, 0, 0, 0.5, 0.5, 0]

    def test_default_period_grows_with_the_leg(self) -> None:
        assert Gait(Commands(), 9.81, self.FEET).period == pytest.approx(2.3)
        assert Gait(Commands(), 9.81, self.FEET[:2]).period == pytest.approx(3.0)
        assert Gait(Commands(gait_period=0.4), 9.81, self.FEET).period == 0.4

    def test_phases_by_hand(self) -> None:
        gait = Gait(Commands(gait_period=0.4, swing_fraction=0.5), 0.5, self.FEET)
        phase, swing = gait.phases(np.array([0.1, 0.3, 0.3]), np.array([True, True, False]))
        np.testing.assert_allclose(phase, [[1, 0], [-1, 0], [0, 0]], atol=1e-6)
        # A quarter of the period is half of a swing.
        expected = [[0, 0.5, 0.5, 0], [0.5, 0, 0, 0.5], [0, 0, 0, 0]]
        np.testing.assert_allclose(swing, expected, atol=1e-6)

    def test_no_period_is_no_gait(self) -> None:
        phase, swing = Gait(Commands(gait_period=0), 0.5, self.FEET).phases(
            np.array([0.1]), np.array([True])
        )
        assert not phase.any()
        assert not swing.any()


def make_env(num_envs: int = 4, **changes: Any) -> LeggedEnv:
    """Return an environment without pushes and random velocities."""
    task = Task(
        env=changes.pop("env", Env(num_envs=num_envs, num_threads=1)),
        init_state=InitState(lin_vel=0, ang_vel=0, reset_range=(1, 1)),
        domain_rand=DomainRand(push_interval_s=0, joint_offset=0),
        control=Control(decimation=changes.pop("decimation", 4)),
    )
    robot = Robot.load(Path(str(bundled.urdf_path("quadruped"))).parent)
    ground = changes.pop("ground", Plane())
    return LeggedEnv(replace(task, **changes), robot, ground)


def run(env: LeggedEnv, steps: int) -> list[Any]:
    """Step the environment, and return the commands after each step."""
    seen = []
    for _ in range(steps):
        env.step(torch.zeros(env.num_envs, env.num_actions))
        seen.append(env.state.commands.copy())
    return seen


class TestInEnvironment:
    def test_commands_are_resampled_every_10_s(self) -> None:
        env = make_env(commands=Commands(standing=0))
        first = env.state.commands.copy()
        assert env.cfg.dt == pytest.approx(0.02)
        seen = run(env, 3)
        env.steps_since_reset[:] = 497  # of the episode, as after 9.94 s
        seen += run(env, 4)
        assert not env.state.fallen.any()
        for commands in seen[:5]:  # what is observed after step k is for step k + 1
            np.testing.assert_array_equal(commands, first)
        assert (seen[5] != first).any(axis=1).all()
        np.testing.assert_array_equal(seen[6], seen[5])

    def test_resampling_time_is_the_tasks(self) -> None:
        env = make_env(commands=Commands(standing=0, resampling_time=0.1))
        seen = [env.state.commands.copy(), *run(env, 12)]
        new = [bool((a != b).any()) for a, b in pairwise(seen)]
        assert [k + 1 for k, is_new in enumerate(new) if is_new] == [5, 10]

    def test_commands_are_resampled_at_reset(self) -> None:
        env = make_env(commands=Commands(standing=0, min_norm=0))
        first = env.state.commands.copy()
        env.sim.qpos[1, 3:7] = (0, 1, 0, 0)
        [after] = run(env, 1)
        assert (after != first).any(axis=1).tolist() == [False, True, False, False]

    def test_observation_has_the_commands(self) -> None:
        env = make_env()
        run(env, 3)
        scaled = env.commands * np.array([2, 2, 0.25], np.float32)
        np.testing.assert_allclose(env.get_observations()["policy"][:, :3], scaled)

    def test_reward_uses_the_commands_of_the_step(self) -> None:
        """The reward must not use the commands that were just sampled for the next step."""
        only = Rewards(**{**dict.fromkeys(REWARDS, 0.0), "tracking_lin_vel": 1.0})
        env = make_env(
            commands=Commands(standing=0, min_norm=0, resampling_time=0.02), rewards=only
        )
        for _ in range(3):
            expected = env.commands.copy()
            _, rewards, *_ = env.step(torch.zeros(4, 12))
            off = np.square(expected - env.state.mean_vel)[:, :2].sum(axis=1)
            share = off / np.square(expected[:, :2]).sum(axis=1)
            np.testing.assert_allclose(rewards, 0.02 * 0.25**share, rtol=1e-4)
            assert (env.commands != expected).any()

    def test_yaw_rate_follows_the_heading(self) -> None:
        env = make_env(commands=Commands(heading_command=True, standing=0))
        run(env, 2)
        quat = env.state.base_quat
        yaw = 2 * np.arctan2(quat[:, 3], quat[:, 0])
        off = np.angle(np.exp(1j * (env.velocity_command.heading - yaw)))
        np.testing.assert_allclose(env.commands[:, 2], np.clip(0.5 * off, -1, 1), atol=2e-3)

    def test_yaw_rate_follows_heading_at_reset(self) -> None:
        env = make_env(commands=Commands(heading_command=True, standing=0))
        quat = env.state.base_quat
        yaw = 2 * np.arctan2(quat[:, 3], quat[:, 0])
        off = np.angle(np.exp(1j * (env.velocity_command.heading - yaw)))
        np.testing.assert_allclose(env.commands[:, 2], np.clip(0.5 * off, -1, 1), atol=2e-3)

    def test_fixed_commands_persist(self) -> None:
        env = make_env(commands=Commands(resampling_time=0.06, heading_command=True))
        held = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]], np.float32)
        env.set_commands(held)
        scaled = held * np.array([2, 2, 0.25], np.float32)
        np.testing.assert_array_equal(env.get_observations()["policy"][:, :3], scaled)
        env.sim.qpos[1, 3:7] = (0, 1, 0, 0)  # a new episode changes nothing
        for commands in run(env, 8):
            np.testing.assert_array_equal(commands, held)

    def test_fixed_commands_survive_reset(self) -> None:
        env = make_env(commands=Commands(standing=0))
        held = np.tile(np.array([0.5, 0, 0], np.float32), (4, 1))
        env.set_commands(held)
        env.reset()
        np.testing.assert_array_equal(env.state.commands, held)
        np.testing.assert_array_equal(env.get_observations()["policy"][:, 0], [1.0] * 4)

    def test_fixed_commands_can_be_released(self) -> None:
        env = make_env(commands=Commands(standing=0, resampling_time=0.04))
        held = np.tile(np.array([5, 5, 5], np.float32), (4, 1))
        env.set_commands(held)
        run(env, 1)
        env.set_commands(None)
        assert np.abs(env.state.commands).max() <= 1
        assert np.abs(run(env, 3)[-1]).max() <= 1
