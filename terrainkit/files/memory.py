"""Check that work fits in memory before it starts."""

from collections.abc import Callable, Iterator
from pathlib import Path

from terrainkit.errors import MemoryLimitError

_CONTROL_GROUPS = Path("/sys/fs/cgroup")
_OWN_GROUP = Path("/proc/self/cgroup")
"""Where Linux lists the control groups (version 2), and the groups of this process."""

MIN_CHECKED_BYTES = 1 << 28
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
            f"{what} needs {needed / 1e9:.1f} GB of memory; {free / 1e9:.1f} GB free{advice}"
            + (hint(free / needed) if hint else "")
        )


def free_memory() -> int:
    """Return the memory that this process may still allocate [bytes]."""
    import psutil

    # Containers and schedulers kill a process that exceeds the limit of its control group.
    return min([int(psutil.virtual_memory().available), *_control_group_limits()])


def _control_group_limits() -> Iterator[int]:
    """Yield the free memory of each control group above this process [bytes]."""
    try:
        lines = _OWN_GROUP.read_text().splitlines()
    except OSError:  # not Linux
        return
    for name in (line.removeprefix("0::/") for line in lines if line.startswith("0::/")):
        group = _CONTROL_GROUPS / name
        for each in (group, *group.parents):
            if each.is_relative_to(_CONTROL_GROUPS):
                free = _control_group_free(each)
                if free is not None:
                    yield free


def _control_group_free(group: Path) -> int | None:
    """Return the free memory of a control group [bytes]; None without a limit."""
    try:
        limit = int((group / "memory.max").read_text())
        used = int((group / "memory.current").read_text())
        stat = dict(line.split() for line in (group / "memory.stat").read_text().splitlines())
    except (OSError, ValueError):  # no such group, or "max": no limit
        return None
    # The kernel reclaims inactive page cache on demand.
    return limit - used + int(stat.get("inactive_file", 0))
