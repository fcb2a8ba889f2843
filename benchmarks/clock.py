"""Ratios of run times, measured alternately so that other load affects both."""

import os
import resource
import statistics
import subprocess
import time
from collections.abc import Callable
from typing import Any


def seconds(function: Callable[[], Any], clock: Callable[[], float] = time.perf_counter) -> float:
    """Return the run time of `function` by a clock [s]."""
    start = clock()
    function()
    return clock() - start


def ratio(function: Callable[[], Any], reference: Callable[[], Any], num_runs: int = 9) -> float:
    """Return the ratio of the median run times of `function` and `reference`."""
    function(), reference()
    pairs = [(seconds(function), seconds(reference)) for _ in range(num_runs)]
    return statistics.median(a for a, _ in pairs) / statistics.median(b for _, b in pairs)


def cpu_ratio(
    function: Callable[[], Any], reference: Callable[[], Any], num_runs: int = 5
) -> float:
    """Return the ratio of the smallest processor times of `function` and `reference`.

    It includes child processes, and depends less on what else runs than `ratio`.
    """
    function(), reference()
    pairs = [(seconds(function, cpu_time), seconds(reference, cpu_time)) for _ in range(num_runs)]
    return min(a for a, _ in pairs) / min(b for _, b in pairs)


def cpu_time() -> float:
    """Return the processor time of this process and its ended children [s]."""
    usages = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def user_time() -> float:
    """Return the processor time of this process without that of the kernel [s]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_utime


def process(command: list[str]) -> Callable[[], Any]:
    """Return a function that runs `command` to its end; modules are cached as bytecode."""
    env = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    return lambda: subprocess.run(command, check=True, capture_output=True, env=env)
