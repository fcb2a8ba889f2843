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
from functools import cached_property
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

MAX_TOTAL = 500_000
"""Most values of all files, where each class also counts what it inherits."""

PARENT = "(parent class)"
"""Name under which a class has a parent that is not read."""

_MAX_FOLDERS = 8
"""Folders above a file in which an imported package is searched."""

_PROJECT_FILES = ("setup.py", "pyproject.toml", "setup.cfg", ".git")
"""Files of the top folder of a project, above which no package is searched."""

_LIBRARY = {"pi": math.pi}
"""What is known of each imported library, such as numpy."""

_SCOPES = (
    *(ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda),
    *(ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp),
)
"""Parts of a statement that have names of their own."""

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


class Modules(dict[Path, Namespace]):
    """Names of each file that was read."""

    count = 0
    """How many values they have."""

    def add(self, count: int) -> None:
        """Count values.

        Raises:
            ConfigError: If there are more than `MAX_TOTAL`.
        """
        self.count += count
        if self.count > MAX_TOTAL:
            raise ConfigError(f"got more than {MAX_TOTAL} values in all classes; expected fewer")


@dataclass(kw_only=True)
class Module:
    """A file of Python classes, executed as far as it defines classes and values."""

    path: Path
    """The file."""
    modules: Modules = field(default_factory=Modules)
    """The files that were read."""
    classes: list[str] = field(default_factory=list)
    """Names of the classes that the file defines itself."""

    def read(self) -> Namespace:
        """Return the names that the file defines or imports.

        Raises:
            ConfigError: If it cannot be read, is larger than a megabyte, is not Python, or has too
                many values.
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
                    for base in reversed([b for b in bases if getattr(b, "id", "") != "object"]):
                        parent = self._value(base, names, outer)
                        known = parent if isinstance(parent, Namespace) else {PARENT: parent}
                        self._update(own, known)
                    self._run(node.body, own, outer)
                    names[name] = self._checked(own)
                case (
                    ast.Assign(targets=[ast.Name(id=name)], value=ast.expr() as value)
                    | ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value)
                ):
                    names[name] = self._value(value, names, outer)
                case ast.Import(names=aliases):
                    names.update({a.asname or a.name: Namespace(_LIBRARY) for a in aliases})
                case ast.ImportFrom(names=aliases):
                    found = self._imported(node)
                    lost = _unread(node)
                    named = {a.asname or a.name: found.get(a.name, lost) for a in aliases}
                    self._update(names, found if "*" in named else named)
                case ast.AnnAssign(value=None) | ast.Pass() | ast.FunctionDef():
                    pass
                case _:  # such as a condition, a loop, or a change of a value
                    lost = _unread(node)
                    for part in _parts(node):
                        self._lose(part, lost, names, outer)

    def _lose(self, part: ast.AST, lost: Unread, names: Namespace, outer: Namespace) -> None:
        """Set what a part of a statement defines or changes to `lost`."""
        match part:
            case ast.Name(id=name, ctx=ast.Store() | ast.Del()) | ast.ClassDef(name=name):
                names[name] = lost
            case ast.alias(name=name, asname=own_name):
                names[own_name or name] = lost
            case ast.Attribute(ctx=context) | ast.Subscript(ctx=context):
                if not isinstance(context, ast.Load):
                    self._lose_owner(part, lost, names, outer)
            case ast.Expr(value=ast.Call(func=ast.Attribute(value=owner))):
                if self._value(owner, names, outer) != _LIBRARY:  # as in np.seterr(...)
                    self._lose_owner(owner, lost, names, outer)

    def _lose_owner(
        self, changed: ast.expr, lost: Unread, names: Namespace, outer: Namespace
    ) -> None:
        """Set an attribute of a class, or else the name that an expression begins with."""
        while isinstance(changed, ast.Attribute | ast.Subscript):
            owner = self._value(changed.value, names, outer)
            if isinstance(changed, ast.Attribute) and isinstance(owner, Namespace):
                owner[changed.attr] = lost
                return
            changed = changed.value
        for known in (names, outer):
            if isinstance(changed, ast.Name) and changed.id in known:
                known[changed.id] = lost
                return

    def _update(self, names: Namespace, found: Mapping[str, Any]) -> None:
        """Add what is inherited or imported to `names`."""
        self.modules.add(len(found))
        names.update(found)

    @cached_property
    def _folders(self) -> Sequence[Path]:
        """The folders above the file, up to the top folder of its project."""
        folders = self.path.resolve().parents[:_MAX_FOLDERS]
        for count, folder in enumerate(folders, 1):
            if any((folder / name).exists() for name in _PROJECT_FILES):
                return folders[:count]
        return folders

    def _imported(self, node: ast.ImportFrom) -> Namespace:
        """Return the names of a module of the same project, none if it is not read."""
        parts = (node.module or "__init__").split(".")
        names = [Path(*parts).with_name(f"{parts[-1]}.py"), Path(*parts, "__init__.py")]
        try:
            folders = self._folders[node.level - 1 : node.level] if node.level else self._folders
            files = (folder / name for folder in folders for name in names)
            file = next((file.resolve() for file in files if file.is_file()), None)
        except OSError:  # such as a name that is too long
            return Namespace()
        if file is not None and file in self.modules:
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
            return self._evaluate(node, ChainMap(names, outer))
        except (ArithmeticError, LookupError, TypeError, ValueError):
            return _unread(node)

    def _evaluate(self, node: ast.expr | None, names: Mapping[str, Any]) -> Any:
        """Return the value of an expression; one of the errors of `_value` if it is not read."""
        result: Any
        match node:
            case ast.Constant(value=bool() | int() | float() | str() | None as value):
                result = _number(value) if isinstance(value, int | float) else value
            case ast.Name(id=name):
                result = names[name]
            case ast.Attribute(value=owner, attr=name):
                result = self._evaluate(owner, names)[name]
            case ast.List(elts=items) | ast.Tuple(elts=items):
                result = self._checked([self._evaluate(item, names) for item in items])
            case ast.Dict(keys=keys, values=items):
                own = [_key(self._evaluate(key, names)) for key in keys]
                values = [self._evaluate(item, names) for item in items]
                result = self._checked(dict(zip(own, values, strict=True)))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                result = -_number(self._evaluate(operand, names))
            case ast.BinOp(left=left, op=op, right=right):
                numbers = [_number(self._evaluate(part, names)) for part in (left, right)]
                if isinstance(op, ast.Pow):  # a large power takes long
                    _number(float(numbers[0]) ** float(numbers[1]))
                result = _number(_OPERATORS[type(op)](*numbers))
            case _:
                raise ValueError("not read")
        if isinstance(result, Unread):
            raise TypeError("not read")
        return result

    def _checked(self, value: Any) -> Any:
        """Return a class, list or table that has fewer than `MAX_VALUES` values in it."""
        count = len([*islice(_items(value), MAX_VALUES)])
        if count == MAX_VALUES:
            raise ConfigError(f"got {count} values in a class or list; expected fewer")
        self.modules.add(count)
        return value


def flatten_class(names: Namespace, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield name and value of each attribute of nested classes, such as `init_state.pos`."""
    for name, value in names.items():
        if isinstance(value, Namespace):
            yield from flatten_class(value, f"{path}{name}.")
        else:
            yield path + name, value


def _unread(node: ast.expr | ast.stmt) -> Unread:
    try:
        source = ast.unparse(node).partition("\n")[0]
    except ValueError:
        source = "a number of too many digits"
    return Unread(f"line {node.lineno}: {truncate(source)}")


def _parts(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a node and the nodes below it, without those that have names of their own."""
    yield node
    if not isinstance(node, _SCOPES):
        for part in ast.iter_child_nodes(node):
            yield from _parts(part)


def _number(value: Any) -> Any:
    if not isinstance(value, int | float) or abs(value) > _MAX_NUMBER:
        raise ValueError("not a number, or too large")
    return value


def _key(value: Any) -> str:
    if not isinstance(value, str | int | float | None):
        raise TypeError("no key of a table")
    return str(value)


def _items(value: Any) -> Iterator[Any]:
    yield value
    for item in value.values() if isinstance(value, dict) else value:
        yield from _items(item) if isinstance(item, dict | list) else [item]
