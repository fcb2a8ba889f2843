"""Ratios of run times, measured alternately so that other load affects both."""

import os
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


def process(command: list[str]) -> Callable[[], Any]:
    """Return a function that runs `command` to its end; modules are cached as bytecode."""
    env = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    return lambda: subprocess.run(command, check=True, capture_output=True, env=env)
