"""Functions that tests call in child processes."""

import os
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np

from terrainkit.files.child_process import ChildProcess
from terrainkit.files.sandbox import forbid_changes


def double(received):
    for value in received:
        yield {"value": 2 * value}


def answer_once(_):
    yield {"value": 1}
    spin()


def folder_content():
    os.write(1, b"::error::out")
    os.write(2, b"::error::native")
    return {"names": np.array([path.name for path in Path.cwd().iterdir()], str)}


def spin():
    while True:
        pass


def answer_with(answer):
    """Send bytes, as a reader that a file has taken over might."""
    for stream in range(3, 20):
        with suppress(OSError):
            os.write(stream, answer)
    os._exit(0)


def num_threads():
    return {"number": len([*Path("/proc/self/task").iterdir()])}


def in_sandbox(folder, function):
    os.chdir(folder)
    assert forbid_changes()
    return {"value": np.asarray(function() or 0)}


def refusals(archives):
    """Return why each TorchScript archive is refused, in a process that can change nothing."""
    from terrainkit_robots.policy.torchscript import check_operators, checked_archive, load_script

    assert forbid_changes()
    messages = []
    for data in archives:
        try:
            check_operators(load_script(checked_archive(data)))
            messages.append("")
        except Exception as error:
            messages.append(str(error))
    return {"messages": np.array(messages)}


def call_scripts(archives, has_sandbox):
    """Load and call TorchScript archives without a check of their operators."""
    import torch

    from terrainkit_robots.policy.torchscript import load_script

    torch.set_num_threads(1)
    for data in archives:
        if not (child := os.fork()):  # some end the process
            with suppress(Exception):
                assert not has_sandbox or forbid_changes()
                module = load_script(data)
                for rows in (1, 2, 4, 8, 4, 8):
                    module(torch.randn(rows, 8))
            os._exit(0)
        os.waitpid(child, 0)
    return {}


def multiply(_):
    yield {}
    matrix = np.ones((4000, 4000))
    while True:
        matrix = np.clip(matrix @ matrix, 0, 1)


def start_child():
    process = ChildProcess(multiply)
    process.receive()
    sys.stdout.write("started\n")
    sys.stdout.flush()
    process.receive()


def start_workers():
    from terrainkit.terrain.worker_pool import worker_pool

    with worker_pool(2) as executor:
        executor.submit(int).result()
        results = [executor.submit(spin) for _ in range(2)]
        sys.stdout.write("started\n")
        sys.stdout.flush()
        results[0].result()


def odd_policy(*_, first, second):
    """Answer with `first`, and then with `second`, as a policy that has taken over its process."""
    yield first
    yield second
