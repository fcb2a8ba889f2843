"""Run MuJoCo without its log file."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def quiet_mujoco() -> Iterator[None]:
    """Discard MuJoCo's warnings, which it would print, or write to MUJOCO_LOG.TXT."""
    import mujoco

    previous = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the compiler warns of a singular inertia
            yield
    finally:
        mujoco.set_mju_user_warning(previous)
