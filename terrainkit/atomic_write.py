"""Atomic writes: what is written is there whole, or not at all."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from terrainkit.errors import ExportError


@contextmanager
def atomic_write(path: Path, *, overwrite: bool = False) -> Iterator[Path]:
    """Yield a path of the same name to write to, and move it to `path` once the block is through.

    Files that the block writes beside it, such as a sidecar, move along. If the block raises,
    nothing has changed.

    Raises:
        ExportError: if a target exists and `overwrite` is not set, or cannot be written.
    """
    check_target(path, overwrite=overwrite)
    name = path.name
    try:
        if path.is_symlink():
            path = path.resolve()  # through the link, which stays one
    except (OSError, RuntimeError) as error:  # before Python 3.13 a loop is a RuntimeError
        raise ExportError(f"cannot write {path}: {error}") from error
    if path.is_symlink():
        raise ExportError(f"cannot write {path}: it leads to itself")
    try:
        # Beside the target, so that moving there is a rename on the same disk.
        folder = Path(tempfile.mkdtemp(prefix=".terrainkit-", dir=path.parent))
    except OSError as error:
        raise ExportError(f"cannot write {path}: {error.strerror or error}") from error
    try:
        yield folder / name  # whose suffix may name the format
        if name != path.name:
            (folder / name).rename(folder / path.name)
        written = sorted(folder.iterdir())
        for file in written:
            check_target(path.with_name(file.name), overwrite=overwrite)
        for file in written:
            file.replace(path.with_name(file.name))
    except OSError as error:
        raise ExportError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def check_target(path: Path, *, overwrite: bool) -> None:
    """Raise ExportError if a file cannot or may not be written at `path`."""
    try:
        if path.is_dir():
            raise ExportError(f"cannot write {path}: it is a folder")
        if path.exists() and not path.is_file():
            raise ExportError(f"cannot write {path}: it is there, and not a plain file")
        if path.exists() and not overwrite:
            raise ExportError(
                f"{path} exists; another name would do, or --overwrite (overwrite=True)"
            )
        if not path.parent.is_dir():
            raise ExportError(f"cannot write {path}: there is no folder {path.parent}")
    except OSError as error:
        raise ExportError(f"cannot write {path}: {error.strerror or error}") from error
