"""Capacity: whether work fits in this machine's memory, asked before it is begun."""

from terrainkit.errors import CapacityError

_CONTROL_GROUP = "/sys/fs/cgroup"

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
    from pathlib import Path

    import psutil

    group = Path(_CONTROL_GROUP)
    free = int(psutil.virtual_memory().available)
    try:
        # In a container or under a scheduler, Linux ends who takes more than the group's limit.
        limit = int((group / "memory.max").read_text())
        used = int((group / "memory.current").read_text())
    except (OSError, ValueError):  # no such group, or "max": no limit
        return free
    return min(free, limit - used)
