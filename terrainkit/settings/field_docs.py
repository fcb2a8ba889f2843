"""Docstrings of the fields of a dataclass."""

import inspect
from functools import cache
from typing import Any


@cache
def field_docs(cls: type[Any]) -> dict[str, str]:
    """Return the docstring of each field of a dataclass on one line, by name."""
    import docstring_parser

    return {
        param.arg_name: " ".join((param.description or "").split())
        for owner in reversed(cls.__mro__)  # a subclass inherits the docs of its parents
        if "__dataclass_fields__" in vars(owner) and inspect.get_annotations(owner)
        for param in docstring_parser.parse_from_object(owner).params
    }
