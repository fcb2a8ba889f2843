"""The process in which xacro runs: a request comes in on stdin, an answer goes out on stdout.

The files are not to be trusted. Xacro shuts out Python's builtins, but not the ways around that:
so names that lead to them are refused, and what a robot has no use for (writing, sockets, other
programs) is forbidden to the whole process before the first file is read.
"""

import ast
import json
import os
import stat
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any
from xml.dom import expatbuilder
from xml.parsers import expat

from terrainkit_robots.description.package_resolver import Packages
from terrainkit_robots.text import short

ORIGIN = "terrainkit-origin"
"""Attribute that carries the file and line of an element through the expansion."""

_MOST_BYTES = 2**26
"""More text is not given back; no robot is described in so much."""

_WORDS = 200
"""So many characters of xacro's messages are passed on."""

_INSIDES = ("_", "gi_", "cr_", "ag_", "f_", "tb_", "co_", "func_", "mro")
"""Attributes that begin so lead from a value to the interpreter."""

_EVENTS = ("os.", "shutil.", "subprocess.", "socket.", "ctypes.", "pty.", "tempfile.", "webbrowser")
"""What the process must not do, as the interpreter calls it; see its table of audit events."""

_HARMLESS = frozenset({"os.listdir", "os.scandir", "os.walk", "os.fwalk"})
"""Events of these that only look around."""


class _RefusedError(Exception):
    """Something that a xacro file must not do."""


def main() -> None:
    """Answer one request."""
    request = json.load(sys.stdin)
    _limit(request["seconds"], request["memory"])
    try:
        answer = _expand(request)
    except BaseException as error:  # whatever the file's expressions raise is the file's
        answer = {"error": _told(error, request), "place": _place(error)}
    sys.stdout.write(json.dumps(answer))
    sys.stdout.flush()
    os._exit(0)  # what is left of a huge document needs no tidying up


def _limit(seconds: float, memory: int) -> None:
    try:
        import resource
    except ImportError:  # Windows has no such limits; the caller's on time holds there, too
        return
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CPU, (int(seconds) + 1, int(seconds) + 2))
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _expand(request: Mapping[str, Any]) -> dict[str, Any]:
    """Return the expanded file and the files that it is made of."""
    try:
        import xacro
        from xacro import substitution_args
    except ImportError as error:
        raise _RefusedError(
            f"the xacro package is not there ({error}); pip install xacro"
        ) from None
    file = Path(request["file"])
    packages = {name: Path(folder) for name, folder in request["packages"].items()}
    files: list[str] = []
    _guard_expressions(xacro, substitution_args)
    _find_packages(xacro, substitution_args, file, packages)
    xacro.parse = _remembering(xacro, files)
    os.chdir(file.parent)
    sys.addaudithook(_forbid)
    document = xacro.process_file(str(file), mappings=dict(request["arguments"]), verbosity=0)
    text = document.documentElement.toxml()
    if len(text) > _MOST_BYTES:
        raise _RefusedError(f"it expands to more than {_MOST_BYTES // 2**20} MiB")
    read = [str(Path(name).absolute()) for name in xacro.all_includes]
    return {"xml": text, "files": [*files, *(name for name in read if name not in files)]}


# What a file must not do


def _forbid(event: str, arguments: tuple[Any, ...]) -> None:
    """Refuse what the process must not do; the interpreter asks before each step of the kind."""
    if event == "open":
        _check_open(*arguments)
    elif event.startswith(_EVENTS) and event not in _HARMLESS:
        raise _RefusedError(f"it tried {event}, which is not allowed here")


def _check_open(path: Any, _: Any, flags: Any) -> None:
    writes = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
    if isinstance(flags, int) and flags & writes:
        raise _RefusedError(f"it tried to write {path}, which is not allowed here")
    if isinstance(path, int) or path is None:
        return
    try:
        kind = os.stat(path).st_mode  # noqa: PTH116
    except (OSError, ValueError):
        return  # nothing there; what opens it will tell
    if not stat.S_ISREG(kind) and not stat.S_ISDIR(kind):
        raise OSError(None, "not a plain file", str(path))


def _guard_expressions(xacro: Any, substitution_args: Any) -> None:
    """Have each expression looked at before it is evaluated."""
    evaluate, substitute = xacro.safe_eval, substitution_args._eval

    def safe_eval(text: str, *scope: Any) -> Any:
        _check_expression(text)
        return evaluate(text, *scope)

    def safe_substitute(text: str, context: Any) -> Any:
        _check_expression(text)
        return substitute(text, context)

    xacro.safe_eval = safe_eval
    substitution_args._eval = safe_substitute
    dict.pop(xacro._global_symbols["python"], "vars", None)  # every attribute of a type, by name

    def argument(name: str) -> Any:
        given = xacro.substitution_args_context["arg"]
        if name not in given:
            raise substitution_args.ArgException(name)
        return given[name]

    dict.__setitem__(xacro._global_symbols["xacro"], "arg", argument)


def _check_expression(text: str) -> None:
    for node in ast.walk(ast.parse(text.strip(), mode="eval")):
        name = node.attr if isinstance(node, ast.Attribute) else ""
        if isinstance(node, ast.Name) and node.id.startswith("__"):
            name = node.id
        if name.startswith(_INSIDES):
            raise _RefusedError(
                f"the expression {short(text, 60)} uses {name}, which is not allowed here"
            )


# Packages


def _find_packages(
    xacro: Any, substitution_args: Any, file: Path, packages: Mapping[str, Path]
) -> None:
    """Have `$(find ...)` answered without ROS."""
    searches = {str(file): Packages(file, packages)}

    def find(name: str) -> str:
        at = str((xacro.filestack or [None])[-1] or file)
        for start in dict.fromkeys((str(file), at)):  # a part may lie in a package of its own
            search = searches.setdefault(start, Packages(Path(start), packages))
            folder = search.find(name)
            if folder is not None:
                return str(folder)
        raise _RefusedError(
            f"there is no package {name}; give its folder with --package {name}=FOLDER"
        )

    substitution_args._eval_find = find
    substitution_args._eval_dict["find"] = find  # for $(eval ...)


# Where elements come from


class _Origins:
    """Copies the origin of an element to its copies; minidom calls it for each."""

    def handle(self, operation: int, key: str, data: Any, source: Any, target: Any) -> None:
        """Give `target` what `source` has."""
        del operation, source
        if target is not None:
            target.setUserData(key, data, self)


def _remembering(xacro: Any, files: list[str]) -> Any:
    """Return another `parse` for xacro, by which each element knows its file and line.

    All elements know it on the way, for errors; those that are not xacro carry it into the text.
    """
    origins = _Origins()

    class Builder(expatbuilder.ExpatBuilderNS):
        def start_element_handler(self, name: str, attributes: list[str]) -> None:
            super().start_element_handler(name, attributes)
            node: Any = self.curNode
            line = self.getParser().CurrentLineNumber
            node.setUserData(ORIGIN, (files[-1], line), origins)
            if "xacro" not in (node.namespaceURI or node.tagName):
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
            raise _RefusedError(f"{filename} declares entities, which are not resolved")
        try:
            return Builder().parseString(data)
        except expat.ExpatError as error:
            error.add_note(files[-1])
            raise

    return parse


def _place(error: BaseException) -> tuple[str, int] | None:
    """Return file and line of the innermost element that was being worked on."""
    for each in _chain(error):
        notes = getattr(each, "__notes__", ())
        if isinstance(each, expat.ExpatError) and notes:
            return notes[0], each.lineno
    places = [place for each in _chain(error) for place in _places(each.__traceback__)]
    return places[-1] if places else None


def _places(traceback: TracebackType | None) -> Iterator[tuple[str, int]]:
    while traceback is not None:
        local = traceback.tb_frame.f_locals
        for name in ("node", "elt"):
            element: Any = local.get(name)
            place = element.getUserData(ORIGIN) if hasattr(element, "getUserData") else None
            if place is not None:
                yield place
        traceback = traceback.tb_next


# What is told


def _told(error: BaseException, request: Mapping[str, Any]) -> str:
    """Return one line that says what is wrong, and what to do where that is known."""
    causes = list(_chain(error))
    if any(isinstance(each, MemoryError) for each in causes):
        return f"the xacro file needs more than {request['memory'] / 2**30:g} GiB of memory"
    if any(isinstance(each, RecursionError) for each in causes):
        return "xacro: a macro or an include calls itself without end, or is nested too deep"
    for each in causes:
        match type(each).__name__:
            case "ArgException":
                return (
                    f"the xacro argument {each} has no value; give it with "
                    f"--xacro-arg {each}:=VALUE"
                )
            case "_RefusedError" | "SubstitutionException":
                return f"xacro: {each}"
            case "ExpatError":
                return f"xacro: malformed XML: {each}"
        if isinstance(each, SyntaxError):
            return f"xacro: invalid expression {short((each.text or '').strip(), 60)!r}: {each.msg}"
        if isinstance(each, OSError):
            return f"xacro: cannot read {each.filename}: {each.strerror}"
    macro = next(iter(getattr(error, "macros", ())), None)
    words = f"{error}{_of(macro)}" or type(error).__name__
    return f"xacro: {short(' '.join(words.split()), _WORDS)}"


def _of(macro: Any) -> str:
    name = macro.body.getAttribute("name") if macro is not None else ""
    return f" of macro {name}" if name else ""


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an error and what caused it; xacro's own keep their cause in `exc`."""
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        seen.add(id(error))
        yield error
        error = getattr(error, "exc", None) or error.__cause__ or error.__context__


if __name__ == "__main__":
    main()
