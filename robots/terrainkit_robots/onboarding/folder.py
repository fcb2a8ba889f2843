"""The folder of an onboarded robot, which is written completely or not at all."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from terrainkit.errors import ExportError
from terrainkit.files.atomic_write import atomic_folder, check_parents
from terrainkit_robots.files import require_utf8
from terrainkit_robots.onboarding.frameworks.frameworks import framework_names
from terrainkit_robots.onboarding.frameworks.leggedgym_ex import MAP_FILES
from terrainkit_robots.spec.robot_arrays import SPEC_FILE
from terrainkit_robots.text import free_name, names

_BACKUP_SUFFIX = ".before"
"""Suffix of backups of edited files."""

_GENERATED = frozenset(
    {"robot.urdf", "robot.xml", "scene.xml", "report.md", "report", "meshes", "__pycache__"}
    | {*MAP_FILES}
)
"""Files and folders that onboarding or Python writes, and that users do not edit."""


def check_folder(target: Path, *, overwrite: bool) -> None:
    """Check that an onboarded robot can be written to a folder.

    Args:
        target: The folder.
        overwrite: Whether a folder that onboarding wrote may be replaced.

    Raises:
        ExportError: if the folder must not be overwritten, or cannot be created.
    """
    require_utf8(target)
    check_parents(target)
    try:
        if target.is_symlink() or (target.exists() and not target.is_dir()):
            raise ExportError(f"cannot write {target}: it exists and is not a folder")
        if not target.is_dir():
            return
        contents = sorted(path.name for path in target.iterdir())
    except OSError as error:
        raise ExportError(f"cannot write {target}: {error.strerror or error}") from error
    if not contents:
        return
    if not overwrite:
        raise ExportError(f"{target} exists; use another name, or `overwrite=True`")
    if SPEC_FILE not in contents:
        raise ExportError(
            f"{target} contains no {SPEC_FILE}; only folders of onboarded robots are overwritten"
        )
    editable = _editable_files(contents)
    foreign = [
        name for name in contents if name not in _GENERATED and _original_name(name) not in editable
    ]
    if foreign:
        raise ExportError(
            f"{target} also contains {names(foreign)}, which onboarding did not write; "
            "move these files to overwrite the rest"
        )


def _editable_files(contents: Iterable[str]) -> set[str]:
    """Return the names of the files that users edit.

    They are the spec, the configurations, and the files of a package with its own configuration:
    __init__.py, NAME.py and NAME_config.py.
    """
    names = {_original_name(name) for name in contents}
    modules = {name for name in names if name.replace(".py", "_config.py") in names - {name}}
    configs = {name.replace(".py", "_config.py") for name in modules}
    frameworks = {f"{name}_config.py" for name in framework_names()}
    return {SPEC_FILE, "__init__.py", *modules, *configs, *frameworks}


def _original_name(name: str) -> str:
    return name.partition(_BACKUP_SUFFIX)[0]


def find_edits(target: Path, files: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return backups of the edited files in a folder that will be replaced, by file name.

    A file is backed up if it differs from the new file of its name. Earlier backups are kept.

    Args:
        target: The folder, which may not exist.
        files: The new files.

    Raises:
        ExportError: if a file cannot be read.
    """
    try:
        paths = sorted(target.iterdir()) if target.is_dir() else []
        editable = _editable_files(path.name for path in paths)
        existing = {
            path.name: path.read_bytes() for path in paths if _original_name(path.name) in editable
        }
    except OSError as error:
        raise ExportError(f"cannot read {target}: {error.strerror or error}") from error
    edits = {name: data for name, data in existing.items() if name not in editable}
    for name in sorted(existing.keys() & editable):
        if existing[name] not in (files.get(name), *edits.values()):
            edits[free_name(f"{name}{_BACKUP_SUFFIX}", edits)] = existing[name]
    return edits


@contextmanager
def new_folder(target: Path, *, overwrite: bool = False) -> Iterator[Path]:
    """Yield an empty folder, and move it to `target` at the end of the block.

    If the block raises an error, `target` is unchanged.

    Raises:
        ExportError: as `check_folder`, and if the folder cannot be written.
    """
    check_folder(target, overwrite=overwrite)
    with atomic_folder(target) as folder:
        yield folder
        # Minutes may have passed, in which the user has put other files there.
        check_folder(target, overwrite=overwrite)


def write_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a folder.

    Args:
        folder: The folder.
        files: Content of each file, by its path relative to the folder.

    Raises:
        ExportError: if a path is outside the folder.
    """
    for name, data in files.items():
        path = folder / name
        if not path.resolve().is_relative_to(folder.resolve()):
            raise ExportError(f"{name} is outside of {folder}")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
