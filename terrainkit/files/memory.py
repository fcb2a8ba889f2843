"""Check that work fits in memory before it starts."""

import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

from terrainkit.errors import MemoryLimitError

PROCESS = Path("/proc/self")
"""Where Linux lists the control groups of this process, and the mounted file systems."""

_FILES = {
    "cgroup2": ("memory.max", "memory.current", "inactive_file"),
    "cgroup": ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
}
"""Files of a control group with the limit and the memory in use, and the key of the page cache in
its memory.stat, by type of file system: version 2 and version 1."""

_UNLIMITED = 1 << 60
"""Control groups of version 1 without a limit have the largest page-aligned number as limit."""

_WORKER_BYTES = 1 << 25
"""Memory of a worker process that it does not share with this one [bytes]."""

MIN_CHECKED_BYTES = 1 << 24
"""Requests below this size always pass [bytes]."""


def check_memory(
    needed: int,
    what: str,
    parts: tuple[str, int] = ("", 0),
    hint: Callable[[float], str] | None = None,
) -> None:
    """Raise an error if more memory is needed than is free.

    Args:
        needed: Peak memory of the work [bytes].
        what: Name of the work in the error.
        parts: Name and number of equal parts of the work, such as ("env.num_envs", 4096); the error
            says how many would fit.
        hint: Function that returns the end of the error from the share of the memory that is free.

    Raises:
        MemoryLimitError: if `needed` exceeds the free memory.
    """
    if needed <= MIN_CHECKED_BYTES:
        return
    free = free_memory()
    if needed > free:
        name, num_parts = parts
        num_fitting = num_parts * free // needed
        advice = f"; {name} {num_fitting} would fit" if num_fitting > 0 else ""
        raise MemoryLimitError(
            f"{what} needs {needed / 1e9:.2f} GB of memory; {free / 1e9:.2f} GB free{advice}"
            + (hint(free / needed) if hint else "")
        )


def check_address_space(needed: int, what: str) -> None:
    """Raise an error if the limit of the address space of this process is too small.

    Args:
        needed: Addresses that the work needs [bytes].
        what: Name of the work in the error.

    Raises:
        MemoryLimitError: if `needed` exceeds the limit.
    """
    with suppress(ImportError):  # Windows
        import resource

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        if 0 <= limit < needed:
            got = f"the limit is {limit / 1e9:.2f} GB"
            raise MemoryLimitError(
                f"{what} needs an address space of {needed / 1e9:.2f} GB; {got} (ulimit -v)"
            )


def free_memory() -> int:
    """Return the memory that this process may still allocate [bytes]."""
    # Containers and schedulers kill a process that exceeds the limit of its control group.
    limits = [*_control_group_limits()]
    with suppress(ModuleNotFoundError):  # in the light installation, allocations may fail instead
        import psutil

        limits.append(int(psutil.virtual_memory().available))
    return max(0, min(limits, default=sys.maxsize))


def limit_allocations(num_workers: int) -> None:
    """Let allocations fail that would exceed the limit of a control group.

    Otherwise the kernel kills the process without a word. Allocations count when they are made, not
    when they are used, so this suits processes with few threads.

    Args:
        num_workers: Number of processes that this one will start.
    """
    free = min(_control_group_limits(), default=None)
    if free is not None:
        import resource

        used = int((PROCESS / "statm").read_text().split()[5]) * resource.getpagesize()
        limit = used + max(0, free - num_workers * _WORKER_BYTES)
        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        with suppress(ValueError, OSError):  # a lower limit of the system
            resource.setrlimit(resource.RLIMIT_DATA, (limit, hard))


def _control_group_limits() -> Iterator[int]:
    """Yield the free memory of each control group above this process [bytes]."""
    try:
        groups = [line.split(":", 2) for line in (PROCESS / "cgroup").read_text().splitlines()]
        mounts = [line.split() for line in (PROCESS / "mountinfo").read_text().splitlines()]
    except OSError:  # not Linux
        return
    paths = {name: Path(path) for _, names, path in groups for name in names.split(",")}
    for mount in mounts:
        root, point, kind = mount[3], Path(mount[4]), mount[mount.index("-") + 1]
        name = "" if kind == "cgroup2" else "memory"
        if kind not in _FILES or name not in paths or name not in ("", *mount[-1].split(",")):
            continue
        # A container sees its own group as the root of the mount, whatever its name is outside.
        path = paths[name]
        group = point / path.relative_to(root) if path.is_relative_to(root) else point
        for parent in (group, *group.parents):
            if parent.is_relative_to(point):
                free = _control_group_free(parent, *_FILES[kind])
                if free is not None:
                    yield free


def _control_group_free(group: Path, limit: str, used: str, cached: str) -> int | None:
    """Return the free memory of a control group [bytes]; None without a limit."""
    try:
        stat = dict(line.split() for line in (group / "memory.stat").read_text().splitlines())
        free = int((group / limit).read_text()) - int((group / used).read_text())
    except (OSError, ValueError):  # no such group, or "max": no limit
        return None
    # The kernel reclaims inactive page cache on demand.
    free += int(stat.get(cached, 0))
    return free if free < _UNLIMITED else None
