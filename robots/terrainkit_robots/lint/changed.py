"""Find the robots that read changed files, such as an included xacro file or a mesh."""

import os
from collections.abc import Iterable, Set
from pathlib import Path

from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.robot_folder import robot_files
from terrainkit_robots.description.xml.document import RobotFileError
from terrainkit_robots.lint.settings import Settings, read_settings

_UNKNOWN = {"XML005": ".xacro", "XML012": ".xml"}
"""Problems of included files, and the suffix of the files that may be included."""


def changed_robots(
    changed: Iterable[Path], settings: Settings, folder: Path = Path()
) -> tuple[Path, ...]:
    """Return the robot files in a folder and its subfolders that read one of the changed files.

    A robot that xacro cannot expand is returned if any xacro file changes, and one with an invalid
    include of MJCF if any .xml file changes.

    Args:
        changed: Files of any kind. They need not exist.
        settings: Packages and xacro arguments, which have priority over configuration files.
        folder: Folder to search.

    Raises:
        RobotFileError: if the folder contains no robot.
        ConfigError: if a configuration file is invalid.
    """
    files = {os.path.realpath(file) for file in changed}
    return tuple(robot for robot in robot_files(folder) if _reads_any(robot, files, settings))


def _reads_any(robot: Path, files: Set[str], settings: Settings) -> bool:
    """Return whether a robot file, an included file or a mesh is one of `files`."""
    settings = settings.over(read_settings(robot.parent))
    packages, arguments = settings.packages, settings.xacro_arguments
    try:
        model = load_robot(robot, packages=packages, xacro_arguments=arguments)
    except RobotFileError:
        return os.path.realpath(robot) in files
    # Nobody knows what a file includes that xacro cannot expand, or what a missing file was.
    unknown = tuple(_UNKNOWN[p.code] for p in model.problems if p.code in _UNKNOWN)
    if any(file.endswith(unknown) for file in files):
        return True
    shapes = (shape for link in model.links for shape in (*link.visuals, *link.collisions))
    meshes = (shape.mesh.path for shape in shapes if shape.mesh is not None)
    return any(os.path.realpath(file) in files for file in (robot, *model.sources, *meshes))
