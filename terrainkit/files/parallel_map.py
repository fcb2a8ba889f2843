"""Run a function on many items, in this process or on an executor."""

from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, TypeVar

from terrainkit.errors import TerrainkitError

if TYPE_CHECKING:
    from concurrent.futures import Executor

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


def parallel_map(
    executor: "Executor | None", function: Callable[[_Item], _Result], items: Iterable[_Item]
) -> Iterator[_Result]:
    """Yield the result of `function` for each item, in order.

    Args:
        executor: Calls the function; None for this process.
        function: The function.
        items: Its arguments.

    Raises:
        TerrainkitError: if the executor fails, for example because its processes end.
    """
    if executor is None:
        yield from map(function, items)
        return
    try:
        yield from executor.map(function, items)
    except Exception as error:
        failure = executor_failure(error)
        raise TerrainkitError(f"{failure}; use fewer processes if memory is short") from error


def executor_failure(error: Exception) -> str:
    """Return in one line why an executor failed.

    Args:
        error: What the executor raised. It is raised again if it is an error of the function that
            the executor called.
    """
    # Each kind of executor has its own errors.
    is_built_in = type(error).__module__ == "builtins" and not isinstance(error, OSError)
    if is_built_in or isinstance(error, TerrainkitError):
        raise error
    reason = " ".join(f"{type(error).__name__}: {error}".split()).strip(":.")
    return f"an executor failed: {reason}"
