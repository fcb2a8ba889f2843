"""A pool of processes for a command."""

import signal
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager

from terrainkit.errors import ConfigError, TerrainkitError

MAX_JOBS = 61
"""Largest number of processes of a `ProcessPoolExecutor` on Windows."""


@contextmanager
def worker_pool(jobs: int) -> Iterator[Executor | None]:
    """Yield an executor of `jobs` processes; None for 1, which is this process.

    Raises:
        ConfigError: if `jobs` is not in 1 to `MAX_JOBS`.
        TerrainkitError: if a process ended unexpectedly.
    """
    if not 1 <= jobs <= MAX_JOBS:
        raise ConfigError(f"--jobs: got {jobs}; expected 1 to {MAX_JOBS}")
    if jobs == 1:
        yield None
        return
    try:
        with ProcessPoolExecutor(jobs, initializer=_reset_signals) as executor:
            yield executor
    except BrokenProcessPool:
        raise TerrainkitError(
            "a worker process ended unexpectedly, for example for lack of memory; use fewer --jobs"
        ) from None


def _reset_signals() -> None:
    """Leave the reaction to Ctrl-C to the main process; end quietly on SIGTERM."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
