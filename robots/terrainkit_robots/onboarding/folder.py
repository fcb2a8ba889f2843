"""The folder of an onboarded robot: there whole, or not at all."""

import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from terrainkit.errors import ExportError
from terrainkit_robots.text import free_name, names

SPEC = "robot.toml"
"""A folder that holds this file is an onboarded robot."""

_BEFORE = ".before"
"""Ends the names of files with what was edited in a folder that is replaced."""

_OURS = frozenset({"robot.urdf", "robot.xml", "scene.xml", "report.md", "report", "meshes"})
"""What onboarding writes, beside the files that are there to be edited."""


def check_folder(target: Path, *, overwrite: bool) -> None:
    """Raise an error if an onboarded robot cannot or may not be written to `target`.

    Raises:
        ExportError: if there is something that is not to be overwritten, or no folder to write in.
    """
    try:
        if not target.parent.is_dir():
            raise ExportError(f"cannot write {target}: there is no folder {target.parent}")
        if target.is_symlink() or (target.exists() and not target.is_dir()):
            raise ExportError(f"cannot write {target}: it is there, and not a folder")
        if not target.is_dir():
            return
        held = sorted(path.name for path in target.iterdir())
    except OSError as error:
        raise ExportError(f"cannot write {target}: {error.strerror or error}") from error
    if not held:
        return
    if not overwrite:
        raise ExportError(f"{target} exists; another name would do, or --overwrite")
    if SPEC not in held:
        raise ExportError(f"{target} holds no {SPEC}: it is not an onboarded robot to overwrite")
    edited = _to_be_edited()
    foreign = [name for name in held if name not in _OURS and _edited_as(name) not in edited]
    if foreign:
        raise ExportError(
            f"{target} also holds {names(foreign)}, which onboarding did not write; "
            "move it away to overwrite the rest"
        )


def _to_be_edited() -> frozenset[str]:
    """Return the names of the files that users edit: the spec, and configurations."""
    from terrainkit_robots.onboarding.frameworks import frameworks

    return frozenset({SPEC, *map(frameworks.file_name, frameworks.names())})


def _edited_as(name: str) -> str:
    """Return the name that a file had when it was edited."""
    return name.partition(_BEFORE)[0]


def of_before(target: Path, files: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return what may have been edited in a folder that is replaced, under names that tell.

    That is what differs from the files that come in its place, and all that was kept before.

    Raises:
        ExportError: if a file cannot be read.
    """
    edited = _to_be_edited()
    try:
        held = {
            path.name: path.read_bytes()
            for path in (sorted(target.iterdir()) if target.is_dir() else ())
            if _edited_as(path.name) in edited
        }
    except OSError as error:
        raise ExportError(f"cannot read {target}: {error.strerror or error}") from error
    kept = {name: data for name, data in held.items() if name not in edited}
    for name in sorted(held.keys() & edited):
        if held[name] not in (files.get(name), *kept.values()):
            kept[free_name(f"{name}{_BEFORE}", kept)] = held[name]
    return kept


@contextmanager
def new_folder(target: Path, *, overwrite: bool = False) -> Iterator[Path]:
    """Yield an empty folder, and move it to `target` once the block is through.

    If the block raises, nothing has changed.

    Raises:
        ExportError: as `check_folder`, and if the disk does not take it.
    """
    check_folder(target, overwrite=overwrite)
    try:
        # Beside the target, so that moving there is a rename on the same disk.
        work = Path(tempfile.mkdtemp(prefix=".terrainkit-", dir=target.parent))
    except OSError as error:
        raise ExportError(f"cannot write {target}: {error.strerror or error}") from error
    made = work / target.name
    try:
        made.mkdir()
        yield made
        check_folder(target, overwrite=overwrite)
        _swap(target, made, work / "before")
    except OSError as error:
        raise ExportError(f"cannot write {target}: {error.strerror or error}") from error
    finally:
        shutil.rmtree(work, ignore_errors=True)


def _swap(target: Path, made: Path, before: Path) -> None:
    """Move a folder to its place, and what is there out of the way; both or neither."""
    if target.is_dir():
        target.replace(before)
    try:
        made.replace(target)
    except OSError:
        if before.is_dir():
            before.replace(target)
        raise


def write_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files by their names in `folder`, which are relative and stay inside of it."""
    for name, data in files.items():
        path = folder / name
        if not path.resolve().is_relative_to(folder.resolve()):
            raise ExportError(f"{name} lies outside of {folder}")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
