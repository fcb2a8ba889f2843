"""Functions for the XPath expressions of defects."""

import re
from collections.abc import Callable, Iterable
from pathlib import PurePath
from typing import Any

import numpy as np

_SIDES = (("FL", "FR"), ("RL", "RR"), ("left", "right"))


def texts(value: Any) -> list[str]:
    """Return the texts of an argument: a string, or a list of attributes or strings."""
    return [str(item) for item in value] if isinstance(value, list) else [value]


def numbers(text: Any) -> np.ndarray:
    """Return the numbers in an attribute."""
    return np.array([float(word) for part in texts(text) for word in part.split()])


def format_numbers(values: Iterable[float], digits: int = 9) -> str:
    """Return the text of an attribute."""
    return " ".join(f"{value:.{digits}g}" for value in values)


def mirror_names(name: str) -> list[str]:
    """Return a name, and the name of its mirror image if there is one."""
    for left, right in _SIDES:
        for one, other in ((left, right), (right, left)):
            if name.startswith(one):
                return [name, other + name[len(one) :]]
    return [name]


def longest_word(name: str) -> str:
    return max(re.sub("_(joint|link)$", "", name).split("_"), key=len)


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": lambda _, value: abs(float(numbers(value)[0]) if isinstance(value, list) else value),
    "max": lambda _, values: float(max(numbers(values))),
    "largest_size": lambda _, values: max(map(float, np.abs(numbers(values))), default=0.0),
    "norm": lambda _, values: float(np.linalg.norm(numbers(values))),
    "cube_root": lambda _, value: float(np.cbrt(value)),
    "component": lambda _, values, index: float(numbers(values)[int(index)]),
    "mirror": lambda _, names: [m for name in texts(names) for m in mirror_names(name)],
    "opposite": lambda _, names: [m for name in texts(names) for m in mirror_names(name)[1:]],
    "longest_word": lambda _, name: longest_word(texts(name)[0]),
    "basename": lambda _, path: PurePath(texts(path)[0].replace("\\", "/")).name,
    "stem": lambda _, path: PurePath(texts(path)[0]).stem,
    "replace_all": lambda _, text, old, new: texts(text)[0].replace(old, new),
    "without_last_letter": lambda _, text: texts(text)[0][:-1],
    "lower_case": lambda _, text: texts(text)[0].lower(),
    "swap_case": lambda _, text: texts(text)[0].swapcase(),
}
"""The functions by name; the first argument is the context of lxml."""
