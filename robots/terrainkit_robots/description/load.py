"""Load a robot from a URDF, xacro or MJCF file."""

from collections.abc import Mapping
from pathlib import Path

from terrainkit.errors import listing
from terrainkit_robots.description.model import Problem, RobotModel, Source
from terrainkit_robots.description.package_resolver import is_folder
from terrainkit_robots.description.robot_file import RobotFile, find_robot
from terrainkit_robots.description.robot_folder import robot_files
from terrainkit_robots.description.xml.document import (
    RobotFileError,
    XmlDocument,
    parse_xml,
    read_bytes,
)

XACRO = "xacro"

_USD_STARTS = (b"#usda", b"PXR-USDC")
"""First bytes of text and binary USD."""

_FORMATS = {"sdf": "SDF", "world": "SDF", "collada": "a Collada mesh", "launch": "a launch file"}
"""Formats that users pass as robots, by their root element."""


def load_robot(
    path: str | Path,
    *,
    packages: Mapping[str, Path] | None = None,
    xacro_arguments: Mapping[str, str] | None = None,
    contents: Mapping[Path, bytes] | None = None,
) -> RobotModel:
    """Load the robot of a URDF, xacro or MJCF file.

    A malformed file is not an error: what could not be read is listed in `problems` of the model.

    Args:
        path: Robot file, or a name: a bundled robot, or one of the package robot_descriptions.
        packages: Folders of ROS packages by name, which take precedence over a search.
        xacro_arguments: Values of xacro arguments by name.
        contents: File contents by path, which are used instead of the files on disk.

    Returns:
        The robot model. It has no links if the file could not be parsed.

    Raises:
        RobotFileError: If the file cannot be found, downloaded or opened.
    """
    contents = contents or {}
    robot = RobotFile(path=Path(path)) if Path(path) in contents else find_robot(path)
    path, packages = robot.path, {**robot.packages, **(packages or {})}
    if is_folder(path):
        found = listing(str(file.relative_to(path)) for file in robot_files(path))
        raise RobotFileError(f"{path}: got a folder; expected a file; it contains {found}")
    data = contents[path] if path in contents else read_bytes(path)
    if data.startswith(_USD_STARTS) or (path.suffix == ".usdz" and data.startswith(b"PK")):
        doc = XmlDocument(file=path, data=data, root=None, sources={})
        return _empty_model(doc, _wrong_format(Source(file=path, line=1), "USD"))
    doc = parse_xml(path, data)
    if doc.root is None:
        return _empty_model(doc)
    tag = doc.root.tag
    if tag == "mujoco" or tag == "mujocoinclude":
        from terrainkit_robots.description.mjcf.reader import read_mjcf

        return read_mjcf(doc, contents=contents)
    if tag != "robot":
        name = _FORMATS.get(tag.lower(), "an XML file of another kind")
        got = f"{name} with the root element <{tag}>"
        return _empty_model(doc, _wrong_format(doc.source(doc.root), got))
    from terrainkit_robots.description.urdf.reader import read_urdf

    if path.suffix == f".{XACRO}":
        from terrainkit_robots.description.xacro.reader import read_xacro

        arguments = {**robot.xacro_arguments, **(xacro_arguments or {})}
        return read_xacro(doc, arguments=arguments, packages=packages)
    return read_urdf(doc, packages=packages)


def _wrong_format(source: Source, got: str) -> Problem:
    message = f"format: got {got}; expected URDF (<robot>), xacro or MJCF (<mujoco>)"
    return Problem(code="XML002", message=message, source=source)


def _empty_model(doc: XmlDocument, *problems: Problem) -> RobotModel:
    suffix = doc.file.suffix
    return RobotModel(
        name="",
        kind="mjcf" if suffix == ".xml" else "xacro" if suffix == f".{XACRO}" else "urdf",
        file=doc.file,
        source=Source(file=doc.file, line=0),
        problems=(*doc.problems, *problems),
        sources=(doc.file,),
    )
