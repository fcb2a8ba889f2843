"""The registry: what can be trained, by name: a robot's folder and its task.

A task is named as the robot; a second one of the same robot says what it is for, too.

One line adds yours::

    register("rover", Path(__file__).parent / "rover", RoverTask())

In a package that is installed, an entry point of the group `terrainkit.tasks` with the same name
says which module has that line; it is imported when the task is asked for, not before. A folder
that `terrainkit onboard` wrote needs none of this: its path is enough.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from terrainkit.errors import ConfigError, listing
from terrainkit_robots.description import bundled
from terrainkit_robots.rl.scene import SPEC_FILE
from terrainkit_robots.rl.task import (
    Algorithm,
    Commands,
    Control,
    DomainRand,
    Noise,
    Policy,
    Rewards,
    Runner,
    Task,
    Terrain,
)
from terrainkit_robots.spec.spec_file import read_spec
from terrainkit_robots.text import closest, short

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

ENTRY_POINTS = "terrainkit.tasks"
"""Group of the entry points of other packages."""

SHIPPED = "trained"
"""Folder of a robot that holds policies that come along, each in a folder named as its task."""

_CLOSE = 0.7
"""Share of common letters from which a name is what another was meant for."""

_registered: dict[str, "Registered"] = {}


@dataclass(frozen=True, kw_only=True)
class Registered:
    """A robot, and its task."""

    name: str
    """Name of the robot. Of a folder that was given by its path it is the one in its spec, which a
    registered robot may have as well: what is to be found again needs the folder."""

    folder: Path
    """Where its robot.toml is."""

    task: Task
    """What it is trained for."""

    @property
    def shipped(self) -> Path:
        """Where the run is whose policy comes along, if there is one."""
        return self.folder / SHIPPED / self.name


def register(name: str, folder: str | Path, task: Task | None = None) -> Registered:
    """Make `name` stand for the robot in `folder`; once more, with another task.

    Args:
        name: What `terrainkit train` is to call it.
        folder: An onboarded robot; it is not read yet.
        task: What it is trained for; unless given, the standard task.

    Raises:
        ConfigError: if the name is none, or stands for another robot.
    """
    task = Task() if task is None else task
    if not isinstance(name, str) or name in ("", "..") or Path(name).name != name:
        raise ConfigError(f"a task called {name!r}; wanted a name that is no path")
    if not isinstance(task, Task):
        raise ConfigError(f"the task of {name} is {task!r}; wanted an instance of Task")
    made = Registered(name=name, folder=Path(folder).absolute(), task=task)
    before = _registered.setdefault(name, made)
    if before.folder != made.folder:
        raise ConfigError(f"{name} is {before.folder} already; wanted another name")
    _registered[name] = made
    return made


def names() -> tuple[str, ...]:
    """Return every name, in alphabetical order; imports nothing."""
    return tuple(sorted({*_registered, *_plugins()}))


def find(name_or_folder: str | Path) -> Registered:
    """Return what is registered as `name_or_folder`, or else the robot in that folder.

    A name goes before a folder here that is called so; `./quadruped` is always a folder.

    Raises:
        ConfigError: if there is neither, listing what exists; or if it cannot be loaded.
    """
    name = str(name_or_folder)
    if name not in _registered and (point := _plugins().get(name)) is not None:
        _load(point)
    if name in _registered:
        return _registered[name]
    folder = Path(name_or_folder)
    try:
        if folder.is_dir():
            spec = read_spec(_spec_file(folder))
            return Registered(name=spec.name, folder=folder.absolute(), task=Task())
    except OSError as error:
        raise ConfigError(f"cannot read {short(name)}: {error.strerror or error}") from error
    near = closest(name, names(), _CLOSE)
    meant = f"; did you mean {near}?" if near else ""
    raise ConfigError(
        f"no robot {short(name)!r}, nor a folder that terrainkit onboard wrote{meant}; "
        f"there are: {listing(names())}"
    )


def _spec_file(folder: Path) -> Path:
    path = folder / SPEC_FILE
    if not path.exists():
        raise ConfigError(
            f"{folder} has no {SPEC_FILE}; wanted a folder that terrainkit onboard wrote"
        )
    return path


def _plugins() -> dict[str, "EntryPoint"]:
    """Return the entry point of each task that another installed package brings, by name."""
    from importlib.metadata import entry_points

    return {point.name: point for point in entry_points(group=ENTRY_POINTS)}


def _load(point: "EntryPoint") -> None:
    """Import what registers the task that the entry point is called after.

    Raises:
        ConfigError: if it fails, or registers no such task.
    """
    what = f"task {point.name} ({point.value})"
    try:
        point.load()
    except Exception as error:  # it is other people's module: anything may be raised
        told = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        raise ConfigError(f"{what} cannot be loaded: {' '.join(told.split())}") from error
    if point.name not in _registered:
        raise ConfigError(f"{what} registers no task of that name; it has to call register()")


_QUADRUPED = Task(
    # Softer than what stands best: an action has to reach as far as a step does.
    control=Control(stiffness=40.0, damping=1.0, action_scale=0.25),
    policy=Policy(init_noise_std=0.7),
)

_BUNDLED = {
    "quadruped": ("quadruped", _QUADRUPED),
    # For a plane first and a map then, so on both it sees the ground and is given headings. Few and
    # clear heights: each number that tells nothing yet takes its part of what an update may change.
    # On stairs it has to lift its feet, both alike; not to fall has to pay, and to go on more than
    # to stand still; what it does at random makes it fall. docs/training.md tells how each was met.
    "quadruped_map": (
        "quadruped",
        replace(
            _QUADRUPED,
            terrain=Terrain(
                max_init_level=1,
                measure_heights=True,
                measured_points_x=(-0.8, -0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6, 0.8),
                measured_points_y=(-0.4, -0.2, 0.0, 0.2, 0.4),
            ),
            commands=Commands(heading_command=True),
            domain_rand=DomainRand(max_push_vel_xy=0.5),
            rewards=Rewards(
                tracking_lin_vel=3.0,
                tracking_ang_vel=1.0,
                orientation=-0.2,
                collision=-0.25,
                termination=-100.0,
                feet_air_time=3.0,
                air_time_target=0.2,
                foot_clearance=-5.0,
                foot_clearance_target=0.12,
            ),
            noise=Noise(height_measurements=0.02),
            algorithm=Algorithm(entropy_coef=0.001, desired_kl=0.008, symmetry="loss"),
            runner=Runner(num_steps_per_env=48),
        ),
    ),
    # Slower than four legs, and falling costs: else it learns to fall forward first.
    "biped": (
        "biped",
        Task(
            commands=Commands(
                lin_vel_x=(-0.4, 0.8), lin_vel_y=(-0.2, 0.2), ang_vel_yaw=(-0.5, 0.5), min_norm=0.1
            ),
            domain_rand=DomainRand(max_push_vel_xy=0.5),
            rewards=Rewards(termination=-100.0, air_time_target=0.3),
            policy=Policy(init_noise_std=0.7),
        ),
    ),
}
"""Tasks of the bundled robots: the robot, and what it is trained for."""

for _name, (_robot, _task) in _BUNDLED.items():
    register(_name, Path(bundled.__file__).parent / _robot, _task)
