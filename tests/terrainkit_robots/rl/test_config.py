"""The sections of a task; tests/terrainkit/settings has the rules of every config."""

import dataclasses
import math
import tomllib
from dataclasses import dataclass, field, replace

import pytest

from terrainkit.errors import ConfigError
from terrainkit.settings.field_docs import field_docs
from terrainkit.settings.schema import Config, flatten
from terrainkit_robots.rl.config import (
    Commands,
    Control,
    DomainRand,
    Env,
    Rewards,
    Runner,
    Sim,
    Task,
)


def sections(section):
    """Return a config and all its sections."""
    inner = [getattr(section, each.name) for each in dataclasses.fields(section)]
    return [section] + [s for one in inner if isinstance(one, Config) for s in sections(one)]


@pytest.mark.parametrize("section", sections(Task()), ids=lambda s: type(s).__name__)
def test_every_option_has_a_docstring_and_a_type(section):
    told = field_docs(type(section))
    for each in dataclasses.fields(section):
        if not isinstance(getattr(section, each.name), Config):  # it has a docstring of its own
            assert told[each.name].endswith("."), each.name
        with pytest.raises(ConfigError, match=rf"^{each.name}: "):
            replace(section, **{each.name: object()})


def with_value(section, name, value):
    first, _, rest = name.partition(".")
    changed = with_value(getattr(section, first), rest, value) if rest else value
    return replace(section, **{first: changed})


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("env.num_envs", 0, "num_envs: got 0; expected an integer >= 1"),
        ("env.episode_length_s", 0, "expected a number > 0 and <= 1000000"),
        ("env.num_threads", -1, "num_threads: got -1; expected an integer from 0 to 4096"),
        ("terrain.collision", "mesh", "expected one of: auto, hfield, boxes, plane"),
        ("terrain.curriculum", "level", "expected one of: .*, or none; did you mean 'levels'?"),
        ("terrain.measured_points_x", [], r"measured_points_x: got \[\]; expected a non-empty"),
        ("init_state.reset_range", (0.5, -1), "reset_range: got .*each a number >= 0"),
        ("control.decimation", 0, "decimation: got 0; expected an integer from 1 to 1000"),
        ("control.action_scale", 0.0, "action_scale: got 0.0; expected a number > 0, or none"),
        ("control.control_type", "X", "expected one of: P, V, T"),
        ("commands.lin_vel_x", (1, -1), "lin_vel_x: got .*, the lower one first"),
        ("commands.lin_vel_x", (math.nan, 1), "lin_vel_x: got .nan, 1.; expected 2 values"),
        ("commands.standing", 1.5, "standing: got 1.5; expected a number from 0 to 1"),
        ("noise.noise_level", 1e300, "noise_level: got 1e.300, which is beyond 1e.30"),
        ("normalization.obs_scales.lin_vel", 1e38, "lin_vel: got 1e.38, which is beyond 1e.30"),
        ("domain_rand.friction", (-0.1, 1), "friction: got .*each a number >= 0"),
        ("domain_rand.com_shift", -1, "com_shift: got -1; expected a number >= 0"),
        ("domain_rand.action_delay", (0.02, 0), "action_delay: got .*, the lower one first"),
        ("observations.history_length", 0, "got 0; expected an integer from 1 to 100"),
        ("rewards.tracking_lin_vel", math.inf, "tracking_lin_vel: got inf; expected a number"),
        ("termination.tilt", 4, "tilt: got 4; expected a number > 0 and <= 3.14159"),
        ("sim.dt", 1, "dt: got 1; expected a number from 1e-06 to 0.1"),
        ("policy.critic_hidden_dims", (128, 10**12), "critic_hidden_dims: .* from 1 to 65536"),
        ("policy.activation", "relu6", "got 'relu6'; expected one of: elu, .*mean 'relu'"),
        ("algorithm.gamma", 1.01, "gamma: got 1.01; expected a number from 0 to 1"),
        ("rewards", Sim(), r"rewards: got Sim; expected a table \(Rewards\)"),
    ],
)
def test_out_of_range_value_is_named(name, value, message):
    with pytest.raises(ConfigError, match=message):
        with_value(Task(), name, value)


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


@dataclass(frozen=True, kw_only=True)
class RoverRewards(Rewards):
    """What a rover is rewarded for."""

    wheel_slip: float = -0.5
    """Wheels that slide."""


@dataclass(frozen=True, kw_only=True)
class Wheels(Config):
    """The wheels."""

    names: tuple[str, ...] = ("front", 'say "rear"')
    """What they are called."""

    note: "str | None" = "rubber"
    """What they are made of; an annotation that is a text, as with `annotations` imported."""


@dataclass(frozen=True, kw_only=True)
class RoverTask(Task):
    """A task with fields of its own."""

    rewards: RoverRewards = field(default_factory=RoverRewards)
    """What is rewarded."""

    wheels: Wheels = field(default_factory=Wheels)
    """The wheels."""

    commands: Commands = field(default_factory=lambda: Commands(standing=0.5))
    """Commands that often are zero."""

    laps: int = 3
    """A value that is in no section."""


def test_toml_round_trip_of_each_value():
    task, numbers = RoverTask(), (7, 0.1 + 0.2, 0.05 + 2**-40, (0.3 + 0.1, 0.5), (7,))
    for name, value in flatten(task):
        tried = 0
        for other in (None, False, True, "T", ('a\n"b"',), *numbers):
            try:
                changed = with_value(task, name, other)
            except ConfigError:
                continue  # of another type, or out of range
            tried += changed != task
            assert Task.from_toml(changed.to_toml(), task) == changed, name
            assert Task.from_toml(task.to_toml(), changed) == task, name
        assert tried or isinstance(value, str), name


def test_toml_has_every_value_with_its_doc():
    text = Task().to_toml()
    assert list(tomllib.loads(text)) == [each.name for each in dataclasses.fields(Task)]
    assert "tracking_lin_vel = 1.5  # Tracking of the linear velocity command.\n" in text
    assert "\n# Scales of the observations.\n[normalization.obs_scales]\n" in text


def test_missing_keys_are_those_of_the_default():
    mine = Task.from_toml("[rewards]\ntracking_lin_vel = 3")
    assert mine == replace(Task(), rewards=Rewards(tracking_lin_vel=3.0))
    both = Task.from_toml("[rewards]\ntracking_ang_vel = 2", mine)
    assert both.rewards == Rewards(tracking_lin_vel=3.0, tracking_ang_vel=2.0)


def test_subclass_adds_keys():
    text = "laps = 5\n[rewards]\nwheel_slip = -1\n[wheels]\nnote = 'none'"
    made = Task.from_toml(text, RoverTask())
    assert type(made) is RoverTask
    assert (made.laps, made.rewards.wheel_slip, made.wheels.note) == (5, -1.0, None)
    with pytest.raises(ConfigError, match=r"rewards has no key 'wheel_slip'; it has: tracking"):
        Task.from_toml("[rewards]\nwheel_slip = -1")
    with pytest.raises(ConfigError, match=r"wheels\.note: got 3; expected a string, or none"):
        Task.from_toml("[wheels]\nnote = 3", RoverTask())


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[[rewards]]\nx = 1", r"rewards: got \[.*; expected a table"),
        ("tracking_lin_vel = 1", r"no key 'tracking_lin_vel'; did you mean 'rewards\.track"),
        ("[reward]\nx = 1", r"no key 'reward'; did you mean 'rewards'\? It has: env, terrain"),
        ("[rewards]\ntracking_sigma = 0", r"rewards\.tracking_sigma: got 0; expected a number > 0"),
        ("[algorithm]\nnum_mini_batches = 1000000", r"^algorithm\.num_mini_batches: got 1000000"),
        ("a.b" * 9999, "not a TOML file"),
        (f"[rewards]\n{'a' * 9999} = 1", "rewards has no key 'aaaa"),
    ],
)
def test_error_is_one_short_line(text, told):
    with pytest.raises(ConfigError, match=told) as error:
        Task.from_toml(text, Task())
    assert "\n" not in str(error.value)
    assert len(str(error.value)) <= 500
