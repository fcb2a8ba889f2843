import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest

from terrainkit.errors import MemoryLimitError
from terrainkit.files import child_process, memory
from terrainkit.files.child_process import (
    ChildProcess,
    ProcessError,
    ProcessLimits,
    run_in_process,
)
from tests.child_functions import (
    answer_once,
    answer_with,
    double,
    folder_content,
    num_threads,
    spin,
)

pytestmark = pytest.mark.usefixtures("real_child")


def test_child_process_returns_arrays():
    heights = np.arange(6.0).reshape(2, 3)
    arrays = run_in_process(dict, [("heights", heights)])
    assert list(arrays) == ["heights"]
    assert np.array_equal(arrays["heights"], heights)


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="Linux only")
def test_child_process_address_space_does_not_depend_on_the_number_of_cpus():
    # One watches the parent. numpy of PyPI has one for each CPU.
    assert run_in_process(num_threads)["number"] == 2


def test_child_process_imports_nothing_from_the_current_folder(tmp_path, monkeypatch):
    (tmp_path / "numpy.py").write_text("raise SystemExit('stranger')")
    monkeypatch.chdir(tmp_path)
    assert run_in_process(dict, [("a", np.ones(1))])["a"].tolist() == [1.0]


@pytest.mark.parametrize(
    ("function", "arguments", "limits", "reason"),
    [
        (time.sleep, (60,), ProcessLimits(seconds=0.01), r"^takes more than 0\.01 s$"),
        (np.zeros, (1 << 31,), ProcessLimits(memory=1 << 32), r"^needs more than 4 GB of memory$"),
        (os.abort, (), ProcessLimits(), "^the process crashed, exit code -6$"),
        (
            int,
            ("two\nlines",),
            ProcessLimits(),
            r"^invalid literal for int\(\) with base 10: 'two\\nlines'$",
        ),
    ],
)
def test_child_process_failure_is_one_line(function, arguments, limits, reason):
    with pytest.raises(ProcessError, match=reason):
        run_in_process(function, *arguments, limits=limits)


def test_child_process_result_is_read_without_pickle():
    with pytest.raises(ProcessError, match=r"^the result cannot be read: got an array of type \|O"):
        run_in_process(dict, [("a", np.array([print], dtype=object))])


@pytest.mark.parametrize(
    "answer",
    [
        b'{"a": ["<f8", [-1]]}\n',
        b'{"a": ["|O", [1]]}\n01234567',
        b'{"a": ["<f8", [1, "2"]]}\n',
        b'{"a": 3}\n',
        b'{"a": ["<f8", [true]]}\n',
        b'{"a": ["V0", [300000000]]}\n',
        b'{"a": ["(1,1)f8", [1]]}\n',
        b'{"a": ["<U0", [300000000]]}\n',
        b'{"a": ["<U1", [1]]}\n\xff\xff\xff\xff',
        b'{"a": ["<f8", [1000000000000000]]}\n',
        b"[\n",
        b"\xff\n",
        b"3\n",
    ],
)
def test_child_process_rejects_damaged_results(answer):
    with pytest.raises(ProcessError, match=r"^the result cannot be read: "):
        run_in_process(answer_with, answer)


def test_child_process_result_has_to_fit_in_memory(monkeypatch):
    monkeypatch.setattr(memory, "free_memory", lambda: 10**8)
    with pytest.raises(MemoryLimitError, match=r"the result of a child process needs 0\.54 GB"):
        run_in_process(dict, [("a", np.zeros(1 << 26))])


def test_child_process_that_does_not_read_is_ended():
    """`send` blocks once the pipe is full."""
    with ChildProcess(answer_once, limits=ProcessLimits(seconds=1.0)) as process:
        assert process.receive()["value"] == 1
        process.send(np.zeros(1 << 20))
        with pytest.raises(ProcessError, match=r"^takes more than 1 s$"):
            process.receive()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="not on Windows")
def test_child_process_is_not_ended_by_a_fork():
    with ChildProcess(double) as process:
        if not (number := os.fork()):
            process.close()
            os._exit(0)
        os.waitpid(number, 0)
        process.send(np.float32(1))
        assert process.receive()["value"] == 2


def test_child_process_answers_what_it_receives():
    with ChildProcess(double) as process:
        for value in (np.arange(3), np.ones((2, 0)), np.float32(0.5)):
            process.send(value)
            np.testing.assert_array_equal(process.receive()["value"], 2 * value)


def test_child_process_keeps_kinds_and_shapes():
    given = {
        "text": np.array(["a", "bcd"]),
        "scalar": np.float32(2.5),
        "flags": np.array([[True], [False]]),
        "empty": np.zeros((0, 3), np.int16),
        "columns": np.asfortranarray(np.arange(6).reshape(2, 3)),
    }
    result = run_in_process(dict, list(given.items()))
    for name, value in given.items():
        np.testing.assert_array_equal(result[name], value)
        assert result[name].dtype == np.asarray(value).dtype


def test_child_process_runs_in_an_empty_folder_and_prints_nothing(capfd):
    assert run_in_process(folder_content)["names"].tolist() == []
    assert capfd.readouterr() == ("", "")


def test_child_process_limits_cpu_time():
    with pytest.raises(ProcessError, match=r"^takes more than 1 s of CPU time$"):
        run_in_process(spin, limits=ProcessLimits(cpu_seconds=1))


def test_child_process_memory_is_at_most_the_free_memory(monkeypatch):
    monkeypatch.setattr(child_process, "free_memory", lambda: 1 << 29)
    with pytest.raises(ProcessError, match=r"^needs more than 0\.5 GB of memory$"):
        run_in_process(np.zeros, 1 << 27)


def test_child_process_ends_when_it_is_closed_or_forgotten():
    others = set(psutil.Process().children())  # of earlier tests, such as a resource tracker
    closed, forgotten = ChildProcess(double), ChildProcess(double)
    assert len(set(psutil.Process().children()) - others) == 2
    closed.close()
    assert len(set(psutil.Process().children()) - others) == 1
    del forgotten
    assert set(psutil.Process().children()) <= others


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="not on Windows")
@pytest.mark.parametrize("start", ["start_child", "start_workers"])
def test_children_end_with_a_killed_parent(start):
    """The children are in native code, which watches no parent."""
    code = f"from tests.child_functions import {start}; {start}()"
    variables = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=variables) as parent:
        assert parent.stdout.readline() == b"started\n"
        children = psutil.Process(parent.pid).children()
        assert children
        parent.kill()
    assert psutil.wait_procs(children, timeout=30)[1] == []


@pytest.mark.usefixtures("import_in_process")
def test_main_needs_memory():
    with pytest.raises(ProcessError, match=r"^needs more than 8 GB of memory$"):
        run_in_process(np.zeros, 1 << 50)
