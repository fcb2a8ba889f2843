import os

from terrainkit_cli.worker_pool import worker_pool


def test_worker_pool_of_one_is_this_process():
    with worker_pool(1) as executor:
        assert executor is None


def test_worker_pool_runs_other_processes():
    with worker_pool(2) as executor:
        assert executor.submit(os.getpid).result() != os.getpid()
