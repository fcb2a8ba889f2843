"""Resolve file names of robot descriptions to files on this machine.

`package://`, `model://` and `$(find ...)` name a ROS package, and ROS is often not installed where
a robot is trained. Packages are looked up in the given folders, in the folders above the robot
file, in ROS's environment variables and in nearby folders. A few hundred names are checked at most,
and nothing is downloaded.
"""

import os
import re
import stat
from collections.abc import Iterator, Mapping
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Literal
from urllib.parse import unquote

from terrainkit_robots.files import open_regular

FoundBy = Literal["path", "package", "search", "nothing"]

_PACKAGE = re.compile(
    r"(?:(?:package|model):/+|(?:file:/*)?\$\(\s*find\s+(?=[^()\s]+\s*\)))(?P<name>[^/\\()\s]+)\s*\)?"
    r"(?:[/\\]+(?P<rest>.*))?",
    re.DOTALL,
)
_DRIVE = re.compile(r"[A-Za-z]:[/\\]")
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:/")

_MAX_ANCESTORS = 16
"""Number of folders above the file that are checked for a package.xml."""

_MAX_SEARCH_FOLDERS = 4
"""Number of folders, from the file upward, in which a search starts: file, urdf/, package,
workspace."""

_MAX_ENTRIES = 400
"""Maximum number of entries of a folder that are listed."""

_MAX_PARTS = 64
"""Maximum depth of a path that is searched for."""

_MAX_LENGTH = 4096
"""Maximum length of a file name; no operating system supports longer paths."""

_MAX_BYTES = 100_000
"""Bytes of a package.xml that are read."""


class PackageResolver:
    """Resolve the file names of one robot file; each package is searched for once."""

    def __init__(self, file: Path, packages: Mapping[str, Path]) -> None:
        """Search from the folder of `file`; `packages` maps package names to folders."""
        self._folder = file.parent
        self._packages = packages
        self._folders: dict[str, tuple[tuple[Path, FoundBy], ...]] = {}
        self._names: dict[Path, str | None] = {}

    def resolve(self, filename: str) -> tuple[Path, FoundBy]:
        """Resolve a file name.

        Args:
            filename: Name of a file, as written in the robot file.

        Returns:
            The path and how it was found: `path` if the file is where the name says, `package` if
            the package was given or has a package.xml, `search` if it was found in a nearby folder
            or with different letter case, `nothing` with the expected path if it was not found.
        """
        if len(filename) > _MAX_LENGTH:
            return _join(self._folder, filename[:_MAX_LENGTH]), "nothing"
        match = _PACKAGE.fullmatch(filename)
        if match is not None:
            return self._resolve_in_package(match["name"], match["rest"] or "")
        return self._resolve_path(filename)

    def find_package(self, name: str) -> Path | None:
        """Return the folder of a package, or None if it is not found."""
        candidates = self._package_candidates(name)
        return candidates[0][0] if candidates else None

    def _resolve_path(self, filename: str) -> tuple[Path, FoundBy]:
        name = filename
        if filename.lower().startswith("file:"):
            name = re.sub(r"(?i)file:(//)?", "", filename)
            name = name if exists(self._folder / name) else unquote(name)
        elif _SCHEME.match(filename) and not _DRIVE.match(filename):
            return _join(self._folder, filename.rpartition("/")[2]), "nothing"  # a URL
        path, how = resolve_in(self._folder, name)
        found = self._search_nearby(name) if how == "nothing" else None
        return (found, "search") if found else (path, how)

    def _search_nearby(self, name: str) -> Path | None:
        """Return a file in a nearby folder whose path has the same end."""
        parts = _split(name)
        absolute = is_absolute(name)
        while parts and parts[0] in ("..", "."):
            parts = parts[1:]
        if not parts or len(parts) > _MAX_PARTS:
            return None
        ends = [parts[k:] for k in range(len(parts))] if absolute else [parts]
        for end in ends:
            for folder in self._search_folders if len(end) > 1 else ():
                if exists(folder.joinpath(*end)):
                    return folder.joinpath(*end)
        paths = (folder / parts[-1] for folder in self._mesh_folders)
        return next((path for path in paths if exists(path)), None)

    @cached_property
    def _mesh_folders(self) -> tuple[Path, ...]:
        """The nearest folders, each followed by its folders of meshes."""
        return tuple(
            path
            for folder in self._search_folders[:2]
            for path in (
                folder,
                *(f for f in _list_folders(folder) if f.name.lower() in _MESH_FOLDERS),
            )
        )

    def _resolve_in_package(self, name: str, rest: str) -> tuple[Path, FoundBy]:
        if not rest:  # a file name in the place of the package
            alone = _join(self._folder, name)
            return alone, "search" if exists(alone) and not is_folder(alone) else "nothing"
        candidates = self._package_candidates(name)
        for folder, how in candidates:
            if exists(_join(folder, rest)):
                return _join(folder, rest), how
        for folder, _ in candidates:
            found = find_ignore_case(folder, rest)
            if found is not None:
                return found, "search"
        found = self._search_nearby(rest)
        if found is not None:
            return found, "search"
        if candidates:
            return _join(candidates[0][0], rest), candidates[0][1]
        return _join(self._folder, rest), "nothing"

    def _package_candidates(self, name: str) -> tuple[tuple[Path, FoundBy], ...]:
        if name not in self._folders:
            paths: dict[Path, FoundBy] = {}
            for folder, how in self._iter_package_folders(name):
                paths.setdefault(folder, how)
            self._folders[name] = tuple(paths.items())
        return self._folders[name]

    def _iter_package_folders(self, name: str) -> Iterator[tuple[Path, FoundBy]]:
        """Yield possible folders of a package, the most likely first."""
        if name in self._packages:
            yield self._packages[name], "package"
            return
        if name in (".", "..") or "\0" in name:
            return
        for folder in self._ancestors:
            if self._declared_name(folder) == name:
                yield folder, "package"
        for folder in self._ancestors:
            if folder.name == name:
                yield folder, "search"
        for folder in _iter_ros_paths(name):
            if self._declared_name(folder) == name or exists(folder):
                yield folder, "package"
        yield from self._iter_nearby_packages(name)

    def _iter_nearby_packages(self, name: str) -> Iterator[tuple[Path, FoundBy]]:
        for folder in self._search_folders:
            if is_folder(folder / name):
                yield folder / name, "package" if self._declared_name(folder / name) else "search"
        for folder in self._search_folders:
            for sub in _list_folders(folder):
                if self._declared_name(sub) == name:
                    yield sub, "package"
                if is_folder(sub / name):
                    yield sub / name, "search"

    @cached_property
    def _ancestors(self) -> tuple[Path, ...]:
        """Folder of the robot file and the folders above it, the nearest first."""
        try:
            folder = self._folder.resolve()
        except (OSError, RuntimeError, ValueError):  # RuntimeError: a cycle of symbolic links
            folder = self._folder.absolute()
        return (folder, *islice(folder.parents, _MAX_ANCESTORS))

    @property
    def _search_folders(self) -> tuple[Path, ...]:
        return tuple(f for f in self._ancestors[:_MAX_SEARCH_FOLDERS] if f != f.parent)

    def _declared_name(self, folder: Path) -> str | None:
        """Return the package name in the folder's package.xml, or None."""
        if folder not in self._names:
            self._names[folder] = _read_package_name(folder / "package.xml")
        return self._names[folder]


_MESH_FOLDERS = {"meshes", "mesh", "assets", "stl", "dae", "obj", "visual", "collision"}


def resolve_in(folder: Path, filename: str) -> tuple[Path, FoundBy]:
    """Resolve a file name in a folder.

    Args:
        folder: The folder.
        filename: Name of a file, as written in the robot file.

    Returns:
        The path and how it was found: `path` if the folder has the file, `search` if it has it with
        different letter case, `nothing` with the expected path otherwise.
    """
    filename = filename[:_MAX_LENGTH]
    written = _join(folder, filename)
    if filename and "\0" not in filename and exists(written):
        return written, "path"
    found = None if is_absolute(filename) else find_ignore_case(folder, filename)
    return (found, "search") if found else (written, "nothing")


def is_package_uri(filename: str) -> bool:
    """Return whether a file name names a package: `package://`, `model://` or `$(find ...)`."""
    return _PACKAGE.fullmatch(filename) is not None


def is_absolute(filename: str) -> bool:
    """Return whether a file name is an absolute path on Linux or Windows."""
    name = re.sub(r"(?i)^file:(//)?", "", filename)
    return name.startswith(("/", "~", "\\\\")) or _DRIVE.match(name) is not None


def find_ignore_case(folder: Path, name: str) -> Path | None:
    """Return the file that matches `name` in any letter case and with any slashes, or None."""
    parts = _split(name)
    if not parts or len(parts) > _MAX_PARTS:
        return None
    at = folder
    for part in parts:
        listed = part if part == ".." or exists(at / part) else _listed_name(at, part)
        if listed is None:
            return None
        at = at / listed
    return at if exists(at) else None


def filename_on_disk(filename: str, path: Path) -> str | None:
    """Return `filename` with the letter case and slashes of the file on disk.

    Args:
        filename: Name of the file, as written in the robot file.
        path: Path that it was resolved to.

    Returns:
        The corrected name. None if the name is correct, absolute, or belongs to another folder.
    """
    if is_absolute(filename) or len(filename) > _MAX_LENGTH:
        return None
    prefix = _prefix(filename)
    pieces = re.split(r"([/\\]+)", filename[len(prefix) :])  # names and separators
    named = [k for k in range(0, len(pieces), 2) if pieces[k] not in ("", ".", "..")]
    real = _names_on_disk(path, len(named))
    if [pieces[k].lower() for k in named] != [name.lower() for name in real]:
        return None
    for k, name in zip(named, real, strict=True):
        pieces[k] = name
    corrected = prefix + "".join(pieces).replace("\\", "/")
    return corrected if corrected != filename else None


def _prefix(filename: str) -> str:
    """Return the part of a name before its folders: a scheme and a package."""
    match = _PACKAGE.fullmatch(filename) or re.match(r"(?i)(?P<rest>)file:(//)?", filename)
    if match is None:
        return ""
    return filename[: match.start("rest")] if match["rest"] else filename[: match.end()]


def _names_on_disk(path: Path, count: int) -> list[str]:
    """Return the last names of a path as listed by their folders.

    A case-insensitive file system finds a file under any letter case.
    """
    names: list[str] = []
    for at in (path, *path.parents):
        if len(names) == count:
            break
        if at.name not in ("", ".", ".."):
            names.append(_listed_name(at.parent, at.name) or at.name)
    return names[::-1]


def _listed_name(folder: Path, name: str) -> str | None:
    """Return a name in a folder, or the only one that differs in letter case, or None."""
    entries = _list_names(folder)
    if name in entries:
        return name
    matches = [entry for entry in entries if entry.lower() == name.lower()]
    return matches[0] if len(matches) == 1 else None


def exists(path: Path) -> bool:
    """Return whether `path` exists; False for an invalid path."""
    return _mode(path) is not None


def is_folder(path: Path) -> bool:
    """Return whether `path` is a folder."""
    mode = _mode(path)
    return mode is not None and stat.S_ISDIR(mode)


def _mode(path: Path) -> int | None:
    try:
        return path.stat().st_mode
    except (OSError, ValueError):  # too long, a cycle of symbolic links, a NUL, no permission
        return None


def _join(folder: Path, name: str) -> Path:
    """Join a folder and a name, without characters that a path cannot have."""
    if "\0" in name:
        return folder / name.replace("\0", "")
    return folder / name if is_absolute(name) else folder / name.lstrip("/")


def _split(name: str) -> list[str]:
    return [part for part in re.split(r"[/\\]+", _DRIVE.sub("", name)) if part not in ("", ".")]


def _list_names(folder: Path) -> list[str]:
    try:
        with os.scandir(folder) as entries:
            return [entry.name for entry in islice(entries, _MAX_ENTRIES)]
    except (OSError, ValueError):
        return []


def _list_folders(folder: Path) -> list[Path]:
    """Return the folders in a folder that are not hidden, sorted by name."""
    paths = (folder / name for name in _list_names(folder) if name[0] != ".")
    return sorted(path for path in paths if is_folder(path))


def _iter_ros_paths(name: str) -> Iterator[Path]:
    """Yield the paths at which ROS would install a package."""
    for prefix in _path_variable("AMENT_PREFIX_PATH"):
        yield prefix / "share" / name
    for folder in _path_variable("ROS_PACKAGE_PATH"):
        if folder.name == name:
            yield folder
        yield folder / name
        for sub in _list_folders(folder):
            yield sub / name


def _path_variable(name: str) -> list[Path]:
    return [Path(entry) for entry in os.environ.get(name, "").split(os.pathsep)[:50] if entry]


def _read_package_name(path: Path) -> str | None:
    try:
        with open_regular(path) as stream:
            text = stream.read(_MAX_BYTES)
    except (OSError, ValueError):
        return None
    match = re.search(rb"<name>\s*([^<\s]+)\s*</name>", text)
    return match[1].decode("utf-8", "replace") if match else None
