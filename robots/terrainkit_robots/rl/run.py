"""Run folders: what training writes, and what it needs to continue.

A run has `task.toml`, `robot.toml` (the spec as it was trained), `run.toml` (robot, terrain and
versions), `map.toml` (the config of its map, if any), `model_<iteration>.pt` checkpoints, and, on a
map, `curriculum.png` (success and visits of the patches at the end of training).
"""

import hashlib
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import datetime
from importlib.metadata import version
from os.path import isdir, isfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from terrainkit import MapConfig, TerrainMap
from terrainkit.errors import (
    ConfigError,
    ExportError,
    TerrainkitWarning,
    listing,
    prefixed_errors,
)
from terrainkit.files.atomic_write import atomic_folder, atomic_write
from terrainkit.settings.schema import Config
from terrainkit.settings.text import expected_names
from terrainkit.settings.toml_text import read_text
from terrainkit_robots.checkpoint import TRAINING_KEYS, read_checkpoint
from terrainkit_robots.files import require_utf8
from terrainkit_robots.rl import tasks
from terrainkit_robots.rl.config import Task
from terrainkit_robots.spec.robot_arrays import SPEC_FILE, Robot
from terrainkit_robots.spec.robot_spec import RobotSpec
from terrainkit_robots.text import free_name

if TYPE_CHECKING:
    from terrainkit_robots.rl.observations import PolicyInterface

RUN_FILE, TASK_FILE, MAP_FILE = "run.toml", "task.toml", "map.toml"
CURRICULUM_FILE, LOCK_FILE = "curriculum.png", ".lock"


@dataclass(frozen=True, kw_only=True)
class RunInfo(Config):
    """The content of `run.toml`: what a run was made from."""

    format_version: Literal[1] = 1
    """Version of the files of a run."""
    robot: str
    """Name of a registered task, or the absolute path of the robot's folder."""
    terrain: str
    """`plane`, or the path of a map or its config."""
    seed: int
    """Seed of all random numbers."""
    started: str
    """Date and time."""
    versions: Mapping[str, str]
    """Versions of the packages."""
    robot_sha256: Mapping[str, str] | None = None
    """Digest of the robot's model by file name."""
    averaged: tuple[int, ...] = ()
    """Iterations of the checkpoints whose networks were averaged."""
    base: str = ""
    """Checkpoint of another run that is the other half of the mean; empty for none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PolicySpec:
    """A policy with its task, robot and terrain: a run, or a function `policy` from outside."""

    task: Task  # the configuration of its environment
    robot: Robot  # the robot, with the spec it was trained with
    terrain: str = "plane"  # of the training, as `load_terrain` takes it: `plane` or a path
    policy: Callable[[Any], Any] | None = None
    """A function from observations, a tensor of shape (n, k), to actions, a tensor or array of
    shape (n, a). It replaces the checkpoint."""
    checkpoint: Path | None = None  # of a run, by default the last; None if there is none
    interface: "PolicyInterface | None" = None  # of a policy of another project

    @property
    def policy_name(self) -> str:
        """The name of the policy or of the checkpoint, in results."""
        if self.policy is not None:
            return getattr(self.policy, "__name__", type(self.policy).__name__)
        return self.checkpoint.name if self.checkpoint else ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run(PolicySpec):
    """A training run."""

    folder: Path  # folder of the run
    info: RunInfo  # what it was made from


def checkpoints(folder: Path) -> dict[int, Path]:
    """Return the checkpoints in a folder by iteration, in order."""
    paths = folder.glob("model_*.pt")
    matches = ((re.fullmatch(r"model_([0-9]{1,12})\.pt", path.name), path) for path in paths)
    return dict(sorted((int(match[1]), path) for match, path in matches if match))


def default_folder(robot: str) -> Path:
    """Return the folder of a new run, `logs/<robot>/<date-time>`."""
    # The name may come from an untrusted file.
    parent = Path("logs") / (re.sub(r"[^\w.-]+", "_", robot).strip(".") or "robot")
    existing = {path.name for path in parent.iterdir()} if parent.is_dir() else set()
    return parent / free_name(datetime.now().strftime("%Y-%m-%d_%H-%M-%S"), existing)


def create_run(folder: Path, task: Task, robot_name: str | Path, terrain: str | Path) -> Run:
    """Create the folder of a new run; `robot_name` is a task's name or an onboarded folder.

    Raises:
        ConfigError: If there is no such robot, or the terrain's file cannot be read.
        ExportError: If the folder is not empty, or cannot be written.
    """
    robot, source = _sources(robot_name, terrain)
    robot_folder = tasks.get_task(robot_name).folder
    map_config = _map_config(source)
    info = RunInfo(
        robot=robot,
        terrain=source,
        seed=task.runner.seed,
        started=datetime.now().astimezone().isoformat(timespec="seconds"),
        versions={name: version(name) for name in ("terrainkit", "mujoco", "rsl-rl-lib", "torch")},
        robot_sha256=_model_digest(robot_folder / RobotSpec.load(robot_folder / SPEC_FILE).mjcf),
    )
    files = {RUN_FILE: info.to_toml(), TASK_FILE: task.to_toml()}
    files[SPEC_FILE] = read_text(robot_folder / SPEC_FILE)
    if map_config is not None:
        files[MAP_FILE] = map_config.to_toml()
    write_run_folder(folder, {name: text.encode() for name, text in files.items()})
    return open_run(folder)


@contextmanager
def run_lock(folder: Path) -> Iterator[None]:
    """Hold the lock of a run, so that no other process trains in its folder.

    Raises:
        ConfigError: If another process holds it.
    """
    from filelock import FileLock, Timeout

    lock = FileLock(folder / LOCK_FILE)
    try:
        lock.acquire(timeout=0)
    except Timeout:
        hint = "wait until it ends, or choose another folder"
        raise ConfigError(f"{folder}: another process trains in this folder; {hint}") from None
    except (NotImplementedError, OSError):  # some network file systems have no locks
        pass
    try:
        yield
    finally:
        lock.release()


def write_run_folder(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write a new folder with some files, completely or not at all.

    Args:
        folder: The folder.
        files: Content of each file by name.

    Raises:
        ExportError: If the folder is not empty, or cannot be written.
    """
    require_utf8(folder)
    with atomic_folder(folder) as new:
        if folder.is_dir() and any(folder.iterdir()):
            hint = f"choose another folder, or continue with --resume {folder}"
            raise ExportError(f"{folder} exists; {hint}")
        for name, data in files.items():
            (new / name).write_bytes(data)


def open_run(
    name: str | Path, checkpoint: int | None = None, task_file: str | Path | None = None
) -> Run:
    """Open a run.

    Args:
        name: Its folder, one of its checkpoints, or a robot with a shipped policy.
        checkpoint: Iteration of the checkpoint to select; by default the checkpoint `name`, or the
            last one.
        task_file: Python file with the task of the run, which is executed. A run names its task,
            but executes nothing by itself.

    Warns:
        TerrainkitWarning: If the robot's model changed after training.

    Raises:
        ConfigError: If there is no such run or checkpoint, or its task or robot is missing.
        PluginError: If the task file fails.
    """
    if task_file is not None:
        tasks.load_task_file(str(task_file))
    folder, selected = _resolve_run(name)
    if not (folder / RUN_FILE).is_file():
        raise ConfigError(f"{folder} has no {RUN_FILE}; terrainkit train writes such a folder")
    info = RunInfo.load(folder / RUN_FILE)
    try:
        terrain = info.terrain
        found = tasks.get_task(info.robot)
    except ConfigError as error:
        hint = "if it is a task of your own, give its Python file with --task"
        raise ConfigError(f"the task of {folder} is missing: {error}; {hint}") from error
    robot = Robot.from_spec(RobotSpec.load(folder / SPEC_FILE), found.folder)
    if not robot.mjcf.is_file():
        raise ConfigError(f"the robot of {folder} is missing: there is no file {robot.mjcf}")
    # The run has its own copy of the spec, so only a change of the model matters.
    digest = _model_digest(robot.mjcf)
    if not digest.items() <= (info.robot_sha256 or digest).items():
        message = f"{info.robot}: {robot.mjcf.name} changed after {folder} was trained"
        warnings.warn(message, TerrainkitWarning, stacklevel=2)
    if terrain != "plane":
        # A map whose file is missing is generated again from its config.
        file, config = folder / terrain, folder / MAP_FILE
        used = config if config.is_file() and not file.is_file() else file
        terrain = str(used.resolve())
    saved = checkpoints(folder)
    if checkpoint is not None and checkpoint not in saved:
        expected = f"expected one of: {listing(map(str, saved))}"
        raise ConfigError(f"{folder}: got checkpoint {checkpoint}; {expected}")
    last = saved[max(saved)] if saved else None
    return Run(
        folder=folder,
        info=info,
        # A key that an older version did not write has its default, not the value of the task that
        # is registered today.
        task=Task.load(folder / TASK_FILE, found.task.with_defaults()),
        robot=robot,
        terrain=terrain,
        checkpoint=selected or last if checkpoint is None else saved[checkpoint],
    )


def _resolve_run(name: str | Path) -> tuple[Path, Path | None]:
    """Return the folder of a run, and the checkpoint if `name` is one.

    A run in the working directory takes precedence over a shipped policy of the same name.
    """
    path, name, robots = Path(name), str(name), tasks.task_names()
    # Path.is_file raises OSError for long names.
    if isfile(path / RUN_FILE) or (isdir(path) and name not in robots):  # noqa: PTH112, PTH113
        return path, None
    if isfile(path):  # noqa: PTH113
        return path.parent, path
    if name not in robots:
        runs = "expected a folder that terrainkit train wrote, a checkpoint in one, or a robot"
        raise ConfigError(f"run: got {name}; {expected_names(name, robots, runs)}")
    shipped = tasks.get_task(name).trained_run
    if not shipped.is_dir():
        hint = f"terrainkit train {name} writes a run with one"
        raise ConfigError(f"no policy is shipped with {name}; {hint}")
    return shipped, None


def is_same_terrain(run: Run, terrain: str | Path) -> bool:
    """Return whether a terrain is the run's; maps with the same config are the same."""
    trained_on = run.folder / MAP_FILE if (run.folder / MAP_FILE).is_file() else "plane"
    return _map_config(terrain) == _map_config(trained_on)


def parts_to_load(
    run: Run, robot: str | Path, terrain: str | Path, task: Task
) -> dict[str, bool] | None:
    """Return the parts of a run that a new run starts with, as `LeggedRunner.load` takes them.

    None if the run itself can continue exactly with this robot, terrain and task.
    """
    is_same_map = is_same_terrain(run, terrain)
    env = replace(task.env, num_envs=run.task.env.num_envs, num_threads=run.task.env.num_threads)
    is_same_task = replace(task, env=env, runner=run.task.runner) == run.task
    is_same = is_same_task and _sources(robot, terrain) == (run.info.robot, run.terrain)
    if is_same and is_same_map and TRAINING_KEYS & read_checkpoint(last_checkpoint(run)).keys():
        return None
    new, old = task.algorithm, run.task.algorithm
    is_plane, was_plane = (config.terrain.collision == "plane" for config in (task, run.task))
    return {
        "actor": True,
        "critic": True,
        "noise_std": task.policy.init_noise_std == run.task.policy.init_noise_std,
        "optimizer": (new.learning_rate, new.schedule) == (old.learning_rate, old.schedule),
        "curriculum": is_plane == was_plane
        and is_same_map
        and task.terrain.curriculum == run.task.terrain.curriculum,
    }


def last_checkpoint(run: Run) -> Path:
    """Return the selected checkpoint of a run.

    Raises:
        ConfigError: If the run has no checkpoint.
    """
    if run.checkpoint is None:
        raise ConfigError(f"run {run.folder}: got no checkpoint; expected a trained run")
    return run.checkpoint


def prepare_run_folder(
    folder: Path | None, robot: str | Path, terrain: str | Path, task: Task, continued: Run | None
) -> Path:
    """Return the folder to write: the continued run's, unless it has later checkpoints."""
    if folder is None and continued is not None:
        saved = checkpoints(continued.folder)
        if saved and saved[max(saved)] == continued.checkpoint:
            with atomic_write(continued.folder / TASK_FILE, overwrite=True) as path:
                path.write_text(task.to_toml(), encoding="utf-8")
            return continued.folder
    folder = folder or default_folder(tasks.get_task(robot).name)
    return create_run(folder, task, robot, terrain).folder


def _model_digest(mjcf: Path) -> dict[str, str]:
    return {mjcf.name: hashlib.sha256(mjcf.read_bytes()).hexdigest()}


def _sources(robot: str | Path, terrain: str | Path) -> tuple[str, str]:
    """Return the robot and the terrain as a run records them: names, or absolute paths."""
    folder = tasks.get_task(robot).folder
    name = str(robot) if str(robot) in tasks.task_names() else str(folder.resolve())
    return name, "plane" if str(terrain) == "plane" else str(Path(terrain).resolve())


def _map_config(terrain: str | Path) -> MapConfig | None:
    """Return the config of a map, or None for a plane; it needs no classes of the user."""
    if str(terrain) == "plane":
        return None
    if Path(terrain).suffix != ".toml":
        return TerrainMap.load(terrain).config
    with prefixed_errors(f"{terrain}: "):
        return MapConfig.from_map(read_text(terrain))
