"""Reward terms: values computed by hand, and properties of all terms."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from made_states import FLAGS, made_state, shapes

from terrainkit_robots.description import bundled
from terrainkit_robots.rl import rewards as module
from terrainkit_robots.rl.config import Env, Rewards, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.rewards import REWARDS, active_rewards, reward
from terrainkit_robots.rl.state import State
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.spec.robot import Robot

torch.set_num_threads(1)

_SHAPES = shapes(joints=2, feet=2, penalized=3, points=0)
"""Shapes of the state of a robot with two joints and two feet."""


def state(n: int = 1, **arrays: Any) -> State:
    """Return a state of n robots that is 0 except for the given arrays."""
    return made_state(_SHAPES, n, **arrays)


def random_state(n: int, seed: int) -> State:
    rng = np.random.default_rng(seed)
    arrays = {}
    for name, shape in _SHAPES.items():
        arrays[name] = (
            rng.random((n, *shape)) < 0.5 if name in FLAGS else rng.normal(0, 3, (n, *shape))
        )
    for positive in ("air_time", "penalized_force"):
        arrays[positive] = np.abs(arrays[positive])
    arrays["foot_force"] *= 50
    for some in ("commands", "foot_force"):
        arrays[some][::3] = 0
    return state(n, **arrays)


@pytest.fixture(scope="module")
def robot() -> Robot:
    """Return a robot with two joints, the second without position limits."""
    real = Robot.load(Path(str(bundled.urdf_path("quadruped"))).parent)
    return replace(
        real,
        spec=replace(real.spec, base_height_target=0.3),
        wheels=np.zeros(2, bool),
        default_pose=np.array([0.5, -0.5], np.float32),
        effort=np.array([10, 20], np.float32),
        velocity=np.array([5, 10], np.float32),
        lower=np.array([-1, -np.inf], np.float32),
        upper=np.array([1, np.inf], np.float32),
    )


def paid(name: str, robot: Robot, given: State, **settings: Any) -> list[float]:
    return REWARDS[name](given, robot, Rewards(**settings)).tolist()


class TestByHand:
    """One test per reward, which `test_every_reward_is_tested` checks."""

    def test_tracking_lin_vel(self, robot: Robot) -> None:
        given = state(
            3,
            commands=[[1, 0, 9], [1, 0, 0], [0, 0.5, 0]],
            base_lin_vel=[[1, 0, 7], [0.5, 0, 0], [0.3, 0.1, 0]],
        )
        # exp(0); exp(-0.25 / 0.25); exp(-(0.09 + 0.16) / 0.25).
        expected = [1, 0.36788, 0.36788]
        assert paid("tracking_lin_vel", robot, given) == pytest.approx(expected, abs=1e-5)
        wide = paid("tracking_lin_vel", robot, given, tracking_sigma=0.5)
        assert wide == pytest.approx([1, 0.60653, 0.60653], abs=1e-5)

    def test_tracking_ang_vel(self, robot: Robot) -> None:
        given = state(2, commands=[[9, 9, -1], [0, 0, 1]], base_ang_vel=[[8, 8, -1], [0, 0, 0]])
        # exp(0); exp(-1 / 0.25)
        expected = [1, 0.0183156]
        assert paid("tracking_ang_vel", robot, given) == pytest.approx(expected, abs=1e-6)

    def test_lin_vel_z(self, robot: Robot) -> None:
        given = state(base_lin_vel=[[5, 6, -0.5]])
        assert paid("lin_vel_z", robot, given) == [0.25]

    def test_ang_vel_xy(self, robot: Robot) -> None:
        given = state(base_ang_vel=[[3, -4, 7]])
        assert paid("ang_vel_xy", robot, given) == [25]

    def test_orientation(self, robot: Robot) -> None:
        # Rolled by 30 degrees: sin^2 is 1/4.
        given = state(2, projected_gravity=[[0, 0, -1], [0, 0.5, -0.8660254]])
        assert paid("orientation", robot, given) == [0, 0.25]

    def test_base_height(self, robot: Robot) -> None:
        given = state(2, base_height=[0.3, 0.5])
        assert paid("base_height", robot, given) == pytest.approx([0, 0.04])
        own = paid("base_height", robot, given, base_height_target=0.4)
        assert own == pytest.approx([0.01, 0.01])
        # Over a hole of 10 m, the error is limited to the target: 0.3^2.
        assert paid("base_height", robot, state(1, base_height=[10.0])) == pytest.approx([0.09])

    def test_torques(self, robot: Robot) -> None:
        assert paid("torques", robot, state(torques=[[3, -4]])) == [25]

    def test_dof_power(self, robot: Robot) -> None:
        # |2 * 3| + |-1 * 4|: negative power counts as well.
        given = state(torques=[[2, -1]], dof_vel=[[3, 4]])
        assert paid("dof_power", robot, given) == [10]

    def test_dof_vel(self, robot: Robot) -> None:
        assert paid("dof_vel", robot, state(dof_vel=[[-1, 2]])) == [5]

    def test_dof_acc(self, robot: Robot) -> None:
        assert paid("dof_acc", robot, state(dof_acc=[[10, -20]])) == [500]

    def test_action_rate(self, robot: Robot) -> None:
        given = state(actions=[[1, 2]], last_actions=[[0, -1]], last_last_actions=[[50, 50]])
        assert paid("action_rate", robot, given) == [10]

    def test_action_smoothness(self, robot: Robot) -> None:
        given = state(
            2,
            actions=[[3, 0], [1, 0]],
            last_actions=[[2, 0], [0, 2]],
            last_last_actions=[[1, 0], [1, 0]],
        )
        # Constant changes are free: 3 - 4 + 1. 1 - 0 + 1 = 2 and 0 - 4 + 0 = -4.
        assert paid("action_smoothness", robot, given) == [0, 20]

    def test_collision(self, robot: Robot) -> None:
        given = state(2, penalized_force=[[0, 0.05, 0], [0.2, 0, 300]])
        assert paid("collision", robot, given) == [0, 2]

    def test_termination(self, robot: Robot) -> None:
        assert paid("termination", robot, state(2, fallen=[False, True])) == [0, 1]

    def test_dof_pos_limits(self, robot: Robot) -> None:
        # Soft limits of -1 and 1; the second joint has none.
        given = state(3, dof_pos=[[0.9, 100], [1.25, -100], [-1.5, 0]])
        assert paid("dof_pos_limits", robot, given) == [0, 0.25, 0.5]

    def test_dof_vel_limits(self, robot: Robot) -> None:
        # 0.9 of 5 and of 10 rad/s is free; the excess of each joint is at most 1.
        given = state(3, dof_vel=[[4.5, -9], [-5, 9.25], [50, 0]])
        assert paid("dof_vel_limits", robot, given) == pytest.approx([0, 0.75, 1])
        tight = paid("dof_vel_limits", robot, given, soft_dof_vel_limit=0.85)
        assert tight == pytest.approx([0.25 + 0.5, 0.75 + 0.75, 1])

    def test_torque_limits(self, robot: Robot) -> None:
        # 0.9 of 10 and of 20 N m is free.
        given = state(2, torques=[[9, -18], [-10, 20]])
        assert paid("torque_limits", robot, given) == pytest.approx([0, 3])
        tight = paid("torque_limits", robot, given, soft_torque_limit=0.5)
        assert tight == pytest.approx([4 + 8, 5 + 10])

    def test_feet_air_time(self, robot: Robot) -> None:
        given = state(
            4,
            commands=[[1, 0, 0], [0, 0, 0.5], [0, 0, 0], [1, 0, 0]],
            first_contact=[[True, False], [True, True], [True, True], [False, False]],
            air_time=[[0.75, 3], [0.5, 0.125], [0.75, 0.75], [2, 2]],
        )
        # 0.75 - 0.25; 0.25 - 0.125; commanded to stand; no first contact.
        quarter = paid("feet_air_time", robot, given, air_time_target=0.25)
        assert quarter == pytest.approx([0.5, 0.125, 0, 0])
        longer = paid("feet_air_time", robot, given, air_time_target=0.5)
        assert longer == pytest.approx([0.25, -0.375, 0, 0])

    def test_small_yaw_rate_counts_as_standing(self, robot: Robot) -> None:
        given = state(
            4,
            commands=[[0, 0, 0.09], [0, 0, -0.11], [0.05, 0, 0], [0, -0.05, 0.01]],
            first_contact=[[True, True]] * 4,
            air_time=[[1.0, 1.0]] * 4,
            dof_pos=[[0.75, -1.0]] * 4,
        )
        assert (np.array(paid("feet_air_time", robot, given)) > 0).tolist() == [False] + 3 * [True]
        assert (np.array(paid("stand_still", robot, given)) > 0).tolist() == [True] + 3 * [False]

    def test_foot_clearance(self, robot: Robot) -> None:
        # (0.13 - 0.08)^2 * |(3, 4)| and 0.08^2 * 0.5; standing feet and vertical velocity are free.
        given = state(
            2,
            foot_height=[[0.13, 0.0], [0.0, 0.08]],
            foot_vel=[[[3, 4, 9], [0.5, 0, 0]], [[0, 0, 5], [2, 0, 0]]],
        )
        assert paid("foot_clearance", robot, given) == pytest.approx([0.0125 + 0.0032, 0], abs=1e-6)
        higher = paid("foot_clearance", robot, given, foot_clearance_target=0.18)
        assert higher == pytest.approx([0.0125 + 0.0162, 0.02], abs=1e-6)
        # Over a hole of 10 m, the error is limited to the target: 0.08^2 * 1.
        hole = state(1, foot_height=[[10.0, 0.08]], foot_vel=[[[1, 0, 0], [0, 0, 0]]])
        assert paid("foot_clearance", robot, hole) == pytest.approx([0.0064])
        # With a target of 0, every height is an error.
        low = state(1, foot_height=[[0.1, 0.0]], foot_vel=[[[1, 0, 0], [1, 0, 0]]])
        assert paid("foot_clearance", robot, low, foot_clearance_target=0) == pytest.approx([0.01])

    def test_stumble(self, robot: Robot) -> None:
        given = state(
            4,
            foot_force=[
                [[0, 0, 0], [0, 0, 0]],
                [[30, 40, 9], [0, 0, 0]],
                [[30, 40, 11], [0, 0, 100]],
                [[0, 0, 100], [0, -60, 11]],
            ],
        )
        assert paid("stumble", robot, given) == [0, 1, 0, 1]

    def test_stand_still(self, robot: Robot) -> None:
        given = state(
            3,
            commands=[[0, 0, 0], [0, 0, 0.3], [0, 0, 0]],
            dof_pos=[[0.75, -1.0], [0.75, -1.0], [0.5, -0.5]],
        )
        assert paid("stand_still", robot, given) == [0.75, 0, 0]
        wheeled = replace(robot, wheels=np.array([False, True]))
        assert paid("stand_still", wheeled, given) == [0.25, 0, 0]

    def test_feet_contact_forces(self, robot: Robot) -> None:
        # |(60, 0, 80)| is just 100 N; |(0, 120, 160)| is 200.
        given = state(2, foot_force=[[[60, 0, 80], [0, 0, 0]], [[0, 120, 160], [0, 0, -150]]])
        assert paid("feet_contact_forces", robot, given) == pytest.approx([0, 150])
        less = paid("feet_contact_forces", robot, given, max_contact_force=50)
        assert less == pytest.approx([50, 150 + 100])

    def test_every_reward_is_tested(self) -> None:
        here = {name.removeprefix("test_") for name in vars(TestByHand) if name.startswith("test_")}
        others = {"every_reward_is_tested", "small_yaw_rate_counts_as_standing"}
        assert {*REWARDS} == here - others


_PENALTIES = sorted({*REWARDS} - {"tracking_lin_vel", "tracking_ang_vel", "feet_air_time"})


@pytest.mark.parametrize("name", sorted(REWARDS))
class TestEveryReward:
    def test_values_are_finite(self, name: str, robot: Robot) -> None:
        for n in (1, 50):
            values = REWARDS[name](random_state(n, seed=n), robot, Rewards())
            assert values.shape == (n,)
            assert np.isfinite(values).all()
            assert values.dtype == np.float32  # or every step pays for conversions

    def test_state_is_not_modified(self, name: str, robot: Robot) -> None:
        given, twin = random_state(20, seed=2), random_state(20, seed=2)
        first = REWARDS[name](given, robot, Rewards())
        for each in fields(State):
            np.testing.assert_array_equal(getattr(given, each.name), getattr(twin, each.name))
        first += 1  # what is returned is no view of the state either
        np.testing.assert_array_equal(REWARDS[name](given, robot, Rewards()) + 1, first)

    def test_robots_are_independent(self, name: str, robot: Robot) -> None:
        all_of_them = random_state(20, seed=3)
        alone = State(**{f.name: getattr(all_of_them, f.name)[7:8] for f in fields(State)})
        together = REWARDS[name](all_of_them, robot, Rewards())[7]
        assert REWARDS[name](alone, robot, Rewards())[0] == pytest.approx(together, rel=1e-5)

    def test_default_scale_has_the_right_sign(self, name: str) -> None:
        scales = {each.name: each.default for each in fields(Rewards)}
        assert isinstance(scales[name], float)
        if name in _PENALTIES:
            assert scales[name] <= 0
        else:
            assert scales[name] > 0

    def test_docstring_has_the_unit(self, name: str) -> None:
        """The unit is in brackets at the end of the docstring, unless there is none."""
        docstring = str(REWARDS[name].__doc__)
        assert docstring.startswith(("Reward ", "Penalize ", "Count "))
        assert docstring.endswith(".")
        pure = {
            "tracking_lin_vel",
            "tracking_ang_vel",
            "orientation",
            "action_rate",
            "action_smoothness",
            "collision",
            "termination",
            "stumble",
        }
        assert bool(re.search(r" \[[^\]]+\]\.$", docstring)) == (name not in pure)


@pytest.mark.parametrize("name", _PENALTIES)
def test_penalties_are_never_negative(name: str, robot: Robot) -> None:
    values = REWARDS[name](random_state(500, seed=4), robot, Rewards())
    assert values.min() >= 0
    assert values.max() > 0


@pytest.mark.parametrize("name", ["tracking_lin_vel", "tracking_ang_vel"])
def test_tracking_is_between_0_and_1(name: str, robot: Robot) -> None:
    values = REWARDS[name](random_state(500, seed=5), robot, Rewards(tracking_sigma=5))
    assert values.min() >= 0
    assert 0.5 < values.max() <= 1


def test_every_scale_has_a_reward() -> None:
    settings = {
        "tracking_sigma",
        "only_positive_rewards",
        "soft_dof_vel_limit",
        "soft_torque_limit",
        "base_height_target",
        "air_time_target",
        "foot_clearance_target",
        "max_contact_force",
    }
    assert {each.name for each in fields(Rewards)} - settings == {*REWARDS}


def test_active_rewards_have_nonzero_scales() -> None:
    nothing = dict.fromkeys(REWARDS, 0.0)
    assert active_rewards(Rewards(**nothing)) == {}
    only = active_rewards(Rewards(**(nothing | {"torques": -0.5})))
    assert only == {"torques": (REWARDS["torques"], -0.5)}


# In the environment.


def make_env(settings: Rewards, num_envs: int = 4, **other: Any) -> LeggedEnv:
    task = Task(env=Env(num_envs=num_envs, num_threads=1, **other), rewards=settings)
    return LeggedEnv(task, Robot.load(Path(str(bundled.urdf_path("quadruped"))).parent), Plane())


_NONE = dict.fromkeys(REWARDS, 0.0)
_REST = torch.zeros(4, 12)


def test_reward_is_sum_of_scaled_terms() -> None:
    env = make_env(Rewards(**(_NONE | {"orientation": -3.0, "lin_vel_z": -0.5})))
    before = env.state
    _, rewards, *_ = env.step(_REST)
    assert env.state is not before
    tilt = np.square(env.state.projected_gravity[:, :2]).sum(axis=1)
    up = np.square(env.state.base_lin_vel[:, 2])
    np.testing.assert_allclose(rewards, 0.02 * (-3 * tilt - 0.5 * up), rtol=1e-5)
    assert (rewards < 0).all()


def test_zero_scale_is_not_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: Any) -> Any:
        raise AssertionError

    monkeypatch.setitem(REWARDS, "torques", never)
    env = make_env(Rewards(torques=0.0))
    env.step(_REST)
    assert "torques" not in env.episode_sums


def test_only_positive_rewards_except_termination() -> None:
    bad = {"orientation": -1e6, "termination": -2.0, "only_positive_rewards": True}
    env = make_env(Rewards(**(_NONE | bad)))
    env.sim.qpos[0, 3:7] = (0, 1, 0, 0)  # on its back
    _, rewards, dones, _ = env.step(_REST)
    assert dones.tolist() == [True, False, False, False]
    assert rewards.tolist() == pytest.approx([-2 * 0.02, 0, 0, 0])
    env = make_env(Rewards(**(_NONE | bad | {"only_positive_rewards": False})))
    env.sim.qpos[0, 3:7] = (0, 1, 0, 0)
    _, rewards, *_ = env.step(_REST)
    assert (rewards < 0).all()


def test_episode_sums_are_logged_per_second() -> None:
    env = make_env(
        Rewards(**(_NONE | {"tracking_ang_vel": 2.0, "tracking_sigma": 1e12})),
        episode_length_s=0.2,
    )
    for step in range(10):
        _, rewards, dones, extras = env.step(_REST)
        assert ("log" in extras) == (step == 9) == bool(dones.all())
        assert rewards.tolist() == pytest.approx([0.04] * 4)
    # 2 per second, whatever the length of the episode.
    assert extras["log"]["Episode/rew_tracking_ang_vel"] == pytest.approx(2)
    assert set(env.episode_sums) == {"tracking_ang_vel"}
    assert env.episode_sums["tracking_ang_vel"].tolist() == [0] * 4


def test_episode_sums_of_short_episode() -> None:
    env = make_env(Rewards(**(_NONE | {"tracking_ang_vel": 2.0, "tracking_sigma": 1e12})))
    env.step(_REST)
    env.step(_REST)
    env.sim.qpos[0, 3:7] = (0, 1, 0, 0)
    *_, extras = env.step(_REST)
    assert extras["log"]["Episode/rew_tracking_ang_vel"] == pytest.approx(2)
    assert extras["log"]["Episode/falls"] == 1
    assert env.episode_sums["tracking_ang_vel"].tolist() == pytest.approx([0, 0.12, 0.12, 0.12])


@dataclass(frozen=True, kw_only=True)
class MyRewards(Rewards):
    """Rewards with a user's own term."""

    headway: float = 0.0
    """Moving along x."""


@pytest.fixture
def own() -> Iterator[None]:
    @reward
    def headway(state: State, robot: Robot, settings: Rewards) -> Any:  # noqa: ARG001
        """Reward the position along x [m]."""
        return state.base_pos[:, 0]

    yield
    del REWARDS["headway"]


@pytest.mark.usefixtures("own")
class TestUserReward:
    def test_user_reward_is_added(self) -> None:
        env = make_env(MyRewards(**(_NONE | {"headway": 10.0})))
        _, rewards, *_ = env.step(_REST)
        np.testing.assert_allclose(rewards, 10 * 0.02 * env.state.base_pos[:, 0], rtol=1e-5)
        assert np.ptp(rewards.numpy()) > 0
        assert list(env.episode_sums) == ["headway"]

    def test_user_reward_is_logged(self) -> None:
        env = make_env(MyRewards(headway=1.0), episode_length_s=0.02)
        *_, extras = env.step(_REST)
        assert "Episode/rew_headway" in extras["log"]

    def test_user_reward_without_scale_is_ignored(self) -> None:
        env = make_env(Rewards())
        assert "headway" not in env.rewards
        assert "headway" not in make_env(MyRewards()).rewards


def test_rewards_are_registered_by_name() -> None:
    for name, function in REWARDS.items():
        assert getattr(module, name) is function
