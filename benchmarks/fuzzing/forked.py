"""Run a command in a forked process with limits, and judge what it did.

A command may write to its working folder and its temporary folder. Native code writes without
events of Python, so the folders are listed as well; a decoy of the home folder is among them.
"""

import json
import os
import re
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from fuzzing.processes import adopt_orphans, children, kill, kill_orphans, wait

_KINDS = "traceback hang memory files executed processes output accepted"
KINDS = tuple(_KINDS.split())
"""Kinds of failures. Files are left or written elsewhere, processes outlive the command, output is
not of terrainkit or controls the terminal, and accepted is a result that a check of the surface
rejects, such as a file whose checksums are wrong."""

SECONDS = 35
"""Limit of the CPU time of a command with its child processes, which may compute for 30 s [s]."""

_WALL_CLOCK, _MAX_WAIT = 4, 3
"""Limit of the wall-clock time, and time from which waiting is a failure, relative to SECONDS."""

MEMORY = 2 << 30
"""Memory above an idle command's that counts as a failure, also of a child process [bytes]."""

_ADDRESS_SPACE = 8 << 30

_CALLS = ("os.system", "os.exec", "os.posix_spawn", "subprocess.Popen", "socket.connect")
EXECUTES = {*_CALLS, "pickle.find_class"}
_OWN = re.compile(
    r"'-P', '-[cm]', '.*terrainkit|^\('(numpy|concurrent|multiproc|terrainkit|plugin)"
)
"""Our child processes, and the classes of what they return."""

_CHANGES = {"os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.symlink", "os.link"}
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT
_OUR_LINE = re.compile(r"terrainkit: |iteration \d+/\d+: ")
_CONTROL = re.compile(r"[\0-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e]|^::\w+", re.MULTILINE)
"""Controls a terminal, or is a command for the runner of a workflow."""

_MAX_OUTPUT = 1 << 20
"""Output that is judged [bytes]."""

_OF_LIBRARIES = re.compile(r"/\.ses$|/home/\.cache(/Microsoft.*)?$")
"""Paths that onnxruntime writes."""

_FOLDERS = ("work", "tmp", "home")
_HEARS_SIGNALS = 124
"""Exit code of a command that reaches its limit of time in Python code."""
_TOO_LARGE = re.compile(r"out of memory|needs more than (?:[3-9]|\d\d)\S* GB of memory")
_NUM_ERRORS = {0: (0,), 1: (0, 1)}
"""Numbers of error lines by exit code; one for others."""


class Failure(NamedTuple):
    """What a command did that it must not do, and the line that shows it."""

    kind: str
    line: str


@dataclass(frozen=True, kw_only=True)
class Command:
    """What a forked process runs in its working folder."""

    words: list[str]
    """Words of the command line after `terrainkit`."""

    path: Path = Path()
    """The damaged file."""

    run: Callable[[list[str]], int] | None = None
    """Runs the words and returns an exit code; None for the command line."""

    check: Callable[[], str] = str
    """Called after a success: returns why the input should have been rejected, or nothing."""


def run_forked(folder: Path, prepare: Callable[[], Command]) -> Failure | None:
    """Run a command in a forked process; return what it did that it must not do.

    Args:
        folder: A new folder for `work`, `tmp`, `home` and what the process printed.
        prepare: Called in `work` by the forked process: returns the command.
    """
    for name in _FOLDERS:
        (folder / name).mkdir(parents=True)
    adopt_orphans()
    known = children(os.getpid())
    if not (child := os.fork()):
        _run_and_exit(folder, prepare)
    start = time.monotonic()
    if not (ended := wait(child, _WALL_CLOCK * SECONDS)):
        waits = " ".join(children(child).values()) or "no child process"
        (folder / "waits").write_text(f"waits for {waits}")
        os.kill(child, signal.SIGXCPU)
        ended = wait(child, 3) or kill(child)
    wall_clock = time.monotonic() - start
    orphans = kill_orphans(known)
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    status, usage = ended
    kibibytes = usage.ru_maxrss - int((folder / "memory").read_text())
    cpu = usage.ru_utime + usage.ru_stime
    # Whether the command ended only by the limits of its child processes.
    is_slow = cpu > SECONDS or wall_clock > _MAX_WAIT * SECONDS
    hang = f"ends after {wall_clock:.0f} s, of which it computes {cpu:.0f} s" if is_slow else ""
    found = chain(
        _failures(folder, os.waitstatus_to_exitcode(status), kibibytes / 2**20),
        [("hang", hang)],
        (("processes", line) for line in orphans),
    )
    return next((Failure(kind, line) for kind, line in found if line), None)


def _failures(folder: Path, code: int, gigabytes: float) -> Iterator[tuple[str, str]]:
    """Yield kinds of failures, and lines that are empty if there is none."""
    lines = _read(folder / "stderr").splitlines() or [""]
    last, errors = lines[-1], sum(line.startswith("terrainkit: error: ") for line in lines)
    waits = (folder / "waits").read_text() if (folder / "waits").exists() else "it computes"
    printed = [*lines, *_read(folder / "stdout").split("\n")]
    for line in (folder / "audit").read_text(errors="replace").splitlines():
        yield line.partition(" ")[0], line
    yield "hang", f"deaf to signals; {waits}" * (code in (-signal.SIGXCPU, -signal.SIGKILL))
    yield "hang", f"in Python code; {waits}" * (code == _HEARS_SIGNALS)
    is_large = gigabytes > MEMORY / 2**30 or _TOO_LARGE.search(last)
    yield "memory", f"{gigabytes:.1f} GB; {last}" * bool(is_large)
    yield "traceback", f"exit code {code}: {last}" * (code not in (0, 1, 2))
    yield from (("output", line) for line in lines if not _OUR_LINE.match(line))
    yield from (("output", repr(line)) for line in printed if _CONTROL.search(line))
    yield (
        "output",
        f"exit code {code}, {errors} errors" * (errors not in _NUM_ERRORS.get(code, (1,))),
    )
    before = (folder / "before").read_text().splitlines()
    for line in set(_listing(folder)).difference(before):
        is_output = code != 2 and line.startswith("'work/out")
        yield "files", f"exit code {code}: changed {line}" * (not is_output)


def _read(path: Path) -> str:
    with path.open("rb") as file:
        return file.read(_MAX_OUTPUT).decode(errors="replace")


def _run_and_exit(folder: Path, prepare: Callable[[], Command]) -> NoReturn:
    code = 70
    try:
        os.setpgid(0, 0)
        code = _run(folder, prepare)
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _run(folder: Path, prepare: Callable[[], Command]) -> int:
    from terrainkit_cli.main import main

    os.chdir(folder / "work")
    for name, number in (("stdout", 1), ("stderr", 2), ("audit", 99)):
        os.dup2(os.open(folder / name, os.O_WRONLY | os.O_CREAT | os.O_APPEND), number)
    # Forking copies file pages only for some mappings, so the parent can't tell what we start with.
    (folder / "memory").write_text(str(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the libraries that write the input
        command = prepare()
    os.environ["TMPDIR"] = tempfile.tempdir = str(folder / "tmp")
    log = {"words": command.words, "path": str(command.path)}
    (folder / "command").write_text(json.dumps(log))
    (folder / "before").write_text("\n".join(_listing(folder)))
    os.environ["HOME"] = str(folder / "home")
    signal.signal(signal.SIGXCPU, lambda *_: os._exit(_HEARS_SIGNALS))
    address_space = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 5))
    resource.setrlimit(resource.RLIMIT_AS, (address_space + _ADDRESS_SPACE,) * 2)
    sys.addaudithook(_audit_hook(folder, 99))
    code = (command.run or main)(command.words)
    reason = command.check() if code == 0 else ""
    os.write(99, f"accepted {reason}\n".encode() if reason else b"")
    return code


def _listing(folder: Path) -> list[str]:
    """Return a line with the name of each path in the folders, and the times of the files."""
    paths = [path for name in _FOLDERS for path in (folder / name).rglob("*")]
    return [
        f"{str(path.relative_to(folder))!a} {path.is_dir() or path.lstat().st_mtime_ns}"
        for path in paths
        if not _OF_LIBRARIES.search(str(path))
    ]


def _audit_hook(folder: Path, target: int) -> Callable[[str, Any], None]:
    """Return a hook that writes a line to `target` for each event that is not allowed."""
    has_plugins = str(folder / "work") in sys.path
    inside = str(folder / "work"), str(folder / "tmp"), os.devnull

    def is_outside(path: Any) -> bool:
        is_path = isinstance(path, str | bytes | Path)
        return is_path and not os.path.abspath(os.fsdecode(path)).startswith(inside)  # noqa: PTH100

    def hook(event: str, arguments: Any) -> None:
        if event in _CHANGES or (event == "open" and arguments[2] & _WRITES):
            kind, is_allowed = "files", not any(map(is_outside, arguments[:2]))
        elif event in EXECUTES:
            kind, is_allowed = "executed", bool(_OWN.search(repr(arguments)))
        elif event == "exec":
            name = arguments[0].co_filename
            kind, is_allowed = "executed", has_plugins or not name.startswith(inside)
        else:
            return
        if not is_allowed:
            os.write(target, f"{kind} {event} {arguments!r:.300}\n".encode())

    return hook
