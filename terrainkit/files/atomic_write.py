"""Write files atomically: completely or not at all."""

import os
import platform
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from terrainkit.errors import ExportError


@contextmanager
def atomic_write(path: Path, *, overwrite: bool = False) -> Iterator[Path]:
    """Yield a temporary path to write to, and move it to `path` when the block ends.

    The folder of `path` is created. Files that the block writes beside the temporary path, such as
    a sidecar, are moved as well. If the block raises, nothing changes.

    Args:
        path: File to write.
        overwrite: Whether an existing file may be replaced.

    Raises:
        ExportError: if a target exists and `overwrite` is not set, or cannot be written.
    """
    check_target(path, overwrite=overwrite)
    name = path.name
    try:
        if path.is_symlink():
            path = path.resolve()  # keep the link, replace its target
    except (OSError, RuntimeError) as error:  # before Python 3.13 a loop is a RuntimeError
        raise ExportError(f"cannot write {path}: {error}") from error
    if path.is_symlink():
        raise ExportError(f"cannot write {path}: the link points to itself")
    try:
        # On the same file system as the target, so that moving is a rename.
        with _new_parents(path), temporary_folder(path.parent) as folder:
            try:
                yield folder / name  # the suffix may select the format
            except ExportError as error:  # of another file that the block writes
                reason = str(error).replace(str(folder), str(path.parent))
                raise ExportError(reason) from error
            if name != path.name:
                (folder / name).rename(folder / path.name)
            written = sorted(folder.iterdir())
            for file in written:
                check_target(path.with_name(file.name), overwrite=overwrite)
            for file in written:
                file.replace(path.with_name(file.name))
    except OSError as error:
        raise ExportError(f"cannot write {path}: {error.strerror or error}") from error


@contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """Yield an empty folder, and move it to `path` when the block ends, replacing a folder there.

    If the block raises, nothing changes.

    Raises:
        ExportError: if the folder cannot be written.
    """
    try:
        with _new_parents(path), temporary_folder(path.parent) as work:
            folder, old = work / path.name, work / f"{path.name}.old"
            folder.mkdir()
            yield folder
            try:
                if path.is_dir():
                    path.replace(old)
                folder.replace(path)
            finally:  # an error or a signal may come between the two moves
                if os.path.lexists(old) and not os.path.lexists(path):
                    old.replace(path)
    except OSError as error:
        raise ExportError(f"cannot write {path}: {error.strerror or error}") from error


def check_target(path: Path, *, overwrite: bool) -> None:
    """Check that a file can be written.

    Args:
        path: File to write.
        overwrite: Whether an existing file may be replaced.

    Raises:
        ExportError: if `path` cannot be written, or exists and may not be replaced.
    """
    try:
        if path.is_dir():
            raise ExportError(f"cannot write {path}: it is a folder")
        if path.exists() and not path.is_file():
            raise ExportError(f"cannot write {path}: it exists and is not a regular file")
        if path.exists() and not overwrite:
            raise ExportError(f"{path} exists; use another name, or `overwrite=True`")
    except OSError as error:
        raise ExportError(f"cannot write {path}: {error.strerror or error}") from error
    check_parents(path)


def check_parents(path: Path) -> None:
    """Raise ExportError if the folder of `path` does not exist and cannot be created."""
    existing = next((parent for parent in path.parents if os.path.lexists(parent)), path.parent)
    if not existing.is_dir():
        raise ExportError(f"cannot write {path}: {existing} is not a folder")
    if existing != path.parent and not os.access(existing, os.W_OK):
        raise ExportError(f"cannot write {path}: cannot create a folder in {existing}")


@contextmanager
def _new_parents(path: Path) -> Iterator[None]:
    """Create the folders above `path`; if the block raises, remove those that were missing."""
    missing = [parent for parent in path.parents if not parent.exists()]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        for folder in missing:
            with suppress(OSError):  # not created, or in use by another process
                folder.rmdir()
        raise


@contextmanager
def temporary_folder(parent: Path) -> Iterator[Path]:
    """Yield a new folder in `parent`, which is removed when the block ends.

    Its name records the host and the process, so that the folders of killed processes of this host
    can be removed first.
    """
    prefix = f".terrainkit-{''.join(filter(str.isalnum, platform.node()))}-"
    for stale in parent.glob(f"{prefix}*-*"):
        pid = stale.name.removeprefix(prefix).partition("-")[0]
        if pid.isdecimal() and not _is_running(int(pid)):
            shutil.rmtree(stale, ignore_errors=True)
    # Named before it exists, so that a signal during its creation cannot leave it behind.
    folder = parent / f"{prefix}{os.getpid()}-{secrets.token_hex(4)}"
    try:
        folder.mkdir(mode=0o700)
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _is_running(pid: int) -> bool:
    try:
        import psutil
    except ModuleNotFoundError:  # the light installation leaves the files of killed processes
        return True
    return bool(psutil.pid_exists(pid))
