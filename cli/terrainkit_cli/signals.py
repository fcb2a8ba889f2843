"""Signals that end a command, or stop training after the current iteration."""

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

REPEAT_TIME = 1.0
"""Signals within this time of the first count as one [s]: torchrun and schedulers repeat them."""


class Terminated(BaseException):
    """A scheduler or a closed terminal ends the process; temporary files are removed."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.signal = signal.Signals(number)


def _termination_signals() -> list[signal.Signals]:
    numbers = [signal.SIGTERM]
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # nohup
        numbers.append(signal.SIGHUP)
    return numbers


def raise_on_signals() -> None:
    """Raise Terminated on SIGTERM and SIGHUP."""
    numbers = _termination_signals()

    def terminate(number: int, _: object) -> None:
        for other in numbers:  # a second signal would interrupt the cleanup
            signal.signal(other, lambda *_: None)
        raise Terminated(number)

    for number in numbers:
        signal.signal(number, terminate)


@contextmanager
def stop_on_signals() -> Iterator[Callable[[], int]]:
    """Yield a function that returns the number of the first stop signal, or 0.

    Its first call installs the handlers; before that, a signal ends the command. After it, the
    first SIGINT, SIGTERM or SIGHUP only sets the returned value. Another one after `REPEAT_TIME`
    raises KeyboardInterrupt.
    """
    signals: list[tuple[int, float]] = []
    previous: dict[int, Any] = {}

    def handle(number: int, _: object) -> None:
        if signals and time.monotonic() - signals[0][1] >= REPEAT_TIME:
            raise KeyboardInterrupt
        signals.append((number, time.monotonic()))

    def stop_signal() -> int:
        if not previous:
            for number in (signal.SIGINT, *_termination_signals()):
                previous[number] = signal.signal(number, handle)
        return signals[0][0] if signals else 0

    try:
        yield stop_signal
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
