"""Robot files: from a path to a robot, whichever of the formats it is."""

from collections.abc import Mapping
from pathlib import Path

from terrainkit_robots.description.model import Problem, RobotModel, Source
from terrainkit_robots.description.xml.document import XmlDocument, parse_xml, read_bytes

XACRO = "xacro"


def load_robot(
    path: Path,
    *,
    packages: Mapping[str, Path] | None = None,
    xacro_arguments: Mapping[str, str] | None = None,
    contents: Mapping[Path, bytes] | None = None,
) -> RobotModel:
    """Return the robot in a URDF, xacro or MJCF file; what is wrong with it is in its `problems`.

    Args:
        path: The file.
        packages: Folder of each ROS package, where a search would not find it.
        xacro_arguments: Value of each xacro argument.
        contents: What to read instead of the files of these paths, such as what a fix would write.

    Raises:
        RobotFileError: if the file cannot be opened. A file that can is never an error.
    """
    packages, contents = packages or {}, contents or {}
    data = contents[path] if path in contents else read_bytes(path)
    document = parse_xml(path, data)
    if document.root is None:
        return _nothing(document)
    tag = document.root.tag
    if tag == "mujoco" or tag == "mujocoinclude":
        from terrainkit_robots.description.mjcf.reader import read_mjcf

        return read_mjcf(document, contents=contents)
    if tag != "robot":
        message = f"the root element is <{tag}>; wanted <robot> (URDF) or <mujoco> (MJCF)"
        source = document.source(document.root)
        return _nothing(document, Problem(code="XML002", message=message, source=source))
    from terrainkit_robots.description.urdf.reader import read_urdf

    if path.suffix == f".{XACRO}":
        from terrainkit_robots.description.xacro.reader import read_xacro

        return read_xacro(document, arguments=xacro_arguments or {}, packages=packages)
    return read_urdf(document, packages=packages)


def _nothing(document: XmlDocument, *problems: Problem) -> RobotModel:
    suffix = document.file.suffix
    return RobotModel(
        name="",
        kind="mjcf" if suffix == ".xml" else "xacro" if suffix == f".{XACRO}" else "urdf",
        file=document.file,
        source=Source(file=document.file, line=0),
        problems=(*document.problems, *problems),
        sources=(document.file,),
    )
