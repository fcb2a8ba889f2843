import dataclasses
import math
from dataclasses import dataclass, field, replace
from typing import Annotated

import pytest
from msgspec import Meta

from terrainkit.errors import ConfigError
from terrainkit.settings.field_docs import field_docs
from terrainkit.settings.schema import Config
from terrainkit.settings.type_hint import SORTED, PositiveFloat
from terrainkit_robots.rl.config import (
    Algorithm,
    Commands,
    Control,
    DomainRand,
    Env,
    InitState,
    Observations,
    Policy,
    Rewards,
    Runner,
    Sim,
    Task,
    Termination,
    Terrain,
)

NESTING = {
    *("env", "terrain", "init_state", "control", "asset", "commands", "rewards", "domain_rand"),
    *("normalization", "noise", "sim", "policy", "algorithm", "runner"),
}


def sections(section=None):
    """Return a task and all its sections."""
    section = section or Task()
    inner = [getattr(section, each.name) for each in dataclasses.fields(section)]
    return [section] + [s for one in inner if isinstance(one, Config) for s in sections(one)]


every_section = pytest.mark.parametrize("section", sections(), ids=lambda s: type(s).__name__)


def test_task_has_sections_of_legged_gym():
    assert {each.name for each in dataclasses.fields(Task)} >= NESTING


@every_section
def test_every_option_has_a_docstring(section):
    told = field_docs(type(section))
    for each in dataclasses.fields(section):
        if not isinstance(getattr(section, each.name), Config):  # it has a docstring of its own
            assert told[each.name].endswith("."), each.name


@every_section
def test_wrong_type_is_rejected_by_name(section):
    for each in dataclasses.fields(section):
        with pytest.raises(ConfigError, match=rf"^{each.name}: "):
            replace(section, **{each.name: object()})


@every_section
def test_non_finite_numbers_are_rejected(section):
    for each in dataclasses.fields(section):
        value = getattr(section, each.name)
        if isinstance(value, float):
            for odd in (math.nan, math.inf, -math.inf):
                with pytest.raises(ConfigError, match=rf"^{each.name}: got {odd}"):
                    replace(section, **{each.name: odd})
        elif isinstance(value, tuple) and isinstance(value[0], float):
            with pytest.raises(ConfigError, match=rf"^{each.name}: got .*nan"):
                replace(section, **{each.name: (math.nan,) * len(value)})


@pytest.mark.parametrize(
    ("section", "name", "value", "message"),
    [
        (Env, "num_envs", 0, "num_envs: got 0; expected an integer >= 1"),
        (Env, "num_envs", 2.0, "num_envs: got 2.0; expected an integer"),
        (Env, "num_envs", True, "num_envs: got True; expected an integer"),
        (Env, "episode_length_s", 0, "expected a number > 0 and <= 1000000"),
        (Env, "num_threads", -1, "num_threads: got -1; expected an integer from 0 to 4096"),
        (Terrain, "collision", "mesh", "expected one of: auto, hfield, boxes, plane"),
        (Terrain, "curriculum", True, "curriculum: got True; expected one of: levels, uniform, "),
        (Terrain, "curriculum", "level", "expected one of: .*, or none; did you mean 'levels'?"),
        (Terrain, "measured_points_x", [], r"measured_points_x: got \[\]; expected a non-empty"),
        (InitState, "reset_range", (0.5, -1), "reset_range: got .*each a number >= 0"),
        (InitState, "reset_range", (1.5, 0.5), "the lower one first, or none"),
        (InitState, "position", -0.1, "position: got -0.1; expected a number >= 0"),
        (Control, "decimation", 0, "decimation: got 0; expected an integer from 1 to 1000"),
        (Control, "decimation", 10**9, "decimation: got 1000000000; expected"),
        (Control, "action_scale", 0.0, "action_scale: got 0.0; expected a number > 0, or none"),
        (Control, "control_type", "X", "expected one of: P, V, T"),
        (Commands, "lin_vel_x", (1, -1), "lin_vel_x: got .*, the lower one first"),
        (Commands, "lin_vel_x", (1, 2, 3), "lin_vel_x: got .*; expected 2 values"),
        (Commands, "standing", 1.5, "standing: got 1.5; expected a number from 0 to 1"),
        (Commands, "resampling_time", 0, "expected a number > 0"),
        (DomainRand, "friction", (-0.1, 1), "friction: got .*each a number >= 0"),
        (DomainRand, "com_shift", -1, "com_shift: got -1; expected a number >= 0"),
        (DomainRand, "action_delay", (0.02, 0), "action_delay: got .*, the lower one first"),
        (DomainRand, "action_delay", (-0.01, 0), "action_delay: got .*each a number >= 0"),
        (DomainRand, "action_delay", 0.02, "action_delay: got 0.02; expected 2 values"),
        (Observations, "history_length", 0, "got 0; expected an integer from 1 to 100"),
        (Observations, "history_length", 1.5, "history_length: got 1.5; expected an integer"),
        (Observations, "foot_contact", 1, "foot_contact: got 1; expected true or false"),
        (Rewards, "tracking_sigma", 0, "tracking_sigma: got 0; expected a number > 0"),
        (Rewards, "tracking_lin_vel", "much", "tracking_lin_vel: got 'much'; expected a number"),
        (Termination, "tilt", 4, "tilt: got 4; expected a number > 0 and <= 3.14159"),
        (Sim, "dt", 1, "dt: got 1; expected a number > 0 and <= 0.1"),
        (Policy, "actor_hidden_dims", (), r"actor_hidden_dims: got \[\]"),
        (Policy, "critic_hidden_dims", (128, 10**12), "critic_hidden_dims: .* from 1 to 65536"),
        (Policy, "activation", "relu6", "got 'relu6'; expected one of: elu, .*mean 'relu'"),
        (Algorithm, "gamma", 1.01, "gamma: got 1.01; expected a number from 0 to 1"),
        (Algorithm, "symmetry", "loss", "symmetry: got 'loss'; expected true or false"),
        (Runner, "seed", -1, "seed: got -1; expected an integer from 0"),
    ],
)
def test_out_of_range_value_is_named(section, name, value, message):
    with pytest.raises(ConfigError, match=message):
        section(**{name: value})


def test_integers_and_lists_are_converted():
    made = Commands(lin_vel_x=[-2, 3], resampling_time=5)
    assert made.lin_vel_x == (-2.0, 3.0)
    assert type(made.lin_vel_x[0]) is type(made.resampling_time) is float


def test_none_is_accepted_where_declared():
    assert DomainRand(friction=None).friction is None
    with pytest.raises(ConfigError, match="com_shift: got None; expected a number"):
        DomainRand(com_shift=None)


def test_episode_has_at_least_one_step():
    short = Env(episode_length_s=0.001)
    with pytest.raises(ConfigError, match=r"env.episode_length_s: got 0.001; expected .* 0.02 s"):
        Task(env=short)
    task = Task(env=short, sim=Sim(dt=0.001), control=Control(decimation=1))
    assert (task.dt, task.max_episode_length) == (0.001, 1)


def test_mini_batches_need_samples():
    with pytest.raises(ConfigError, match=r"num_mini_batches: got 4; .* = 3"):
        Task(env=Env(num_envs=1), runner=Runner(num_steps_per_env=3))


def test_action_delay_has_at_least_one_simulation_step():
    told = r"domain_rand.action_delay: got \[0.0, 0.002\]; expected an end above half of sim.dt"
    with pytest.raises(ConfigError, match=told):
        Task(domain_rand=DomainRand(action_delay=(0, 0.002)))
    for odd in ((0, 0), (0, 1.5)):
        with pytest.raises(ConfigError, match="at most 1 s; or none"):
            Task(domain_rand=DomainRand(action_delay=odd))
    for end, steps in {0.003: 1, 0.005: 1, 0.02: 4, 1: 200}.items():
        assert Task(domain_rand=DomainRand(action_delay=(0, end))).max_delay_steps == steps
    assert Task().max_delay_steps == 0


def test_section_of_other_class_is_rejected():
    with pytest.raises(ConfigError, match=r"rewards: got Noisy; expected a table \(Rewards\)"):
        Task(rewards=Noisy())


@dataclass(frozen=True, kw_only=True)
class Noisy(Config):
    """Not a part of a task."""

    level: PositiveFloat = 1.0
    """How loud."""

    names: tuple[str, ...] = ()
    """What of."""

    ends: "Annotated[tuple[float, Annotated[float, Meta(le=5)]], SORTED] | None" = None
    """Where it ends; an annotation that is a text, as with `from __future__ import annotations`."""


@dataclass(frozen=True, kw_only=True)
class NoisyTask(Task):
    """A task with a section of its own."""

    din: Noisy = field(default_factory=Noisy)
    """How loud it is."""


def test_fields_of_subclass_are_validated():
    assert NoisyTask(din=Noisy(level=2, ends=[0, 1])).din.ends == (0.0, 1.0)
    for values, told in {
        (("level", 0),): "level: got 0; expected a number > 0",
        (("names", (1,)),): "names: got .1.; expected a list, each value a string",
        (("ends", (0, 6)),): "ends: got .*; expected",
        (("ends", (1, 0)),): "the lower one first",
    }.items():
        with pytest.raises(ConfigError, match=told):
            Noisy(**dict(values))
