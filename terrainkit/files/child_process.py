"""Call a function in a child process with limits of time and memory.

Image decoders, mesh readers and CoACD are native code, which may crash, run for hours, or allocate
the sizes that a file claims.
"""

import os
import pickle
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import TerrainkitError
from terrainkit.files.memory import check_memory


@dataclass(frozen=True, kw_only=True)
class ProcessLimits:
    """What a child process may use."""

    seconds: float = 120.0
    """Time limit [s]; a mesh of a million triangles takes a few seconds."""

    memory: int = 8 << 30
    """Largest address space [bytes], where the operating system supports it."""


class ProcessError(TerrainkitError):
    """The function failed, crashed, or exceeded a limit; the message is the reason in one line."""


def run_in_process(
    function: Callable[..., Mapping[str, Any]], *arguments: Any, limits: ProcessLimits | None = None
) -> dict[str, NDArray[Any]]:
    """Return the arrays that a function returns by name, called in a child process.

    The result is read without pickle, since the child handles files of strangers.

    Args:
        function: A function of a module.
        *arguments: Its arguments, which are pickled.
        limits: Limits of the child process; None for the defaults.

    Raises:
        ProcessError: if the function fails, crashes, or exceeds a limit.
        MemoryLimitError: if the arrays do not fit in memory.
    """
    limits = limits or ProcessLimits()
    with tempfile.TemporaryDirectory(prefix="terrainkit-") as folder:
        request, result = Path(folder) / "request", Path(folder) / "result.npz"
        request.write_bytes(pickle.dumps((function, arguments, limits.memory)))
        # -P: no module is imported from the current folder, which may be a stranger's.
        start = f"import sys; from {__name__} import main; main(*sys.argv[1:])"
        command = [sys.executable, "-P", "-c", start, str(request), str(result)]
        # Each thread of OpenBLAS takes 40 MB of the address space, before any work.
        variables = {"PYTHONPATH": import_path(), "OPENBLAS_NUM_THREADS": "1"}
        try:
            subprocess.run(
                command,
                check=True,
                capture_output=True,
                timeout=limits.seconds,
                env=os.environ | variables,
            )
            check_memory(result.stat().st_size, "the result of a child process")
            with np.load(result, allow_pickle=False) as arrays:
                return dict(arrays)
        except subprocess.TimeoutExpired:
            raise ProcessError(f"takes more than {limits.seconds:g} s") from None
        except subprocess.CalledProcessError as error:
            lines = error.stderr.decode(errors="replace").strip().splitlines()
            reason = lines[-1] if lines and error.returncode > 0 else "the process crashed"
            raise ProcessError(textwrap.shorten(reason, 200, placeholder="...")) from None
        except TerrainkitError:
            raise
        except Exception as error:  # damaged arrays raise various errors of zipfile and numpy
            raise ProcessError(f"the result cannot be read: {error}") from None


def import_path() -> str:
    """Return the PYTHONPATH with which a child process imports from the folders of this process.

    The current folder, which may contain files of strangers, is not among them.
    """
    return os.pathsep.join(str(Path(entry).absolute()) for entry in sys.path if entry)


def main(request: str, result: str) -> None:
    """Call the function of a request in this process, and write what it returns to `result`."""
    function, arguments, memory = pickle.loads(Path(request).read_bytes())
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    except (ImportError, ValueError, OSError):  # Windows, or a lower limit of the system
        pass
    try:
        np.savez(result, **function(*arguments))
    except MemoryError:
        sys.exit(f"needs more than {memory / 2**30:g} GB of memory")
    except Exception as error:
        sys.exit(" ".join(str(error).split()) or type(error).__name__)
