"""The threads that torch works on."""

import os
from collections.abc import Iterator
from contextlib import contextmanager


def wait_asleep() -> None:
    """Let threads of torch that wait sleep, or they hold up the physics; before torch is imported.

    What the user's own environment says of it counts.
    """
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")


@contextmanager
def one_thread() -> Iterator[None]:
    """Let torch work on one thread: in networks as small as these several wait for each other.

    On a machine that is busy with other work they do so 20 times as long as they work.
    """
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
