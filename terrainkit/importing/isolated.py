"""Run the functions of child_process.py with a limit of time."""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import HeightFileError
from terrainkit.settings.text import truncate

MAX_SECONDS = 120.0
"""Time limit of a child process [s]; a mesh of a million triangles takes a few seconds."""

MAX_FILE_BYTES = 1 << 30
"""Largest file that is read [bytes]."""


def run_isolated(
    function: str, path: Path, *arguments: str, subject: str = ""
) -> dict[str, NDArray[np.generic]]:
    """Return the arrays of a function of child_process.py.

    Args:
        function: Name of the function.
        path: File that the function reads.
        *arguments: Further arguments of the function.
        subject: Start of the error; the path and "cannot be read" by default.

    Raises:
        HeightFileError: if the function fails, crashes, or exceeds a limit.
    """
    subject = subject or f"{path}: cannot be read"
    script = Path(__file__).with_name("child_process.py")
    with tempfile.TemporaryDirectory(prefix="terrainkit-") as folder:
        target = Path(folder) / "result.npz"
        # -P: modules are not imported from the folder of the script
        command = [sys.executable, "-P", str(script), function, str(target), str(path), *arguments]
        try:
            subprocess.run(command, check=True, capture_output=True, timeout=MAX_SECONDS)
            with np.load(target, allow_pickle=False) as arrays:
                return dict(arrays)
        except subprocess.TimeoutExpired:
            raise HeightFileError(f"{subject}: takes more than {MAX_SECONDS:g} s") from None
        except subprocess.CalledProcessError as error:
            lines = error.stderr.decode(errors="replace").strip().splitlines()
            reason = lines[-1] if lines and error.returncode > 0 else "the reader crashed"
            raise HeightFileError(f"{subject}: {truncate(reason, 200)}") from None


def check_file(path: Path) -> None:
    """Raise HeightFileError if `path` is no regular file, or is empty or too large."""
    try:
        if not path.exists():
            raise HeightFileError(f"no file {path}")
        if not path.is_file():
            raise HeightFileError(f"{path}: got a special file or folder; expected a file")
        size = path.stat().st_size
    except (OSError, ValueError) as error:
        raise HeightFileError(f"cannot read {path}: {error}") from error
    if not size:
        raise HeightFileError(f"{path}: got an empty file")
    if size > MAX_FILE_BYTES:
        raise HeightFileError(f"{path}: got {size} bytes; expected at most {MAX_FILE_BYTES}")
