import dataclasses
import tomllib
import types
from dataclasses import dataclass, field, replace
from typing import Literal, get_args, get_origin, get_type_hints

import pytest

from terrainkit.errors import ConfigError
from terrainkit.settings.schema import Config, flatten
from terrainkit.settings.type_hint import parse_hint
from terrainkit_robots.rl.config import Commands, Rewards, Task


@dataclass(frozen=True, kw_only=True)
class RoverRewards(Rewards):
    """What a rover is rewarded for."""

    wheel_slip: float = -0.5
    """Wheels that slide."""

    collision: float = 0.0
    """Nothing, so that little of it may touch the ground."""


@dataclass(frozen=True, kw_only=True)
class Wheels(Config):
    """The wheels."""

    names: tuple[str, ...] = ("front", 'say "rear"')
    """What they are called."""

    note: str | None = "rubber"
    """What they are made of."""


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


def kind_of(task, name):
    *path, last = name.split(".")
    for part in path:
        task = getattr(task, part)
    return get_type_hints(type(task))[last]


def with_value(section, name, value):
    first, _, rest = name.partition(".")
    changed = with_value(getattr(section, first), rest, value) if rest else value
    return replace(section, **{first: changed})


def others(kind, value):
    """Return values of a type other than `value`, within any limits of ours."""
    if parse_hint(kind).is_optional:
        (inner,) = (part for part in get_args(kind) if part is not types.NoneType)
        return [*([] if value is None else [None]), *others(inner, value)]
    if get_origin(kind) is Literal:
        return [other for other in get_args(kind) if other != value]
    if get_origin(kind) is tuple:
        if Ellipsis not in get_args(kind):
            return [(0.1 + 0.2, 1 / 3 + 0.1), (0.5, 0.5)]
        return [(7,) * 3 if get_args(kind)[0] is int else (get_args(kind)[0](0.1),) * 30]
    return {
        bool: [not value],
        int: [7],
        float: [1e-17, 0.05 + 1e-17 + 2**-40],
        str: ["a\nb # \x7f é"],
    }[kind]


every_value = pytest.mark.parametrize("name", [name for name, _ in flatten(RoverTask())])


@every_value
def test_toml_round_trip_of_each_value(name):
    task, before = RoverTask(), dict(flatten(RoverTask()))[name]
    tried = 0
    for value in others(kind_of(task, name), before):
        try:
            changed = with_value(task, name, value)
        except ConfigError:
            continue  # outside the limits of this one
        tried += 1
        assert changed != task
        assert Task.from_toml(changed.to_toml(), task) == changed
        assert Task.from_toml(task.to_toml(), changed) == task
    assert tried


def test_toml_round_trip_of_a_task():
    assert Task.from_toml(Task().to_toml()) == Task()
    assert RoverTask.from_toml(RoverTask().to_toml()) == RoverTask()
    assert Task.from_toml("") == Task()


def test_toml_has_every_value_with_its_doc():
    text = Task().to_toml()
    table = tomllib.loads(text)
    assert list(table) == [each.name for each in dataclasses.fields(Task)]
    for name, _ in flatten(Task()):
        inner = table
        for part in name.split("."):
            inner = inner[part]
    assert "tracking_lin_vel = 1.5  # Tracking of the linear velocity command.\n" in text
    assert "\n# Scales of the observations.\n[normalization.obs_scales]\n" in text


def test_missing_keys_are_those_of_the_default():
    mine = Task.from_toml("[rewards]\ntracking_lin_vel = 3")
    assert mine == replace(Task(), rewards=Rewards(tracking_lin_vel=3.0))
    both = Task.from_toml("[rewards]\ntracking_ang_vel = 2", mine)
    assert both.rewards == Rewards(tracking_lin_vel=3.0, tracking_ang_vel=2.0)


def test_none_is_written_as_a_string():
    assert Task.from_toml('[domain_rand]\nfriction = "none"').domain_rand.friction is None
    assert Task.from_toml('[algorithm]\nsymmetry = "none"').algorithm.symmetry is None
    with pytest.raises(ConfigError, match=r"domain_rand\.com_shift: got 'none'; expected a number"):
        Task.from_toml('[domain_rand]\ncom_shift = "none"')


def test_subclass_adds_keys():
    text = "laps = 5\n[rewards]\nwheel_slip = -1\n[wheels]\nnote = 'none'"
    made = Task.from_toml(text, RoverTask())
    assert type(made) is RoverTask
    assert (made.laps, made.rewards.wheel_slip, made.wheels.note) == (5, -1.0, None)
    with pytest.raises(ConfigError, match=r"rewards has no key 'wheel_slip'; it has: tracking"):
        Task.from_toml("[rewards]\nwheel_slip = -1")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("rewards = 1", r"rewards: got 1; expected a table \(Rewards\)"),
        ("[[rewards]]\nx = 1", r"rewards: got \[.*; expected a table"),
        (
            "tracking_lin_vel = 1",
            r"no key 'tracking_lin_vel'; did you mean 'rewards\.track",
        ),
        ("[reward]\nx = 1", r"no key 'reward'; did you mean 'rewards'\? It has: env, terrain"),
        (
            "[rewards]\ntraking_lin_vel = 1",
            r"rewards has no key 'traking_lin_vel'; did you mean 'tracking_lin_vel'\? It has",
        ),
        (
            "[rewards]\ntracking_lin_vel = '1'",
            r"rewards\.tracking_lin_vel: got '1'; expected",
        ),
        (
            "[rewards]\ntracking_lin_vel.x = 1",
            r"rewards\.tracking_lin_vel: got a table; exp",
        ),
        ("[rewards]\ntracking_sigma = 0", r"rewards\.tracking_sigma: got 0; expected a number > 0"),
        ("[sim]\ndt = nan", r"sim\.dt: got nan; expected a number > 0"),
        ("[env]\nnum_envs = 99999999999999999999", r"env\.num_envs: got an integer beyond 64 b"),
        ("[env]\nnum_envs = 2024-01-01", r"env\.num_envs: got datetime.*expected an integer"),
        ("[normalization.obs_scales]\nlin_vel = -1", r"normalization\.obs_scales\.lin_vel: got -1"),
        (
            "[algorithm]\nnum_mini_batches = 1000000",
            r"^algorithm\.num_mini_batches: got 1000000",
        ),
        ("[rewards]\n'a b' = 1", "rewards has no key 'a b'; it has"),
        ("[rewards", "not a TOML file"),
        ("a.b" * 9999, "not a TOML file"),
        (f"[rewards]\n{'a' * 9999} = 1", "rewards has no key 'aaaa"),
    ],
)
def test_error_is_one_short_line(text, told):
    with pytest.raises(ConfigError, match=told) as error:
        Task.from_toml(text, Task())
    assert "\n" not in str(error.value)
    assert len(str(error.value)) <= 500


@pytest.mark.parametrize("name", ["missing.toml", ".", "a\0b"])
def test_load_of_other_paths_is_rejected(tmp_path, name):
    with pytest.raises(ConfigError, match="cannot read "):
        Task.load(tmp_path / name)
