"""Cache a function of a robot's facts."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

_K = TypeVar("_K")
_V = TypeVar("_V")


def cached_fact(function: Callable[[_K], _V]) -> Callable[[_K], _V]:
    """Cache the result of a function of `Facts` for as long as the facts exist.

    For facts of the layers above `analysis`, which cannot be properties of `Facts`. The result
    must not refer to the facts: the reference would keep both alive forever.
    """
    cache: WeakKeyDictionary[_K, _V] = WeakKeyDictionary()

    @wraps(function)
    def wrapper(facts: _K) -> _V:
        if facts not in cache:
            cache[facts] = function(facts)
        return cache[facts]

    return wrapper
