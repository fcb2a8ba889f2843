import dataclasses
import tomllib
import types
from dataclasses import dataclass, field, replace
from typing import Literal, get_args, get_origin, get_type_hints

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.rl.section import Section
from terrainkit_robots.rl.task import Commands, Rewards, Task
from terrainkit_robots.rl.task_file import from_toml, may_be_none, read_task, to_toml, values_of


@dataclass(frozen=True, kw_only=True)
class RoverRewards(Rewards):
    """What a rover is rewarded for."""

    wheel_slip: float = -0.5
    """Wheels that slide."""

    collision: float = 0.0
    """Nothing, so that little of it may touch the ground."""


@dataclass(frozen=True, kw_only=True)
class Wheels(Section):
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

    commands: Commands = field(default_factory=lambda: Commands(max_curriculum=2.0))
    """Commands that may grow."""

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
    if may_be_none(kind):
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


every_value = pytest.mark.parametrize("name", [name for name, _ in values_of(RoverTask())])


@every_value
def test_every_value_is_read_as_it_was_written(name):
    task, before = RoverTask(), dict(values_of(RoverTask()))[name]
    tried = 0
    for value in others(kind_of(task, name), before):
        try:
            changed = with_value(task, name, value)
        except ConfigError:
            continue  # outside the limits of this one
        tried += 1
        assert changed != task
        assert from_toml(to_toml(changed), task) == changed
        assert from_toml(to_toml(task), changed) == task
    assert tried


def test_a_task_is_read_as_it_was_written():
    assert from_toml(to_toml(Task())) == Task()
    assert from_toml(to_toml(RoverTask()), RoverTask()) == RoverTask()
    assert from_toml("") == Task()


def test_every_value_is_in_the_file_with_what_it_is():
    text = to_toml(Task())
    table = tomllib.loads(text)
    assert list(table) == [each.name for each in dataclasses.fields(Task)]
    for name, _ in values_of(Task()):
        inner = table
        for part in name.split("."):
            inner = inner[part]
    assert "tracking_lin_vel = 1.5  # Moving as asked.\n" in text
    assert "\n# Factors on observations.\n[normalization.obs_scales]\n" in text


def test_what_is_left_out_is_as_in_the_default():
    mine = from_toml("[rewards]\ntracking_lin_vel = 3")
    assert mine == replace(Task(), rewards=Rewards(tracking_lin_vel=3.0))
    both = from_toml("[rewards]\ntracking_ang_vel = 2", mine)
    assert both.rewards == Rewards(tracking_lin_vel=3.0, tracking_ang_vel=2.0)


def test_none_is_written_as_a_word():
    assert from_toml('[domain_rand]\nfriction = "none"').domain_rand.friction is None
    assert from_toml('[algorithm]\nsymmetry = "none"').algorithm.symmetry == "none"
    with pytest.raises(ConfigError, match=r"domain_rand\.com_shift is 'none'; wanted a number"):
        from_toml('[domain_rand]\ncom_shift = "none"')


def test_a_subclass_has_keys_of_its_own():
    text = "laps = 5\n[rewards]\nwheel_slip = -1\n[wheels]\nnote = 'none'"
    made = from_toml(text, RoverTask())
    assert type(made) is RoverTask
    assert (made.laps, made.rewards.wheel_slip, made.wheels.note) == (5, -1.0, None)
    with pytest.raises(ConfigError, match=r"no key rewards\.wheel_slip; rewards has: tracking"):
        from_toml("[rewards]\nwheel_slip = -1")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("rewards = 1", r"rewards is 1; wanted a table, \[rewards\]"),
        ("[[rewards]]\nx = 1", r"rewards is \[.*; wanted a table"),
        ("tracking_lin_vel = 1", r"no key tracking_lin_vel; did you mean rewards\.tracking_lin_v"),
        ("[reward]\nx = 1", "no key reward; did you mean rewards\\?; a task has: env, terrain"),
        (
            "[rewards]\ntraking_lin_vel = 1",
            r"no key rewards\.traking_lin_vel; did you mean rewards\.tracking_lin_vel\?; rewards h",
        ),
        ("[rewards]\ntracking_lin_vel = '1'", r"rewards\.tracking_lin_vel is '1'; wanted a number"),
        ("[rewards]\ntracking_lin_vel.x = 1", r"rewards\.tracking_lin_vel is {.*wanted a number"),
        ("[rewards]\ntracking_sigma = 0", r"rewards\.tracking_sigma is 0\.0; wanted a number abov"),
        ("[sim]\ndt = nan", r"sim\.dt is nan; wanted a number above 0"),
        ("[env]\nnum_envs = 99999999999999999999", r"env\.num_envs is a whole number beyond 64 b"),
        ("[env]\nnum_envs = 2024-01-01", r"env\.num_envs is datetime.*wanted a whole number"),
        ("[normalization.obs_scales]\nlin_vel = -1", r"normalization\.obs_scales\.lin_vel is -1"),
        ("[algorithm]\nnum_mini_batches = 1000000", r"^algorithm\.num_mini_batches is 1000000; w"),
        ("[rewards]\n'a b' = 1", 'no key rewards."a b"; rewards has'),
        ("[rewards", "not a TOML file"),
        ("a.b" * 9999, "not a TOML file"),
        (f"[rewards]\n{'a' * 9999} = 1", "no key rewards.aaaa"),
    ],
)
def test_what_is_wrong_is_named_on_one_short_line(text, told):
    with pytest.raises(ConfigError, match=told) as error:
        from_toml(text)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) <= 500


def test_a_file_is_read(tmp_path):
    path = tmp_path / "task.toml"
    path.write_text(to_toml(RoverTask(laps=9)))
    assert read_task(path, RoverTask()) == RoverTask(laps=9)
    assert read_task(str(path), RoverTask(laps=1)).laps == 9


@pytest.mark.parametrize(
    ("data", "told"),
    [
        (b"[rewards]\nx = 1", r"task\.toml: no key rewards\.x"),
        (b"\xff\xfe", r"task\.toml: .*can't decode"),
        (b"#" * ((1 << 20) + 1), r"task\.toml: over 1048576 bytes; wanted the TOML file of a task"),
    ],
)
def test_a_file_that_is_no_task_is_named(tmp_path, data, told):
    path = tmp_path / "task.toml"
    path.write_bytes(data)
    with pytest.raises(ConfigError, match=told):
        read_task(path)


@pytest.mark.parametrize("name", ["missing.toml", ".", "a\0b"])
def test_what_is_no_file_is_named(tmp_path, name):
    with pytest.raises(ConfigError, match="cannot read "):
        read_task(tmp_path / name)
