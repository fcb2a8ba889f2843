"""Tasks by name: the folder of a robot, and the configuration of its training.

A task is registered with one line::

    register_task("rover", Path(__file__).parent / "rover", RoverTask())

In an installed package, an entry point of the group `terrainkit.tasks` with the name of the task
points to the module with that line, which is imported when the task is used. `load_task_file`
executes a single file. The tasks of the bundled robots are TOML files beside them. The folder of an
onboarded robot needs no registration.
"""

import math
import sys
from dataclasses import dataclass, replace
from functools import cache
from importlib import metadata
from os.path import isdir, isfile
from pathlib import Path
from types import ModuleType

from terrainkit.errors import ConfigError, plugin_errors
from terrainkit.settings.text import expected_names, truncate
from terrainkit_robots.description import bundled
from terrainkit_robots.rl.config import Env, Runner, Task
from terrainkit_robots.spec.robot_arrays import SPEC_FILE
from terrainkit_robots.spec.robot_spec import RobotSpec

ENTRY_POINTS = "terrainkit.tasks"
"""Entry point group in which other packages name their tasks."""

_registered: dict[str, "RegisteredTask"] = {}


@dataclass(frozen=True, kw_only=True)
class RegisteredTask:
    """A robot, and the configuration of its training."""

    name: str  # of the task; for a folder, the name in its robot.toml, which a task may share
    folder: Path  # with robot.toml
    task: Task  # configuration of training

    @property
    def trained_run(self) -> Path:
        """Folder of the run with the bundled trained policy; it may not exist."""
        return self.folder / "trained" / self.name


def register_task(name: str, folder: str | Path, task: Task | None = None) -> RegisteredTask:
    """Register a task; a second call replaces the configuration.

    Args:
        name: Name of the task, for `terrainkit train`.
        folder: Folder of an onboarded robot; it is not read.
        task: Configuration of training; the default one unless given.

    Raises:
        ConfigError: if the name is not a file name, or is registered with another folder.
    """
    if not isinstance(name, str) or name in ("", "..") or Path(name).name != name:
        raise ConfigError(f"task name: got {name!r}; expected a name without slashes")
    if not isinstance(task, Task | None):
        raise ConfigError(f"task {name}: got {task!r}; expected an instance of Task")
    new = RegisteredTask(name=name, folder=Path(folder).absolute(), task=task or Task())
    if (other := _registered.get(name, new)).folder != new.folder:
        raise ConfigError(f"task {name}: registered with {other.folder}; expected a new name")
    _registered[name] = new
    return new


@cache
def load_task_file(path: str | Path) -> RegisteredTask:
    """Execute a Python file that registers a task, once, and return the task.

    Args:
        path: The file, which calls `register_task` once.

    Raises:
        ConfigError: if there is no such file, or it registers no task or several.
        PluginError: if it fails.
    """
    path = Path(path)
    before = dict(_registered)
    if path.suffix != ".py" or not isfile(path):  # noqa: PTH113 - see `get_task`
        raise ConfigError(f"task: got {path}; expected a Python file that calls register_task")
    module = sys.modules[path.stem] = ModuleType(path.stem)  # dataclasses look there
    module.__file__ = str(path)
    with plugin_errors(f"task {path}"):
        exec(compile(path.read_bytes(), path, "exec"), vars(module))
    new = [task for name, task in _registered.items() if before.get(name) is not task]
    if len(new) != 1:
        raise ConfigError(f"{path}: got {len(new)} tasks; expected one call of register_task")
    return new[0]


def robot_and_task(robot: str, path: Path | None) -> tuple[str, Task | None]:
    """Return the robot and the task of a policy of another project.

    Args:
        robot: Name or folder of the robot; empty for the robot of the file.
        path: A file for `load_task_file`; None for the task of the robot.

    Returns:
        Name or folder of the robot, and the task of the file.

    Raises:
        ConfigError: if the file registers no task or several.
        PluginError: if it fails.
    """
    own = load_task_file(str(path)) if path else None
    return robot or (own.name if own else ""), own.task if own else None


def task_names() -> tuple[str, ...]:
    """Return the names of all tasks in alphabetical order; imports no module of a task."""
    return tuple(sorted({*_registered, *metadata.entry_points(group=ENTRY_POINTS).names}))


def get_task(name_or_folder: str | Path) -> RegisteredTask:
    """Return the task of that name, or the default task of the robot in that folder.

    A name has priority over a folder of that name; `./quadruped` is always a folder.

    Raises:
        ConfigError: if there is neither, listing the known names, or it cannot be loaded.
    """
    name, folder = str(name_or_folder), Path(name_or_folder)
    if name in _registered:
        return _registered[name]
    for plugin in metadata.entry_points(group=ENTRY_POINTS, name=name):
        with plugin_errors(f"task {name} ({plugin.value}) cannot be loaded"):
            plugin.load()  # it calls `register_task`
            if name not in _registered:
                raise ConfigError(f"expected a call of register_task({name!r}, ...)")
        return _registered[name]
    if not isdir(name):  # noqa: PTH112 - Path.is_dir raises OSError for long names
        from terrainkit_robots.description.robot_file import robot_names

        expected = expected_names(name, task_names(), "tasks are")
        if folder.suffix.lower() == ".npz":
            expected = f"a map is a terrain: `terrain={name}`; {expected}"
        for file in (name, f"{name}_description"):
            if file in robot_names() or folder.suffix in (".urdf", ".xacro", ".xml"):
                expected = f"terrainkit onboard {file} makes a folder; {expected}"
                break
        raise ConfigError(f"no task or robot folder {truncate(repr(name))}; {expected}")
    if not (folder / SPEC_FILE).exists():
        raise ConfigError(f"{folder} has no {SPEC_FILE}; expected a folder of terrainkit onboard")
    spec = RobotSpec.load(folder / SPEC_FILE)
    return RegisteredTask(name=spec.name, folder=folder.absolute(), task=default_task(spec))


def default_task(spec: RobotSpec) -> Task:
    """Return the task of an onboarded robot: of the bundled `biped` or `quadruped`, scaled to it.

    Velocities are equal in units of sqrt(g leg length), and yaw rates in sqrt(g / leg length).
    """
    is_biped = len(spec.feet) == 2
    bundled_folder = Path(bundled.__file__).parent / ("biped" if is_biped else "quadruped")
    task = Task.load(bundled_folder / "tasks" / f"{bundled_folder.name}.toml")
    reference = RobotSpec.load(bundled_folder / SPEC_FILE)
    sizes = spec.leg_length, reference.leg_length
    if not spec.leg_length:
        sizes = spec.base_height_target, reference.base_height_target
    length = (sizes[0] or 1.0) / (sizes[1] or 1.0)
    speed = math.sqrt(length)
    commands, randomization, rewards = task.commands, task.domain_rand, task.rewards

    def scaled(limits: tuple[float, float], factor: float) -> tuple[float, float]:
        return round(limits[0] * factor, 2), round(limits[1] * factor, 2)

    task = replace(
        task,
        env=Env(),
        commands=replace(
            commands,
            lin_vel_x=scaled(commands.lin_vel_x, speed),
            lin_vel_y=scaled(commands.lin_vel_y, speed),
            ang_vel_yaw=scaled(commands.ang_vel_yaw, 1 / speed),
            min_norm=round(commands.min_norm * speed, 2),
        ),
        init_state=replace(task.init_state, lin_vel=round(task.init_state.lin_vel * speed, 2)),
        domain_rand=replace(
            randomization,
            com_shift=round(randomization.com_shift * length, 3),
            max_push_vel_xy=None,
        ),
        rewards=replace(rewards, tracking_sigma=rewards.tracking_sigma * length),
        runner=Runner(),
    )
    if not is_biped:
        return task
    # Without an estimator, h1 stood for 1.8 s after 3.1 M samples. If tracking is paid out of step,
    # it takes 1.6 steps/s with 6 cm of swing and falls on 9 of 44 commands after 6.5 M; in step
    # only, 1.1 steps/s with 13 cm, and no falls.
    tracking = replace(
        task.rewards,
        tracking_lin_vel=3.0,
        tracking_ang_vel=1.5,
        progress=1.0,
        tracking_in_gait=True,
    )
    return replace(
        task,
        rewards=tracking,
        policy=replace(task.policy, estimator_hidden_dims=(128, 64)),
        algorithm=replace(task.algorithm, entropy_coef=0.002),
    )


for _path in Path(bundled.__file__).parent.glob("*/tasks/*.toml"):
    register_task(_path.stem, _path.parents[1], Task.load(_path))
