import shutil
import subprocess
import sys
from dataclasses import dataclass, field, replace
from typing import Annotated

import pytest
import tyro

from terrainkit.errors import ConfigError
from terrainkit_cli.parse import UsageError, parse
from terrainkit_cli.robot_options import Output, Text
from terrainkit_cli.task_options import TaskCommand
from terrainkit_robots.rl import registry, tasks
from terrainkit_robots.rl.task import Commands, Env, Rewards, Task
from terrainkit_robots.rl.task_file import from_toml, values_of


@dataclass(frozen=True, kw_only=True)
class Train(TaskCommand):
    """Train a policy.

    On a ground.
    """

    terrain: Text = ""
    """The ground: an option that is called as a section is."""

    named: Annotated[str, tyro.conf.arg(name="robot")] = ""
    """An option with another name than its field."""

    output: Output = ""
    """An option with a short name."""

    quick: bool = False
    """A flag."""

    def run(self) -> int:
        """Do nothing."""
        return 0


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
def rover(monkeypatch, tmp_path):
    monkeypatch.setattr(tasks, "_registered", dict(tasks._registered))
    return registry.register("rover", tmp_path, RoverTask(env=Env(num_envs=17)))


def read(*words):
    """Return the command that words describe, as `terrainkit train` reads them."""
    return parse(Train.options(words), "terrainkit train", list(words))


def changes(command):
    """Return what the command line changed, by name."""
    before = dict(values_of(command.start_task()))
    return {name: new for name, new in values_of(command.task()) if new != before[name]}


def test_values_of_the_task_are_options():
    words = (
        "quadruped --rewards.tracking-lin-vel 1.25 --commands.lin-vel-x -1 2 --terrain rough.npz "
        "--terrain.collision plane --rewards.dof-acc -1e-8 --domain-rand.friction none "
        "--domain-rand.added-mass 0 3 --terrain.measure_heights true --quick "
        "--policy.actor-hidden-dims 64 32 --algorithm.symmetry loss --env.num-envs=64 "
        "--normalization.obs-scales.lin-vel 1 --commands.heading-command true --robot x -o y"
    )
    made = read(*words.split())
    assert (made.robot, made.terrain, made.quick) == ("quadruped", "rough.npz", True)
    assert (made.named, made.output) == ("x", "y")
    assert changes(made) == {
        "rewards.tracking_lin_vel": 1.25,
        "commands.lin_vel_x": (-1.0, 2.0),
        "terrain.collision": "plane",
        "rewards.dof_acc": -1e-8,
        "domain_rand.friction": None,
        "domain_rand.added_mass": (0.0, 3.0),
        "terrain.measure_heights": True,
        "policy.actor_hidden_dims": (64, 32),
        "algorithm.symmetry": "loss",
        "env.num_envs": 64,
        "normalization.obs_scales.lin_vel": 1.0,
        "commands.heading_command": True,
    }


def shown(value):
    if isinstance(value, tuple):
        return [word for part in value for word in shown(part)]
    return [str(value).lower() if isinstance(value, bool) or value is None else str(value)]


def test_every_value_can_be_given_as_it_is():
    words = ["quadruped"]
    for name, value in values_of(Task()):
        words += [f"--{name.replace('_', '-')}", *shown(value)]
    assert read(*words).task() == Task()


def test_the_robot_may_come_last_and_nothing_has_to_be_given():
    made = read("--rewards.tracking-lin-vel", "2", "--commands.lin-vel-y", "0", "1", "quadruped")
    assert made.robot == "quadruped"
    assert made.task().commands == Commands(lin_vel_y=(0.0, 1.0))
    own = registry.find("quadruped").task
    assert read("quadruped").task() == Train(robot="quadruped").task() == own
    assert read().robot == ""


def test_a_file_goes_before_the_robots_task_and_options_before_both(tmp_path, rover):
    path = tmp_path / "mine.toml"
    path.write_text("laps = 4\n[rewards]\nwheel_slip = -3\ntorques = -1\n")
    made = read("rover", "--config", str(path), "--rewards.torques", "-2")
    assert made.start_task() == from_toml(path.read_text(), rover.task)
    task = made.task()
    assert (task.laps, task.rewards.wheel_slip, task.rewards.torques) == (4, -3.0, -2.0)
    assert task.env.num_envs == 17


@pytest.mark.parametrize("words", [("rover", "--laps", "5"), ("--laps", "5", "rover")])
def test_a_task_of_ones_own_has_its_own_options(rover, words):
    made = read(*words, "--rewards.wheel-slip", "-1", "--rewards.tracking-lin-vel", "3")
    rewards = RoverRewards(wheel_slip=-1.0, tracking_lin_vel=3.0)
    assert made.task() == replace(rover.task, laps=5, rewards=rewards)


def test_an_onboarded_folder_has_the_standard_task(tmp_path):
    folder = tmp_path / "mine"
    folder.mkdir()
    shutil.copy(registry.find("quadruped").folder / "robot.toml", folder)
    assert read(str(folder), "--env.num-envs", "8").task() == Task(env=Env(num_envs=8))


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (
            ("quadruped", "--rewards.traking-lin-vel", "1"),
            r"^no option --rewards\.traking-lin-vel; did you mean --rewards\.tracking-lin-vel\?; ",
        ),
        (("quadruped", "--rewards.wheel-slip", "1"), r"^no option --rewards\.wheel-slip"),
        (("quadruped", "--reward.torques", "1"), r"did you mean --rewards\.torques\?"),
        (("quadruped", "--rewards.torques"), r"Missing value for argument '--rewards\.torques'"),
        (("quadruped", "--terain", "x"), r"^no option --terain; did you mean --terrain\?; --help"),
        (("quadruped", "rough.npz"), r"Unrecognized .*rough\.npz"),
    ],
)
def test_an_option_that_is_not_there_is_told_on_one_line(words, told):
    with pytest.raises(UsageError, match=told) as error:
        read(*words)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--rewards.torques", "x"), r"^rewards\.torques is 'x'; wanted a number$"),
        (("--rewards.tracking-sigma", "0"), r"^rewards\.tracking_sigma is 0\.0; wanted a number a"),
        (("--commands.lin-vel-x", "2", "1"), r"^commands\.lin_vel_x .*wanted the lower number fir"),
        (("--domain-rand.friction", "1"), r"^domain_rand\.friction has 1 values; wanted 2"),
        (("--env.num-envs", "1e3"), r"^env\.num_envs is 1000\.0; wanted a whole number"),
        (("--terrain.collision", "mesh"), r"^terrain\.collision is 'mesh'; wanted one of: auto, "),
        (("--asset.self-collisions", "yes"), r"^asset\.self_collisions is 'yes'; wanted true or f"),
        (("--normalization.obs-scales.lin-vel", "-1"), r"^normalization\.obs_scales\.lin_vel is"),
        (("--env.episode-length-s", "0.001"), r"^env\.episode_length_s is 0\.001; wanted one step"),
    ],
)
def test_a_value_that_is_out_of_range_is_named(words, told):
    with pytest.raises(ConfigError, match=told):
        read("quadruped", *words).task()


def test_what_the_task_starts_from_has_to_be_there(tmp_path):
    with pytest.raises(ConfigError, match=r"no robot 'quadrupd', .*did you mean quadruped\?"):
        read("quadrupd", "--rewards.torques", "1")
    with pytest.raises(ConfigError, match=r"cannot read .*missing\.toml"):
        read("quadruped", "--config", str(tmp_path / "missing.toml"))


@pytest.mark.usefixtures("rover")
def test_help_shows_the_values_of_the_robot_that_is_named(capsys):
    with pytest.raises(SystemExit) as end:
        read("rover", "--help")
    assert end.value.code in (0, None)
    told = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "Train a policy. On a ground." in told
    assert "--terrain PATH The ground: an option" in told
    assert "--env.num-envs INT Environments that are stepped together" in told
    assert "(default: 17)" in told
    assert "--rewards.wheel-slip FLOAT Wheels that slide. (default: -0.5)" in told
    assert "--laps INT A value that is in no section. (default: 3)" in told
    assert "--domain-rand.friction FLOAT FLOAT|none" in told
    assert "(default: 0.5 1.25)" in told


def test_help_is_given_whatever_is_missing(capsys):
    for words in (("--help",), ("-h", "no_such_robot")):
        with pytest.raises(SystemExit):
            read(*words)
        assert "--rewards.tracking-lin-vel FLOAT" in capsys.readouterr().out


def test_neither_torch_nor_mujoco_nor_typeguard_is_imported():
    code = (
        "import sys; from dataclasses import dataclass\n"
        "from terrainkit_cli.task_options import TaskCommand\n"
        "assert not {'terrainkit_robots.rl', 'mujoco'} & set(sys.modules)\n"
        "@dataclass(frozen=True, kw_only=True)\n"
        "class Train(TaskCommand):\n"
        "    def run(self): return 0\n"
        "Train.options(['quadruped', '--env.num-envs', '4'])\n"
        "assert not {'torch', 'mujoco', 'typeguard', 'rsl_rl'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
