"""A pool of processes for a command."""

import signal
import sys
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from concurrent.futures import Executor


def worker_pool(jobs: int) -> "AbstractContextManager[Executor | None]":
    """Return the context of an executor of `jobs` processes; None for 1, which is this process."""
    if jobs == 1:
        return nullcontext()
    from concurrent.futures import ProcessPoolExecutor

    return ProcessPoolExecutor(jobs, initializer=_start_worker)


def _start_worker() -> None:
    """Leave the reaction to Ctrl-C to the main process; end quietly on SIGTERM."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if opencv := sys.modules.get("cv2"):
        # A forked process lacks the threads of the main process. OpenCV 4.10 once waited for them.
        opencv.setNumThreads(0)
