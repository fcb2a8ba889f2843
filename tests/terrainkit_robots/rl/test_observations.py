import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from terrainkit_robots.rl.config import (
    Commands,
    Noise,
    Normalization,
    Observations,
    ObsScales,
    Task,
    Terrain,
)
from terrainkit_robots.rl.observations import (
    compute_observations,
    history_length,
    policy_terms,
    privileged_terms,
)
from tests.tables import read_table
from tests.terrainkit_robots.rl.made_states import made_env, shapes

_SHAPES = shapes(joints=12, feet=4, penalized=8, points=187)

_TASK_TABLE = read_table(__file__, "task_table")
"""Terms of the policy group in order: 47 numbers for 12 joints, and the height scan."""

_SECRETS = read_table(__file__, "secrets")


@pytest.fixture(scope="module")
def make(quadruped):
    """Return a function that makes n robots whose arrays are 0 except for the given ones."""

    def make(n=1, task=None, robot=quadruped, **arrays):
        return made_env(robot, task or Task(), _SHAPES, n, **arrays)

    return make


def compute(group, given, rng=None):
    return compute_observations(given, group, rng)


def observed(group, name, given):
    """Return the values of one term, without noise."""
    return compute({name: group[name]}, given)[0].tolist()


def slices(group, given):
    found, start = {}, 0
    for name, each in group.items():
        stop = start + each.function(given).shape[1]
        found[name], start = slice(start, stop), stop
    return found


_BY_HAND = tomllib.loads(Path(__file__).with_name("observations.toml").read_text())


@pytest.mark.parametrize("name", _BY_HAND)
def test_term_by_hand(make, name):
    expected = _BY_HAND[name]["seen"]
    env = make(**{key: array for key, array in _BY_HAND[name].items() if key != "seen"})
    found = observed(privileged_terms(env), name, env)
    assert found == pytest.approx(expected + [0] * (len(found) - len(expected)), abs=1e-6)


def test_height_scan_by_hand(make):
    # A height of 0.5 m is observed as 0; differences are clipped at 1 m.
    env = make(height_scan=[[0.5, 0.7, 0.3, 9, -9, *[0.5] * 182]])
    found = observed(policy_terms(env), "height_scan", env)
    assert found == pytest.approx([0, 1, -1, 5, -5, *[0] * 182], abs=1e-6)


def test_dof_pos_by_hand(make, quadruped):
    # Measured position, including the joint offset, minus the default pose.
    env = make(dof_pos=quadruped.default_pose + np.float32(0.5), joint_offset=0.125)
    assert observed(policy_terms(env), "dof_pos", env) == pytest.approx([0.625] * 12)
    # Wheels are observed as 0; 100 is the clipping limit.
    wheeled = replace(quadruped, wheels=np.arange(12) % 3 == 2)
    env = make(robot=wheeled, dof_pos=quadruped.default_pose + np.float32(400))
    assert observed(policy_terms(env), "dof_pos", env) == pytest.approx([100, 100, 0] * 4)


def test_every_term_is_tested_by_hand(make):
    assert privileged_terms(make()).keys() == {*_BY_HAND, "dof_pos", "height_scan"}


class TestGroups:
    def test_groups_have_the_documented_terms(self, make):
        env = make(2)
        policy, privileged = policy_terms(env), privileged_terms(env)
        for group, table in ((policy, _TASK_TABLE), (privileged, _TASK_TABLE + _SECRETS)):
            assert [[name, each.function(env).shape[1]] for name, each in group.items()] == table
        assert compute(policy, env).shape == (2, 234)
        env.has_height_scan = False
        assert [*policy] == [*policy_terms(env), "height_scan"]

    @pytest.mark.parametrize(("depth", "seen"), [(None, 1.0), (0.3, 0.134), (5.0, 1.0)])
    def test_height_scan_is_clipped_below_the_feet(self, make, depth, seen):
        scan = policy_terms(make(task=Task(terrain=Terrain(scan_depth=depth))))["height_scan"]
        # The base stands 0.334 m high, and 0.5 m are observed as 0.
        assert scan.clip == (-1.0, pytest.approx(seen))

    def test_observed_velocity_has_a_constant_error(self, nominal_env):
        noise = Noise(lin_vel=0.0, lin_vel_bias=0.4)
        env = nominal_env(400, observations=Observations(base_lin_vel=True), noise=noise)
        for _ in range(2):  # steps of the same episode
            error = env.obs_terms["policy"]["base_lin_vel"].function(env) - env.state.base_lin_vel
            np.testing.assert_allclose(error, env.lin_vel_bias, atol=1e-6)
            env.step(torch.zeros(400, env.num_actions))
        assert 0.39 < np.abs(env.lin_vel_bias).max() <= 0.4

    def test_additional_terms_of_the_policy(self, make):
        options = Observations(base_lin_vel=True, foot_contact=True, history_length=3)
        force = [[9, 9, 1.5], [9, 9, 0.5], [0, 0, 50], [0, 0, -50]]
        task = Task(observations=options)
        env = make(task=task, base_lin_vel=[[1, -0.5, 0.25]], foot_force=[force])
        group = policy_terms(env)
        assert observed(group, "base_lin_vel", env) == [2, -1, 0.5]
        assert observed(group, "foot_contact", env) == [1, 0, 1, 0]
        more = ["gait_phase", "base_lin_vel", "foot_contact", "history", "height_scan"]
        assert [*group][6:] == more
        # The critic knows the velocity anyway, and needs no history.
        assert "history" not in privileged_terms(env)

    @pytest.mark.parametrize(("name", "default"), [("quadruped", 3), ("biped", 5)])
    def test_history_is_longer_on_two_legs_and_none_with_the_velocity(self, request, name, default):
        robot = request.getfixturevalue(name)
        for options, expected in (
            (Observations(), default),
            (Observations(base_lin_vel=True), 1),
            (Observations(base_lin_vel=True, history_length=2), 2),
        ):
            assert history_length(Task(observations=options), robot) == expected

    @pytest.mark.parametrize("gait_period", [0, None])
    @pytest.mark.parametrize("more", [False, True])
    def test_history_repeats_the_terms_before_it(self, nominal_env, gait_period, more):
        options = Observations(base_lin_vel=more, foot_contact=more, history_length=4)
        env = nominal_env(observations=options, commands=Commands(gait_period=gait_period))
        width = 45 + 2 * (gait_period is None) + 7 * more
        assert env.obs_history.shape == (4, 3 * width)
        assert env.obs_sizes["policy"] == 4 * width

    def test_scales_are_the_tasks(self, make, quadruped):
        scales = ObsScales(lin_vel=3, ang_vel=5, dof_pos=7, dof_vel=11, height_measurements=13)
        ones = dict.fromkeys(["commands", "base_lin_vel", "base_ang_vel", "dof_vel"], 1)
        env = make(
            task=Task(normalization=Normalization(obs_scales=scales)),
            **ones,
            dof_pos=quadruped.default_pose + 1,
            height_scan=1.5,
        )
        group = privileged_terms(env)
        seen, here = compute(group, env)[0], slices(group, env)
        for name, expected in {
            "commands": [3, 3, 5],
            "base_ang_vel": [5] * 3,
            "dof_pos": [7] * 12,
            "dof_vel": [11] * 12,
            "height_scan": [13] * 187,
            "base_lin_vel": [3] * 3,
        }.items():
            assert seen[here[name]].tolist() == pytest.approx(expected), name

    def test_values_are_clipped(self, make):
        task = Task(normalization=Normalization(clip_observations=1.25))
        env = make(task=task, dof_vel=[[1e6, -1e6, 30, *[0] * 9]])
        seen = compute(policy_terms(env), env)
        assert seen[0, 21:24].tolist() == [1.25, -1.25, 1.25]
        assert np.abs(seen).max() == 1.25


_NOISE = read_table(__file__, "noise")
"""Half ranges of the noise of the default task, after scaling."""


class TestNoise:
    @pytest.mark.parametrize("level", [1.0, 0.5])
    def test_noise_is_uniform(self, make, quadruped, level):
        task = Task(noise=Noise(noise_level=level))
        given = make(4000, task, projected_gravity=[0, 0, -1], dof_pos=quadruped.default_pose)
        given.state.height_scan[:] = 0.5
        group = policy_terms(given)
        off = compute(group, given, np.random.default_rng(0)) - compute(group, given)
        for name, here in slices(group, given).items():
            drawn = off[:, here]
            most = level * _NOISE.get(name, 0.0)
            if most == 0:
                assert (drawn == 0).all(), name
                continue
            # Uniform over [-most, most]: check the limits, the quartiles and the independence.
            assert most * 0.99 < drawn.max() <= most * 1.001, name
            assert -most * 1.001 <= drawn.min() < -most * 0.99, name
            quarters = np.quantile(drawn / most, [0.25, 0.5, 0.75])
            np.testing.assert_allclose(quarters, [-0.5, 0, 0.5], atol=0.03, err_msg=name)
            assert (drawn.std(axis=0) > 0.5 * most).all(), name
            together = np.corrcoef(drawn[:, 0], drawn[:, 1])[0, 1]
            assert abs(together) < 0.1, name

    def test_noise_levels_are_the_tasks(self, make):
        noise = Noise(dof_pos=1, dof_vel=2, ang_vel=3, gravity=4, height_measurements=5)
        terms = policy_terms(make(task=Task(noise=noise)))
        found = {name: each.noise for name, each in terms.items()}
        levels = {"projected_gravity": 4, "base_ang_vel": 3, "dof_pos": 1, "dof_vel": 2}
        without = {"commands": 0, "actions": 0, "gait_phase": 0}
        assert found == levels | without | {"height_scan": 5}

    def test_noise_level_zero_samples_nothing(self, make):
        env = make(5, Task(noise=Noise(noise_level=0)))
        group, rng = policy_terms(env), np.random.default_rng(0)
        np.testing.assert_array_equal(compute(group, env, rng), compute(group, env))
        # The random generator is not used.
        assert rng.bit_generator.state == np.random.default_rng(0).bit_generator.state

    def test_noise_is_added_before_clipping(self, make):
        limits = Normalization(clip_observations=2.0)
        env = make(50, Task(noise=Noise(dof_vel=1e6), normalization=limits))
        seen = compute(policy_terms(env), env, np.random.default_rng(0))
        assert np.abs(seen).max() == 2.0
