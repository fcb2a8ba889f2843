"""Read the robot of a xacro file, with the locations of its elements in the xacro files.

The xacro package expands it in a child process: xacro evaluates Python expressions, and macros may
recurse. The child process (see `process`) has limits on time and memory and returns text. ROS is
not required: `PackageResolver` finds packages.
"""

import os
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from lxml import etree

from terrainkit.errors import TerrainkitError, one_line
from terrainkit.files.child_process import ChildProcess, ProcessError, ProcessLimits
from terrainkit.settings.text import truncate
from terrainkit_robots.description.model import Problem, RobotModel, Source
from terrainkit_robots.description.urdf.reader import read_urdf
from terrainkit_robots.description.xacro.process import ORIGIN, expand
from terrainkit_robots.description.xml.document import XmlDocument, parse_xml

MAX_SECONDS = 8.0
"""Time limit of an expansion [s]; large robots need half a second."""

_MAX_BYTES = 2**30
"""Memory limit of an expansion."""

_SECRET_NAME = re.compile(r"TOKEN|SECRET|PASSW|CREDENTIAL|KEY|AUTH|COOKIE", re.IGNORECASE)
"""Environment variables with such names are hidden from `$(env)`."""


class XacroError(TerrainkitError):
    """A xacro file that cannot be expanded."""

    def __init__(self, message: str, location: tuple[Path, int] | None = None) -> None:
        super().__init__(message)
        self.location = location
        """File and line of the element that failed, if known."""


def expand_xacro(
    file: Path,
    arguments: Mapping[str, str],
    packages: Mapping[str, Path],
    *,
    timeout: float = MAX_SECONDS,
    max_memory: int = _MAX_BYTES,
) -> tuple[bytes, tuple[Path, ...]]:
    """Expand a xacro file.

    Args:
        file: The xacro file.
        arguments: Values of xacro arguments by name.
        packages: Folders of ROS packages by name.
        timeout: Time limit [s].
        max_memory: Memory limit [bytes], where the operating system supports it.

    Returns:
        The URDF, whose elements have their origin, for `pop_origin`; and the xacro file and all
        files that it includes.

    Raises:
        XacroError: If the file cannot be expanded within the limits.
    """
    request = {
        "file": str(file.absolute()),
        "arguments": dict(arguments),
        "packages": {name: str(folder.absolute()) for name, folder in packages.items()},
        "max_memory": max_memory,
    }
    environment = {k: value for k, value in os.environ.items() if not _SECRET_NAME.search(k)}
    limits = ProcessLimits(seconds=timeout, memory=max_memory)
    try:
        with ChildProcess(expand, request, limits=limits, environment=environment) as process:
            reply = process.receive()
        xml = reply["xml"].tobytes()
        files = tuple(map(Path, reply["files"].tolist()))
        message, location = str(reply["error"]), reply["location"].tolist()
        place = (Path(location[0]), int(location[1])) if location else None
    except (ProcessError, LookupError, TypeError, ValueError) as error:
        hint = "check macros and expressions for endless recursion"
        raise XacroError(f"xacro: cannot be expanded: {error}; {hint}") from None
    if message:
        raise XacroError(truncate(one_line(message), 1000), place)
    return xml, files


def pop_origin(element: Any, files: tuple[Path, ...]) -> tuple[Path, int] | None:
    """Remove the origin attribute of an expanded element.

    Returns:
        File and line of the element in the xacro files, or None.
    """
    words = element.attrib.pop(ORIGIN, "").split(":")
    if len(words) != 2 or not all(word.isdecimal() for word in words):
        return None
    index, line = map(int, words)
    return (files[index], line) if index < len(files) else None


def read_xacro(
    doc: XmlDocument, *, arguments: Mapping[str, str], packages: Mapping[str, Path]
) -> RobotModel:
    """Return the robot of a xacro file.

    An error of the expansion is recorded as a problem of the model.

    Args:
        doc: The xacro file, parsed as XML.
        arguments: Values of xacro arguments by name.
        packages: Folders of ROS packages by name.
    """
    file_source = Source(file=doc.file, line=0)
    model = RobotModel(
        name="", kind="xacro", file=doc.file, source=file_source, sources=(doc.file,)
    )
    if doc.problems:  # the expansion would only repeat them
        return replace(model, problems=doc.problems)
    try:
        data, included = expand_xacro(doc.file, arguments, packages)
    except XacroError as error:
        source = file_source
        if error.location is not None:
            file, line = error.location
            source = Source(file=_as_given(file, doc.file), line=line)
        problem = Problem(code="XML005", message=str(error), source=source)
        return replace(model, problems=(problem,))
    expanded = parse_xml(doc.file, data)
    if expanded.root is None:
        return replace(model, problems=expanded.problems)
    sources = {}
    source = file_source
    for element in expanded.root.iter(etree.Element):
        origin = pop_origin(element, included)
        if origin is not None:  # otherwise, the location of the previous element
            source = Source(file=_as_given(origin[0], doc.file), line=origin[1])
        sources[element] = source
    model = read_urdf(replace(expanded, sources=sources), packages=packages)
    files = tuple(_as_given(file, doc.file) for file in included)
    return replace(model, kind="xacro", sources=files)


def _as_given(file: Path, main: Path) -> Path:
    return main if file == main.absolute() else file
