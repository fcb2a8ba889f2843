"""Find the robot files in a folder."""

import os
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from lxml import etree

from terrainkit_robots.description.package_resolver import PackageResolver
from terrainkit_robots.description.xml.document import RobotFileError, parse_xml, read_bytes

MAX_FILES = 100_000
"""Maximum number of files in a folder that may be robots, by their suffix."""

_SUFFIXES = (".urdf", ".xacro", ".xml", ".mjcf")
_IGNORE_FILES = {"COLCON_IGNORE", "CATKIN_IGNORE"}
"""Files that mark folders without sources, such as folders of a build."""

_FRAGMENTS = {"macro", "property", "arg", "material", "transmission", "gazebo"}
"""Elements of `<robot>` that describe no robot without others."""

_MOVING = ("joint", "freejoint", "include", "attach")
"""Elements of `<worldbody>` that a robot has at least one of."""


def robot_files(folder: Path) -> list[Path]:
    """Return the robot files in a folder and the folders below it, sorted by path.

    A file with the root `<robot>` is one unless another file includes it, or it only defines
    macros, materials and the like. A file with the root `<mujoco>` is one if it has a joint, unless
    it includes another robot, as a scene does. Damaged files count, except those that end in .xml.
    Links to folders are not followed. Hidden folders and folders of a colcon or catkin build are
    skipped.

    Raises:
        RobotFileError: If there is no robot file, or the folder has too many files.
    """
    files = list(islice(filter(_may_be_robot, _iter_files(folder)), MAX_FILES + 1))
    if len(files) > MAX_FILES:
        raise RobotFileError(f"{folder}: got more than {MAX_FILES} files of robots; expected fewer")
    # Of a file and links to it, the last one counts.
    files.sort(key=lambda path: (not path.is_symlink(), path))
    robots, fragments, scenes = dict[str, Path](), set[str](), dict[str, set[str]]()
    for path in files:
        root = _read_root(path)
        file = os.path.realpath(path)
        included = _included_files(path, root)
        fragments |= included
        if _is_robot(path, root):
            robots[file] = path
            if _is_mjcf(root):
                scenes[file] = included
    found = [
        path
        for file, path in robots.items()
        if not (scenes[file] & robots.keys() if file in scenes else file in fragments)
    ]
    if not found:
        raise RobotFileError(f"{folder}: got no robot file in it; expected URDF, xacro or MJCF")
    return sorted(found)


def _iter_files(folder: Path) -> Iterator[Path]:
    for parent, folders, files in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".")]
        if _IGNORE_FILES & {*files}:
            folders.clear()
        else:
            yield from (Path(parent, name) for name in files)


def _may_be_robot(path: Path) -> bool:
    is_srdf = path.name.endswith(".srdf.xacro")
    return path.suffix.lower() in _SUFFIXES and not is_srdf and path.is_file()


def _read_root(path: Path) -> etree._Element | None:
    """Return the root element of a file; None if it cannot be read."""
    try:
        return parse_xml(path, read_bytes(path)).root
    except RobotFileError:
        return None


def _is_mjcf(root: etree._Element | None) -> bool:
    return root is not None and root.tag == "mujoco"


def _is_robot(path: Path, root: etree._Element | None) -> bool:
    """Return whether a file describes a robot, or is one by its suffix and is damaged."""
    tags = () if root is None else [str(child.tag) for child in root.iterchildren("*")]
    children = {tag.rpartition("}")[2] for tag in tags}
    if root is None or root.tag not in ("robot", "mujoco") or not children:
        return path.suffix.lower() != ".xml"
    if _is_mjcf(root):
        return any(root.find(f"worldbody//{tag}") is not None for tag in _MOVING)
    # Macros include the macros that they use.
    return not children <= _FRAGMENTS | ({"include"} if "macro" in children else set())


def _included_files(path: Path, root: etree._Element | None) -> set[str]:
    """Return the real paths of the files that a file includes."""
    elements = () if root is None else root.iter("{*}include")
    names = [element.get("filename") or element.get("file") or "" for element in elements]
    resolver = PackageResolver(path, {})
    paths = (resolver.resolve(name.replace("$(dirname)/", ""))[0] for name in names)
    return {os.path.realpath(path) for path in paths}  # Path.resolve rejects loops of links
