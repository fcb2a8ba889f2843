import dataclasses
import math
from dataclasses import dataclass, field, replace
from typing import Annotated, get_type_hints

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.rl.rewards import REWARDS
from terrainkit_robots.rl.task import (
    Algorithm,
    Asset,
    Commands,
    Control,
    DomainRand,
    Env,
    InitState,
    Limits,
    Policy,
    Positive,
    Rewards,
    Runner,
    Section,
    Sim,
    Task,
    Termination,
    Terrain,
)
from terrainkit_robots.rl.task_file import told_of

NESTING = {
    *("env", "terrain", "init_state", "control", "asset", "commands", "rewards", "domain_rand"),
    *("normalization", "noise", "sim", "policy", "algorithm", "runner"),
}


def sections(section=None):
    """Return a task and all its sections."""
    section = section or Task()
    inner = [getattr(section, each.name) for each in dataclasses.fields(section)]
    return [section] + [s for one in inner if isinstance(one, Section) for s in sections(one)]


every_section = pytest.mark.parametrize("section", sections(), ids=lambda s: type(s).__name__)


def test_a_task_has_legged_gyms_sections():
    assert {each.name for each in dataclasses.fields(Task)} >= NESTING


def test_every_reward_has_a_scale():
    assert set(REWARDS) <= {each.name for each in dataclasses.fields(Rewards)}


@every_section
def test_every_value_says_what_it_is(section):
    told = told_of(type(section))
    for each in dataclasses.fields(section):
        assert told[each.name].endswith("."), each.name


@every_section
def test_values_are_checked_one_by_one(section):
    for each in dataclasses.fields(section):
        with pytest.raises(ConfigError, match=rf"^{each.name} "):
            replace(section, **{each.name: object()})


@every_section
def test_no_number_may_be_infinite_or_not_a_number(section):
    for each in dataclasses.fields(section):
        value = getattr(section, each.name)
        if isinstance(value, float):
            for odd in (math.nan, math.inf, -math.inf):
                with pytest.raises(ConfigError, match=rf"^{each.name} is {odd}"):
                    replace(section, **{each.name: odd})
        elif isinstance(value, tuple) and isinstance(value[0], float):
            with pytest.raises(ConfigError, match=rf"^{each.name} is .*nan"):
                replace(section, **{each.name: (math.nan,) * len(value)})


@pytest.mark.parametrize(
    ("section", "name", "value", "told"),
    [
        (Env, "num_envs", 0, "num_envs is 0; wanted 1 or more"),
        (Env, "num_envs", 2.0, "num_envs is 2.0; wanted a whole number"),
        (Env, "num_envs", True, "num_envs is True; wanted a whole number"),
        (Env, "episode_length_s", 0, r"wanted a number above 0, at most 1e\+06"),
        (Env, "num_threads", -1, "num_threads is -1; wanted 0 or more"),
        (Terrain, "collision", "mesh", "wanted one of: auto, hfield, boxes, plane"),
        (Terrain, "curriculum", 1, "curriculum is 1; wanted true or false"),
        (Terrain, "measured_points_x", [], "measured_points_x is empty; wanted one number or more"),
        (InitState, "reset_range", (0.5, -1), "reset_range is .*wanted 0 or more"),
        (InitState, "reset_range", (1.5, 0.5), "wanted the lower number first"),
        (InitState, "position", -0.1, "position is -0.1; wanted 0 or more"),
        (Control, "decimation", 0, "decimation is 0; wanted 1 or more, at most 1000"),
        (Control, "decimation", 10**9, "decimation is 1000000000; wanted"),
        (Control, "action_scale", 0.0, "action_scale is 0.0; wanted a number above 0"),
        (Control, "control_type", "X", "wanted one of: P, V, T"),
        (Commands, "lin_vel_x", (1, -1), "lin_vel_x is .*; wanted the lower number first"),
        (Commands, "lin_vel_x", (1, 2, 3), "lin_vel_x has 3 values; wanted 2"),
        (Commands, "standing", 1.5, "standing is 1.5; wanted 0 or more, at most 1"),
        (Commands, "resampling_time", 0, "wanted a number above 0"),
        (DomainRand, "friction", (-0.1, 1), "friction is .*; wanted 0 or more"),
        (DomainRand, "com_shift", -1, "com_shift is -1.0; wanted 0 or more"),
        (Rewards, "tracking_sigma", 0, "tracking_sigma is 0.0; wanted a number above 0"),
        (Rewards, "tracking_lin_vel", "much", "tracking_lin_vel is 'much'; wanted a number"),
        (Termination, "tilt", 4, "tilt is 4.0; wanted a number above 0, at most 3.14159"),
        (Sim, "dt", 1, "dt is 1.0; wanted a number above 0, at most 0.1"),
        (Policy, "actor_hidden_dims", (), "actor_hidden_dims is empty"),
        (Policy, "critic_hidden_dims", (128, 10**12), "critic_hidden_dims is .*; wanted 1 or more"),
        (Policy, "activation", "relu6", "activation is 'relu6'; wanted one of: elu, selu"),
        (Algorithm, "gamma", 1.01, "gamma is 1.01; wanted 0 or more, at most 1"),
        (Algorithm, "symmetry", True, "wanted one of: none, augmentation, loss"),
        (Runner, "seed", -1, "seed is -1; wanted 0 or more"),
    ],
)
def test_what_is_out_of_range_is_named(section, name, value, told):
    with pytest.raises(ConfigError, match=told):
        section(**{name: value})


def test_whole_numbers_become_floats_and_lists_tuples():
    made = Commands(lin_vel_x=[-2, 3], resampling_time=5)
    assert made.lin_vel_x == (-2.0, 3.0)
    assert type(made.lin_vel_x[0]) is type(made.resampling_time) is float


def test_none_is_a_value_only_where_it_means_something():
    assert DomainRand(friction=None).friction is None
    with pytest.raises(ConfigError, match="com_shift is None; wanted a number"):
        DomainRand(com_shift=None)


def test_a_height_scan_is_no_map():
    points = tuple(0.01 * k for k in range(101))
    with pytest.raises(ConfigError, match="make 10201 points; wanted 10000 or less"):
        Terrain(measured_points_x=points, measured_points_y=points)


def test_an_episode_has_a_step():
    short = Env(episode_length_s=0.001)
    with pytest.raises(ConfigError, match=r"env.episode_length_s is 0.001; wanted .* 0.02 s"):
        Task(env=short)
    task = Task(env=short, sim=Sim(dt=0.001), control=Control(decimation=1))
    assert (task.dt, task.max_episode_length) == (0.001, 1)


def test_there_is_a_sample_for_each_mini_batch():
    with pytest.raises(ConfigError, match=r"num_mini_batches is 4; .* = 3"):
        Task(env=Env(num_envs=1), runner=Runner(num_steps_per_env=3))


def test_who_touches_nothing_pays_for_no_collisions():
    few = Asset(collisions="feet_and_termination")
    told = r"rewards.collision is -1; wanted 0 with asset.collisions feet_and_termination"
    with pytest.raises(ConfigError, match=told):
        Task(asset=few)
    assert Task(asset=few, rewards=Rewards(collision=0.0)).asset == few


def test_a_section_is_of_its_class():
    with pytest.raises(ConfigError, match=r"rewards is .*; wanted Rewards"):
        Task(rewards=Noisy())


@dataclass(frozen=True, kw_only=True)
class Noisy(Section):
    """Not a part of a task."""

    level: Positive = 1.0
    """How loud."""

    names: tuple[str, ...] = ()
    """What of."""

    ends: "Annotated[tuple[float, float], Limits(most=5, rising=True)] | None" = None
    """Where it ends; an annotation that is a text, as with `from __future__ import annotations`."""


@dataclass(frozen=True, kw_only=True)
class NoisyTask(Task):
    """A task with a section of its own."""

    din: Noisy = field(default_factory=Noisy)
    """How loud it is."""


def test_a_subclass_has_its_own_values_checked():
    assert NoisyTask(din=Noisy(level=2, ends=[0, 1])).din.ends == (0.0, 1.0)
    for values, told in {
        (("level", 0),): "level is 0.0; wanted a number above 0",
        (("names", (1,)),): "names is 1; wanted a text",
        (("ends", (0, 6)),): "ends is .*; wanted",
        (("ends", (1, 0)),): "wanted the lower number first",
    }.items():
        with pytest.raises(ConfigError, match=told):
            Noisy(**dict(values))


def test_a_subclass_that_is_no_dataclass_is_refused():
    class Mine(Rewards):
        tracking_lin_vel: float = 3.0

    with pytest.raises(ConfigError, match=r"Mine lacks @dataclass\(frozen=True, kw_only=True\)"):
        Mine()


@every_section
def test_every_annotation_can_be_read(section):
    kinds = get_type_hints(type(section))
    assert all(each.name in kinds for each in dataclasses.fields(section))


def test_limits_say_what_they_want():
    assert str(Limits()) == "a finite number"
    assert str(Limits(least=0.0, most=1.0)) == "0 or more, at most 1"
    assert str(Limits(most=5.0)) == "5 or less"
