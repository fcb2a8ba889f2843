import os

import pytest

from terrainkit.errors import TerrainkitError
from terrainkit_cli.worker_pool import worker_pool


def test_worker_pool_of_one_is_this_process():
    with worker_pool(1) as executor:
        assert executor is None


def test_worker_pool_runs_other_processes():
    with worker_pool(2) as executor:
        assert executor.submit(os.getpid).result() != os.getpid()


def test_worker_pool_reports_ended_process():
    with (
        pytest.raises(TerrainkitError, match="a worker process ended unexpectedly"),
        worker_pool(2) as executor,
    ):
        executor.submit(os._exit, 1).result()
