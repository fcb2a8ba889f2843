import dataclasses
import importlib.metadata
import re
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from terrainkit.errors import ConfigError
from terrainkit_cli.main import COMMANDS
from terrainkit_robots.description import bundled
from terrainkit_robots.rl import registry, rewards, robot
from terrainkit_robots.rl.task import Env, Task
from terrainkit_robots.rl.task_file import from_toml, to_toml, values_of

MINE = replace(Task(), env=Env(num_envs=7))
QUADRUPED = registry.find("quadruped").folder


@pytest.fixture(autouse=True)
def forgotten(monkeypatch):
    """Forget afterwards what a test registers."""
    monkeypatch.setattr(registry, "_registered", dict(registry._registered))


@pytest.fixture
def plugin(monkeypatch):
    """Install an entry point called rover, which is nothing but its name yet."""

    def install(value):
        point = importlib.metadata.EntryPoint("rover", value, registry.ENTRY_POINTS)
        found = {registry.ENTRY_POINTS: (point,)}
        monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: found[group])

    return install


@pytest.mark.parametrize("name", bundled.names())
def test_bundled_robots_are_registered_and_can_be_trained(name):
    found = registry.find(name)
    assert (found.name, found.folder) == (name, bundled.find(name).parent)
    assert name in registry.names()
    read = robot.load_robot(found.folder)
    assert read.mjcf.is_file()
    assert len(read.default_pose) == 12


def test_one_line_registers_a_robot_and_its_task(tmp_path):
    made = registry.register("rover", tmp_path, MINE)
    assert registry.find("rover") is made
    assert (made.name, made.folder, made.task) == ("rover", tmp_path, MINE)
    assert registry.names() == ("biped", "quadruped", "quadruped_map", "rover")
    assert registry.register("standard", tmp_path).task == Task()


def test_a_robot_may_get_another_task_but_no_other_robot_its_name(tmp_path):
    registry.register("quadruped", QUADRUPED, MINE)
    assert registry.find("quadruped").task == MINE
    with pytest.raises(ConfigError, match=r"quadruped is .*quadruped already; wanted another name"):
        registry.register("quadruped", tmp_path)
    assert registry.find("quadruped").task == MINE


@pytest.mark.parametrize("name", ["", "a/b", "/a", ".", "..", 3])
def test_a_name_is_no_path(tmp_path, name):
    with pytest.raises(ConfigError, match="wanted a name that is no path"):
        registry.register(name, tmp_path)


def test_a_task_is_an_instance_of_task(tmp_path):
    with pytest.raises(ConfigError, match=r"the task of rover is <class .*; wanted an instance of"):
        registry.register("rover", tmp_path, Task)


@pytest.mark.parametrize("kind", [str, Path])
def test_a_folder_is_a_task_of_its_own(tmp_path, monkeypatch, kind):
    folder = tmp_path / "quadruped"
    folder.mkdir()
    (folder / "robot.toml").write_bytes((QUADRUPED / "robot.toml").read_bytes())
    found = registry.find(kind(folder))
    assert (found.name, found.folder, found.task) == ("quadruped", folder, Task())
    monkeypatch.chdir(tmp_path)
    assert registry.find("./quadruped").folder == folder
    assert registry.find("quadruped").folder == QUADRUPED


def test_what_is_unknown_is_told_with_what_exists(tmp_path):
    told = r"no robot 'quadrupde', .*; did you mean quadruped\?; there are: biped, quadruped, qua"
    with pytest.raises(ConfigError, match=told):
        registry.find("quadrupde")
    with pytest.raises(ConfigError, match=r"has no robot\.toml; wanted a folder that terrainkit"):
        registry.find(tmp_path)
    (tmp_path / "robot.toml").write_text("x = 1")
    with pytest.raises(ConfigError, match=r"robot\.toml: format_version is missing"):
        registry.find(tmp_path)


@pytest.mark.parametrize("name", ["", "a\0b", "a" * 5000])
def test_odd_names_are_errors_on_one_short_line(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError) as error:
        registry.find(name)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 400


def test_an_entry_point_is_imported_when_it_is_asked_for(tmp_path, monkeypatch, plugin):
    (tmp_path / "rover_tasks.py").write_text(
        "from terrainkit_robots.rl.registry import register\n"
        "rover = register('rover', '/somewhere')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    plugin("rover_tasks")
    assert registry.names() == ("biped", "quadruped", "quadruped_map", "rover")
    registry.find("quadruped")
    assert "rover_tasks" not in sys.modules
    try:
        assert registry.find("rover").folder == Path("/somewhere")
    finally:
        sys.modules.pop("rover_tasks", None)


@pytest.mark.parametrize(
    ("value", "told"),
    [
        ("no_such_package", r"task rover \(no_such_package\) cannot be loaded: ModuleNotFoundErr"),
        ("math:no_such_name", r"rover \(math:no_such_name\) cannot be loaded: AttributeError"),
        ("math", r"task rover \(math\) registers no task of that name; it has to call register"),
    ],
)
def test_an_entry_point_that_leads_nowhere_is_an_error_once_it_is_used(plugin, value, told):
    plugin(value)
    assert "rover" in registry.names()
    assert registry.find("quadruped").name == "quadruped"
    with pytest.raises(ConfigError, match=told):
        registry.find("rover")


def test_a_module_that_fails_is_told_on_one_line(tmp_path, monkeypatch, plugin):
    (tmp_path / "broken_tasks.py").write_text("raise RuntimeError('two\\nlines')\n")
    monkeypatch.syspath_prepend(tmp_path)
    plugin("broken_tasks")
    with pytest.raises(ConfigError, match=r"cannot be loaded: RuntimeError: two lines$"):
        registry.find("rover")


GUIDE = Path(__file__).parents[3] / "docs" / "adding_a_robot.md"


@pytest.fixture
def guide(tmp_path, monkeypatch):
    """Import the code of the guide as the module my_package.trot, as its entry point would."""
    code = re.findall(r"```python\n(.*?)```", GUIDE.read_text(), re.DOTALL)
    point = tomllib.loads(re.findall(r"```toml\n(.*?)```", GUIDE.read_text(), re.DOTALL)[0])
    (name, module), *more = point["project"]["entry-points"][registry.ENTRY_POINTS].items()
    assert len(code) == 1
    assert not more
    path = tmp_path / Path(*module.split(".")).with_suffix(".py")
    path.parent.mkdir()
    path.write_text(code[0])
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(rewards, "REWARDS", dict(rewards.REWARDS))
    found = (importlib.metadata.EntryPoint(name, module, registry.ENTRY_POINTS),)
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: found)  # noqa: ARG005
    yield registry.find(name)
    for loaded in (module, module.partition(".")[0]):
        sys.modules.pop(loaded, None)


def test_the_task_of_the_guide_is_found_saved_and_trained_with(guide):
    import numpy as np
    import torch

    from terrainkit_robots.rl.env import LeggedEnv
    from terrainkit_robots.rl.ground import Plane

    assert (guide.name, guide.folder) == ("trotter", QUADRUPED)
    assert guide.task.rewards.trot == 0.5
    text = to_toml(guide.task)
    assert "# One diagonal pair of feet on the ground" in text
    assert from_toml(text.replace("trot = 0.5", "trot = 2.0"), guide.task).rewards.trot == 2.0
    task = replace(guide.task, env=Env(num_envs=4, num_threads=1))
    env = LeggedEnv(task, robot.load_robot(guide.folder), Plane())
    function, scale = env.rewards["trot"]
    assert scale == 0.5
    env.state.foot_force[..., 2] = [[9, 0, 0, 9], [9, 9, 9, 9], [0, 6, 6, 0], [0, 4, 4, 0]]
    got = function(env.state, env.robot, task.rewards)
    np.testing.assert_array_equal(got, [1, 0, 1, 0])
    paid = env.step(torch.zeros(4, env.num_actions))[1]
    assert torch.isfinite(paid).all()


def test_the_guide_is_short_and_names_what_exists():
    text = GUIDE.read_text()
    assert len(text.splitlines()) < 150
    for section in dataclasses.fields(Task):
        assert f"`{section.name}`" in text
    options = {f"--{name.replace('_', '-')}" for name, _ in values_of(Task())}
    for option in re.findall(r"--[a-z-]+\.[a-z-]+", text):
        assert option in options or option == "--rewards.trot"
    for command in set(re.findall(r"terrainkit ([a-z]+(?:-[a-z]+)*) ", text)):
        assert command in COMMANDS


def test_neither_torch_nor_mujoco_is_imported():
    code = (
        "import sys; from terrainkit_robots.rl import registry; registry.find('quadruped'); "
        "from terrainkit_robots.rl.task_file import to_toml; "
        "assert to_toml(registry.find('biped').task); "
        "assert not {'torch', 'mujoco', 'rsl_rl'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
