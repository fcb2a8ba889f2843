"""The run: what training leaves on disk, and all that is needed to go on from it.

A folder with `task.toml` (every number), `robot.toml` (the spec as it was trained), `run.toml`
(which robot, which ground), `map.toml` (the config of its map, if it was one), and a
`model_<iteration>.pt` for each checkpoint. Beside them are TensorBoard's files.
"""

import re
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from terrainkit.errors import ConfigError, ExportError, listing
from terrainkit.toml_text import parse_toml
from terrainkit_robots.mesh.sniff import open_regular
from terrainkit_robots.onboarding.folder import new_folder, write_files
from terrainkit_robots.rl import registry
from terrainkit_robots.rl.robot import SPEC_FILE, Robot, robot_of
from terrainkit_robots.rl.task import Task
from terrainkit_robots.rl.task_file import read_task, to_toml
from terrainkit_robots.spec.spec_file import read_spec
from terrainkit_robots.text import free_name

if TYPE_CHECKING:
    from terrainkit.config import MapConfig

_ROBOT, _GROUND = "robot_sha256", "terrain_sha256"
"""Keys in `run.toml` that tell the files of the robot, and a ground that is no map, from other
ones."""

RUN_FILE, TASK_FILE, MAP_FILE = "run.toml", "task.toml", "map.toml"

FORMAT_VERSION = 1
"""Version of a run's files; it changes when an old one would be read wrongly."""

_CHECKPOINT = re.compile(r"model_([0-9]{1,12})\.pt")
_LARGEST = 1 << 20
"""No file of text in a run is larger [bytes]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """A training run."""

    folder: Path
    """Where it is."""

    task: Task
    """What is trained."""

    robot: Robot
    """The robot, with the spec that it was trained with."""

    robot_name: str
    """Name of a registered robot, or the absolute path of its folder."""

    terrain: str
    """The ground, as `read_ground` takes it: `plane`, or a path."""

    checkpoint: Path | None
    """The checkpoint that was asked for, or else the last one; None if there is none yet."""


def checkpoint_name(iteration: int) -> str:
    """Return the file name of the checkpoint after so many updates."""
    return f"model_{iteration}.pt"


def checkpoints(folder: Path) -> dict[int, Path]:
    """Return the checkpoints in a folder by their iteration, in order."""
    found = {}
    for path in folder.glob("model_*.pt"):
        if match := _CHECKPOINT.fullmatch(path.name):
            found[int(match[1])] = path
    return dict(sorted(found.items()))


def default_folder(robot: str) -> Path:
    """Return where a new run goes unless told: `logs/<robot>/<date-time>`."""
    # The name may come from a file of other people's.
    parent = Path("logs") / (re.sub(r"[^\w.-]+", "_", robot).strip(".") or "robot")
    now = datetime.now().strftime("%Y-%m-%d_%H-%M-%S")
    taken = {path.name for path in parent.iterdir()} if parent.is_dir() else set()
    return parent / free_name(now, taken)


def located_terrain(terrain: str | Path) -> str:
    """Return the ground as a run notes it: `plane`, or an absolute path."""
    return str(terrain) if str(terrain) == "plane" else str(Path(terrain).resolve())


def located_robot(robot: str | Path) -> str:
    """Return the robot as a run notes it: a registered name, or the absolute path of its folder.

    Raises:
        ConfigError: if there is no such robot.
    """
    found = registry.find(robot)
    return str(robot) if str(robot) in registry.names() else str(found.folder.resolve())


def create_run(folder: Path, task: Task, robot_name: str | Path, terrain: str | Path) -> Run:
    """Write a new run, without checkpoints.

    Args:
        folder: Where; folders above it are made.
        task: What will be trained.
        robot_name: A registered robot, or the folder of an onboarded one.
        terrain: The ground, as `read_ground` takes it.

    Raises:
        ConfigError: if there is no such robot, or the ground's file cannot be read.
        ExportError: if the folder exists and holds something, or cannot be written.
    """
    name, ground = located_robot(robot_name), located_terrain(terrain)
    files = {
        RUN_FILE: _about(name, ground, task, registry.find(robot_name).folder),
        TASK_FILE: to_toml(task),
        SPEC_FILE: _text(registry.find(robot_name).folder / SPEC_FILE),
    }
    if (config := _map_config(ground)) is not None:
        files[MAP_FILE] = config.to_toml()
    _refuse_existing(folder)
    make_parents(folder)
    with new_folder(folder) as made:
        write_files(made, {file: text.encode() for file, text in files.items()})
    return open_run(folder)


def _refuse_existing(folder: Path) -> None:
    """Refuse to write where something is."""
    try:
        if folder.is_dir() and any(folder.iterdir()):
            raise ExportError(
                f"{folder} exists; another folder would do, or --resume {folder} to go on with it"
            )
    except OSError as error:
        raise ExportError(f"cannot write {folder}: {error.strerror or error}") from error


def make_parents(folder: Path) -> None:
    """Make the folders above a run's.

    Raises:
        ExportError: if one cannot be made.
    """
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ExportError(f"cannot write {folder}: {error.strerror or error}") from error


def open_run(name: str | Path, checkpoint: int | None = None) -> Run:
    """Return a run.

    Args:
        name: Its folder, one of its checkpoints, or a robot whose policy is shipped.
        checkpoint: Iteration of the checkpoint to take; unless given, the one that is named, or
            else the last.

    Raises:
        ConfigError: if there is no such run or checkpoint, or what it needs is gone.
    """
    folder, named = _located(name)
    about = _read_about(folder / RUN_FILE)
    robot_name, terrain = about["robot"], about["terrain"]
    found = registry.find(robot_name)
    robot = robot_of(read_spec(folder / SPEC_FILE), found.folder)
    if not robot.mjcf.is_file():
        raise ConfigError(f"the robot of {folder} is gone: there is no file {robot.mjcf}")
    if terrain != "plane":
        # A map whose file is gone is made again from its config.
        own, again = folder / terrain, folder / MAP_FILE
        terrain = located_terrain(again if again.is_file() and not own.is_file() else own)
    return Run(
        folder=folder,
        task=read_task(folder / TASK_FILE, default=found.task),
        robot=robot,
        robot_name=robot_name,
        terrain=terrain,
        checkpoint=_chosen(folder, checkpoint, named),
    )


def is_shipped(run: Run) -> bool:
    """Return whether a run comes with a package, so that nothing is to be written to its folder."""
    return run.folder.resolve() == registry.find(run.robot_name).shipped.resolve()


def changed_robot(run: Run) -> tuple[str, ...]:
    """Return which files of the run's robot are others than those it was trained with.

    A run that does not tell, of an earlier version, is not asked.

    Raises:
        ConfigError: if a file cannot be read.
    """
    noted = parse_toml(_text(run.folder / RUN_FILE)).get(_ROBOT)
    if not isinstance(noted, dict):
        return ()
    now = _digests(registry.find(run.robot_name).folder)
    return tuple(name for name in sorted({*noted, *now}) if noted.get(name) != now.get(name))


def same_ground(run: Run, terrain: str | Path) -> bool:
    """Return whether a ground is the one that the run was trained on: a map is, wherever it lies.

    Of a MuJoCo model the file itself is looked at, not those that it names.

    Raises:
        ConfigError: if a config cannot be read.
        MapFileError: if the map cannot.
    """
    here, noted = located_terrain(terrain), run.folder / MAP_FILE
    if not noted.is_file():
        if here != run.terrain:
            return False
        digest = parse_toml(_text(run.folder / RUN_FILE)).get(_GROUND)
        return digest is None or digest == _digest(Path(here))
    from terrainkit.config import MapConfig

    return _map_config(here) == MapConfig.load(noted)


def rewrite_task(run: Run, task: Task) -> None:
    """Note in a run's folder that it goes on with another task."""
    from terrainkit.atomic_write import atomic_write

    with atomic_write(run.folder / TASK_FILE, overwrite=True) as path:
        path.write_text(to_toml(task), encoding="utf-8")


def _located(name: str | Path) -> tuple[Path, Path | None]:
    """Return the folder of a run, and the checkpoint in it that `name` is, if it is one.

    A run here goes before a policy that is shipped; another folder that is called so does not.
    """
    path, known = Path(name), str(name) in registry.names()
    try:
        if (path / RUN_FILE).is_file() or (path.is_dir() and not known):
            return path, None
        if path.is_file():
            return path.parent, path
    except (OSError, ValueError) as error:
        raise ConfigError(f"cannot read {name}: {error}") from error
    if not known:
        raise ConfigError(
            f"no run {name}: neither a folder that terrainkit train wrote, nor a checkpoint in "
            f"one, nor a robot; the robots are: {listing(registry.names())}"
        )
    shipped = registry.find(str(name)).shipped
    if not shipped.is_dir():
        raise ConfigError(
            f"no policy is shipped with {name}; wanted the folder of a run: "
            f"terrainkit train {name} makes one"
        )
    return shipped, None


def _chosen(folder: Path, iteration: int | None, named: Path | None) -> Path | None:
    if iteration is None and named is not None:
        return named
    there = checkpoints(folder)
    if iteration is None:
        return there[max(there)] if there else None
    if iteration not in there:
        raise ConfigError(
            f"{folder} has no checkpoint {iteration}; there are: {listing(map(str, there))}"
        )
    return there[iteration]


def _digests(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of the files that make up a robot, but for its meshes, by name."""
    spec = read_spec(folder / SPEC_FILE)
    return {name: _digest(folder / name) for name in (SPEC_FILE, spec.mjcf)}


def _digest(path: Path) -> str:
    """Return the SHA-256 of a file."""
    import hashlib

    try:
        with open_regular(path) as file:
            return hashlib.sha256(file.read()).hexdigest()
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror or error}") from error


def _about(robot: str, terrain: str, task: Task, folder: Path) -> str:
    """Return `run.toml` of a robot in a folder."""
    from importlib.metadata import version

    import tomli_w

    packages = ("terrainkit", "mujoco", "rsl-rl-lib", "torch")
    return tomli_w.dumps(
        {
            "format_version": FORMAT_VERSION,
            "robot": robot,
            "terrain": terrain,
            **({_GROUND: _digest(Path(terrain))} if terrain.endswith(".xml") else {}),
            "seed": task.runner.seed,
            "begun": datetime.now().astimezone().isoformat(timespec="seconds"),
            "versions": {name: version(name) for name in packages},
            _ROBOT: _digests(folder),
        }
    )


def _read_about(path: Path) -> dict[str, str]:
    if not path.is_file():
        raise ConfigError(
            f"{path.parent} has no {RUN_FILE}; wanted a folder that terrainkit train wrote"
        )
    table = parse_toml(_text(path))
    if table.get("format_version") != FORMAT_VERSION:
        got = table.get("format_version", "missing")
        raise ConfigError(f"{path}: format_version is {got!r}; wanted {FORMAT_VERSION}")
    for key in ("robot", "terrain"):
        if not isinstance(table.get(key), str):
            raise ConfigError(f"{path}: {key} is {table.get(key, 'missing')!r}; wanted a text")
    return {key: table[key] for key in ("robot", "terrain")}


def _text(path: Path) -> str:
    try:
        with open_regular(path) as file:
            data = file.read(_LARGEST + 1)
        if len(data) > _LARGEST:
            raise ConfigError(f"{path}: over {_LARGEST} bytes; wanted a file of a run")
        return data.decode()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else None
        raise ConfigError(f"cannot read {path}: {reason or error}") from error


def _map_config(terrain: str) -> "MapConfig | None":
    """Return the config of the map, if the ground is one."""
    if terrain.endswith(".toml"):
        from terrainkit.config import MapConfig

        return MapConfig.load(terrain)
    if terrain.endswith(".npz"):
        from terrainkit.terrain_map import TerrainMap

        return TerrainMap.load(terrain).config
    return None
