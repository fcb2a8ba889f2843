"""Load a robot from a URDF, xacro or MJCF file."""

from collections.abc import Mapping
from pathlib import Path

from terrainkit_robots.description.model import Problem, RobotModel, Source
from terrainkit_robots.description.xml.document import XmlDocument, parse_xml, read_bytes

XACRO = "xacro"


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
        path: Robot file.
        packages: Folders of ROS packages by name, which take precedence over a search.
        xacro_arguments: Values of xacro arguments by name.
        contents: File contents by path, which are used instead of the files on disk.

    Returns:
        The robot model. It has no links if the file could not be parsed.

    Raises:
        RobotFileError: If the file cannot be opened.
    """
    path, packages, contents = Path(path), packages or {}, contents or {}
    data = contents[path] if path in contents else read_bytes(path)
    document = parse_xml(path, data)
    if document.root is None:
        return _empty_model(document)
    tag = document.root.tag
    if tag == "mujoco" or tag == "mujocoinclude":
        from terrainkit_robots.description.mjcf.reader import read_mjcf

        return read_mjcf(document, contents=contents)
    if tag != "robot":
        message = f"root element: got <{tag}>; expected <robot> (URDF) or <mujoco> (MJCF)"
        source = document.source(document.root)
        return _empty_model(document, Problem(code="XML002", message=message, source=source))
    from terrainkit_robots.description.urdf.reader import read_urdf

    if path.suffix == f".{XACRO}":
        from terrainkit_robots.description.xacro.reader import read_xacro

        return read_xacro(document, arguments=xacro_arguments or {}, packages=packages)
    return read_urdf(document, packages=packages)


def _empty_model(document: XmlDocument, *problems: Problem) -> RobotModel:
    suffix = document.file.suffix
    return RobotModel(
        name="",
        kind="mjcf" if suffix == ".xml" else "xacro" if suffix == f".{XACRO}" else "urdf",
        file=document.file,
        source=Source(file=document.file, line=0),
        problems=(*document.problems, *problems),
        sources=(document.file,),
    )
