"""Timing two things in turn, so that a busy machine slows both."""

import statistics
import subprocess
import time
from collections.abc import Callable
from typing import Any


def seconds(work: Callable[[], Any]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def ratio(work: Callable[[], Any], limit: Callable[[], Any], rounds: int = 9) -> float:
    """Return the median time of `work` over the median time of `limit`, run in turn."""
    work(), limit()
    pairs = [(seconds(work), seconds(limit)) for _ in range(rounds)]
    return statistics.median(a for a, _ in pairs) / statistics.median(b for _, b in pairs)


def process(command: list[str]) -> Callable[[], Any]:
    """Return the work of running `command` to its end."""
    return lambda: subprocess.run(command, check=True, capture_output=True)
