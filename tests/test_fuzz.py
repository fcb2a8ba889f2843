import ctypes
import json
import mmap
import os
import pickle
import signal
import subprocess
import sys
import time
import zipfile
from fnmatch import fnmatch
from functools import partial
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from random import Random
from xml.etree import ElementTree

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


def _write_natively(path):
    """Write a file without an event of Python, as torch does."""
    ctypes.CDLL(None).creat(path.encode(), 0o644)
    return 0


def _leave_process():
    if not os.fork():
        os.setsid()
        time.sleep(100)
    return 0


def _print(text):
    os.write(1, text)
    return 0


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
    "deaf loop": (lambda: sum(range(10**13)), "hang"),
    "process that stays": (_leave_process, "processes"),
    "file at home": (partial(_write_natively, "../home/x"), "files"),
    "native file": (partial(_write_natively, "x"), "files"),
    "control of the terminal": (partial(_print, b"a\x1b[2J\n"), "output"),
    "control in an error": (partial(_act, 2, text="terrainkit: error: \x9b2J\n"), "output"),
    "command of a workflow": (partial(_print, b"a\n::error::b\n"), "output"),
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


HANGS = {
    "loop": (_loop, "in Python code; "),
    "deaf": (lambda: sum(range(10**13)), "deaf to signals; "),
    "child": (lambda: subprocess.call(["sleep", "100"]), "in Python code; waits for sleep 100 "),
}


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
@pytest.mark.parametrize(("function", "expected"), HANGS.values(), ids=HANGS)
def test_hang_says_whether_the_command_or_its_child_hangs(
    tmp_path, monkeypatch, forked, function, expected
):
    monkeypatch.setattr("terrainkit_cli.main.main", lambda _: function())
    monkeypatch.setattr(forked, "EXECUTES", ())
    failure = forked.run_forked(tmp_path, lambda: forked.Command(words=[]))
    assert failure
    assert failure.kind == "hang"
    assert failure.line.startswith(expected)


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


@pytest.fixture
def surfaces(forked):
    from fuzzing import surfaces

    assert forked
    return surfaces


def _surface(surfaces, name):
    return next(surface for surface in surfaces.load_surfaces() if surface.name == name)


def test_inputs_depend_on_seed_and_index_only(tmp_path, monkeypatch, surfaces):
    from fuzzing.surfaces import FILE, prepare

    surface = _surface(surfaces, "robots")
    contents = []
    for name in "ab":
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        for index in range(20):
            prepare(surface, FILE.with_name("seeds") / "robots", 3, index)
        contents.append({p.name: p.read_bytes() for p in Path().iterdir() if p.is_file()})
    assert contents[0] == contents[1]


@pytest.mark.parametrize("name", ["words", "calls"])
def test_words_depend_on_seed_and_index_only(tmp_path, monkeypatch, surfaces, name):
    monkeypatch.chdir(tmp_path)
    surface = _surface(surfaces, name)
    words = [[surfaces.prepare(surface, tmp_path / "none", 3, index).words for index in range(20)]]
    words += [[surfaces.prepare(surface, tmp_path / "none", 3, index).words for index in range(20)]]
    assert words[0] == words[1]
    assert len({tuple(line) for line in words[0]}) > 10


def test_kept_input_is_read_first(tmp_path, monkeypatch, surfaces):
    from fuzz import keep_in_corpus

    monkeypatch.setattr(surfaces, "CORPUS", tmp_path / "corpus")
    monkeypatch.setattr("fuzz.CORPUS", tmp_path / "corpus")
    failed, surface = tmp_path / "robots/3_7", _surface(surfaces, "robots")
    (failed / "work/a").mkdir(parents=True)
    log = {"words": ["check-robot", "a/x.urdf"], "path": "a/x.urdf"}
    (failed / "command").write_text(json.dumps(log))
    (failed / "work/a/x.urdf").write_text("damaged")
    (failed / "work/seed.urdf").write_text("a valid file")
    keep_in_corpus(failed)
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    command = surfaces.prepare(surface, tmp_path / "none", 0, 0)
    assert (command.words, command.path) == (log["words"], Path("a/x.urdf"))
    assert [str(path) for path in Path().rglob("*.*")] == ["a/x.urdf"]
    assert Path("a/x.urdf").read_text() == "damaged"


def test_pipes_and_links_are_made_beside_a_scene(tmp_path, monkeypatch, surfaces):
    surface, made = _surface(surfaces, "scenes"), {}
    for index, entry in enumerate(surface.hostile):
        if not {"beside", "pipe"} & entry.keys():
            continue
        (tmp_path / str(index)).mkdir()
        monkeypatch.chdir(tmp_path / str(index))
        surfaces.prepare(surface, surfaces.FILE.with_name("seeds") / "scenes", 0, index)
        made |= {path.name: path.is_fifo() for path in Path().iterdir() if not path.is_file()}
    pipes = dict.fromkeys(("pipe.stl", "pipe.png", "pipe.xml", "scene.xml"), True)
    assert made == pipes | {"zero.stl": False, "zero.xml": False}


def test_every_suffix_of_import_has_a_seed(surfaces):
    from terrainkit.importing import readers

    tried = set()
    for surface in (_surface(surfaces, "imports"), _surface(surfaces, "scenes")):
        names = [path.name for path in (ROOT / "benchmarks/fuzzing/seeds" / surface.name).iterdir()]
        names += [line.split()[-1] for line in surface.seeds]
        names += [entry["file"] for entry in surface.files]
        matched = [name for name in names if any(fnmatch(name, key) for key in surface.commands)]
        tried |= {Path(name).suffix for name in matched}
    modules = iter_modules(readers.__path__, f"{readers.__name__}.")
    imported = [import_module(module.name) for module in modules]
    suffixes = {suffix for reader in imported for suffix in getattr(reader, "SUFFIXES", ())}
    same_reader = {".jpeg", ".dt1", ".dt2", ".xyzn", ".xyzrgb", ".usd", ".usdz", ".sdf"}
    assert suffixes - tried == same_reader


def test_kept_inputs_are_small(surfaces):
    kept = [path for path in surfaces.CORPUS.rglob("*") if path.is_file()]
    assert kept
    assert [path for path in kept if path.stat().st_size > 20_000] == []


# Escapes of TorchScript.


def test_listed_escapes_have_their_effects(surfaces):
    from fuzzing.escapes.torchscript import ESCAPES

    scripts = _surface(surfaces, "scripts").hostile
    assert {entry["escape"] for entry in scripts} == set(ESCAPES)
    assert len(ESCAPES) > 100
    names = [name for name, escape in ESCAPES.items() if escape.effect == "writes"][::6]
    names += ["nested-comprehension-if-rows", "tensor-if-rows", "print", "list-in-itself"]
    command = [sys.executable, "benchmarks/verify_escapes.py", *names]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=500)
    assert result.returncode == 0, result.stdout + result.stderr


def test_script_with_a_flipped_bit_is_judged_by_its_checksums(tmp_path, surfaces):
    from fuzzing.escapes.torchscript import Escape

    path = tmp_path / "policy.pt"
    data = Escape(effect="writes").archive("x")
    path.write_bytes(data)
    judge = surfaces.CHECKS["checksums"]
    assert judge(path, path) == ""
    with zipfile.ZipFile(path) as archive:
        at = data.index(archive.read("policy/data/0"))
    path.write_bytes(data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :])
    assert judge(path, path) == "policy.pt, whose checksums are wrong: policy/data/0"
    path.write_bytes(data[:-30])
    assert judge(path, path).startswith("policy.pt, whose checksums are wrong: BadZipFile")


CONFIGS = {
    "quoted": ("NAME = {!r}", "' + str(1) + '", ""),
    "text": ('NAME = "{}"', '" + str(1) + "', "the name adds"),
    "long text": ('NAME = """{}"""', '""" + str(1) + """', "the name adds"),
    "broken": ("NAME = '{}'", "'", "cannot be parsed"),
}


@pytest.mark.parametrize(("line", "name", "expected"), CONFIGS.values(), ids=CONFIGS)
@pytest.mark.usefixtures("forked")
def test_name_that_becomes_code_is_found(tmp_path, monkeypatch, line, name, expected):
    from fuzzing.names import prepare_name

    def onboard(words):
        _, robot, _, folder = words
        link = ElementTree.parse(robot).find("link").get("name")
        Path(folder).mkdir()
        Path(folder, "config.py").write_text(line.format(link))
        return 0

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("terrainkit_cli.main.main", onboard)
    Path("plain").mkdir()
    Path("plain/robot.urdf").write_text('<robot><link name="trunk"/></robot>')
    command = prepare_name("onboard {} -o out", name, Random(0))
    onboard(command.words)
    reason = command.check()
    assert (expected in reason) if expected else reason == ""


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
@pytest.mark.parametrize(
    ("expression", "kind"),
    [
        ("np.zeros(3)", None),
        ("a_map.height('a')", None),
        ("[].missing", "traceback"),
        ("1 / 0", "traceback"),
        ("terrainkit.get_suite('a').missing", None),
        ("np.zeros(3).tofile('x')", "files"),
    ],
)
def test_call_is_judged_like_a_command(tmp_path, terrain_map, forked, expression, kind):
    from fuzzing.calls import call

    terrain_map.save(tmp_path / "map.npz")

    def prepare():
        os.link(tmp_path / "map.npz", "map.npz")
        return forked.Command(words=[expression], run=call)

    failure = forked.run_forked(tmp_path / "forked", prepare)
    assert (failure and failure.kind) == kind, failure


def test_no_input_of_a_fixed_seed_fails():
    command = [sys.executable, "benchmarks/fuzz.py", "--inputs", "20"]
    command += ["--only", "npz", "imports", "configuration", "robots", "plugins", "names"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=500)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "npz" in result.stdout
