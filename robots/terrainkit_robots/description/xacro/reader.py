"""Read the robot of a xacro file, with the locations of its elements in the xacro files."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

from lxml import etree

from terrainkit_robots.description.model import Problem, RobotModel, Source
from terrainkit_robots.description.urdf.reader import read_urdf
from terrainkit_robots.description.xacro.expansion import XacroError, expand_xacro, pop_origin
from terrainkit_robots.description.xml.document import XmlDocument, parse_xml


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
        return dataclasses.replace(model, problems=doc.problems)
    try:
        expansion = expand_xacro(doc.file, arguments, packages)
    except XacroError as error:
        source = file_source
        if error.location is not None:
            file, line = error.location
            source = Source(file=_as_given(file, doc.file), line=line)
        problem = Problem(code="XML005", message=str(error), source=source)
        return dataclasses.replace(model, problems=(problem,))
    expanded = parse_xml(doc.file, expansion.data)
    if expanded.root is None:
        return dataclasses.replace(model, problems=expanded.problems)
    sources = {}
    source = file_source
    for element in expanded.root.iter(etree.Element):
        origin = pop_origin(element, expansion.files)
        if origin is not None:  # otherwise, the location of the previous element
            source = Source(file=_as_given(origin[0], doc.file), line=origin[1])
        sources[element] = source
    model = read_urdf(dataclasses.replace(expanded, sources=sources), packages=packages)
    files = tuple(_as_given(file, doc.file) for file in expansion.files)
    return dataclasses.replace(model, kind="xacro", sources=files)


def _as_given(file: Path, main: Path) -> Path:
    return main if file == main.absolute() else file
