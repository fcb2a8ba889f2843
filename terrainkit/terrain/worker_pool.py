"""A pool of processes that build patches."""

import signal
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from concurrent.futures import Executor
    from pathlib import Path

# If a process was killed while it sent a result, Python's pool never ends the others.
_MAX_WAIT = 10.0
"""Time for the processes to finish what they do at the end [s]."""


@contextmanager
def worker_pool(jobs: int) -> "Iterator[Executor | None]":
    """Run processes, which end with the block, and with this process, however that ends.

    They know the terrains of plugin files. On Linux, they also end with the thread that starts
    them.

    Args:
        jobs: Number of processes.

    Yields:
        The executor, for `generate` and `TerrainStream`; None for 1 job, which is this process.
    """
    if jobs == 1:
        yield None
        return
    from concurrent.futures import ProcessPoolExecutor

    from terrainkit.terrain.plugin_file import plugin_files

    executor = ProcessPoolExecutor(jobs, initializer=_start_worker, initargs=(plugin_files(),))
    try:
        yield executor
    finally:
        processes = list(executor._processes.values())
        executor.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.join(_MAX_WAIT)
            process.kill()


def _start_worker(plugins: "Sequence[Path]") -> None:
    """Leave the reaction to Ctrl-C to the main process; end quietly on SIGTERM, and with it."""
    from multiprocessing import parent_process

    from terrainkit.files.child_process import end_with_parent
    from terrainkit.terrain.plugin_file import load_plugin

    if main_process := parent_process():
        end_with_parent(main_process.is_alive)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if opencv := sys.modules.get("cv2"):
        # A forked process lacks the threads of the main process. OpenCV 4.10 once waited for them.
        opencv.setNumThreads(0)
    for path in plugins:  # a process that is not forked has not imported them
        load_plugin(path)
