"""Call a function in a child process with limits of time and memory.

Image decoders, mesh readers, renderers and policies are native code, which may crash, run for
hours, or allocate the sizes that a file claims. A child process answers with arrays, which are read
without pickle, since it handles files of strangers.
"""

import json
import math
import os
import pickle
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import textwrap
import time
import weakref
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from threading import Thread, Timer
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import TerrainkitError, one_line
from terrainkit.files.memory import MIN_CHECKED_BYTES, check_memory, free_memory

_MAX_HEADER = 1 << 18
"""Largest header of an answer, with the names, types and shapes of its arrays [bytes]."""

_KIND = re.compile(r"[<>|][biufcSU][1-9]\d{0,8}")
"""Types of the arrays of an answer. numpy also reads types of any size, and of objects."""

_START_SECONDS = 120.0
"""Time limit of the imports [s]: torch takes seconds, and more where the disk is slow."""

_POLL_TIME = 0.5
"""Time between two looks at the parent process [s]."""


@dataclass(frozen=True, kw_only=True)
class ProcessLimits:
    """What a child process may use."""

    seconds: float = 120.0
    """Time limit of an answer [s]; a mesh of a million triangles takes a few seconds."""

    cpu_seconds: int | None = None
    """Limit of the CPU time of the process [s], where the operating system supports it."""

    memory: int | None = 8 << 30
    """Memory beyond that of the imports [bytes], where the operating system supports it; the free
    memory is another limit. None for no limit."""

    def apply(self) -> None:
        """Limit this process."""
        try:
            import resource

            import psutil

            if self.memory is not None:
                limit = int(psutil.Process().memory_info().vms) + self.memory
                resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
            if self.cpu_seconds is not None:
                resource.setrlimit(resource.RLIMIT_CPU, (self.cpu_seconds, self.cpu_seconds + 1))
        except (ImportError, ValueError, OSError):  # Windows, or a lower limit of the system
            pass


class ProcessError(TerrainkitError):
    """The function failed, crashed, or exceeded a limit; the message is the reason in one line."""


class ChildProcess:
    """A child process that calls a generator function, and sends the arrays that it yields.

    It runs in an empty folder, what it prints is discarded, and it ends with this process. On Linux
    it also ends with the thread that started it.
    """

    def __init__(
        self,
        function: Callable[..., Iterator[Mapping[str, Any]]],
        *arguments: Any,
        limits: ProcessLimits | None = None,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        """Start the process.

        Args:
            function: A generator function of a module, which yields arrays by name. Its first
                argument is an iterator of the values that `send` sends.
            *arguments: Its further arguments, which are pickled; paths are absolute.
            limits: Limits of the process; None for the defaults.
            environment: Environment variables; None for those of this process.
        """
        self._limits, self._is_late = limits or ProcessLimits(), False
        self._is_ready = False
        if self._limits.memory is not None:
            memory = max(min(self._limits.memory, free_memory()), MIN_CHECKED_BYTES)
            self._limits = replace(self._limits, memory=memory)
        # Each thread of OpenBLAS takes 40 MB of the address space, before any work. The current
        # folder, which may be a stranger's, is not among the folders of imports.
        variables = {
            "PYTHONPATH": os.pathsep.join(str(Path(p).absolute()) for p in sys.path if p),
            "OPENBLAS_NUM_THREADS": "1",
        }
        folder = tempfile.mkdtemp(prefix="terrainkit-")
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", f"from {__name__} import main; main({os.getpid()})"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**(os.environ if environment is None else environment), **variables},
            cwd=folder,
        )
        self.close = weakref.finalize(self, _end, self._process, folder, os.getpid())
        """End the process."""
        self.send((function, arguments, self._limits))

    def __enter__(self) -> Self:
        """Return the process."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the process."""
        self.close()

    def send(self, value: Any) -> None:
        """Send a value, which is pickled, to the iterator of the function."""
        stream = self._process.stdin
        assert stream is not None
        with self._time_limit(), suppress(BrokenPipeError):  # `receive` tells why it ended
            pickle.dump(value, stream)
            stream.flush()

    def receive(self) -> dict[str, NDArray[Any]]:
        """Return the next arrays of the function by name; no arrays if it has ended.

        Raises:
            ProcessError: if the function fails, crashes, or exceeds a limit.
            MemoryLimitError: if the arrays do not fit in memory.
        """
        if not self._is_ready:
            self._read()
            self._is_ready = True
        return self._read()

    def _read(self) -> dict[str, NDArray[Any]]:
        try:
            with self._time_limit():
                return _read_arrays(self._process.stdout, self._limits.memory)
        except TerrainkitError:
            raise
        except EOFError:
            raise ProcessError(self._why_it_ended()) from None
        except Exception as error:  # of what a process sends that a file has taken over
            raise ProcessError(f"the result cannot be read: {one_line(str(error))}") from None

    @contextmanager
    def _time_limit(self) -> Iterator[None]:
        """Kill the process if the block takes too long."""

        def end_late() -> None:
            self._is_late = True
            self._process.kill()

        timer = Timer(self._limits.seconds if self._is_ready else _START_SECONDS, end_late)
        timer.daemon = True
        timer.start()
        try:
            yield
        finally:
            timer.cancel()

    def _why_it_ended(self) -> str:
        code = self._process.wait()
        if self._is_late:
            seconds = self._limits.seconds if self._is_ready else _START_SECONDS
            return f"takes more than {seconds:g} s"
        if code == -getattr(signal, "SIGXCPU", 0):
            return f"takes more than {self._limits.cpu_seconds} s of CPU time"
        return f"the process crashed, exit code {code}"


def run_in_process(
    function: Callable[..., Mapping[str, Any]], *arguments: Any, limits: ProcessLimits | None = None
) -> dict[str, NDArray[Any]]:
    """Return the arrays that a function returns by name, called in a child process.

    Args:
        function: A function of a module.
        *arguments: Its arguments, which are pickled; paths are absolute.
        limits: Limits of the child process; None for the defaults.

    Raises:
        ProcessError: if the function fails, crashes, or exceeds a limit.
        MemoryLimitError: if the arrays do not fit in memory.
    """
    with ChildProcess(_call_once, function, *arguments, limits=limits) as process:
        return process.receive()


def _call_once(_: Iterator[Any], function: Callable[..., Any], *arguments: Any) -> Iterator[Any]:
    yield function(*arguments)


def _end(process: "subprocess.Popen[bytes]", folder: str, owner: int) -> None:
    if os.getpid() == owner:  # and not a copy that was forked
        process.kill()
        with suppress(BrokenPipeError):  # of input that was not read
            process.communicate()
        shutil.rmtree(folder, ignore_errors=True)


def _read_arrays(stream: Any, memory: int | None) -> dict[str, NDArray[Any]]:
    """Return the arrays of a message.

    Args:
        stream: Where to read.
        memory: Largest size of all arrays [bytes]; None for the free memory.

    Raises:
        EOFError: if the process has ended.
        ProcessError: if the message is an error.
        MemoryLimitError: if the arrays do not fit in memory.
    """
    line = stream.readline(_MAX_HEADER)
    if not line.endswith(b"\n"):
        raise EOFError
    header = json.loads(line)
    if isinstance(header, str):
        raise ProcessError(textwrap.shorten(one_line(header), 200, placeholder="..."))
    sizes = {}
    for name, (kind, shape) in header.items():
        if not _KIND.fullmatch(kind) or not all(type(k) is int and k >= 0 for k in shape):
            raise ValueError(f"got an array of type {kind[:20]}")
        sizes[name] = np.dtype(kind).itemsize * math.prod(shape)
    size = sum(sizes.values())
    if memory is not None and size > memory:
        raise ValueError(f"got {size} bytes")
    check_memory(size, "the result of a child process")
    arrays = {name: np.empty(shape, kind) for name, (kind, shape) in header.items()}
    for array in arrays.values():
        data = memoryview(_as_bytes(array).data)
        while data:
            count = stream.readinto(data)
            if not count:
                raise EOFError
            data = data[count:]
        if array.dtype.kind == "U" and (array.reshape(-1).view(np.uint32) > sys.maxunicode).any():
            raise ValueError("got an array of text with other numbers")
    return arrays


def _write_arrays(stream: Any, arrays: Mapping[str, Any]) -> None:
    """Write a message of arrays by name."""
    values = {name: np.asarray(value, order="C") for name, value in arrays.items()}
    _write_header(stream, {name: (value.dtype.str, value.shape) for name, value in values.items()})
    for value in values.values():
        stream.write(_as_bytes(value))
    stream.flush()


def _write_header(stream: Any, header: Any) -> None:
    stream.write(json.dumps(header).encode() + b"\n")
    stream.flush()


def _as_bytes(array: NDArray[Any]) -> NDArray[np.uint8]:
    return array.reshape(-1).view(np.uint8)


def end_with_parent(is_running: Callable[[], bool]) -> None:
    """End this process when its parent ends.

    Args:
        is_running: Returns whether the parent is running.
    """
    if sys.platform == "linux":
        import ctypes

        pr_set_pdeathsig = 1
        ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGKILL)

    def watch() -> None:
        while is_running():
            time.sleep(_POLL_TIME)
        os._exit(1)

    # The parent may have ended before, and other systems have no such signal.
    Thread(target=watch, daemon=True).start()


def main(parent: int) -> None:
    """Call the function that arrives on stdin, and write what it yields to stdout.

    Args:
        parent: Number of the parent process.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C ends the parent
    end_with_parent(partial(_is_running, parent))
    received, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    null = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(null, stream)
    limits = ProcessLimits()
    try:
        function, arguments, limits = pickle.load(received)
        _write_header(answers, {})  # ready
        limits.apply()
        for arrays in function(_received_values(received), *arguments):
            _write_arrays(answers, arrays)
        _write_header(answers, {})
    except MemoryError:
        _write_header(answers, f"needs more than {(limits.memory or 0) / 2**30:.2g} GB of memory")
    except Exception as error:
        _write_header(answers, one_line(str(error)) or type(error).__name__)


def _is_running(parent: int) -> bool:
    if os.name == "posix":
        return os.getppid() == parent  # otherwise, another process has adopted this one
    import psutil  # on Windows, the number of the parent does not change

    return bool(psutil.pid_exists(parent))


def _received_values(stream: Any) -> Iterator[Any]:
    with suppress(EOFError):  # the parent needs no more
        while True:
            yield pickle.load(stream)
