import dataclasses
import importlib.metadata
import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from terrainkit.errors import ConfigError
from terrainkit.settings.schema import flatten
from terrainkit_cli.main import COMMANDS
from terrainkit_robots.description import bundled
from terrainkit_robots.rl import scene, tasks
from terrainkit_robots.rl.config import Env, Runner, Task
from terrainkit_robots.rl.tasks import get_task, register_task, task_names
from tests.tables import read_table

MINE = replace(Task(), env=Env(num_envs=7))
QUADRUPED = get_task("quadruped").folder

pytestmark = pytest.mark.usefixtures("own_tasks")


@pytest.fixture
def plugin(monkeypatch):
    """Return a function that installs an entry point."""

    def install(value, name="rover"):
        point = importlib.metadata.EntryPoint(name, value, tasks.ENTRY_POINTS)
        points = importlib.metadata.EntryPoints((point,))
        monkeypatch.setattr(importlib.metadata, "entry_points", points.select)

    return install


@pytest.mark.parametrize("name", bundled.robot_names())
def test_bundled_robots_have_a_task(name):
    found = get_task(name)
    assert (found.name, found.folder) == (name, bundled.urdf_path(name).parent)
    assert name in task_names()
    read = scene.Robot.load(found.folder)
    assert read.mjcf.is_file()
    assert len(read.default_pose) == 12


def test_register_task_adds_a_task(tmp_path):
    made = register_task("rover", tmp_path, MINE)
    assert get_task("rover") is made
    assert (made.name, made.folder, made.task) == ("rover", tmp_path, MINE)
    assert task_names() == ("biped", "quadruped", "quadruped_hard", "quadruped_map", "rover")
    assert register_task("standard", tmp_path).task == Task()


def test_register_task_keeps_the_folder(tmp_path):
    register_task("quadruped", QUADRUPED, MINE)
    assert get_task("quadruped").task == MINE
    with pytest.raises(ConfigError, match=r"registered with .*quadruped; expected a new name"):
        register_task("quadruped", tmp_path)
    assert get_task("quadruped").task == MINE


def test_register_task_rejects_paths_and_classes(tmp_path):
    for name in ("", "a/b", "..", 3):
        with pytest.raises(ConfigError, match="expected a name without slashes"):
            register_task(name, tmp_path)
    with pytest.raises(ConfigError, match=r"task rover: got <class .*; expected an instance of"):
        register_task("rover", tmp_path, Task)


@pytest.mark.parametrize("kind", [str, Path])
def test_get_task_accepts_a_folder(tmp_path, monkeypatch, kind):
    folder = tmp_path / "quadruped"
    folder.mkdir()
    (folder / "robot.toml").write_bytes((QUADRUPED / "robot.toml").read_bytes())
    found = get_task(kind(folder))
    assert (found.name, found.folder, found.task) == ("quadruped", folder, Task())
    monkeypatch.chdir(tmp_path)
    assert get_task("./quadruped").folder == folder
    assert get_task("quadruped").folder == QUADRUPED


def test_folder_of_a_biped_estimates_its_velocity_and_tracks_it_more():
    biped = get_task("biped")
    task = get_task(biped.folder).task
    assert task.policy.estimator_hidden_dims
    assert task.rewards.tracking_in_gait
    assert not task.observations.base_lin_vel
    assert task.rewards.feet_gait == biped.task.rewards.feet_gait
    for name in ("tracking_lin_vel", "tracking_ang_vel", "progress"):
        assert getattr(task.rewards, name) == 2 * getattr(biped.task.rewards, name)
    assert task.commands == biped.task.commands
    assert task.env == Task().env != biped.task.env


def test_commands_of_a_folder_are_scaled_to_the_legs(tmp_path):
    text = (QUADRUPED / "robot.toml").read_text()
    (tmp_path / "robot.toml").write_text(text.replace("leg_length = 0.448", "leg_length = 0.112"))
    task = get_task(tmp_path).task
    # A quarter of the length: half of the velocity, and twice the yaw rate.
    assert (task.commands.lin_vel_x, task.commands.lin_vel_y) == ((-0.5, 0.5), (-0.25, 0.25))
    assert (task.commands.ang_vel_yaw, task.commands.min_norm) == ((-2.0, 2.0), 0.1)
    assert (task.init_state.lin_vel, task.domain_rand.com_shift) == (0.25, 0.007)
    assert task.rewards.tracking_sigma == pytest.approx(0.015)


def test_unknown_task_lists_known_ones(tmp_path):
    told = r"'quadrupde'; did you mean 'quadruped'\? Tasks are: biped, quadruped, qua"
    with pytest.raises(ConfigError, match=told):
        get_task("quadrupde")
    with pytest.raises(ConfigError, match=r"has no robot\.toml; expected a folder of terrainkit"):
        get_task(tmp_path)
    (tmp_path / "robot.toml").write_text("x = 1")
    with pytest.raises(ConfigError, match=r"robot\.toml: format_version: got nothing"):
        get_task(tmp_path)
    for odd in ("", "a\0b", "a" * 5000):
        with pytest.raises(ConfigError) as error:
            get_task(odd)
        assert "\n" not in str(error.value)
        assert len(str(error.value)) < 400


def test_entry_point_is_imported_on_use(tmp_path, monkeypatch, plugin):
    (tmp_path / "rover_tasks.py").write_text(
        "from terrainkit_robots.rl.tasks import register_task\n"
        "rover = register_task('rover', '/somewhere')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    plugin("rover_tasks")
    assert task_names() == ("biped", "quadruped", "quadruped_hard", "quadruped_map", "rover")
    get_task("quadruped")
    assert "rover_tasks" not in sys.modules
    try:
        assert get_task("rover").folder == Path("/somewhere")
    finally:
        sys.modules.pop("rover_tasks", None)


@pytest.mark.parametrize(("value", "told"), read_table(__file__, "invalid_entry_point_fails"))
def test_invalid_entry_point_fails_on_use(tmp_path, monkeypatch, plugin, value, told):
    (tmp_path / "broken_tasks.py").write_text("raise RuntimeError('two\\nlines')\n")
    (tmp_path / "ended_tasks.py").write_text("raise SystemExit(0)\n")
    monkeypatch.syspath_prepend(tmp_path)
    plugin(value)
    assert "rover" in task_names()
    assert get_task("quadruped").name == "quadruped"
    with pytest.raises(ConfigError, match=told):
        get_task("rover")


GUIDE = Path(__file__).parents[3] / "docs" / "adding_a_robot.md"


@pytest.fixture
def guide(tmp_path):
    """Return the task in the code of the guide."""
    [code] = re.findall(r"```python\n(.*?)```", GUIDE.read_text(), re.DOTALL)
    assert len(code.splitlines()) < 70
    path = tmp_path / "crouch.py"
    path.write_text(code)
    yield tasks.load_task_file(str(path))
    sys.modules.pop("crouch")


def test_task_of_the_guide_has_its_terms(guide):
    import numpy as np
    import torch

    from terrainkit_robots.rl.env import make_env
    from terrainkit_robots.rl.env_state import env_state
    from terrainkit_robots.rl.terrain import Plane

    assert (guide.name, guide.folder) == ("crouch", QUADRUPED)
    text = guide.task.to_toml()
    assert "# Error of the height of the base" in text
    assert "rnn_type" in text
    changed = Task.from_toml(text.replace("height = -20.0", "height = -2.0"), guide.task)
    assert changed.rewards.height == -2.0
    task = replace(guide.task, env=Env(num_envs=4, num_threads=1))
    env = make_env(task, scene.Robot.load(guide.folder), Plane())
    assert [*env.obs_terms["policy"]][-2:] == ["height_command", "front_feet"]
    assert env.mirror_maps.groups["policy"].index[-2:].tolist() == [143, 142]
    height = env.active_commands["height"].values
    assert 0.2 <= height.min() < height.max() <= 0.35
    assert env_state(env)["arrays"]["height.values"].tolist() == height.tolist()
    env.state.base_height[:] = height[:, 0] + np.float32([0, 0.5, -1, 2])
    function, scale = env.active_rewards["height"]
    assert (function(env).round(4).tolist(), scale) == ([0, 0.25, 1, 4], -20)
    before = env.sim.qvel[:, 1].copy()
    env.active_events["gust"].step(env)
    assert (env.sim.qvel[:, 1] != before).all()
    env.sim.qpos[1, 2], env.sim.qpos[1, env.scene.joint_qpos] = 0.08, [0, 1.5, -2.5] * 4
    *_, dones, _ = env.step(torch.zeros(4, env.num_actions))
    assert dones.tolist() == [False, True, False, False]


@pytest.mark.parametrize(
    ("code", "told"),
    [
        ("", "got 0 tasks; expected one call of register_task"),
        ("1 / 0", "ZeroDivisionError: division by zero"),
        ("def f(:", "SyntaxError: invalid syntax"),
        ("raise SystemExit(3)", "SystemExit: 3"),
    ],
)
def test_invalid_task_file_is_named(tmp_path, code, told):
    path = tmp_path / "mine.py"
    path.write_text(code)
    with pytest.raises(ConfigError, match=rf"mine\.py: .*{re.escape(told)}"):
        tasks.load_task_file(str(path))
    with pytest.raises(ConfigError, match=r"got .*other\.py; expected a Python file"):
        tasks.load_task_file(str(tmp_path / "other.py"))


@pytest.mark.parametrize(
    "name", ["os:system", "torch.nn.Linear", "terrainkit_robots.rl.env:LeggedEnv"]
)
def test_run_cannot_name_functions_of_other_modules(name):
    from terrainkit_robots.rl.runner import runner_config

    task = Task(runner=Runner(rsl_rl={"actor": {"class_name": name}}))
    expected = r"runner\.rsl_rl\.actor\.class_name: got .*; expected a class of rsl-rl"
    with pytest.raises(ConfigError, match=expected):
        runner_config(task)


@pytest.mark.parametrize("name", ["logger", "seed", "num_steps_per_env"])
def test_rsl_rl_table_replaces_no_other_settings(name):
    from terrainkit_robots.rl.runner import runner_config

    with pytest.raises(ConfigError, match=f"runner.rsl_rl: got {name}; expected one of: actor,"):
        runner_config(Task(runner=Runner(rsl_rl={name: 3})))


def test_guide_is_short_and_current():
    text = GUIDE.read_text()
    assert len(text.splitlines()) < 240
    for section in dataclasses.fields(Task):
        assert f"`{section.name}`" in text
    options = {f"--{name.replace('_', '-')}" for name, _ in flatten(Task())}
    for option in re.findall(r"--[a-z-]+\.[a-z-]+", text):
        assert option in options or option == "--rewards.height"
    for command in set(re.findall(r"terrainkit ([a-z]+(?:-[a-z]+)*) ", text)):
        assert command in COMMANDS
