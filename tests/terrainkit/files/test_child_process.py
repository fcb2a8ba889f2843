import importlib
import os
import time
from pathlib import Path

import numpy as np
import pytest

from terrainkit.files.child_process import ProcessError, ProcessLimits, run_in_process

pytestmark = pytest.mark.usefixtures("real_child")


def test_child_process_returns_arrays():
    heights = np.arange(6.0).reshape(2, 3)
    arrays = run_in_process(dict, [("heights", heights)])
    assert list(arrays) == ["heights"]
    assert np.array_equal(arrays["heights"], heights)


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="Linux only")
def test_child_process_address_space_does_not_depend_on_the_number_of_cpus(tmp_path, monkeypatch):
    code = "import os\ndef threads():\n    return {'number': len(os.listdir('/proc/self/task'))}\n"
    (tmp_path / "own_threads.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    threads = importlib.import_module("own_threads").threads
    assert run_in_process(threads)["number"] == 1  # numpy of PyPI has one for each CPU


def test_child_process_imports_nothing_from_the_current_folder(tmp_path, monkeypatch):
    (tmp_path / "numpy.py").write_text("raise SystemExit('stranger')")
    monkeypatch.chdir(tmp_path)
    assert run_in_process(dict, [("a", np.ones(1))])["a"].tolist() == [1.0]


@pytest.mark.parametrize(
    ("function", "arguments", "limits", "reason"),
    [
        (time.sleep, (60,), ProcessLimits(seconds=0.01), r"^takes more than 0\.01 s$"),
        (np.zeros, (1 << 31,), ProcessLimits(memory=1 << 32), r"^needs more than 4 GB of memory$"),
        (os.abort, (), ProcessLimits(), "^the process crashed$"),
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
    with pytest.raises(ProcessError, match=r"^the result cannot be read: .*allow_pickle=False"):
        run_in_process(dict, [("a", np.array([print], dtype=object))])


def test_child_process_rejects_result_with_damaged_header(tmp_path, monkeypatch):
    code = """
import atexit, sys, zipfile
def write():  # as a reader that was taken over
    with zipfile.ZipFile(sys.argv[2], "w") as file:
        file.writestr("a.npy", b"\\x93NUMPY\\x01\\x00\\x02\\x00{'")
def damage():
    atexit.register(write)
    return {}
"""
    (tmp_path / "own_result.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    damage = importlib.import_module("own_result").damage
    with pytest.raises(ProcessError, match=r"^the result cannot be read: "):
        run_in_process(damage)


@pytest.mark.usefixtures("import_in_process")
def test_main_needs_memory():
    with pytest.raises(ProcessError, match=r"^needs more than 8 GB of memory$"):
        run_in_process(np.zeros, 1 << 50)
