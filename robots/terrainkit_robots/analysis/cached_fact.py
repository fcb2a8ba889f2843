"""What several rules need of a robot, worked out once."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

from terrainkit_robots.analysis.facts import Facts

_T = TypeVar("_T")


def per_robot(function: Callable[[Facts], _T]) -> Callable[[Facts], _T]:
    """Return the function, which now remembers its answer for as long as the robot is in use.

    The answer must not hold the robot itself, or neither would ever be let go.
    """
    known: WeakKeyDictionary[Facts, _T] = WeakKeyDictionary()

    @wraps(function)
    def remembered(robot: Facts) -> _T:
        if robot not in known:
            known[robot] = function(robot)
        return known[robot]

    return remembered
