"""Packages: which file on this machine a name in a robot's description means.

`package://`, `model://` and `$(find ...)` name a ROS package, and ROS is seldom there when a robot
is trained. So a package is looked for where it was given, up the tree, in ROS's own variables and
in the folders around; a few hundred names are looked at, and nothing is fetched.
"""

import os
import re
import stat
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Literal
from urllib.parse import unquote

FoundBy = Literal["path", "package", "search", "nothing"]

_PACKAGE = re.compile(
    r"(?:(?:package|model):/+|\$\(\s*find\s+(?=[^()\s]+\s*\)))(?P<name>[^/\\()\s]+)\s*\)?"
    r"(?:[/\\]+(?P<rest>.*))?",
    re.DOTALL,
)
_DRIVE = re.compile(r"[A-Za-z]:[/\\]")
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:/")

_MOST_ANCESTORS = 16
"""Folders above the file that are asked for a package.xml."""

_NEAR_ANCESTORS = 4
"""Folders above the file in which a search begins: file, urdf/, package, workspace."""

_MOST_ENTRIES = 400
"""Entries of a folder that are looked at; of a home or temporary folder that is not all."""

_MOST_PARTS = 64
"""Parts of a path that is put right or searched for; no package is that deep."""

_LONGEST = 4096
"""Letters of a name that is looked for; no system has longer paths."""

_MOST_BYTES = 100_000
"""A package.xml is a page of text; of a larger file the beginning is read."""


class Packages:
    """Where one robot file looks for others, each package searched for once."""

    def __init__(self, file: Path, packages: Mapping[str, Path]) -> None:
        """Search from the folder of `file`; `packages` are those given by name."""
        self._folder = file.parent
        self._given = packages
        self._found: dict[str, tuple[tuple[Path, FoundBy], ...]] = {}
        self._names: dict[Path, str | None] = {}

    def resolve(self, filename: str) -> tuple[Path, FoundBy]:
        """Return where a file is that is called so, and how that was found.

        By `path` if it is where the name says, by `package` if a package was given or has a
        package.xml, by `search` if the folders around have it, or have it in other letters;
        `nothing` comes with the place where it was expected.
        """
        if len(filename) > _LONGEST:
            return _joined(self._folder, filename[:_LONGEST]), "nothing"
        match = _PACKAGE.fullmatch(filename)
        if match is not None:
            return self._in_package(match["name"], match["rest"] or "")
        return self._plain(filename)

    def find(self, name: str) -> Path | None:
        """Return the folder of a package, or None if it is not found."""
        candidates = self._candidates(name)
        return candidates[0][0] if candidates else None

    def _plain(self, filename: str) -> tuple[Path, FoundBy]:
        name = filename
        if filename.lower().startswith("file:"):
            name = re.sub(r"(?i)file:(//)?", "", filename)
            name = name if exists(self._folder / name) else unquote(name)
        elif _SCHEME.match(filename) and not _DRIVE.match(filename):
            return _joined(self._folder, filename.rpartition("/")[2]), "nothing"  # not on here
        written = _joined(self._folder, name)
        if name and "\0" not in name and exists(written):
            return written, "path"
        found = self._put_right(name) or self._around(name)
        return (found, "search") if found else (written, "nothing")

    def _put_right(self, name: str) -> Path | None:
        """Return the file that is there in other letters, or with slashes for backslashes."""
        if is_absolute(name):
            return None
        return find_ignore_case(self._folder, name)

    def _around(self, name: str) -> Path | None:
        """Return a file with the same end of its path, in the folders around."""
        parts = _parts(name)
        rooted = is_absolute(name)
        while parts and parts[0] in ("..", "."):
            parts = parts[1:]
        if not parts or len(parts) > _MOST_PARTS:
            return None
        ends = [parts[k:] for k in range(len(parts))] if rooted else [parts]
        for end in ends:
            if len(end) == 1:
                continue
            for folder in self._near:
                if exists(folder.joinpath(*end)):
                    return folder.joinpath(*end)
        return self._by_name(parts[-1])

    def _by_name(self, name: str) -> Path | None:
        """Return a file of that name in a folder of meshes nearby."""
        for folder in self._near[:2]:
            for sub in (
                folder,
                *(f for f in _subfolders(folder) if f.name.lower() in _MESH_FOLDERS),
            ):
                if exists(sub / name):
                    return sub / name
        return None

    def _in_package(self, name: str, rest: str) -> tuple[Path, FoundBy]:
        if not rest:  # what should be a package is the name of the file
            alone = _joined(self._folder, name)
            return alone, "search" if exists(alone) and not is_folder(alone) else "nothing"
        candidates = self._candidates(name)
        for folder, how in candidates:
            if exists(_joined(folder, rest)):
                return _joined(folder, rest), how
        for folder, _ in candidates:
            found = find_ignore_case(folder, rest)
            if found is not None:
                return found, "search"
        found = self._around(rest)
        if found is not None:
            return found, "search"
        if candidates:
            return _joined(candidates[0][0], rest), candidates[0][1]
        return _joined(self._folder, rest), "nothing"

    def _candidates(self, name: str) -> tuple[tuple[Path, FoundBy], ...]:
        if name not in self._found:
            places: dict[Path, FoundBy] = {}
            for folder, how in self._places(name):
                places.setdefault(folder, how)
            self._found[name] = tuple(places.items())
        return self._found[name]

    def _places(self, name: str) -> Iterator[tuple[Path, FoundBy]]:
        """Yield the folders that may be the package, the surest first."""
        if name in self._given:
            yield self._given[name], "package"
            return
        if name in (".", "..") or "\0" in name:
            return
        for folder in self._above:
            if self._declared(folder) == name:
                yield folder, "package"
        for folder in self._above:
            if folder.name == name:
                yield folder, "search"
        for folder in _ros_folders(name):
            if self._declared(folder) == name or exists(folder):
                yield folder, "package"
        yield from self._beside(name)

    def _beside(self, name: str) -> Iterator[tuple[Path, FoundBy]]:
        for folder in self._near:
            if is_folder(folder / name):
                yield folder / name, "package" if self._declared(folder / name) else "search"
        for folder in self._near:
            for sub in _subfolders(folder):
                if self._declared(sub) == name:
                    yield sub, "package"
                if is_folder(sub / name):
                    yield sub / name, "search"

    @cached_property
    def _above(self) -> tuple[Path, ...]:
        """The folder of the file and those above it, the nearest first."""
        try:
            folder = self._folder.resolve()
        except (OSError, RuntimeError, ValueError):  # RuntimeError: a loop of links
            folder = self._folder.absolute()
        return (folder, *islice(folder.parents, _MOST_ANCESTORS))

    @property
    def _near(self) -> tuple[Path, ...]:
        return tuple(f for f in self._above[:_NEAR_ANCESTORS] if f != f.parent)

    def _declared(self, folder: Path) -> str | None:
        """Return the name in the folder's package.xml, if there is one."""
        if folder not in self._names:
            self._names[folder] = _package_name(folder / "package.xml")
        return self._names[folder]


_MESH_FOLDERS = {"meshes", "mesh", "assets", "stl", "dae", "obj", "visual", "collision"}


def resolve_in(folders: Iterable[Path], filename: str) -> tuple[Path, FoundBy]:
    """Return where a file is that one of these folders has, and how that was found.

    By `path` if one has it as it is written, by `search` if one has it in other letters; `nothing`
    comes with the place in the first of them.
    """
    places, filename = list(folders), filename[:_LONGEST]
    for folder in places:
        if "\0" not in filename and exists(_joined(folder, filename)):
            return _joined(folder, filename), "path"
    if not is_absolute(filename):
        for folder in places:
            found = find_ignore_case(folder, filename)
            if found is not None:
                return found, "search"
    return _joined(places[0], filename), "nothing"


def is_package_uri(filename: str) -> bool:
    """Return whether a file is named by its package: `package://`, `model://` or `$(find ...)`."""
    return _PACKAGE.fullmatch(filename) is not None


def is_absolute(filename: str) -> bool:
    """Return whether a name starts at the root of a file system, that of Windows included."""
    name = re.sub(r"(?i)^file:(//)?", "", filename)
    return name.startswith(("/", "~", "\\\\")) or _DRIVE.match(name) is not None


def find_ignore_case(folder: Path, name: str) -> Path | None:
    """Return the file that `name` means if case does not count, and a backslash is a slash."""
    parts = _parts(name)
    if not parts or len(parts) > _MOST_PARTS:
        return None
    at = folder
    for part in parts:
        if part == ".." or exists(at / part):
            at = at / part
            continue
        alike = [entry for entry in _entries(at) if entry.lower() == part.lower()]
        if len(alike) != 1:
            return None
        at = at / alike[0]
    return at if exists(at) else None


def filename_on_disk(filename: str, path: Path) -> str | None:
    """Return `filename` as it has to be written for `path`, if it has other letters or backslashes.

    None if it is right, if only the folder is another one, or if it starts at a root.
    """
    if is_absolute(filename) or len(filename) > _LONGEST:
        return None
    prefix = _prefix(filename)
    pieces = re.split(r"([/\\]+)", filename[len(prefix) :])  # names, and what parts them
    named = [k for k in range(0, len(pieces), 2) if pieces[k] not in ("", ".", "..")]
    real = _names_on_disk(path, len(named))
    if [pieces[k].lower() for k in named] != [name.lower() for name in real]:
        return None
    for k, name in zip(named, real, strict=True):
        pieces[k] = name
    right = prefix + "".join(pieces).replace("\\", "/")
    return right if right != filename else None


def _prefix(filename: str) -> str:
    """Return what comes before the names of folders: a scheme, and the package."""
    match = _PACKAGE.fullmatch(filename) or re.match(r"(?i)(?P<rest>)file:(//)?", filename)
    if match is None:
        return ""
    return filename[: match.start("rest")] if match["rest"] else filename[: match.end()]


def _names_on_disk(path: Path, count: int) -> list[str]:
    """Return the last names of a path as its folders list them, not as it is written.

    A file system that takes no heed of case finds a file under any letters.
    """
    names: list[str] = []
    for at in (path, *path.parents):
        if len(names) == count:
            break
        if at.name not in ("", ".", ".."):
            entries = _entries(at.parent)
            alike = [entry for entry in entries if entry.lower() == at.name.lower()]
            names.append(alike[0] if len(alike) == 1 and at.name not in entries else at.name)
    return names[::-1]


def exists(path: Path) -> bool:
    """Return whether there is something at `path`; False for a name that cannot be one."""
    return _mode(path) is not None


def is_folder(path: Path) -> bool:
    """Return whether there is a folder at `path`."""
    mode = _mode(path)
    return mode is not None and stat.S_ISDIR(mode)


def _mode(path: Path) -> int | None:
    try:
        return path.stat().st_mode
    except (OSError, ValueError):  # too long, a loop of links, a NUL, no permission
        return None


def _joined(folder: Path, name: str) -> Path:
    """Return a path in `folder`, as written; `folder` itself for a name that can be none."""
    if "\0" in name:
        return folder / name.replace("\0", "")
    return folder / name if is_absolute(name) else folder / name.lstrip("/")


def _parts(name: str) -> list[str]:
    return [part for part in re.split(r"[/\\]+", _DRIVE.sub("", name)) if part not in ("", ".")]


def _entries(folder: Path) -> list[str]:
    try:
        with os.scandir(folder) as entries:
            return [entry.name for entry in islice(entries, _MOST_ENTRIES)]
    except (OSError, ValueError):
        return []


def _subfolders(folder: Path) -> list[Path]:
    """Return the folders in a folder, without those that are hidden, by name."""
    try:
        with os.scandir(folder) as entries:
            first = list(islice(entries, _MOST_ENTRIES))
            return sorted(
                Path(entry.path) for entry in first if entry.name[0] != "." and entry.is_dir()
            )
    except (OSError, ValueError):
        return []


def _ros_folders(name: str) -> Iterator[Path]:
    """Yield where ROS would have the package."""
    for prefix in _variable("AMENT_PREFIX_PATH"):
        yield prefix / "share" / name
    for folder in _variable("ROS_PACKAGE_PATH"):
        if folder.name == name:
            yield folder
        yield folder / name
        for sub in _subfolders(folder):
            yield sub / name


def _variable(name: str) -> list[Path]:
    return [Path(entry) for entry in os.environ.get(name, "").split(os.pathsep)[:50] if entry]


def _package_name(path: Path) -> str | None:
    mode = _mode(path)
    if mode is None or not stat.S_ISREG(mode):
        return None
    try:
        with path.open("rb") as stream:
            text = stream.read(_MOST_BYTES)
    except OSError:
        return None
    match = re.search(rb"<name>\s*([^<\s]+)\s*</name>", text)
    return match[1].decode("utf-8", "replace") if match else None
