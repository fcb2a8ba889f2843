"""Expand a xacro file in a restricted process.

The file is not trusted. Xacro removes Python's builtins from expressions, but there are ways around
that, so names that lead to the interpreter are rejected. Writing, sockets and child processes are
blocked in the whole process before the first file is read.
"""

import ast
import os
import stat
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any
from xml.dom import expatbuilder
from xml.parsers import expat

import numpy as np

from terrainkit.files.sandbox import forbid_changes
from terrainkit.settings.text import truncate
from terrainkit_robots.description.package_resolver import PackageResolver

ORIGIN = "terrainkit-origin"
"""Attribute that stores the file and line of an element during the expansion."""

_MAX_BYTES = 2**26
"""Maximum size of the expanded file."""

_MAX_MESSAGE = 200
"""Maximum length of an error message of xacro."""

_BLOCKED_PREFIXES = ("_", "gi_", "cr_", "ag_", "f_", "tb_", "co_", "func_", "mro")
"""Prefixes of attributes that lead from a value to the interpreter."""

_BLOCKED_EVENTS = (
    "os.",
    "shutil.",
    "subprocess.",
    "socket.",
    "ctypes.",
    "pty.",
    "tempfile.",
    "webbrowser",
)
"""Prefixes of blocked audit events; see Python's table of audit events."""

_ALLOWED_EVENTS = frozenset({"os.listdir", "os.scandir", "os.walk", "os.fwalk"})
"""Events that are not blocked, since they only list folders."""


class _RejectedError(Exception):
    """Something that a xacro file is not allowed to do."""


def expand(_: Iterator[Any], request: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the expanded file `xml` and its `files`, or an `error` and its `location`."""
    forbid_changes()
    reply: dict[str, Any] = {"xml": [], "files": [], "error": "", "location": []}
    try:
        reply |= _expand(request)
    except BaseException as error:  # expressions of the file may raise anything
        reply["error"] = _error_message(error, request)
        reply["location"] = list(map(str, _error_location(error) or ()))
    yield reply


def _expand(request: Mapping[str, Any]) -> dict[str, Any]:
    """Return the expanded file and the list of files that it includes."""
    try:
        import xacro
        from xacro import substitution_args
    except ImportError as error:
        raise _RejectedError(
            f"the package xacro is not installed ({error}); run: pip install xacro"
        ) from None
    file = Path(request["file"])
    packages = {name: Path(folder) for name, folder in request["packages"].items()}
    files: list[str] = []
    _install_expression_checks(xacro, substitution_args)
    _install_find(xacro, substitution_args, file, packages)
    xacro.parse = _parse_with_origins(xacro, files)
    os.chdir(file.parent)
    sys.addaudithook(_audit_hook)
    document = xacro.process_file(str(file), mappings=dict(request["arguments"]), verbosity=0)
    text = document.documentElement.toxml().encode()
    if len(text) > _MAX_BYTES:
        raise _RejectedError(f"size of the expansion: more than {_MAX_BYTES // 2**20} MiB")
    read = [str(Path(name).absolute()) for name in xacro.all_includes]
    names = [*files, *(name for name in read if name not in files)]
    return {"xml": np.frombuffer(text, np.uint8), "files": names}


# Restrictions


def _audit_hook(event: str, arguments: tuple[Any, ...]) -> None:
    """Raise an error for blocked audit events."""
    if event == "open":
        _check_open(*arguments)
    elif event.startswith(_BLOCKED_EVENTS) and event not in _ALLOWED_EVENTS:
        raise _RejectedError(f"the file uses {event}, which is not allowed")


def _check_open(path: Any, _: Any, flags: Any) -> None:
    writes = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
    if isinstance(flags, int) and flags & writes:
        raise _RejectedError(f"the file writes {path}, which is not allowed")
    if isinstance(path, int) or path is None:
        return
    try:
        kind = os.stat(path).st_mode  # noqa: PTH116
    except (OSError, ValueError):
        return  # opening it raises the error
    if not stat.S_ISREG(kind) and not stat.S_ISDIR(kind):
        raise OSError(None, "not a regular file", str(path))


def _install_expression_checks(xacro: Any, substitution_args: Any) -> None:
    """Check each expression before xacro evaluates it."""

    def checked(evaluate: Callable[..., Any]) -> Callable[..., Any]:
        def check_and_evaluate(text: str, *scope: Any) -> Any:
            _check_expression(text)
            return evaluate(text, *scope)

        return check_and_evaluate

    xacro.safe_eval = checked(xacro.safe_eval)
    substitution_args._eval = checked(substitution_args._eval)
    dict.pop(xacro._global_symbols["python"], "vars", None)  # gives access to every attribute

    def argument(name: str) -> Any:
        arguments = xacro.substitution_args_context["arg"]
        if name not in arguments:
            raise substitution_args.ArgException(name)
        return arguments[name]

    dict.__setitem__(xacro._global_symbols["xacro"], "arg", argument)


def _check_expression(text: str) -> None:
    for node in ast.walk(ast.parse(text.strip(), mode="eval")):
        name = node.attr if isinstance(node, ast.Attribute) else ""
        if isinstance(node, ast.Name) and node.id.startswith("__"):
            name = node.id
        if name.startswith(_BLOCKED_PREFIXES):
            raise _RejectedError(
                f"the expression {truncate(text, 60)} uses {name}, which is not allowed"
            )


# Packages


def _install_find(
    xacro: Any, substitution_args: Any, file: Path, packages: Mapping[str, Path]
) -> None:
    """Resolve `$(find ...)` without ROS."""
    searches = {str(file): PackageResolver(file, packages)}

    def find_package(name: str) -> str:
        at = str((xacro.filestack or [None])[-1] or file)
        # an included file may belong to another package
        for start in dict.fromkeys((str(file), at)):
            search = searches.setdefault(start, PackageResolver(Path(start), packages))
            folder = search.find_package(name)
            if folder is not None:
                return str(folder)
        raise _RejectedError(
            f"package {name}: not found; pass its folder with --package {name}=FOLDER"
        )

    substitution_args._eval_find = find_package
    substitution_args._eval_dict["find"] = find_package  # for $(eval ...)


# Locations of elements


class _Origins:
    """Copy the origin of an element to its copies; minidom calls `handle` for each copy."""

    def handle(self, operation: int, key: str, data: Any, source: Any, target: Any) -> None:
        """Copy the data of `source` to `target`."""
        del operation, source
        if target is not None:
            target.setUserData(key, data, self)


def _parse_with_origins(xacro: Any, files: list[str]) -> Any:
    """Return a replacement of `xacro.parse` that records the file and line of each element.

    All elements store their origin for error messages. Elements that are not xacro also store it as
    an attribute, which remains in the expanded text.
    """
    origins = _Origins()

    class Builder(expatbuilder.ExpatBuilderNS):
        def start_element_handler(self, name: str, attributes: list[str]) -> None:
            super().start_element_handler(name, attributes)
            node: Any = self.curNode
            line = self.getParser().CurrentLineNumber
            node.setUserData(ORIGIN, (files[-1], line), origins)
            if not node.tagName.startswith("xacro:"):  # as xacro decides, whatever the namespace
                node.setAttribute(ORIGIN, f"{len(files) - 1}:{line}")

    def parse(text: Any, filename: str | None = None) -> Any:
        assert text is None
        assert filename is not None
        try:
            data = Path(filename).read_bytes()
        except OSError as error:
            xacro.filestack.pop()  # as xacro does
            raise xacro.XacroException(f"{error.strerror}: {filename}", exc=error) from error
        files.append(str(Path(filename).absolute()))
        if b"<!ENTITY" in data:
            raise _RejectedError(f"{filename} declares entities, which are not supported")
        try:
            return Builder().parseString(data)
        except expat.ExpatError as error:
            error.add_note(files[-1])
            raise

    return parse


def _error_location(error: BaseException) -> tuple[str, int] | None:
    """Return the file and line of the innermost element that was being expanded."""
    for cause in _chain(error):
        notes = getattr(cause, "__notes__", ())
        if isinstance(cause, expat.ExpatError) and notes:
            return notes[0], cause.lineno
    places = [location for cause in _chain(error) for location in _locations(cause.__traceback__)]
    return places[-1] if places else None


def _locations(traceback: TracebackType | None) -> Iterator[tuple[str, int]]:
    while traceback is not None:
        local = traceback.tb_frame.f_locals
        for name in ("node", "elt"):
            element: Any = local.get(name)
            location = element.getUserData(ORIGIN) if hasattr(element, "getUserData") else None
            if location is not None:
                yield location
        traceback = traceback.tb_next


# Error messages


def _error_message(error: BaseException, request: Mapping[str, Any]) -> str:
    """Return a one-line message that says what is wrong and how to fix it."""
    causes = list(_chain(error))
    if any(isinstance(cause, MemoryError) for cause in causes):
        return (
            f"xacro: the expansion needs more than {request['max_memory'] / 2**30:g} GiB of memory"
        )
    if any(isinstance(cause, RecursionError) for cause in causes):
        return "xacro: a macro or an include recurses without end, or is nested too deeply"
    for cause in causes:
        match type(cause).__name__:
            case "ArgException":
                return (
                    f"xacro: argument {cause} has no value; pass it with --xacro-arg {cause}:=VALUE"
                )
            case "_RejectedError" | "SubstitutionException":
                return f"xacro: {cause}"
            case "ExpatError":
                return f"xacro: malformed XML: {cause}"
        if isinstance(cause, SyntaxError):
            expression = truncate((cause.text or "").strip(), 60)
            return f"xacro: invalid expression {expression!r}: {cause.msg}"
        if isinstance(cause, OSError):
            return f"xacro: cannot read {cause.filename}: {cause.strerror}"
    macro = next(iter(getattr(error, "macros", ())), None)
    name = macro.body.getAttribute("name") if macro is not None else ""
    words = f"{error} of macro {name}" if name else str(error) or type(error).__name__
    if "unknown macro" in words and b"<include " in Path(request["file"]).read_bytes():
        words += "; xacro reads <xacro:include>, not <include>"
    return f"xacro: {truncate(' '.join(words.split()), _MAX_MESSAGE)}"


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an error and its causes; xacro's errors store their cause in `exc`."""
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        seen.add(id(error))
        yield error
        error = getattr(error, "exc", None) or error.__cause__ or error.__context__
