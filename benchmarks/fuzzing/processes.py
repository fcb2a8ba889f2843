"""Wait for a process, and find the processes that it leaves behind."""

import ctypes
import os
import resource
import signal
import time
from contextlib import suppress
from pathlib import Path

GRACE = 2.0
"""Time for the processes of a command to end after it [s]."""

_PR_SET_CHILD_SUBREAPER = 36

Ended = tuple[int, resource.struct_rusage]
"""Status and usage of a process that has ended."""


def adopt_orphans() -> None:
    """Become the parent of processes whose parent ends."""
    ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def children(parent: int) -> dict[int, str]:
    """Return the command line of each child process that runs."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            state, ppid = (folder / "stat").read_text().rpartition(")")[2].split()[:2]
            if int(ppid) == parent and state != "Z":
                line = (folder / "cmdline").read_bytes().replace(b"\0", b" ")
                found[int(folder.name)] = line.decode(errors="replace")[:200]
    return found


def wait(child: int, seconds: float) -> Ended | None:
    """Wait for a child process for some time."""
    end = time.monotonic() + seconds
    pid, status, usage = os.wait4(child, os.WNOHANG)
    while not pid and time.monotonic() < end:
        time.sleep(0.002)
        pid, status, usage = os.wait4(child, os.WNOHANG)
    return (status, usage) if pid else None


def kill(child: int) -> Ended:
    """End a child process."""
    os.kill(child, signal.SIGKILL)
    return os.wait4(child, 0)[1:]


def kill_orphans(known: dict[int, str]) -> list[str]:
    """End the children that are not known and do not end soon; return their command lines."""
    end = time.monotonic() + GRACE
    while (left := children(os.getpid())).keys() - known and time.monotonic() < end:
        time.sleep(0.01)
    orphans = {pid: line for pid, line in left.items() if pid not in known}
    for pid in orphans:
        kill(pid)
    return list(orphans.values())
