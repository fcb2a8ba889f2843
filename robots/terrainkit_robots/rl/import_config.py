"""Import a training configuration of legged_gym or LeggedGym-Ex: a `LeggedRobotCfg` class."""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from terrainkit import MapConfig
from terrainkit.errors import ConfigError, listing, one_line
from terrainkit.files.atomic_write import atomic_write
from terrainkit.settings.schema import field_types, nested_table
from terrainkit.settings.toml_text import line_text
from terrainkit.settings.type_hint import NONE, convert
from terrainkit.terrain.presets import get_preset
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.rl.class_reader import Module, Namespace, Unread, flatten_class
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.legged_gym_names import (
    Name,
    base_settings,
    convert_value,
    find_name,
    names,
)
from terrainkit_robots.rl.run import MAP_FILE, TASK_FILE
from terrainkit_robots.spec.provenance import with_provenance
from terrainkit_robots.spec.robot_arrays import SPEC_FILE, Robot
from terrainkit_robots.spec.robot_spec import JOINT_TABLES, RobotSpec

PPO = "PPO"
"""Ending of the name of the class with the settings of the learning algorithm."""

Draft = Mapping[str, Any]
"""Settings of a file by name."""


@dataclass(frozen=True, kw_only=True)
class ImportedConfig:
    """A configuration class as settings of terrainkit."""

    name: str
    """Name of the class."""
    taken: dict[str, tuple[str, Any]] = field(default_factory=dict)
    """Our setting and its value, by their setting."""
    without_effect: dict[str, str] = field(default_factory=dict)
    """Settings whose value makes no difference here, and why."""
    listed: dict[str, str] = field(default_factory=dict)
    """Settings that are not taken, and why."""
    files: dict[str, str] = field(default_factory=dict)
    """Text of each file by its name: task.toml, robot.toml, and map.toml, the config of a map."""


def import_config(
    path: Path, folder: Path, class_name: str = "", robot: Robot | None = None
) -> ImportedConfig:
    """Return the configuration class in a Python file, which is not executed.

    Args:
        path: The file. Parent classes are read from the files of its project.
        folder: Folder for `write_config`, which the paths in robot.toml are relative to.
        class_name: Name of the class; by default the only one of the file.
        robot: The robot, whose joints and bodies some values need.

    Raises:
        ConfigError: If the file cannot be read, does not have one such class, or the MJCF of the
            robot does not load.
    """
    class_name, values = _read_settings(path, class_name)
    imported = ImportedConfig(name=class_name)
    rows = _counterparts(values, imported)
    settings = {**values, **_robot_values(values, robot)}
    off = {row.here for key, row in rows.items() if row.off is not None and not values[key]}
    writers = _writers(robot, folder, path.name)
    drafts: dict[str, dict[str, Any]] = {file: {} for file in writers}
    for key, row in rows.items():
        # A flag that is true sets nothing, and a setting that is off has no effect.
        if (row.off is None) == (row.here in off):
            imported.without_effect[key] = f"{row.here} is {'off' if row.here in off else 'on'}"
            continue
        place, _, own = row.here.partition(".")
        file, name = _FILES.get(place, TASK_FILE), own if place in _FILES else row.here
        try:
            value = convert_value(row, values[key], settings) if row.off is None else row.off
            if drafts[file].get(name, value) != value:
                raise ConfigError(f"{row.here} is {drafts[file][name]} from another setting")
            writers[file]({**drafts[file], name: value})
        except ConfigError as error:
            imported.listed[key] = str(error)
        else:
            drafts[file][name] = value
            imported.taken[key] = row.here, value
    for file, draft in drafts.items():
        if draft or file == TASK_FILE or (robot and file == SPEC_FILE):
            imported.files[file] = writers[file](draft)
    return imported


def _counterparts(values: Mapping[str, Any], imported: ImportedConfig) -> dict[str, Name]:
    """Return the rows of settings that have a counterpart here, and note the others."""
    rows: dict[str, Name] = {}
    for key, value in values.items():
        row = find_name(key) or Name(no="not a setting of legged_gym or LeggedGym-Ex")
        fixed = list(row.fixed) if isinstance(row.fixed, tuple) else row.fixed
        if isinstance(value, Unread):
            imported.listed[key] = f"not read: {value.text}"
        elif not row.no:
            rows[key] = row
        elif fixed is not None and fixed == (NONE if value is None else value):
            imported.without_effect[key] = row.no
        else:
            imported.listed[key] = row.no
    return rows


def write_config(imported: ImportedConfig, folder: Path, *, overwrite: bool = False) -> None:
    """Write the files of an imported configuration, completely or not at all.

    Args:
        imported: The configuration.
        folder: Folder of the files.
        overwrite: Whether existing files may be replaced.

    Raises:
        ExportError: If a file exists and `overwrite` is not set, or cannot be written.
    """
    with atomic_write(folder / TASK_FILE, overwrite=overwrite) as path:
        for name, text in imported.files.items():
            path.with_name(name).write_text(text, encoding="utf-8")


_FILES = {"robot": SPEC_FILE, "map": MAP_FILE}
"""Files by the first part of our names."""


def _writers(robot: Robot | None, folder: Path, source: str) -> dict[str, Callable[[Draft], str]]:
    """Return functions that check the settings of a file, and return its text, by its name."""
    base = Task.from_table(base_settings())

    def task_text(draft: Draft) -> str:
        return Task.from_table(nested_table(draft), base).to_toml()

    def map_text(draft: Draft) -> str:
        shares = dict(draft.get("terrains", ()))
        terrains = (t for t in get_preset("legged_gym") if shares.get(t.name))
        own = [replace(terrain, proportion=shares[terrain.name]) for terrain in terrains]
        return MapConfig.from_table({**draft, **({"terrains": own} if own else {})}).to_toml()

    def robot_text(draft: Draft) -> str:
        if robot is None:
            kinds = field_types(RobotSpec)
            values = {name: convert(name, value, kinds[name]) for name, value in draft.items()}
            return "".join(f"{line_text(name, value)}\n" for name, value in values.items())
        changes = dict(draft)
        for key in draft.keys() & {*JOINT_TABLES}:
            changes[key] = {**robot.spec.per_joint(key), **draft[key]}
        for key in ("urdf", "mjcf"):
            file = (robot.folder / getattr(robot.spec, key)).resolve()
            changes[key] = os.path.relpath(file, folder.resolve())
        spec = with_provenance(replace(robot.spec, **changes), robot.spec, source)
        return Robot.from_spec(spec, folder).spec.to_toml()

    return {TASK_FILE: task_text, SPEC_FILE: robot_text, MAP_FILE: map_text}


def _read_settings(path: Path, class_name: str) -> tuple[str, dict[str, Any]]:
    """Return the name of the class, and its settings with those of its algorithm."""
    module = Module(path=path)
    found = module.read()
    sections = {key.partition(".")[0] for key in names()}
    classes = [
        name
        for name in module.classes
        if isinstance(found[name], Namespace) and found[name].keys() & sections
    ]
    own = [name for name in classes if not name.endswith(PPO)]
    chosen = class_name or (own[0] if len(own) == 1 else "")
    if chosen not in classes:
        got = class_name or f"{len(own)} classes"
        raise ConfigError(f"{path}: got {got}; expected --class, one of: {listing(classes)}")
    pair = found[chosen], found.get(f"{chosen}{PPO}")
    read = [part for part in pair if isinstance(part, Namespace)]
    return chosen, {key: value for part in read for key, value in flatten_class(part)}


def _robot_values(values: Mapping[str, Any], robot: Robot | None) -> dict[str, Any]:
    """Return what conversions of values need of a robot."""
    if robot is None:
        pose = values.get("init_state.default_joint_angles")
        return {"joints": [*pose]} if isinstance(pose, dict) else {}
    import mujoco

    try:
        with quiet_mujoco():
            model = mujoco.MjModel.from_xml_path(str(robot.mjcf))
        joints = {name: model.joint(name) for name in robot.spec.joint_order}
    except (KeyError, ValueError) as error:
        raise ConfigError(f"{robot.mjcf}: {one_line(str(error))}") from None
    limited = {name: joint.range for name, joint in joints.items() if model.jnt_limited[joint.id]}
    measured = {
        "bodies": [model.body(index).name for index in range(model.nbody)],
        "limits": {name: limits.tolist() for name, limits in limited.items()},
        "leg_length": robot.leg_length,
    }
    return {"joints": robot.spec.joint_order, "--robot": measured}
