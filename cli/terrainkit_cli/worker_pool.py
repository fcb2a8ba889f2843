"""A pool of processes for a command."""

import signal
import sys
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from concurrent.futures import Executor
    from pathlib import Path


def worker_pool(jobs: int) -> "AbstractContextManager[Executor | None]":
    """Return the context of an executor of `jobs` processes; None for 1, which is this process."""
    if jobs == 1:
        return nullcontext()
    from concurrent.futures import ProcessPoolExecutor

    from terrainkit.terrain.plugin_file import plugin_files

    return ProcessPoolExecutor(jobs, initializer=_start_worker, initargs=(plugin_files(),))


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
