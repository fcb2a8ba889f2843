import multiprocessing
import os
import time

import cv2
import numpy as np
import pytest

from terrainkit.terrain import plugin_file
from terrainkit.terrain.worker_pool import worker_pool


def test_worker_pool_of_one_is_this_process():
    with worker_pool(1) as executor:
        assert executor is None


def test_worker_pool_runs_other_processes():
    with worker_pool(2) as executor:
        assert executor.submit(os.getpid).result() != os.getpid()


def test_worker_pool_does_not_wait_for_threads_of_opencv():
    cv2.distanceTransform(np.ones((2000, 2000), np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    with worker_pool(2) as executor:
        assert executor.submit(cv2.getNumThreads).result() == 1


@pytest.mark.usefixtures("own_registry")
def test_worker_pool_imports_plugin_files_in_processes_that_are_not_forked(tmp_path):
    path = tmp_path / "bump.py"
    path.write_text("")
    plugin_file.load_plugin(path)
    method = multiprocessing.get_start_method()
    multiprocessing.set_start_method("spawn", force=True)
    try:
        with worker_pool(2) as executor:
            assert executor.submit(plugin_file.plugin_files).result() == (path,)
    finally:
        multiprocessing.set_start_method(method, force=True)


def test_worker_pool_does_not_wait_for_work_that_has_not_started():
    with worker_pool(2) as executor:
        futures = [executor.submit(time.sleep, 0.1) for _ in range(100)]
    assert futures[-1].cancelled()
