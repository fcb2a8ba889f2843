"""Open files that are not trusted to be regular files."""

import os
import stat
from pathlib import Path
from typing import BinaryIO

from terrainkit.errors import ExportError

_BINARY: int = getattr(os, "O_BINARY", 0)
"""Windows opens files in text mode without it."""


class SpecialFileError(OSError):
    """A path that is a folder, a pipe or a device; the message lacks its subject."""


def is_utf8(path: Path) -> bool:
    """Return whether a path is UTF-8; MuJoCo and TensorBoard open no others."""
    return str(path).encode(errors="replace").decode() == str(path)


def require_utf8(path: Path) -> None:
    """Raise ExportError if a path is not UTF-8."""
    if not is_utf8(path.absolute()):
        raise ExportError(f"cannot write {path}: its name is not UTF-8")


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file for reading; opening a pipe would block, reading a device never end.

    Raises:
        SpecialFileError: If the path is not a regular file.
        OSError: If the file does not exist or cannot be read.
        ValueError: If the path is invalid.
    """
    _check_regular(path.stat().st_mode)
    # the file may have been replaced by a pipe, and opening a pipe blocks
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | _BINARY)
    try:
        _check_regular(os.fstat(descriptor).st_mode)
        return os.fdopen(descriptor, "rb")
    except OSError:
        os.close(descriptor)
        raise


def _check_regular(mode: int) -> None:
    if not stat.S_ISREG(mode):
        kinds = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}
        raise SpecialFileError(f"is {kinds.get(stat.S_IFMT(mode), 'a device')}, not a file")
