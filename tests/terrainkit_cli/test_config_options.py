import shutil
import subprocess
import sys
from dataclasses import dataclass, field, replace

import pytest

from terrainkit.errors import ConfigError
from terrainkit.settings.schema import field_types, flatten
from terrainkit_cli.train_command import Train
from terrainkit_robots.rl.config import Commands, Env, Rewards, Task
from terrainkit_robots.rl.tasks import get_task, register_task
from tests.tables import read_table


@dataclass(frozen=True, kw_only=True)
class RoverRewards(Rewards):
    """What a rover is rewarded for."""

    wheel_slip: float = -0.5
    """Wheels that slide."""


@dataclass(frozen=True, kw_only=True)
class RoverTask(Task):
    """A task with fields of its own."""

    rewards: RoverRewards = field(default_factory=RoverRewards)
    """What is rewarded."""

    laps: int = 3
    """A value that is in no section."""


@pytest.fixture
def rover(own_tasks, tmp_path):  # noqa: ARG001
    return register_task("rover", tmp_path, RoverTask(env=Env(num_envs=17)))


def parse_words(*words):
    """Return the command that words describe, as `terrainkit train` reads them."""
    return Train.parse(words)


def test_train_has_option_for_each_value():
    words = (
        "quadruped --rewards.tracking-lin-vel 1.25 --commands.lin-vel-x -1 2 --terrain rough.npz "
        "--terrain.collision plane --rewards.dof-acc -1e-8 --domain-rand.friction none "
        "--domain-rand.added-mass 0 3 --terrain.measure_heights true "
        "--policy.actor-hidden-dims 64 32 --algorithm.symmetry false --env.num-envs=64 "
        "--normalization.obs-scales.lin-vel 1 --commands.heading-command true"
    )
    made = parse_words(*words.split())
    assert (made.robot, made.terrain) == ("quadruped", "rough.npz")
    before, after = dict(flatten(made.defaults)), dict(flatten(made.changed_config()))
    assert {name: value for name, value in after.items() if value != before[name]} == {
        "rewards.tracking_lin_vel": 1.25,
        "commands.lin_vel_x": (-1.0, 2.0),
        "terrain.collision": "plane",
        "rewards.dof_acc": -1e-8,
        "domain_rand.friction": None,
        "domain_rand.added_mass": (0.0, 3.0),
        "terrain.measure_heights": True,
        "policy.actor_hidden_dims": (64, 32),
        "algorithm.symmetry": False,
        "env.num_envs": 64,
        "normalization.obs_scales.lin_vel": 1.0,
        "commands.heading_command": True,
    }


def words_of(name, annotation, value):
    """Return the words on the command line that set a value."""
    *sections, last = name.replace("_", "-").split(".")
    if annotation is bool:
        return ["--" + ".".join([*sections, last if value else f"no-{last}"])]
    values = value if isinstance(value, tuple) else (value,)
    words = [str(each).lower() if each is None else str(each) for each in values]
    return ["--" + ".".join([*sections, last]), *words]


def test_train_accepts_every_default():
    words = ["quadruped"]
    for name, value in flatten(Task()):
        section = getattr(Task(), name.partition(".")[0])
        annotation = field_types(type(section)).get(name.partition(".")[2])
        words += [] if name == "runner.rsl_rl" else words_of(name, annotation, value)
    assert parse_words(*words).changed_config() == Task()


def test_train_accepts_robot_last(tmp_path):
    words = "--rewards.tracking-lin-vel 2 --commands.lin-vel-y 0 1 quadruped"
    made = parse_words(*words.split())
    assert made.robot == "quadruped"
    assert made.changed_config().commands == Commands(lin_vel_y=(0.0, 1.0))
    assert parse_words("quadruped").changed_config() == get_task("quadruped").task
    shutil.copy(get_task("quadruped").folder / "robot.toml", tmp_path)
    task = parse_words(str(tmp_path), "--env.num-envs", "8").changed_config()
    assert task == Task(env=Env(num_envs=8))  # of an onboarded folder


def test_train_options_override_file(tmp_path, rover):
    path = tmp_path / "mine.toml"
    path.write_text("laps = 4\n[rewards]\nwheel_slip = -3\ntorques = -1\n")
    made = parse_words("rover", "--config", str(path), "--rewards.torques", "-2")
    assert made.defaults == Task.from_toml(path.read_text(), rover.task)
    task = made.changed_config()
    assert (task.laps, task.rewards.wheel_slip, task.rewards.torques) == (4, -3.0, -2.0)
    assert task.env.num_envs == 17


@pytest.mark.parametrize("words", [("rover", "--laps", "5"), ("--laps", "5", "rover")])
def test_train_options_of_custom_task(rover, words):
    made = parse_words(*words, "--rewards.wheel-slip", "-1", "--rewards.tracking-lin-vel", "3")
    rewards = RoverRewards(wheel_slip=-1.0, tracking_lin_vel=3.0)
    assert made.changed_config() == replace(rover.task, laps=5, rewards=rewards)


@pytest.mark.parametrize(("words", "message"), read_table(__file__, "train_rejects_invalid"))
def test_train_rejects_invalid_options(words, message):
    with pytest.raises(ConfigError, match=message) as error:
        parse_words("quadruped", *words.split()).changed_config()
    assert "\n" not in str(error.value)


@pytest.mark.usefixtures("rover")
def test_train_help_shows_task_values(run_main, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    run = run_main("train", "rover", "--help")
    assert (run.returncode, run.stderr) == (0, "")
    output = " ".join(run.stdout.split())
    assert output.startswith("usage: terrainkit train [OPTIONS] ROBOT Train a policy for a robot ")
    assert "env options: Environments and episodes. --num-envs" in output
    assert "(default: 17)" in output
    assert "--rewards.wheel-slip FLOAT Wheels that slide. (default: -0.5)" in output
    assert "--laps INT A value that is in no section. (default: 3)" in output
    assert "--domain-rand.friction FLOAT FLOAT|none" in output
    assert "--asset.self-collisions, --asset.no-self-collisions" in output
    assert "(default: 0.3 1.25)" in output


def test_train_options_avoid_slow_imports():
    code = (
        "import sys; from terrainkit_cli.train_command import Train\n"
        "assert not {'terrainkit_robots.rl', 'mujoco'} & set(sys.modules)\n"
        "Train.parse(['quadruped', '--env.num-envs', '4'])\n"
        "assert not {'torch', 'mujoco', 'rsl_rl'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_train_flags_set_and_clear(tmp_path):
    path = tmp_path / "task.toml"
    path.write_text("[asset]\nself_collisions = true\n")
    words = ("quadruped", "--config", str(path))
    assert parse_words(*words).changed_config().asset.self_collisions
    cleared = parse_words(*words, "--asset.no-self-collisions").changed_config()
    assert not cleared.asset.self_collisions
    before = parse_words("--asset.self-collisions", "quadruped")
    assert (before.robot, before.changed_config().asset.self_collisions) == ("quadruped", True)
