import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from terrainkit_robots.rl.config import (
    Commands,
    Noise,
    Normalization,
    Observations,
    ObsScales,
    Task,
)
from terrainkit_robots.rl.observations import (
    compute_observations,
    history_width,
    policy_group,
    privileged_group,
)
from tests.terrainkit_robots.rl.made_states import made_state, shapes

_SHAPES = shapes(joints=12, feet=4, penalized=8, points=187)

_TASK_TABLE = [
    ("commands", 3),
    ("projected_gravity", 3),
    ("base_ang_vel", 3),
    ("dof_pos", 12),
    ("dof_vel", 12),
    ("actions", 12),
    ("gait_phase", 2),
    ("height_scan", 187),
]
"""Terms of the policy group in order: 47 numbers for 12 joints, and the height scan."""

_SECRETS = [
    ("base_lin_vel", 3),
    ("mean_vel", 3),
    ("friction", 1),
    ("added_mass", 1),
    ("com_shift", 3),
    ("joint_offset", 12),
    ("push_vel", 3),
    ("foot_force", 12),
]


def state(n=1, **arrays):
    """Return a state of n quadrupeds that is 0 except for the given arrays."""
    return made_state(_SHAPES, n, **arrays)


def group_of(robot, task=None):
    return policy_group(robot, task or Task(), scan=True)


def privileged_of(robot, task=None):
    return privileged_group(robot, task or Task(), scan=True, weight=100.0)


def observed(group, name, given):
    """Return the values of one term, without noise."""
    [only] = [each for each in group if each.name == name]
    return compute_observations([only], given, 100.0)[0].tolist()


def slices(group, given):
    found, start = {}, 0
    for each in group:
        stop = start + each.function(given).shape[1]
        found[each.name], start = slice(start, stop), stop
    return found


_BY_HAND = tomllib.loads(Path(__file__).with_name("observations.toml").read_text())


@pytest.mark.parametrize("name", _BY_HAND)
def test_term_by_hand(quadruped, name):
    expected = _BY_HAND[name]["seen"]
    arrays = {key: array for key, array in _BY_HAND[name].items() if key != "seen"}
    found = observed(privileged_of(quadruped), name, state(**arrays))
    assert found == pytest.approx(expected + [0] * (len(found) - len(expected)), abs=1e-6)


def test_height_scan_by_hand(quadruped):
    # A height of 0.5 m is observed as 0; differences are clipped at 1 m.
    given = state(height_scan=[[0.5, 0.7, 0.3, 9, -9, *[0.5] * 182]])
    found = observed(group_of(quadruped), "height_scan", given)
    assert found == pytest.approx([0, 1, -1, 5, -5, *[0] * 182], abs=1e-6)


def test_dof_pos_by_hand(quadruped):
    # Measured position, including the joint offset, minus the default pose.
    given = state(dof_pos=quadruped.default_pose + np.float32(0.5), joint_offset=0.125)
    assert observed(group_of(quadruped), "dof_pos", given) == pytest.approx([0.625] * 12)
    # Wheels are observed as 0; 100 is the clipping limit.
    wheeled = replace(quadruped, wheels=np.arange(12) % 3 == 2)
    given = state(dof_pos=quadruped.default_pose + np.float32(400))
    assert observed(group_of(wheeled), "dof_pos", given) == pytest.approx([100, 100, 0] * 4)


def test_every_term_is_tested_by_hand(quadruped):
    assert {each.name for each in privileged_of(quadruped)} == {*_BY_HAND, "dof_pos", "height_scan"}


class TestGroups:
    def test_groups_have_the_documented_terms(self, quadruped):
        policy, privileged = group_of(quadruped), privileged_of(quadruped)
        for group, table in ((policy, _TASK_TABLE), (privileged, _TASK_TABLE + _SECRETS)):
            assert [(each.name, each.function(state()).shape[1]) for each in group] == table
        assert policy_group(quadruped, Task(), scan=False) != policy
        assert compute_observations(policy, state(2), 100.0).shape == (2, 234)
        assert {each.noise for each in privileged} == {0.0}

    def test_additional_terms_of_the_policy(self, quadruped):
        options = Observations(base_lin_vel=True, foot_contact=True, history_length=3)
        force = [[9, 9, 1.5], [9, 9, 0.5], [0, 0, 50], [0, 0, -50]]
        given = state(base_lin_vel=[[1, -0.5, 0.25]], foot_force=[force])
        group = group_of(quadruped, Task(observations=options))
        assert observed(group, "base_lin_vel", given) == [2, -1, 0.5]
        assert observed(group, "foot_contact", given) == [1, 0, 1, 0]
        names = [each.name for each in group]
        assert names[6:] == ["gait_phase", "base_lin_vel", "foot_contact", "history", "height_scan"]
        # The critic knows the velocity anyway, and needs no history.
        names = [each.name for each in privileged_of(quadruped, Task(observations=options))]
        assert names.count("base_lin_vel") == names.count("foot_contact") == 1
        assert "history" not in names

    @pytest.mark.parametrize(("name", "default"), [("quadruped", False), ("biped", True)])
    def test_two_legs_observe_the_linear_velocity(self, request, name, default):
        legged = request.getfixturevalue(name)
        for setting in (None, not default):
            task = Task(observations=Observations(base_lin_vel=setting, history_length=2))
            observed = default if setting is None else setting
            names = [each.name for each in policy_group(legged, task, scan=False)]
            assert ("base_lin_vel" in names) == observed
            assert history_width(legged, task, 8) == 11 + 2 * 12 + 8 + 3 * observed

    @pytest.mark.parametrize("gait_period", [0, None])
    @pytest.mark.parametrize("more", [False, True])
    def test_history_repeats_the_terms_before_it(self, quadruped, gait_period, more):
        options = Observations(base_lin_vel=more, foot_contact=more, history_length=4)
        task = Task(observations=options, commands=Commands(gait_period=gait_period))
        width = 45 + 2 * (gait_period is None) + 7 * more
        assert history_width(quadruped, task, 12) == 3 * width
        before = [t for t in group_of(quadruped, task) if t.name not in ("history", "height_scan")]
        assert compute_observations(before, state(), 100.0).shape == (1, width)

    def test_scales_are_the_tasks(self, quadruped):
        scales = ObsScales(lin_vel=3, ang_vel=5, dof_pos=7, dof_vel=11, height_measurements=13)
        task = Task(normalization=Normalization(obs_scales=scales))
        ones = dict.fromkeys(["commands", "base_lin_vel", "base_ang_vel", "dof_vel"], 1)
        given = state(**ones, dof_pos=quadruped.default_pose + 1, height_scan=1.5)
        seen = compute_observations(privileged_of(quadruped, task), given, 100.0)[0]
        here = slices(privileged_of(quadruped), given)
        for name, expected in {
            "commands": [3, 3, 5],
            "base_ang_vel": [5] * 3,
            "dof_pos": [7] * 12,
            "dof_vel": [11] * 12,
            "height_scan": [13] * 187,
            "base_lin_vel": [3] * 3,
        }.items():
            assert seen[here[name]].tolist() == pytest.approx(expected), name

    def test_values_are_clipped(self, quadruped):
        given = state(dof_vel=[[1e6, -1e6, 30, *[0] * 9]])
        seen = compute_observations(group_of(quadruped), given, 1.25)
        assert seen[0, 21:24].tolist() == [1.25, -1.25, 1.25]
        assert np.abs(seen).max() == 1.25


_NOISE = {
    "projected_gravity": 0.05,
    "base_ang_vel": 0.2 * 0.25,
    "dof_pos": 0.01,
    "dof_vel": 1.5 * 0.05,
    "height_scan": 0.1 * 5,
}
"""Half ranges of the noise of the default task, after scaling."""


class TestNoise:
    @pytest.mark.parametrize("level", [1.0, 0.5])
    def test_noise_is_uniform(self, quadruped, level):
        group = group_of(quadruped, Task(noise=Noise(noise_level=level)))
        given = state(4000, projected_gravity=[0, 0, -1], dof_pos=quadruped.default_pose)
        given.height_scan[:] = 0.5
        noisy = compute_observations(group, given, 100.0, np.random.default_rng(0))
        off = noisy - compute_observations(group, given, 100.0)
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

    def test_noise_levels_are_the_tasks(self, quadruped):
        noise = Noise(dof_pos=1, dof_vel=2, ang_vel=3, gravity=4, height_measurements=5)
        found = {each.name: each.noise for each in group_of(quadruped, Task(noise=noise))}
        levels = {"projected_gravity": 4, "base_ang_vel": 3, "dof_pos": 1, "dof_vel": 2}
        without = {"commands": 0, "actions": 0, "gait_phase": 0}
        assert found == levels | without | {"height_scan": 5}

    def test_noise_level_zero_samples_nothing(self, quadruped):
        group = group_of(quadruped, Task(noise=Noise(noise_level=0)))
        rng = np.random.default_rng(0)
        seen = compute_observations(group, state(5), 100.0, rng)
        np.testing.assert_array_equal(seen, compute_observations(group, state(5), 100.0))
        # The random generator is not used.
        assert rng.bit_generator.state == np.random.default_rng(0).bit_generator.state

    def test_noise_is_added_before_clipping(self, quadruped):
        group = group_of(quadruped, Task(noise=Noise(dof_vel=1e6)))
        seen = compute_observations(group, state(50), 2.0, np.random.default_rng(0))
        assert np.abs(seen).max() == 2.0
