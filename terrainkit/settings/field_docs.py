"""Docstrings of the fields of a dataclass."""

import ast
import inspect
import textwrap
from functools import cache
from itertools import pairwise
from typing import Any

from terrainkit.errors import one_line


@cache
def field_docs(cls: type[Any]) -> dict[str, str]:
    """Return the docstring of each field of a dataclass on one line, by name."""
    docs: dict[str, str] = {}
    for owner in reversed(cls.__mro__):  # a subclass inherits the docs of its parents
        if "__dataclass_fields__" not in vars(owner) or not inspect.get_annotations(owner):
            continue
        try:
            source = inspect.getsource(owner)
        except (OSError, TypeError):  # a class that was typed at a prompt
            continue
        (definition,) = ast.parse(textwrap.dedent(source)).body
        assert isinstance(definition, ast.ClassDef)
        for node, following in pairwise(definition.body):
            match node, following:
                case (
                    ast.AnnAssign(target=ast.Name(id=name)),
                    ast.Expr(value=ast.Constant(value=str(text))),
                ):
                    docs[name] = one_line(text)
    return docs
