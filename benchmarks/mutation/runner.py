"""Run test files on a copy of the working tree, each run in a forked process with limits."""

import hashlib
import importlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import psutil
import pytest

ROOT = Path(__file__).parents[2]

IMPORT_ROOTS = {"terrainkit": ".", "terrainkit_robots": "robots", "terrainkit_cli": "cli"}
"""Folder of each package; the tests of a package are in `tests/<package>`."""

_PRELOADED = ("coverage", "cv2", "hypothesis", "lxml.etree", "mujoco", "numpy")
_PRELOADED += ("rsl_rl.runners", "scipy.spatial", "scipy.optimize", "torch", "trimesh", "viser")
"""Modules that are imported once instead of by each run."""

_OPTIONS = ["-q", "-n", "0", "-p", "no:cacheprovider", "--tb=no"]
_OPTIONS += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]  # of preloaded plugins

_MEMORY = 6 << 30
"""Resident memory from which a run is ended [bytes]."""

_SLOWER = 6
"""A changed file may make its tests slower by this factor, and by `_MORE_SECONDS`."""

_MORE_SECONDS = 20.0


class Baseline(NamedTuple):
    """The tests of a file without a change: failed tests, and times [s]."""

    failed: list[str]
    cpu_seconds: float
    seconds: float


class Tree:
    """A copy of the working tree in a temporary folder, and what its tests did without a change.

    Args:
        folder: Folder of the copy.
        kept: Folder in which the baselines and coverage of the test files are kept.
    """

    def __init__(self, folder: Path, kept: Path) -> None:
        """Copy the files that git does not ignore."""
        self.folder = folder
        listing = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        for name in subprocess.check_output(listing, cwd=ROOT, text=True).split("\0"):
            if name and (ROOT / name).is_file():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, folder / name)
        self.kept = kept / "tests" / self._digest()
        self.kept.mkdir(parents=True, exist_ok=True)
        self.baselines: dict[Path, Baseline] = {}
        for name in _PRELOADED:
            with suppress(ImportError):
                importlib.import_module(name)

    def product_files(self) -> list[Path]:
        """Return the Python files of the three packages, relative to the tree."""
        folders = [Path(root) / name for name, root in IMPORT_ROOTS.items()]
        paths = (path for folder in folders for path in (self.folder / folder).rglob("*.py"))
        return sorted(path.relative_to(self.folder) for path in paths)

    def test_files(self, folder: Path) -> list[Path]:
        """Return the test files of a folder and its folders, relative to the tree."""
        paths = (self.folder / folder).rglob("test_*.py")
        return sorted(path.relative_to(self.folder) for path in paths)

    @contextmanager
    def changed(self, path: Path, source: bytes) -> Iterator[None]:
        """Replace a file for a while. No compiled file of it is left."""
        before = (self.folder / path).read_bytes()
        try:
            self._write(path, source)
            yield
        finally:
            self._write(path, before)

    def _write(self, path: Path, source: bytes) -> None:
        file = self.folder / path
        file.write_bytes(source)
        for compiled in (file.parent / "__pycache__").glob(f"{file.stem}.*.pyc"):
            compiled.unlink()

    def baseline(self, path: Path) -> Baseline:
        """Return what the tests of a file do without a change; run them once with coverage."""
        if path not in self.baselines:
            kept = self._kept(path)
            if not kept.with_suffix(".json").exists():
                done = self.run(path, None, coverage_file=kept)
                kept.with_suffix(".json").write_text(json.dumps(done._asdict()))
            done = Run(**json.loads(kept.with_suffix(".json").read_text()))
            self.baselines[path] = Baseline(done.failed, done.cpu_seconds, done.seconds)
        return self.baselines[path]

    def covering(self, test_file: Path, path: Path, lines: range) -> set[str] | None:
        """Return the tests that execute one of the lines, or without any, a function of the file.

        None stands for all tests of the file: a fixture or an import executed the lines.
        """
        from coverage import CoverageData

        self.baseline(test_file)
        data = CoverageData(str(self._kept(test_file)))
        data.read()
        by_line = data.contexts_by_lineno(str(path))
        tests = {name for each in lines or by_line for name in by_line.get(each, ()) if name}
        has_functions = b"def " in (self.folder / path).read_bytes()
        is_imported = bool(by_line) and not lines and not has_functions
        if is_imported or any(name.endswith("|setup") for name in tests):
            return None
        return tests

    def run(
        self,
        path: Path,
        only: set[str] | None,
        *,
        limit: Baseline | None = None,
        coverage_file: Path | None = None,
    ) -> "Run":
        """Run the tests of a file, to the first failure if there is a limit."""
        with tempfile.TemporaryDirectory(prefix="mutate-") as temporary:
            result, begin = Path(temporary) / "result", time.monotonic()
            cpu, wall = 3600.0, 3600.0
            if limit:
                cpu = _SLOWER * limit.cpu_seconds + _MORE_SECONDS
                wall = _SLOWER * (limit.seconds + _MORE_SECONDS)
            sys.stdout.flush()
            if not (child := os.fork()):
                os.environ["TMPDIR"] = tempfile.tempdir = temporary
                resource.setrlimit(resource.RLIMIT_CPU, (int(cpu) + 1, int(cpu) + 5))
                self._run_and_exit(path, only, limit, coverage_file, result)
            ended = wait(child, begin + wall)
            done = {"code": -1, "failed": [], "cpu_seconds": cpu}
            done |= json.loads(result.read_text()) if result.exists() else {}
            if limit is None and done["code"] not in (0, 1, 5):
                output = result.with_name("output").read_text()
                raise RuntimeError(f"{path}: {ended or done['code']}\n{output}")
            return Run(**done, seconds=round(time.monotonic() - begin, 1), ended=ended)

    def _run_and_exit(
        self,
        path: Path,
        only: set[str] | None,
        limit: Baseline | None,
        coverage_file: Path | None,
        result: Path,
    ) -> NoReturn:
        try:
            os.setsid()
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            os.chdir(self.folder)
            os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
            for number in (1, 2):
                os.dup2(os.open(result.with_name("output"), os.O_WRONLY | os.O_CREAT), number)
            roots = [str(self.folder / root) for root in IMPORT_ROOTS.values()]
            os.environ["PYTHONPATH"] = os.pathsep.join([*roots, os.environ.get("PYTHONPATH", "")])
            os.environ.setdefault("TERRAINKIT_ROBOTS", str(ROOT.parent / "shared/robots"))
            own = [str((ROOT / root).resolve()) for root in IMPORT_ROOTS.values()]
            sys.path[:] = roots + [entry for entry in sys.path if entry not in own]
            plugin = _Plugin(only, set(limit.failed) if limit else set())
            with plugin.measured(coverage_file, self.folder):
                options = [*_OPTIONS, *["-x"] * bool(limit), str(path)]
                code = pytest.main(options, [plugin])
            times = (
                resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
            )
            cpu = sum(each.ru_utime + each.ru_stime for each in times)
            done = {"code": int(code), "failed": plugin.failed, "cpu_seconds": round(cpu, 2)}
            result.write_text(json.dumps(done))
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(0)

    @cache  # noqa: B019
    def _kept(self, test_file: Path) -> Path:
        """Return where the baseline of a test file is kept, and of what it reads beside it."""
        file = self.folder / test_file
        beside = [path for path in file.parent.rglob("*") if path.suffix in (".toml", ".json")]
        digest = hashlib.sha1()
        for path in (file, file.with_name("conftest.py"), *sorted(beside)):
            digest.update(path.read_bytes() if path.exists() else b"")
        return self.kept / f"{test_file.stem}-{digest.hexdigest()[:12]}"

    def _digest(self) -> str:
        """Return a digest of the files that the tests run, which the lines of coverage are of."""
        digest = hashlib.sha1()
        for path in self.product_files():
            digest.update((self.folder / path).read_bytes())
        return digest.hexdigest()[:12]


class Run(NamedTuple):
    """What the tests of a file did: exit code of pytest, failed tests, times [s], why it ended."""

    code: int
    failed: list[str]
    cpu_seconds: float
    seconds: float
    ended: str

    @property
    def noticed(self) -> str:
        """Return what noticed a change, or nothing. Exit code 5 says that no test was selected."""
        if self.ended:
            return self.ended
        if self.failed:
            return self.failed[0]
        return "" if self.code in (0, 5) else f"pytest ended with {self.code}"


class _Plugin:
    """Selects tests, collects failed ones, and tells coverage which test runs."""

    def __init__(self, only: set[str] | None, excluded: set[str]) -> None:
        self.only, self.excluded = only, excluded
        self.failed: list[str] = []
        self.coverage: Any = None

    @contextmanager
    def measured(self, file: Path | None, tree: Path) -> Iterator[None]:
        """Measure coverage where there is a file for it. Paths are relative to the tree."""
        if file is None:
            yield
            return
        from coverage import Coverage

        include = [f"{tree / root / name}/*" for name, root in IMPORT_ROOTS.items()]
        config = tree / "coverage.ini"
        config.write_text("[run]\nrelative_files = true\n")
        self.coverage = Coverage(data_file=str(file), include=include, config_file=str(config))
        self.coverage.start()
        yield
        self.coverage.stop()
        self.coverage.save()

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        items[:] = [
            item
            for item in items
            if item.nodeid not in self.excluded and (self.only is None or item.nodeid in self.only)
        ]

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: Any) -> None:
        self._switch(f"{item.nodeid}|setup")

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_call(self, item: Any) -> None:
        self._switch(item.nodeid)

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.failed:
            self.failed.append(report.nodeid)

    def pytest_collectreport(self, report: Any) -> None:
        if report.failed:
            self.failed.append(report.nodeid or "collection")

    def _switch(self, context: str) -> None:
        if self.coverage:
            self.coverage.switch_context(context)


def wait(child: int, end: float) -> str:
    """Wait for a process and end what it left; return why it was ended before its time."""
    process, ended, looked = psutil.Process(child), "", 0.0
    descendants: set[psutil.Process] = set()
    try:
        while not ended and process.status() != psutil.STATUS_ZOMBIE:
            time.sleep(0.02)
            if time.monotonic() > looked + 0.5:
                looked = time.monotonic()
                descendants |= set(process.children(recursive=True))
                memory = _memory(process, *descendants)
                ended = "time" * (looked > end) or "memory" * (memory > _MEMORY)
    finally:  # also if this process is to end
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        for each in (process, *descendants):
            with suppress(psutil.NoSuchProcess):
                each.kill()
        os.waitpid(child, 0)
        psutil.wait_procs(descendants, timeout=10)
    return ended


def _memory(*processes: psutil.Process) -> int:
    """Return the resident memory of processes [bytes]."""
    total = 0
    for process in processes:
        with suppress(psutil.NoSuchProcess):
            total += process.memory_info().rss
    return total
