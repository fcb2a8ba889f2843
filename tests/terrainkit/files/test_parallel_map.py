import os
from concurrent.futures import CancelledError, Executor, ProcessPoolExecutor, ThreadPoolExecutor
from unittest.mock import Mock

import pytest

from terrainkit.errors import ConfigError, TerrainkitError
from terrainkit.files.parallel_map import parallel_map


def test_parallel_map_without_an_executor_runs_here():
    results = parallel_map(None, lambda item: (item, os.getpid()), "ab")
    assert list(results) == [("a", os.getpid()), ("b", os.getpid())]


def test_parallel_map_reports_an_ended_process_in_one_line():
    with (
        ProcessPoolExecutor(1) as executor,
        pytest.raises(TerrainkitError, match=r"^an executor failed: BrokenProcessPool: .*; use "),
    ):
        list(parallel_map(executor, os._exit, [1]))


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (CancelledError(), "an executor failed: CancelledError; use fewer"),
        (OSError("no\nroom."), "an executor failed: OSError: no room; use fewer"),
        (ConfigError("seed: wrong"), "seed: wrong"),
    ],
)
def test_parallel_map_reports_errors_of_an_executor(error, expected):
    executor = Mock(spec=Executor, map=Mock(side_effect=error))
    with pytest.raises(TerrainkitError) as caught:
        list(parallel_map(executor, str, "a"))
    assert str(caught.value).startswith(expected)


def test_parallel_map_raises_errors_of_the_function():
    with ThreadPoolExecutor() as executor, pytest.raises(ValueError, match="invalid literal"):
        list(parallel_map(executor, int, "x"))
