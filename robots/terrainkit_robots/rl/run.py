"""Run folders and checkpoints: what training writes, and what it needs to continue.

A run has `task.toml`, `robot.toml` (the spec as it was trained), `run.toml` (robot, terrain and
versions), `map.toml` (the config of its map, if any), and `model_<iteration>.pt` checkpoints.
"""

import hashlib
import io
import re
import zipfile
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from terrainkit.atomic_write import atomic_folder, atomic_write
from terrainkit.errors import ConfigError, ExportError, listing
from terrainkit.schema import Config
from terrainkit.text import expected_names
from terrainkit.toml_text import read_text
from terrainkit_robots.files import open_regular
from terrainkit_robots.rl import tasks
from terrainkit_robots.rl.config import Task
from terrainkit_robots.spec.robot import SPEC_FILE, Robot
from terrainkit_robots.spec.robot_spec import RobotSpec
from terrainkit_robots.text import free_name

if TYPE_CHECKING:
    from terrainkit.config import MapConfig

RUN_FILE, TASK_FILE, MAP_FILE = "run.toml", "task.toml", "map.toml"
CHECKPOINT_HEADER = {"format": "terrainkit checkpoint", "version": 1}
CHECKPOINT_KEYS = {
    "iteration": int,
    "robot": str,
    "joints": list,
    "observed": dict,
    "actor_state_dict": dict,
    "critic_state_dict": dict,
}
"""Keys of every checkpoint, and their types; a checkpoint of training has more."""


@dataclass(frozen=True, kw_only=True)
class RunInfo(Config):
    """The content of `run.toml`: what a run was made from."""

    format_version: Literal[1] = 1
    """Version of the files of a run."""
    robot: str
    """Name of a registered task, or the absolute path of the robot's folder."""
    terrain: str
    """`plane`, or the path of a map, its config, or a MuJoCo model."""
    terrain_sha256: str | None = None
    """Digest of a MuJoCo model."""
    seed: int
    """Seed of all random numbers."""
    started: str
    """Date and time."""
    versions: Mapping[str, str]
    """Versions of the packages."""
    robot_sha256: Mapping[str, str] | None = None
    """Digests of the robot's spec and model."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """A training run."""

    folder: Path
    """Folder of the run."""
    info: RunInfo
    """What it was made from."""
    task: Task
    """Its task."""
    robot: Robot
    """The robot, with the spec it was trained with."""
    terrain: str
    """The terrain, as `load_terrain` takes it: `plane` or a path."""
    checkpoint: Path | None
    """The selected checkpoint, by default the last; None if there is none."""


def checkpoint_name(iteration: int) -> str:
    """Return the file name of a checkpoint."""
    return f"model_{iteration}.pt"


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


def resolve_terrain(terrain: str | Path) -> str:
    """Return the terrain as a run records it: `plane`, or an absolute path."""
    return "plane" if str(terrain) == "plane" else str(Path(terrain).resolve())


def resolve_robot(robot: str | Path) -> str:
    """Return the robot as a run records it: a registered name, or its folder's absolute path."""
    found = tasks.get_task(robot)
    return str(robot) if str(robot) in tasks.task_names() else str(found.folder.resolve())


def create_run(folder: Path, task: Task, robot_name: str | Path, terrain: str | Path) -> Run:
    """Create the folder of a new run; `robot_name` is a task's name or an onboarded folder.

    Raises:
        ConfigError: If there is no such robot, or the terrain's file cannot be read.
        ExportError: If the folder is not empty, or cannot be written.
    """
    robot_folder, source = tasks.get_task(robot_name).folder, resolve_terrain(terrain)
    packages = ("terrainkit", "mujoco", "rsl-rl-lib", "torch")
    info = RunInfo(
        robot=resolve_robot(robot_name),
        terrain=source,
        terrain_sha256=_sha256(Path(source)) if source.endswith(".xml") else None,
        seed=task.runner.seed,
        started=datetime.now().astimezone().isoformat(timespec="seconds"),
        versions={name: version(name) for name in packages},
        robot_sha256=_robot_digests(robot_folder),
    )
    files = {
        RUN_FILE: info.to_toml(),
        TASK_FILE: task.to_toml(),
        SPEC_FILE: read_text(robot_folder / SPEC_FILE),
    }
    if (config := _map_config(source)) is not None:
        files[MAP_FILE] = config.to_toml()
    write_run_folder(folder, {name: text.encode() for name, text in files.items()})
    return open_run(folder)


def write_run_folder(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write a new folder with some files, completely or not at all."""
    with atomic_folder(folder) as new:
        if folder.is_dir() and any(folder.iterdir()):
            raise ExportError(
                f"{folder} exists; choose another folder, or continue with --resume {folder}"
            )
        for name, data in files.items():
            (new / name).write_bytes(data)


def open_run(name: str | Path, checkpoint: int | None = None) -> Run:
    """Open a run.

    Args:
        name: Its folder, one of its checkpoints, or a robot with a shipped policy.
        checkpoint: Iteration of the checkpoint to select; by default the one that `name` is, or
            the last.

    Raises:
        ConfigError: If there is no such run or checkpoint, or its robot is missing.
    """
    folder, selected = _resolve_run(name)
    if not (folder / RUN_FILE).is_file():
        raise ConfigError(f"{folder} has no {RUN_FILE}; terrainkit train writes such a folder")
    info = RunInfo.load(folder / RUN_FILE)
    terrain, found = info.terrain, tasks.get_task(info.robot)
    robot = Robot.from_spec(RobotSpec.load(folder / SPEC_FILE), found.folder)
    if not robot.mjcf.is_file():
        raise ConfigError(f"the robot of {folder} is missing: there is no file {robot.mjcf}")
    if terrain != "plane":
        # A map whose file is missing is generated again from its config.
        file, config = folder / terrain, folder / MAP_FILE
        terrain = resolve_terrain(config if config.is_file() and not file.is_file() else file)
    saved = checkpoints(folder)
    if checkpoint is not None:
        if checkpoint not in saved:
            iterations = listing(map(str, saved))
            raise ConfigError(
                f"{folder}: got checkpoint {checkpoint}; expected one of: {iterations}"
            )
        selected = saved[checkpoint]
    return Run(
        folder=folder,
        info=info,
        task=Task.load(folder / TASK_FILE, found.task),
        robot=robot,
        terrain=terrain,
        checkpoint=selected or (saved[max(saved)] if saved else None),
    )


def _resolve_run(name: str | Path) -> tuple[Path, Path | None]:
    """Return the folder of a run, and the checkpoint if `name` is one.

    A run in the working directory takes precedence over a shipped policy of the same name.
    """
    path, is_robot = Path(name), str(name) in tasks.task_names()
    try:
        if (path / RUN_FILE).is_file() or (path.is_dir() and not is_robot):
            return path, None
        if path.is_file():
            return path.parent, path
    except (OSError, ValueError) as error:
        raise ConfigError(f"cannot read {name}: {error}") from error
    if not is_robot:
        expected = expected_names(
            str(name),
            tasks.task_names(),
            "expected a folder that terrainkit train wrote, a checkpoint in one, or a robot",
        )
        raise ConfigError(f"run: got {name}; {expected}")
    shipped = tasks.get_task(str(name)).trained_run
    if not shipped.is_dir():
        raise ConfigError(
            f"no policy is shipped with {name}; terrainkit train {name} writes a run with one"
        )
    return shipped, None


def is_shipped(run: Run) -> bool:
    """Return whether a run is part of a package, so that its folder must not be written."""
    return run.folder.resolve() == tasks.get_task(run.info.robot).trained_run.resolve()


def changed_robot_files(run: Run) -> tuple[str, ...]:
    """Return the names of the robot's files that differ from those it was trained with."""
    recorded = run.info.robot_sha256
    if recorded is None:
        return ()
    current = _robot_digests(tasks.get_task(run.info.robot).folder)
    names = sorted({*recorded, *current})
    return tuple(name for name in names if recorded.get(name) != current.get(name))


def is_same_terrain(run: Run, terrain: str | Path) -> bool:
    """Return whether a terrain is the run's; maps with the same config are the same."""
    source, config = resolve_terrain(terrain), run.folder / MAP_FILE
    if config.is_file():
        return _map_config(source) == _map_config(str(config))
    recorded = run.info.terrain_sha256
    return source == run.terrain and recorded in (None, recorded and _sha256(Path(source)))


def can_continue(run: Run, robot: str | Path, terrain: str | Path, task: Task) -> bool:
    """Return whether a run can continue exactly with a robot, terrain and task.

    Raises:
        ConfigError: If a file of the robot or terrain was modified since.
    """
    num_envs, num_threads = run.task.env.num_envs, run.task.env.num_threads
    env = replace(task.env, num_envs=num_envs, num_threads=num_threads)
    if (
        replace(task, env=env, runner=run.task.runner) != run.task
        or resolve_terrain(terrain) != run.terrain
        or resolve_robot(robot) != run.info.robot
    ):
        return False
    if not is_same_terrain(run, terrain):
        raise ConfigError(
            f"{run.terrain} has changed since {run.folder} was trained on it; with another "
            "--terrain, a new run starts with its networks"
        )
    if files := changed_robot_files(run):
        raise ConfigError(
            f"{' and '.join(files)} of {run.info.robot} changed since {run.folder} was trained; "
            "with a copy of the robot in another folder, a new run starts with its networks"
        )
    return "processes" in read_checkpoint(last_checkpoint(run))


def parts_to_load(run: Run, terrain: str | Path, task: Task) -> dict[str, bool]:
    """Return which parts of a run a new run starts with; see `LeggedRunner.load`."""
    rates = [(each.learning_rate, each.schedule) for each in (task.algorithm, run.task.algorithm)]
    is_plane, was_plane = (each.terrain.collision == "plane" for each in (task, run.task))
    return {
        "actor": True,
        "critic": True,
        "optimizer": rates[0] == rates[1],
        "curriculum": is_plane == was_plane and is_same_terrain(run, terrain),
    }


def last_checkpoint(run: Run) -> Path:
    """Return the selected checkpoint of a run; raise ConfigError if there is none."""
    if run.checkpoint is None:
        raise ConfigError(f"{run.folder} has no checkpoint yet; train it first")
    return run.checkpoint


def run_folder(
    folder: Path | None, robot: str | Path, terrain: str | Path, task: Task, continued: Run | None
) -> Path:
    """Return the folder to write: that of the continued run, unless it has later checkpoints."""
    if folder is None and continued is not None:
        saved = checkpoints(continued.folder)
        if saved and saved[max(saved)] == continued.checkpoint:
            if task != continued.task:
                with atomic_write(continued.folder / TASK_FILE, overwrite=True) as path:
                    path.write_text(task.to_toml(), encoding="utf-8")
            return continued.folder
    folder = folder or default_folder(tasks.get_task(robot).name)
    return create_run(folder, task, robot, terrain).folder


def save_checkpoint(path: Path, state: Mapping[str, Any]) -> None:
    """Write a checkpoint completely, or not at all; see `LeggedRunner.state_dict`."""
    import torch

    data = io.BytesIO()  # torch itself aborts the process on a full disk
    torch.save(_to_plain({**CHECKPOINT_HEADER, **state}), data)
    with atomic_write(path, overwrite=True) as target:
        target.write_bytes(data.getbuffer())


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Read a checkpoint, without executing code from it; arrays become tensors.

    Raises:
        ConfigError: If it is missing, damaged, or not written by terrainkit.
    """
    import torch

    try:
        if path.exists() and not path.is_file():
            raise ConfigError(f"{path} is not a file; expected a checkpoint")
        with zipfile.ZipFile(path) as file:  # compressed parts could expand to any size
            if any(part.compress_type != zipfile.ZIP_STORED for part in file.infolist()):
                raise ConfigError(f"{path} is not a checkpoint of terrainkit: it is compressed")
        state = torch.load(path, map_location="cpu", weights_only=True)
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror or error}") from error
    except ConfigError:
        raise
    except Exception as error:  # torch's errors for damaged files have no common class
        raise ConfigError(f"{path} is not a checkpoint of terrainkit, or is damaged") from error
    if not isinstance(state, dict) or state.get("format") != CHECKPOINT_HEADER["format"]:
        raise ConfigError(f"{path} is not a checkpoint of terrainkit")
    if (got := state.get("version")) != CHECKPOINT_HEADER["version"]:
        raise ConfigError(f"{path}: version: got {got!r}; expected 1")
    for key, kind in CHECKPOINT_KEYS.items():
        if not isinstance(state.get(key), kind):
            raise ConfigError(f"{path}: {key} is missing or not a {kind.__name__}")
    return state


def policy_state(state: Mapping[str, Any]) -> dict[str, Any]:
    """Return the part of a checkpoint without which there is no policy or critic."""
    return {key: state[key] for key in CHECKPOINT_KEYS}


def _to_plain(value: Any) -> Any:
    """Convert to dicts, lists, numbers and tensors, which can be read without executing code."""
    import torch

    if isinstance(value, Mapping):
        return {key: _to_plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | deque):
        return [_to_plain(item) for item in value]
    if isinstance(value, np.ndarray | torch.Tensor):
        return torch.as_tensor(value).detach().to("cpu").clone()  # without a view's storage
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise TypeError(f"a checkpoint cannot hold a {type(value).__name__}")


def _robot_digests(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of a robot's spec and model by file name."""
    files = (SPEC_FILE, RobotSpec.load(folder / SPEC_FILE).mjcf)
    return {name: _sha256(folder / name) for name in files}


def _sha256(path: Path) -> str:
    try:
        with open_regular(path) as file:
            return hashlib.sha256(file.read()).hexdigest()
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror or error}") from error


def _map_config(terrain: str) -> "MapConfig | None":
    """Return the config of a map; None for another terrain."""
    if terrain.endswith(".toml"):
        from terrainkit.config import MapConfig

        return MapConfig.load(terrain)
    if terrain.endswith(".npz"):
        from terrainkit.terrain_map import TerrainMap

        return TerrainMap.load(terrain).config
    return None
