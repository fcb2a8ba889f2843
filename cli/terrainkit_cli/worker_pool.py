"""A pool of processes for a command."""

import signal
from contextlib import contextmanager
from typing import TYPE_CHECKING

from terrainkit.errors import TerrainkitError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from concurrent.futures import Executor


@contextmanager
def worker_pool(jobs: int) -> "Iterator[Executor | None]":
    """Yield an executor of `jobs` processes; None for 1, which is this process.

    Raises:
        TerrainkitError: if a process ended unexpectedly.
    """
    if jobs == 1:
        yield None
        return
    from concurrent.futures import ProcessPoolExecutor
    from concurrent.futures.process import BrokenProcessPool

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
