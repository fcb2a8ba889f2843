import tomllib
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from terrainkit.errors import PluginError
from terrainkit_robots.rl.config import Env, Rewards, Task
from terrainkit_robots.rl.own_terms import checked
from terrainkit_robots.rl.rewards import REWARDS, reward_scales
from terrainkit_robots.rl.state import State
from tests.terrainkit_robots.rl.made_states import FLAGS, made_state, shapes

_SHAPES = shapes(joints=2, feet=2, penalized=3, points=0)
"""Shapes of the state of a robot with two joints and two feet."""


def state(n=1, **arrays):
    """Return a state of n robots that is 0 except for the given arrays."""
    return made_state(_SHAPES, n, **arrays)


def rewarded(name, robot, given, **settings):
    """Return the values of a reward."""
    cfg = Task(rewards=Rewards(**settings))
    scene = SimpleNamespace(hip_joints=np.array([0]))
    return REWARDS[name](SimpleNamespace(state=given, robot=robot, cfg=cfg, scene=scene))


def random_state(n, seed):
    rng = np.random.default_rng(seed)
    arrays = {}
    for name, shape in _SHAPES.items():
        arrays[name] = (
            rng.random((n, *shape)) < 0.5 if name in FLAGS else rng.normal(0, 3, (n, *shape))
        )
    for positive in ("swing_phase", "penalized_force", "foot_air_time"):
        arrays[positive] = np.abs(arrays[positive])
    arrays["foot_force"] *= 50
    for some in ("commands", "foot_force"):
        arrays[some][::3] = 0
    return state(n, **arrays)


@pytest.fixture(scope="module")
def robot(quadruped):
    """Return a robot with two joints, the second without position limits."""
    return replace(
        quadruped,
        spec=replace(quadruped.spec, base_height_target=0.3, leg_length=0.5),
        wheels=np.zeros(2, bool),
        default_pose=np.array([0.5, -0.5], np.float32),
        effort=np.array([10, 20], np.float32),
        velocity=np.array([5, 10], np.float32),
        lower=np.array([-1, -np.inf], np.float32),
        upper=np.array([1, np.inf], np.float32),
    )


def paid(name, robot, given, **settings):
    return rewarded(name, robot, given, **settings).tolist()


_BY_HAND = tomllib.loads(Path(__file__).with_name("rewards.toml").read_text())


@pytest.mark.parametrize("name", _BY_HAND)
def test_reward_by_hand(robot, name):
    expected = _BY_HAND[name]["pays"]
    arrays = {key: array for key, array in _BY_HAND[name].items() if key != "pays"}
    found = paid(name, robot, state(len(expected), **arrays), tracking_sigma=0.25)
    assert found == pytest.approx(expected, abs=1e-5)


def test_stand_still_ignores_wheels(robot):
    wheeled = replace(robot, wheels=np.array([False, True]))
    assert paid("stand_still", wheeled, state(dof_pos=[[0.75, -1.0]])) == [0.125]


def test_every_reward_is_tested_by_hand():
    assert {*REWARDS} == {*_BY_HAND}


@pytest.mark.parametrize(
    ("num_feet", "leg_length", "height"), [(4, 0.4, 0.072), (4, 0.6, 0.09), (2, 0.6, 0.108)]
)
def test_default_swing_height_is_limited_on_four_legs(robot, num_feet, leg_length, height):
    robot = replace(robot, spec=replace(robot.spec, leg_length=leg_length))
    sizes = shapes(joints=2, feet=num_feet, penalized=3, points=0)
    phase, heights = [[0.5] * num_feet], [[height] * num_feet]
    given = made_state(sizes, 1, swing_phase=phase, foot_height_over_edges=heights)
    assert paid("foot_swing_height", robot, given) == pytest.approx([0], abs=1e-6)
    scaled = paid("foot_swing_height", robot, given, swing_height=2 * height / leg_length)
    assert scaled == pytest.approx([0.25])


@pytest.mark.parametrize("name", sorted(REWARDS))
class TestEveryReward:
    def test_values_are_finite(self, name, robot):
        for n in (1, 50):
            values = rewarded(name, robot, random_state(n, seed=n))
            assert values.shape == (n,)
            assert np.isfinite(values).all()
            assert values.dtype == np.float32  # or every step pays for conversions

    def test_state_is_not_modified(self, name, robot):
        given, twin = random_state(20, seed=2), random_state(20, seed=2)
        first = rewarded(name, robot, given)
        for each in fields(State):
            np.testing.assert_array_equal(getattr(given, each.name), getattr(twin, each.name))
        first += 1  # what is returned is no view of the state either
        np.testing.assert_array_equal(rewarded(name, robot, given) + 1, first)

    def test_robots_are_independent(self, name, robot):
        all_of_them = random_state(20, seed=3)
        alone = State(**{f.name: getattr(all_of_them, f.name)[7:8] for f in fields(State)})
        together = rewarded(name, robot, all_of_them)[7]
        assert rewarded(name, robot, alone)[0] == pytest.approx(together, rel=1e-5)

    def test_penalties_are_positive_and_have_negative_scales(self, name, robot):
        values = rewarded(name, robot, random_state(500, seed=4), tracking_sigma=5)
        scale = getattr(Rewards(), name)
        verb = REWARDS[name].__doc__.split()[0]
        assert np.sign(scale) in (0, {"Reward": 1, "Penalize": -1}[verb])
        if verb == "Penalize":
            assert values.min() >= 0
            assert values.max() > 0
        elif name in ("tracking_lin_vel", "tracking_ang_vel", "feet_gait"):
            assert values.min() >= 0
            assert 0.5 < values.max() <= 1


def test_every_scale_has_a_reward():
    scales = {field.name for field in fields(Rewards) if field.type is float}
    assert scales == {*REWARDS}  # parameters of rewards have limits


def test_rewards_without_a_scale_are_not_computed(nominal_env):
    env = nominal_env(rewards=Rewards(**(_NONE | {"collision": -0.5})))
    assert env.active_rewards == {"collision": (REWARDS["collision"], -0.5)}


def test_scales_are_in_units_of_the_robot():
    # 2 kg on legs of 9.81 / 4 m: the unit of time is 0.5 s.
    length = 9.81 / 4
    scales = reward_scales(Rewards(dof_power=-1.0), 2.0, length)
    assert (scales["collision"], scales["ang_vel_xy"]) == (-1, pytest.approx(-1 / 2**2))
    assert scales["torques"] == pytest.approx(-1 / (2 * 9.81 * length) ** 2)
    assert scales["lin_vel_z"] == pytest.approx(-9 / (length / 0.5) ** 2)
    assert scales["dof_power"] == pytest.approx(-1 / (2 * 9.81 * length / 0.5))
    limits = reward_scales(Rewards(torque_limits=-1.0), 2.0, length)["torque_limits"]
    assert limits == pytest.approx(-1 / (2 * 9.81 * length))
    assert reward_scales(Rewards(units="SI"), 2.0, length)["lin_vel_z"] == -9


_NONE = dict.fromkeys(REWARDS, 0.0)
_REST = torch.zeros(4, 12)


def test_reward_is_sum_of_scaled_terms(random_env):
    env = random_env(rewards=Rewards(**(_NONE | {"collision": -3.0, "action_rate": -0.5})))
    before = env.state
    _, rewards, *_ = env.step(_REST + 0.1)
    assert env.state is not before
    touching = (env.state.penalized_force > 0.1).sum(axis=1)
    np.testing.assert_allclose(rewards, 0.02 * (-3 * touching - 0.5 * 0.01), rtol=1e-5)
    env = random_env(rewards=replace(env.cfg.rewards, only_positive_rewards=True))
    assert not env.step(_REST + 0.1)[1].any()
    assert (rewards < 0).all()


@pytest.fixture
def standing(random_env):
    """Return robots that are commanded to stand, whose tracking rewards are 1."""
    env = random_env(
        env=Env(num_envs=4, num_threads=1, episode_length_s=0.2),
        rewards=Rewards(**(_NONE | {"tracking_ang_vel": 2.0, "tracking_sigma": 1e9})),
    )
    env.set_commands(np.zeros((4, 3), np.float32))
    return env


def test_episode_sums_are_logged_per_second(standing):
    speeds = []
    for step in range(10):
        _, rewards, dones, extras = standing.step(_REST)
        assert ("log" in extras) == (step == 9) == bool(dones.all())
        assert rewards.tolist() == pytest.approx([0.04] * 4)
        speeds.append(np.linalg.norm(standing.state.base_lin_vel[:, :2], axis=1).mean())
    # 2 per second, whatever the length of the episode. Time-outs are no falls.
    assert extras["log"].pop("Episode/rew_tracking_ang_vel") == pytest.approx(2)
    assert extras["log"].pop("Episode/speed") == pytest.approx(np.mean(speeds[:9]), abs=0.05)
    assert extras["log"] == {"Episode/falls": 0}
    assert extras["time_outs"].all()
    assert set(standing.episode_sums) == {"tracking_ang_vel"}
    assert standing.episode_sums["tracking_ang_vel"].tolist() == [0] * 4


def test_episode_sums_of_short_episode(standing):
    standing.step(_REST)
    standing.step(_REST)
    standing.sim.qpos[0, 3:7] = (0, 1, 0, 0)
    *_, extras = standing.step(_REST)
    assert extras["log"]["Episode/rew_tracking_ang_vel"] == pytest.approx(2)
    assert extras["log"]["Episode/falls"] == 1
    sums = standing.episode_sums["tracking_ang_vel"]
    assert sums.tolist() == pytest.approx([0, 0.12, 0.12, 0.12])


@pytest.mark.parametrize(
    ("result", "told"),
    [
        (ValueError("two\nlines"), "ValueError: two lines"),
        (SystemExit(0), "SystemExit: 0"),
        (None, "TypeError: Cannot cast .*"),
        (np.zeros((3, 1)), r"got shape \(3, 1\); expected \(3,\)"),
    ],
)
def test_failing_reward_of_another_package_is_named(result, told):
    def bonus(_):
        if isinstance(result, BaseException):
            raise result
        return result

    bonus.__module__ = "rover_pack.rewards"
    function = checked("reward", "bonus", bonus, (3,))
    with pytest.raises(PluginError, match=rf"^reward bonus \(rover_pack\.rewards\): {told}$"):
        function(None)


@pytest.mark.parametrize("name", ["tracking_lin_vel", "tracking_ang_vel"])
def test_tracking_in_gait_is_paid_while_all_feet_agree_with_it(name, robot):
    # The second foot is to swing: neither, only the first, only the second, and both agree.
    force = np.zeros((4, 2, 3))
    force[:, :, 2] = [[0, 9], [9, 9], [0, 0], [9, 0]]
    given = state(4, swing_phase=np.array([[0, 0.5]] * 4), foot_force=force)
    assert rewarded(name, robot, given, tracking_in_gait=True).tolist() == [0, 0, 0, 1]
    assert rewarded(name, robot, given).tolist() == [1] * 4


def test_tiny_tracking_sigma_pays_nothing(robot):
    given = state(2, mean_vel=[[1.0, 0, 0], [0, 0, 0]])
    assert paid("tracking_lin_vel", robot, given, tracking_sigma=1e-12) == [0, 1]
