"""Capacity: whether work fits in this machine's memory, asked before it is begun."""

from collections.abc import Iterator
from pathlib import Path

from terrainkit.errors import CapacityError

_CONTROL_GROUPS = Path("/sys/fs/cgroup")
_OWN_GROUP = Path("/proc/self/cgroup")
"""Where Linux tells the control groups (version 2), and which of them this process is in."""

_SURE_TO_FIT = 1 << 28
"""Work below this is not worth asking the operating system about [bytes]."""


def require_memory(needed: int, what: str) -> None:
    """Raise CapacityError if `needed` bytes are more than the memory that is free.

    Args:
        needed: Most that the work will hold at a time [bytes].
        what: Names the work in the error.
    """
    if needed <= _SURE_TO_FIT:
        return
    free = _free_memory()
    if needed > free:
        raise CapacityError(
            f"{what} needs {needed / 1e9:.1f} GB of memory; {free / 1e9:.1f} GB free"
        )


def _free_memory() -> int:
    """Return the memory that this process may still take [bytes]: the machine's, or its share."""
    import psutil

    # In a container or under a scheduler, Linux ends who takes more than a group's limit.
    return min([int(psutil.virtual_memory().available), *_left_in_groups()])


def _left_in_groups() -> Iterator[int]:
    """Yield what each control group above this process leaves to it [bytes]."""
    try:
        lines = _OWN_GROUP.read_text().splitlines()
    except OSError:  # another system
        return
    inside = [line.removeprefix("0::/") for line in lines if line.startswith("0::/")]
    for name in inside:
        group = _CONTROL_GROUPS / name
        for each in (group, *group.parents):
            if each.is_relative_to(_CONTROL_GROUPS) and (left := _left_in(each)) is not None:
                yield left


def _left_in(group: Path) -> int | None:
    """Return what a control group leaves [bytes]; None without a limit."""
    try:
        limit = int((group / "memory.max").read_text())
        used = int((group / "memory.current").read_text())
        stat = dict(line.split() for line in (group / "memory.stat").read_text().splitlines())
    except (OSError, ValueError):  # no such group, or "max": no limit
        return None
    # Copies of files that nobody reads just now are given back when memory is asked for.
    return limit - used + int(stat.get("inactive_file", 0))
