"""Parameterized: the parent class of terrains and overlays, which are declared in the same way."""

import re
from dataclasses import dataclass
from functools import cache
from typing import Any

from terrainkit.geometry.grid import Grid
from terrainkit.settings.field_docs import field_docs
from terrainkit.terrain.parameter import Parameter, Value, parameters_of

_WORD_START = re.compile("(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")


@dataclass(frozen=True, kw_only=True)
class Parameterized:
    """A frozen dataclass whose fields are declared with `terrainkit.terrain.parameter`."""

    @classmethod
    def kind(cls) -> str:
        """Return the name of the class in snake_case: `pyramid_stairs` for `PyramidStairs`."""
        return _snake_case(cls.__name__)

    def declarations(self) -> dict[str, Parameter]:
        """Return the declarations of the values of `requested`, by name."""
        kind: Any = type(self)
        return dict(parameters_of(kind))

    def requested(self) -> dict[str, Value]:
        """Return the parameters before snapping, by name."""
        kind: Any = type(self)  # mypy does not take it as hashable
        return {name: getattr(self, name) for name in parameters_of(kind)}

    def realized(self, grid: Grid) -> dict[str, Value]:
        """Return the parameters after snapping to the cells of `grid`, by name."""
        kind: Any = type(self)
        realized = self.requested()
        for name, parameter in parameters_of(kind).items():
            if parameter.snap != "none":
                realized[name] = parameter.realized(realized[name], grid)
        return realized

    def _got(self, *names: str) -> str:
        """Return values as the start of an error: `maze: got corridor 0.8 m and number 7`.

        The unit of a value is the one that the docstring of the parameter states in brackets.
        """
        kind: Any = type(self)
        docs = field_docs(kind)
        texts = []
        for name in names:
            unit = re.search(r"\[(m|rad)\]", docs.get(name, ""))
            texts.append(f"{name} {getattr(self, name):g}{f' {unit[1]}' if unit else ''}")
        *first, last = texts
        before = f"{', '.join(first)} and " if first else ""
        return f"{self.kind()}: got {before}{last}"


@cache
def _snake_case(name: str) -> str:
    return _WORD_START.sub("_", name.strip("_")).lower()
