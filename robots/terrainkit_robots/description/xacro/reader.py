"""Xacro files: expanded, and read as the URDF they become, with the places they came from."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

from lxml import etree

from terrainkit_robots.description.model import Problem, RobotModel, Source
from terrainkit_robots.description.urdf.reader import read_urdf
from terrainkit_robots.description.xacro.expansion import XacroError, expand_xacro, pop_origin
from terrainkit_robots.description.xml.document import XmlDocument, parse_xml


def read_xacro(
    document: XmlDocument, *, arguments: Mapping[str, str], packages: Mapping[str, Path]
) -> RobotModel:
    """Return the robot that a xacro file expands to; why it does not is one of its problems.

    Args:
        document: The file, as it is.
        arguments: Value of each xacro argument.
        packages: Folder of each ROS package, where a search would not find it.
    """
    whole = Source(file=document.file, line=0)
    nothing = RobotModel(
        name="", kind="xacro", file=document.file, source=whole, sources=(document.file,)
    )
    if document.problems:  # broken already; expanding it would only say so in other words
        return dataclasses.replace(nothing, problems=document.problems)
    try:
        expansion = expand_xacro(document.file, arguments, packages)
    except XacroError as error:
        problem = Problem(code="XML005", message=str(error), source=_source(document, error))
        return dataclasses.replace(nothing, problems=(problem,))
    expanded = parse_xml(document.file, expansion.data)
    if expanded.root is None:
        return dataclasses.replace(nothing, problems=expanded.problems)
    sources = {}
    at = whole
    for element in expanded.root.iter(etree.Element):
        origin = pop_origin(element, expansion.files)
        if origin is not None:  # else it is where the one before it is
            at = Source(file=_as_given(origin[0], document.file), line=origin[1])
        sources[element] = at
    model = read_urdf(dataclasses.replace(expanded, sources=sources), packages=packages)
    files = tuple(_as_given(file, document.file) for file in expansion.files)
    return dataclasses.replace(model, kind="xacro", sources=files)


def _as_given(file: Path, main: Path) -> Path:
    return main if file == main.absolute() else file


def _source(document: XmlDocument, error: XacroError) -> Source:
    if error.place is None:
        return Source(file=document.file, line=0)
    file, line = error.place
    return Source(file=_as_given(file, document.file), line=line)
