import dataclasses
import importlib.metadata
import re
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from terrainkit.errors import ConfigError
from terrainkit.settings.schema import flatten
from terrainkit_cli.main import COMMANDS
from terrainkit_robots.description import bundled
from terrainkit_robots.rl import rewards, scene, tasks
from terrainkit_robots.rl.config import Env, Task
from terrainkit_robots.rl.tasks import get_task, register_task, task_names

MINE = replace(Task(), env=Env(num_envs=7))
QUADRUPED = get_task("quadruped").folder


@pytest.fixture(autouse=True)
def restored_tasks(monkeypatch):
    """Restore the registered tasks after each test."""
    monkeypatch.setattr(tasks, "_registered", dict(tasks._registered))


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
    assert task_names() == ("biped", "quadruped", "quadruped_map", "rover")
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
    assert task_names() == ("biped", "quadruped", "quadruped_map", "rover")
    get_task("quadruped")
    assert "rover_tasks" not in sys.modules
    try:
        assert get_task("rover").folder == Path("/somewhere")
    finally:
        sys.modules.pop("rover_tasks", None)


@pytest.mark.parametrize(
    ("value", "told"),
    [
        ("no_such_package", r"task rover \(no_such_package\) cannot be loaded: ModuleNotFoundErr"),
        ("math:no_such_name", r"rover \(math:no_such_name\) cannot be loaded: AttributeError"),
        ("math", r"task rover \(math\) cannot be loaded: expected a call of register_task"),
        ("broken_tasks", r"cannot be loaded: RuntimeError: two lines$"),
        ("ended_tasks", r"task rover \(ended_tasks\) cannot be loaded: SystemExit: 0$"),
    ],
)
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
def guide(tmp_path, monkeypatch, plugin):
    """Import the code of the guide as the module my_package.trot, as its entry point would."""
    code = re.findall(r"```python\n(.*?)```", GUIDE.read_text(), re.DOTALL)
    point = tomllib.loads(re.findall(r"```toml\n(.*?)```", GUIDE.read_text(), re.DOTALL)[0])
    (name, module), *more = point["project"]["entry-points"][tasks.ENTRY_POINTS].items()
    assert len(code) == 1
    assert not more
    path = tmp_path / Path(*module.split(".")).with_suffix(".py")
    path.parent.mkdir()
    path.write_text(code[0])
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(rewards, "REWARDS", dict(rewards.REWARDS))
    plugin(module, name)
    yield get_task(name)
    for loaded in (module, module.partition(".")[0]):
        sys.modules.pop(loaded, None)


def test_task_of_the_guide_can_be_trained(guide):
    import numpy as np
    import torch

    from terrainkit_robots.rl.env import LeggedEnv
    from terrainkit_robots.rl.terrain import Plane

    assert (guide.name, guide.folder) == ("trotter", QUADRUPED)
    assert guide.task.rewards.trot == 0.5
    text = guide.task.to_toml()
    assert "# One diagonal pair of feet is on the ground" in text
    assert Task.from_toml(text.replace("trot = 0.5", "trot = 2.0"), guide.task).rewards.trot == 2.0
    task = replace(guide.task, env=Env(num_envs=4, num_threads=1))
    env = LeggedEnv(task, scene.Robot.load(guide.folder), Plane())
    function, scale = env.reward_terms["trot"]
    assert scale == 0.5
    env.state.foot_force[..., 2] = [[9, 0, 0, 9], [9, 9, 9, 9], [0, 6, 6, 0], [0, 4, 4, 0]]
    got = function(env.state, env.robot, task.rewards)
    np.testing.assert_array_equal(got, [1, 0, 1, 0])
    paid = env.step(torch.zeros(4, env.num_actions))[1]
    assert torch.isfinite(paid).all()


def test_guide_is_short_and_current():
    text = GUIDE.read_text()
    assert len(text.splitlines()) < 150
    for section in dataclasses.fields(Task):
        assert f"`{section.name}`" in text
    options = {f"--{name.replace('_', '-')}" for name, _ in flatten(Task())}
    for option in re.findall(r"--[a-z-]+\.[a-z-]+", text):
        assert option in options or option == "--rewards.trot"
    for command in set(re.findall(r"terrainkit ([a-z]+(?:-[a-z]+)*) ", text)):
        assert command in COMMANDS
