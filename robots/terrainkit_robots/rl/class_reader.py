"""Read the values of nested configuration classes from their source, which is never executed.

Values are literals, arithmetic, and names of values before them, also in parent classes and in
imported files of the same project. What consists of anything else is not read, but named.
"""

import ast
import math
import operator
from collections import ChainMap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

from terrainkit.errors import ConfigError
from terrainkit.settings.text import truncate
from terrainkit.settings.toml_text import read_text

MAX_FILES = 50
"""Most files that are read, with the files that they import."""

MAX_VALUES = 10_000
"""Most values of a class, and items of a list or table."""

PARENT = "(parent class)"
"""Name under which a class has a parent that is not read."""

_MAX_FOLDERS = 8
"""Folders above a file in which an imported package is searched."""

_MAX_NUMBER = 1e30
_OPERATORS: dict[type, Any] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}


@dataclass(frozen=True)
class Unread:
    """A value that is not read."""

    text: str
    """Its line and source."""


class Namespace(dict[str, Any]):
    """The attributes of a class by name."""


@dataclass(kw_only=True)
class Module:
    """A file of Python classes, executed as far as it defines classes and values."""

    path: Path
    """The file."""
    modules: dict[Path, Namespace] = field(default_factory=dict)
    """Names of each file that was read."""
    classes: list[str] = field(default_factory=list)
    """Names of the classes that the file defines itself."""

    def read(self) -> Namespace:
        """Return the names that the file defines or imports.

        Raises:
            ConfigError: If it cannot be read, is larger than a megabyte, or is not Python.
        """
        self.modules[self.path.resolve()] = names = Namespace()
        source = read_text(self.path, "Python")
        try:
            body = ast.parse(source).body
            self.classes += [node.name for node in body if isinstance(node, ast.ClassDef)]
            self._run(body, names, names)
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            place = f", line {error.lineno}" if isinstance(error, SyntaxError) else ""
            reason = getattr(error, "msg", error)
            raise ConfigError(f"{self.path}{place}: cannot be read as Python: {reason}") from None
        return names

    def _run(self, body: Sequence[ast.stmt], names: Namespace, outer: Namespace) -> None:
        """Add what statements define to `names`; a class in a class sees only `outer`."""
        for node in body:
            match node:
                case ast.ClassDef(name=name, bases=bases):
                    own = Namespace()
                    for base in reversed([self._value(base, names, outer) for base in bases]):
                        own.update(base if isinstance(base, Namespace) else {PARENT: base})
                    self._run(node.body, own, outer)
                    names[name] = _checked(own)
                case (
                    ast.Assign(targets=[ast.Name(id=name)], value=ast.expr() as value)
                    | ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value)
                ):
                    names[name] = self._value(value, names, outer)
                case ast.Import(names=aliases):
                    names.update({a.asname or a.name: Namespace(pi=math.pi) for a in aliases})
                case ast.ImportFrom(names=aliases):
                    found = self._imported(node)
                    for alias in aliases:
                        own_name = alias.asname or alias.name
                        missing = {own_name: found.get(alias.name, _unread(node))}
                        names.update(found if own_name == "*" else missing)
                case ast.Expr() | ast.Pass() | ast.FunctionDef():
                    pass
                case _:  # a condition or a loop
                    stored = (part for part in ast.walk(node) if isinstance(part, ast.Name))
                    lost = [part.id for part in stored if isinstance(part.ctx, ast.Store)]
                    names.update(dict.fromkeys(lost, _unread(node)))

    def _imported(self, node: ast.ImportFrom) -> Namespace:
        """Return the names of a module of the same project, none if it is not read."""
        parents = self.path.resolve().parents
        folders = parents[node.level - 1 : node.level] if node.level else parents[:_MAX_FOLDERS]
        targets = [folder.joinpath(*(node.module or "").split(".")) for folder in folders]
        files = (f for t in targets for f in (t.with_suffix(".py"), t / "__init__.py"))
        file = next((file.resolve() for file in files if file.is_file()), None)
        if file in self.modules:
            return self.modules[file]
        if file is None or len(self.modules) == MAX_FILES:
            return Namespace()
        try:
            return Module(path=file, modules=self.modules).read()
        except ConfigError:  # values that need it are not read
            return Namespace()

    def _value(self, node: ast.expr, names: Namespace, outer: Namespace) -> Any:
        """Return the value of an expression, `Unread` if it is not read."""
        try:
            return _evaluate(node, ChainMap(names, outer))
        except (ArithmeticError, LookupError, TypeError, ValueError):
            return _unread(node)


def flatten_class(names: Namespace, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield name and value of each attribute of nested classes, such as `init_state.pos`."""
    for name, value in names.items():
        if isinstance(value, Namespace):
            yield from flatten_class(value, f"{path}{name}.")
        else:
            yield path + name, value


def _unread(node: ast.expr | ast.stmt) -> Unread:
    source = ast.unparse(node).partition("\n")[0]
    return Unread(f"line {node.lineno}: {truncate(source)}")


def _evaluate(node: ast.expr | None, names: Mapping[str, Any]) -> Any:
    """Return the value of an expression; one of the errors of `_value` if it is not read."""
    result: Any
    match node:
        case ast.Constant(value=bool() | int() | float() | str() | None as value):
            result = value
        case ast.Name(id=name):
            result = names[name]
        case ast.Attribute(value=owner, attr=name):
            result = _evaluate(owner, names)[name]
        case ast.List(elts=items) | ast.Tuple(elts=items):
            result = [_evaluate(item, names) for item in items]
        case ast.Dict(keys=keys, values=items):
            pairs = zip(keys, items, strict=True)
            result = {str(_evaluate(k, names)): _evaluate(v, names) for k, v in pairs}
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            result = -_number(_evaluate(operand, names))
        case ast.BinOp(left=left, op=op, right=right):
            numbers = [_number(_evaluate(part, names)) for part in (left, right)]
            if isinstance(op, ast.Pow):  # a large power takes long
                _number(float(numbers[0]) ** float(numbers[1]))
            result = _number(_OPERATORS[type(op)](*numbers))
        case _:
            raise ValueError("not read")
    if isinstance(result, Unread):
        raise TypeError("not read")
    return _checked(result)


def _number(value: Any) -> Any:
    if not isinstance(value, int | float) or abs(value) > _MAX_NUMBER:
        raise ValueError("not a number, or too large")
    return value


def _checked(value: Any) -> Any:
    """Return a value that has fewer than `MAX_VALUES` values in it."""
    if isinstance(value, dict | list) and len([*islice(_items(value), MAX_VALUES)]) == MAX_VALUES:
        raise ConfigError(f"got {MAX_VALUES} values in a class or list; expected fewer")
    return value


def _items(value: Any) -> Iterator[Any]:
    yield value
    for item in value.values() if isinstance(value, dict) else value:
        yield from _items(item) if isinstance(item, dict | list) else [item]
