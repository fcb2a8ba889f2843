"""The sections of a task; tests/terrainkit/settings has the rules of every config."""

import dataclasses
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from terrainkit.errors import ConfigError
from terrainkit.settings.field_docs import field_docs
from terrainkit.settings.schema import Config
from terrainkit_robots.rl.config import (
    Commands,
    Control,
    DomainRand,
    Env,
    Policy,
    Rewards,
    Runner,
    Sim,
    Task,
    Terrain,
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


OUT_OF_RANGE = tomllib.loads(Path(__file__).with_name("out_of_range.toml").read_text())


@pytest.mark.parametrize(("name", "value", "message"), OUT_OF_RANGE["rejected"])
def test_out_of_range_value_is_named(name, value, message):
    with pytest.raises(ConfigError, match=message):
        with_value(Task(), name, value)


@pytest.mark.parametrize(("text", "message"), OUT_OF_RANGE["pasted"])
def test_setting_of_legged_gym_names_ours(text, message):
    with pytest.raises(ConfigError) as raised:
        Task.from_toml(text)
    assert str(raised.value) == message


def test_section_is_a_table_of_its_class():
    with pytest.raises(ConfigError, match=r"rewards: got Sim; expected a table \(Rewards\)"):
        Task(rewards=Sim())


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
    assert Task().max_delay_steps == 8
    assert Task(domain_rand=DomainRand(action_delay=None)).max_delay_steps == 0


def test_toml_round_trip():
    task = Task(
        terrain=Terrain(curriculum=None),
        domain_rand=DomainRand(friction=None, gains=(0.05 + 2**-40, 1)),
        commands=Commands(heading_command=True, gait_period=0.1 + 0.2),
        policy=Policy(actor_hidden_dims=(7,)),
    )
    assert Task.from_toml(task.to_toml()) == Task.from_toml(task.to_toml(), Task()) == task
    assert Task.from_toml(Task().to_toml(), task) == Task()


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


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[reward]\nx = 1", r"no key 'reward'; did you mean 'rewards'\? It has: env, terrain"),
        ("[algorithm]\nnum_mini_batches = 1000000", r"^algorithm\.num_mini_batches: got 1000000"),
        (f"[rewards]\n{'a' * 9999} = 1", "rewards has no key 'aaaa"),
    ],
)
def test_error_is_one_short_line(text, told):
    with pytest.raises(ConfigError, match=told) as error:
        Task.from_toml(text, Task())
    assert "\n" not in str(error.value)
    assert len(str(error.value)) <= 500
