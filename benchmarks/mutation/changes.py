"""Find the single changes that can be planted in a Python file."""

import ast
import re
from bisect import bisect_right
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any, NamedTuple

_COMPARISONS: dict[type[ast.cmpop], tuple[str, tuple[str, ...]]] = {
    ast.Lt: ("<", ("<=", ">=")),
    ast.LtE: ("<=", ("<", ">")),
    ast.Gt: (">", (">=", "<=")),
    ast.GtE: (">=", (">", "<")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.Is: (r"is(?!\s+not\b)", ("is not",)),
    ast.IsNot: (r"is\s+not", ("is",)),
    ast.In: ("in", ("not in",)),
    ast.NotIn: (r"not\s+in", ("in",)),
}
"""Pattern of each comparison, and what it is changed to."""

_OPERATORS: dict[type[ast.operator], tuple[str, str]] = {
    ast.Add: (r"\+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: (r"\*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"),
    ast.Mod: ("%", "*"),
    ast.Pow: (r"\*\*", "*"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: (r"\|", "&"),
}

_PAIRS = (
    ("min", "max"),
    ("minimum", "maximum"),
    ("argmin", "argmax"),
    ("any", "all"),
    ("floor", "ceil"),
    ("sin", "cos"),
)
_OTHER_NAME = {a: b for pair in _PAIRS for a, b in (pair, pair[::-1])}

_REMOVABLE = (ast.AugAssign, ast.Continue, ast.Break, ast.Raise)
_ANNOTATIONS = {"annotation", "returns", "decorator_list", "type_params"}


Span = tuple[int, int, str, str]
"""Start and end of a change [bytes], its kind, and the new text."""


class Change(NamedTuple):
    """A replacement of one span of a file.

    `start` and `end` are offsets [bytes]; `line` counts from 1. `lines` are those of the statement,
    or of its head, if it is in a function; there are none if it is executed on import.
    """

    start: int
    end: int
    line: int
    kind: str
    text: str
    lines: range

    def apply(self, source: bytes) -> bytes:
        """Return the file with the change."""
        return source[: self.start] + self.text.encode() + source[self.end :]

    def is_valid(self, source: bytes) -> bool:
        """Return whether the changed file compiles and differs from the file."""
        try:
            return ast.dump(ast.parse(self.apply(source))) != ast.dump(ast.parse(source))
        except SyntaxError:
            return False


def find_changes(source: bytes) -> list[Change]:
    """Return the changes of a file; a few do not compile or do not alter it.

    Annotations, decorators, docstrings, f-strings and imports are left alone.
    """
    finder = _Finder(source)
    finder.visit_children(ast.parse(source), range(0))
    return finder.changes


class _Finder:
    def __init__(self, source: bytes) -> None:
        self.source = source
        self.starts = [0]
        for line in source.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))
        self.changes: list[Change] = []

    def visit_children(self, node: ast.AST, lines: range) -> None:
        for name, value in ast.iter_fields(node):
            children = value if isinstance(value, list) else [value]
            is_inside = lines or (name == "body" and isinstance(node, ast.FunctionDef | ast.Lambda))
            for child in children:
                if name not in _ANNOTATIONS and isinstance(child, ast.AST):
                    self.visit(child, _lines(child) or lines if is_inside else lines)

    def visit(self, node: ast.AST, lines: range) -> None:
        is_docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if is_docstring or isinstance(node, ast.JoinedStr | ast.Import | ast.ImportFrom):
            return
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            return
        for start, end, kind, text in self._changes_of(node):
            line = bisect_right(self.starts, start)
            self.changes.append(Change(start, end, line, kind, text, lines))
        self.visit_children(node, lines)

    def _changes_of(self, node: ast.AST) -> Iterator[Span]:
        for kind, find in _FINDERS.items():
            if isinstance(node, kind):
                yield from find(self, node)
        if isinstance(node, ast.If | ast.IfExp):
            for text in ("True", "False"):
                yield *self._span(node.test), "condition", text

    def _and_or(self, node: ast.BoolOp) -> Iterator[Span]:
        old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for a, b in pairwise(node.values):
            yield from self._between(a, b, rf"\b{old}\b", "and/or", new)

    def _operator(self, node: ast.BinOp) -> Iterator[Span]:
        is_text = _is_text(node.left) or _is_text(node.right)
        if type(node.op) in _OPERATORS and not is_text:
            old, new = _OPERATORS[type(node.op)]
            yield from self._between(node.left, node.right, old, "operator", new)

    def _number(self, node: ast.Constant) -> Iterator[Span]:
        if isinstance(node.value, int | float):
            for value in _other_numbers(node.value):
                yield *self._span(node), "constant", repr(value)

    def _unary(self, node: ast.UnaryOp) -> Iterator[Span]:
        if isinstance(node.op, ast.USub | ast.Not):
            kind = "not" if isinstance(node.op, ast.Not) else "sign"
            yield self._span(node)[0], self._span(node.operand)[0], kind, ""

    def _call(self, node: ast.Call) -> Iterator[Span]:
        yield from self._swapped(node.args)
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        if name in _OTHER_NAME:
            end = self._span(node.func)[1]
            yield end - len(name), end, "function", _OTHER_NAME[name]

    def _dict(self, node: ast.Dict) -> Iterator[Span]:
        for key in node.keys:
            yield from self._string(key)

    def _filter(self, node: ast.comprehension) -> Iterator[Span]:
        for each in node.ifs:
            yield *self._span(each), "condition", "True"

    def _return(self, node: ast.Return) -> Iterator[Span]:
        if node.value is not None and not isinstance(node.value, ast.Constant):
            yield *self._span(node.value), "return", "None"

    def _statement(self, node: ast.stmt) -> Iterator[Span]:
        is_call = isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
        if is_call or isinstance(node, _REMOVABLE) or _stores_into(node):
            yield *self._span(node), "removed", "pass"

    def _comparison(self, node: ast.Compare) -> Iterator[Span]:
        operands = [node.left, *node.comparators]
        for each in operands:
            yield from self._string(each)
        for (a, b), operator in zip(pairwise(operands), node.ops, strict=True):
            old, others = _COMPARISONS[type(operator)]
            for new in others:
                yield from self._between(a, b, old, "comparison", new)

    def _swapped(self, arguments: list[ast.expr]) -> Iterator[Span]:
        for a, b in pairwise(arguments):
            if not isinstance(a, ast.Starred) and not isinstance(b, ast.Starred):
                (start, a_end), (b_start, end) = self._span(a), self._span(b)
                first, gap, last = (
                    self.source[i:j].decode()
                    for i, j in ((start, a_end), (a_end, b_start), (b_start, end))
                )
                yield start, end, "swapped", last + gap + first

    def _string(self, node: ast.AST | None) -> Iterator[Span]:
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield *self._span(node), "string", repr(node.value + "_")

    def _between(self, a: ast.expr, b: ast.expr, old: str, kind: str, new: str) -> Iterator[Span]:
        start, end = self._span(a)[1], self._span(b)[0]
        found = re.search(old, self.source[start:end].decode())
        if found:
            yield start + found.start(), start + found.end(), kind, new

    def _span(self, node: ast.expr | ast.stmt) -> tuple[int, int]:
        """Return the offsets of the start and the end of a node [bytes]."""
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return (
            self.starts[node.lineno - 1] + node.col_offset,
            self.starts[node.end_lineno - 1] + node.end_col_offset,
        )


_FINDERS: dict[type[ast.AST], Callable[[_Finder, Any], Iterator[Span]]] = {
    ast.Compare: _Finder._comparison,
    ast.BoolOp: _Finder._and_or,
    ast.BinOp: _Finder._operator,
    ast.Constant: _Finder._number,
    ast.UnaryOp: _Finder._unary,
    ast.Call: _Finder._call,
    ast.Subscript: lambda finder, node: finder._string(node.slice),
    ast.Dict: _Finder._dict,
    ast.MatchValue: lambda finder, node: finder._string(node.value),
    ast.comprehension: _Finder._filter,
    ast.Return: _Finder._return,
    ast.stmt: _Finder._statement,
}
"""What finds the changes of each kind of node."""


def _stores_into(node: ast.stmt) -> bool:
    """Return whether a statement assigns to items or attributes only.

    Without any other assignment, the next use of the name would be an error.
    """
    return isinstance(node, ast.Assign) and all(
        isinstance(target, ast.Attribute | ast.Subscript) for target in node.targets
    )


def _lines(node: ast.AST) -> range:
    """Return the lines of a statement without the statements in it; none for other nodes."""
    if not isinstance(node, ast.stmt | ast.Lambda):
        return range(0)
    body = getattr(node, "body", None)
    end = node.end_lineno or node.lineno
    if isinstance(body, list):
        end = max(node.lineno, body[0].lineno - 1)
    return range(node.lineno, end + 1)


def _is_text(node: ast.expr) -> bool:
    is_string = isinstance(node, ast.Constant) and isinstance(node.value, str)
    return is_string or isinstance(node, ast.JoinedStr)


def _other_numbers(value: bool | int | float) -> Iterator[float]:
    if isinstance(value, bool):
        yield not value
        return
    if isinstance(value, int):
        yield value + 1
    if value != 0:
        yield type(value)(0)
    if value not in (0, 1):
        yield value * 2
