import mmap
import os
import pickle
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture
def forked(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    from fuzzing import forked

    monkeypatch.setattr(forked, "SECONDS", 1)
    monkeypatch.setattr(forked, "MEMORY", 40 << 20)
    return forked


def _loop():
    while True:
        pass


def _fill_new_pages():
    """Use 64 MiB that malloc can't serve from memory that the parent has freed but not returned."""
    np.frombuffer(mmap.mmap(-1, 64 << 20), np.uint8).fill(1)
    return 0


def _act(code, *, errors=0, text="", path=""):
    """Print lines, write a file, and return the exit code."""
    os.write(2, b"terrainkit: error: x\n" * errors + text.encode())
    if path:
        Path(path).write_text("1")
    return code


class _Payload:
    def __reduce__(self):
        return os.getenv, ("HOME",)


BEHAVIORS = {
    "success": (partial(_act, 0), None),
    "one error": (partial(_act, 2, errors=1), None),
    "output file": (partial(_act, 0, path="out.npz"), None),
    "exception": (lambda: 1 // 0, "traceback"),
    "exit": (lambda: sys.exit(0), "traceback"),
    "crash": (lambda: os.kill(os.getpid(), signal.SIGTERM), "traceback"),
    "loop": (_loop, "hang"),
    "sleep": (partial(time.sleep, 100), "hang"),
    "memory": (_fill_new_pages, "memory"),
    "partial file": (partial(_act, 2, errors=1, path="out.npz"), "files"),
    "file beside": (partial(_act, 0, path="x"), "files"),
    "file elsewhere": (partial(_act, 0, path="../x"), "files"),
    "changed input": (partial(_act, 0, path="input"), "files"),
    "program": (lambda: os.system("true"), "executed"),
    "process": (lambda: subprocess.call(["true"]), "executed"),
    "pickle": (lambda: pickle.loads(pickle.dumps(_Payload())) and 0, "executed"),
    "warning": (partial(_act, 0, text="UserWarning: x\n"), "output"),
    "no error": (partial(_act, 2), "output"),
    "two errors": (partial(_act, 2, errors=2), "output"),
}


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")  # pytest-xdist has threads
@pytest.mark.parametrize("name", BEHAVIORS)
def test_fork_finds_what_a_command_must_not_do(tmp_path, monkeypatch, forked, name):
    function, kind = BEHAVIORS[name]
    monkeypatch.setattr("terrainkit_cli.main.main", lambda _: function())

    def prepare():
        Path("input").write_text("0")
        return forked.Command(words=[])

    failure = forked.run_forked(tmp_path, prepare)
    assert (failure and failure.kind) == kind, failure


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_memory_that_a_process_starts_with_is_not_counted(tmp_path, monkeypatch, forked):
    np.memmap(tmp_path / "file", np.uint8, "w+", shape=2 * forked.MEMORY)
    private = np.memmap(tmp_path / "file", np.uint8, "c")
    private[0] = 1  # after a write, forking copies the pages of the file too
    assert private.sum() == 1
    monkeypatch.setattr("terrainkit_cli.main.main", lambda _: 0)
    assert forked.run_forked(tmp_path, lambda: forked.Command(words=[])) is None


@pytest.mark.usefixtures("forked")
def test_minimize_keeps_what_fails():
    from fuzz import minimize

    assert minimize(b"abcdXefghYi", lambda data: b"X" in data and b"Y" in data, 10) == b"XY"


@pytest.mark.usefixtures("forked")
def test_inputs_depend_on_seed_and_index_only(tmp_path, monkeypatch):
    from fuzzing.surfaces import FILE, load_surfaces, prepare

    surface = next(each for each in load_surfaces() if each.name == "robots")
    contents = []
    for name in "ab":
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        for index in range(20):
            prepare(surface, FILE.with_name("seeds") / "robots", 3, index)
        contents.append({p.name: p.read_bytes() for p in Path().iterdir() if p.is_file()})
    assert contents[0] == contents[1]


def test_no_input_of_a_fixed_seed_fails():
    command = [sys.executable, "benchmarks/fuzz.py", "--inputs", "20"]
    command += ["--only", "npz", "imports", "configuration", "robots", "plugins"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=500)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "npz" in result.stdout
