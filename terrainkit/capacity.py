"""Capacity: whether work fits in this machine's memory, asked before it is begun."""

from terrainkit.errors import CapacityError

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
    import psutil

    free = psutil.virtual_memory().available
    if needed > free:
        raise CapacityError(
            f"{what} needs {needed / 1e9:.1f} GB of memory; {free / 1e9:.1f} GB free"
        )
