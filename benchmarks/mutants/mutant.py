"""A mutant: a copy of a robot to which one defect is added."""

import random
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from lxml import etree

from .xpath_functions import FUNCTIONS

Element = Any
"""An lxml element."""

_NAMESPACES = {"re": "http://exslt.org/regular-expressions"}
_PLACEHOLDER = re.compile(r"\{\{|\}\}|\{(.+?)(?::(\.\d+[fg]))?\}", re.DOTALL)

SELECTORS = tomllib.loads(Path(__file__).with_name("selectors.toml").read_text())
"""Elements that defects refer to by `$name`."""


class NotApplicableError(Exception):
    """The robot has no element to which the defect applies."""


class Mutant:
    """A copy of a robot whose XML, text and files can be edited.

    Attributes:
        root: Root of the copy.
        it: The element that edits refer to.
        rng: Selects the elements and values at random.
        variables: Values of `$name` in XPath expressions.
        functions: Functions in XPath expressions, by name.
        files: Content of the files besides the robot file, by path relative to its folder.
        folder: Folder of the robot file.
        file_name: Name of the robot file.
        mesh: The mesh that gets the defect.
        prefix: Start of the names of new mesh files.
    """

    def __init__(
        self,
        root: Element,
        rng: random.Random,
        file: Path,
        *,
        prefix: str = "mutant",
        functions: Mapping[str, Callable[..., Any]] = FUNCTIONS,
    ) -> None:
        self.root = self.it = root
        self.rng = rng
        self.folder = file.parent
        self.file_name = file.name
        self.prefix = prefix
        self.functions = {(None, name): function for name, function in functions.items()}
        self.variables: dict[str, Any] = {}
        self.files: dict[str, bytes] = {}
        self.mesh: Any = None
        self.rewrites: list[Callable[[bytes], bytes]] = []

    def rewrite(self, text: bytes) -> bytes:
        """Return the final text of the robot file."""
        for rewrite in self.rewrites:
            text = rewrite(text)
        return text

    def xpath(self, expression: str, element: Element | None = None) -> Any:
        """Evaluate an XPath expression relative to an element, by default to `it`.

        Raises:
            ValueError: If the expression is invalid.
        """
        names = set(re.findall(r"\$(\w+)", expression))
        try:
            return (self.it if element is None else element).xpath(
                expression,
                namespaces=_NAMESPACES,
                extensions=self.functions,
                **{name: self._variable(name) for name in names},
            )
        except etree.XPathError as error:
            raise ValueError(f"{expression}: {error}; expected XPath 1.0") from None

    def _variable(self, name: str) -> Any:
        if name == "it":
            return self.it
        if name in self.variables:
            return self.variables[name]
        return self.xpath(SELECTORS[name], self.root)

    def select(self, expression: str) -> list[Any]:
        """Return the elements or attributes of an XPath expression.

        Raises:
            NotApplicableError: If there are none.
        """
        found: list[Any] = self.xpath(expression)
        if not found:
            raise NotApplicableError(expression)
        return found

    def pick(self, candidates: Sequence[Any]) -> Any:
        """Return a random candidate."""
        if not candidates:
            raise NotApplicableError
        return self.rng.choice(candidates)

    def fill(self, template: Any) -> str:
        """Return a text whose `{XPath}` parts are replaced by their values.

        A number has nine significant digits, or the format after a colon: `{2 * @mass:.3f}`.
        If the template is a list, one of its items is selected at random.
        """
        if isinstance(template, list):
            template = self.pick(template)
        return _PLACEHOLDER.sub(self._value, str(template))

    def _value(self, match: re.Match[str]) -> str:
        if match[1] is None:
            return match[0][0]
        value = self.xpath(match[1])
        if isinstance(value, list):
            if not value:
                raise NotApplicableError(match[0])
            value = value[0]
        if match[2]:
            value = float(value)
        return format(value, match[2] or ".9g") if isinstance(value, float) else str(value)

    def fill_names(self, templates: Sequence[str]) -> Iterator[str]:
        """Yield the texts of templates; a template that is one expression can have several."""
        for template in templates:
            match = _PLACEHOLDER.fullmatch(template)
            value = self.xpath(match[1]) if match and match[1] else self.fill(template)
            yield from map(str, value) if isinstance(value, list) else [str(value)]
