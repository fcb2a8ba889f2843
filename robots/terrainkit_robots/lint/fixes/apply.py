"""Fixes, applied: from what a robot's rules propose to files that those rules find nothing in.

All of it happens in memory, in rounds: fixes that do not touch each other are made, the result is
checked again, and what is found then is fixed in turn. Only `write_fixes` writes, and it writes to
the robot's own files and new ones near them, wherever else the file may point.
"""

import difflib
import hashlib
import os
import re
import stat
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from terrainkit.atomic_write import atomic_write
from terrainkit.errors import ExportError, TerrainkitError
from terrainkit_robots.description.fix import Edit, Fix, InsertChild, ReplaceBytes, WriteFile
from terrainkit_robots.description.model import RobotModel
from terrainkit_robots.description.xml.document import read_bytes
from terrainkit_robots.lint.fixes.edits import EditedBytes, EditError
from terrainkit_robots.lint.runner import Finding, Report
from terrainkit_robots.mesh.mesh_cache import MeshError

Look = Callable[[Mapping[Path, bytes]], Report]
"""Reads and checks a robot, with these contents in the place of the files of these paths."""

_MOST_ROUNDS = 50
"""So often a robot is checked again; fixes that wait for each other need a handful of rounds."""

_FOLDERS = {"urdf", "xacro", "mjcf", "xml", "robots"}
"""What the folder of the robot's file is called in a package, by custom."""

_NEW_FILES = frozenset({".stl", ".obj"})
"""What a fix may add is a mesh, whatever its name was made from."""


@dataclass(frozen=True, kw_only=True)
class Unfixed:
    """A finding that has a fix which was not made, or did not help."""

    finding: Finding

    reason: str
    """Why."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FixResult:
    """What fixes make of a robot. Nothing of it is written yet."""

    before: Mapping[Path, bytes]
    """What the files that change held, by the path under which they were read."""

    after: Mapping[Path, bytes]
    """What they are to hold."""

    new: Mapping[Path, bytes]
    """Files to be added."""

    fixed: tuple[Finding, ...]
    """What was found, and is not found any more."""

    unfixed: tuple[Unfixed, ...]
    """What could be fixed, and was not."""

    report: Report
    """What is found once the files are written."""


def fix_robot(file: Path, look: Look, *, unsafe: bool = False) -> FixResult:
    """Return what the fixes of a robot make of it; nothing is written.

    Args:
        file: The robot's file.
        look: Reads and checks it.
        unsafe: Whether fixes that change a number, a shape or another file are made, too.
    """
    report = look({})
    files = _Files(file)
    made: list[Finding] = []
    reasons: dict[_Key, str] = {}
    seen = {_state(files.now)}
    while len(seen) <= _MOST_ROUNDS:
        now, done, reasons = _round(files, report, unsafe=unsafe, made=made)
        if _state(now) in seen:
            reasons |= dict.fromkeys(map(_key, done), "its fix changes nothing, or undoes another")
            break
        seen.add(_state(now))
        files.now = now
        made += done
        report = look(files.contents(report.facts.model))
    left = {_key(finding) for finding in report.findings}
    changed = [path for path, data in files.before.items() if files.now.get(path, data) != data]
    return FixResult(
        before={files.given[path]: files.before[path] for path in changed},
        after={files.given[path]: files.now[path] for path in changed},
        new={files.given[path]: files.now[path] for path in files.now if path not in files.before},
        fixed=tuple({_key(f): f for f in made if _key(f) not in left}.values()),
        unfixed=tuple(
            Unfixed(finding=f, reason=reasons.get(_key(f), "too many fixes wait for each other"))
            for f in report.findings
            if f.fix is not None
        ),
        report=report,
    )


_Key = tuple[str, str, str]


def _key(finding: Finding) -> _Key:
    return finding.code, finding.subject, finding.message


def _state(now: Mapping[Path, bytes]) -> frozenset[tuple[Path, bytes]]:
    return frozenset((path, hashlib.sha256(data).digest()) for path, data in now.items())


def _package(folder: Path) -> Path:
    """Return the folder that is the robot's own: that of its package, if it is in one."""
    above = folder.parent
    return above if folder.name in _FOLDERS or (above / "package.xml").is_file() else folder


def _where(path: Path) -> Path:
    """Return where a path leads; unlike `Path.resolve`, of a loop of links, too."""
    return Path(os.path.realpath(path))


class _Files:
    """The files of a robot, each known by where its path leads."""

    def __init__(self, file: Path) -> None:
        self.folder = _where(file.parent)
        self.given: dict[Path, Path] = {_where(file): file}
        """The path that was given for each."""

        self.before: dict[Path, bytes] = {}
        """What those hold that fixes were to be made in."""

        self.now: dict[Path, bytes] = {}
        """What is to be in their place, and what is to be added."""

    def contents(self, model: RobotModel) -> dict[Path, bytes]:
        """Return what to read in the place of files, by every path that leads to them."""
        contents = self.now | {self.given[path]: data for path, data in self.now.items()}
        for source in model.sources:
            if _where(source) in self.now:
                contents[source] = self.now[_where(source)]
        return contents

    def text(self, path: Path) -> bytes:
        """Return what is in a file now."""
        if path not in self.before:
            self.before[path] = read_bytes(path)
        return self.now.get(path, self.before[path])


def _round(
    files: _Files, report: Report, *, unsafe: bool, made: Sequence[Finding]
) -> tuple[dict[Path, bytes], list[Finding], dict[_Key, str]]:
    """Make all fixes that can be made at once.

    Returns:
        What the files hold then, which findings were fixed, and why the others were not.
    """
    grown = {edit for finding in made for edit in _growing(finding)}
    stage = _Stage(files, report.facts.model)
    done: list[Finding] = []
    reasons: dict[_Key, str] = {}
    for finding in report.findings:
        if finding.fix is None:
            continue
        try:
            if finding.fix.safety != "safe" and not unsafe:
                raise EditError("its fix is unsafe: the robot would not stay the same")
            if not grown.isdisjoint(_growing(finding)):
                raise EditError("its fix was made, and did not help")
            stage.add(finding.fix)
        except (TerrainkitError, MeshError, OSError, ValueError, MemoryError) as error:
            reasons[_key(finding)] = str(error) or type(error).__name__
        else:
            done.append(finding)
    return stage.result(), done, reasons


def _growing(finding: Finding) -> Iterator[tuple[_Key, Edit]]:
    """Yield the edits that would make a file longer each time, if they did not help."""
    for edit in finding.fix.edits if finding.fix else ():
        if isinstance(edit, InsertChild | ReplaceBytes):
            source = replace(edit.source, line=0)
            yield _key(finding), replace(edit, source=source)


class _Stage:
    """Files with the fixes of one round in them."""

    def __init__(self, files: _Files, model: RobotModel) -> None:
        self._files = files
        self._model = model
        self._sources = {_where(source) for source in model.sources}
        self._texts: dict[Path, EditedBytes] = {}
        self._new: dict[Path, bytes] = {}

    def add(self, fix: Fix) -> None:
        """Make all edits of a fix, or none.

        Raises:
            TerrainkitError: if one of them cannot or may not be made.
        """
        if self._model.kind == "xacro":
            raise EditError("the robot is made from xacro, which no fix can change")
        edits: dict[Path, list[Edit]] = {}
        new: dict[Path, bytes] = {}
        for edit in fix.edits:
            if isinstance(edit, WriteFile):
                new[self._to_be_added(edit)] = edit.content()
            else:
                edits.setdefault(self._to_be_changed(edit.source.file), []).append(edit)
        added = {path: data for path, data in new.items() if self._is_new(path, data)}
        texts = {path: self._text(path) for path in edits}
        prepared = {path: texts[path].prepare(edits[path]) for path in edits}
        for path, each in prepared.items():
            texts[path].make(each)
        self._new |= added

    def result(self) -> dict[Path, bytes]:
        """Return what the files hold now."""
        edited = {path: text.result() for path, text in self._texts.items()}
        return self._files.now | edited | self._new

    def _text(self, path: Path) -> EditedBytes:
        if path not in self._texts:
            self._texts[path] = EditedBytes(self._files.text(path))
        return self._texts[path]

    def _to_be_changed(self, given: Path) -> Path:
        """Return where the path of a file leads, if it is one of the robot's own."""
        path = _where(given)
        if path not in self._sources:
            raise EditError(f"{given} is no text of this robot")
        if path not in self._files.given and not path.is_relative_to(self._files.folder):
            raise EditError(f"{given} is outside of {self._files.folder}: it is left as it is")
        self._files.given.setdefault(path, given)
        return path

    def _to_be_added(self, edit: WriteFile) -> Path:
        """Return where the path of a new file leads, if there may be one.

        That is in the folder of the robot, or of its package, as is meshes/ beside urdf/: the file
        names its meshes, and must not say where else something is written.
        """
        path = _where(edit.path.parent) / edit.path.name
        package = _package(self._files.folder)
        hidden = path.is_relative_to(package) and any(
            part.startswith(".") for part in path.relative_to(package).parts
        )
        if hidden or not path.is_relative_to(package):
            raise EditError(f"{edit.path} would be outside of {package}: nothing is written there")
        if path.suffix.lower() not in _NEW_FILES:
            raise EditError(f"{edit.path} would be no mesh, to go by its name")
        if not path.parent.is_dir():
            raise EditError(f"there is no folder {edit.path.parent}")
        short = Path(os.path.normpath(edit.path))  # without the .. of urdf/../meshes
        self._files.given.setdefault(path, short if _where(short) == path else edit.path)
        return path

    def _is_new(self, path: Path, data: bytes) -> bool:
        """Return whether a file is to be added; False if it is there already, the same."""
        there = self._new.get(path, self._files.now.get(path))
        if there is None:
            if not os.path.lexists(path):
                return True
            there = path.read_bytes() if _is_plain(path, len(data)) else None
        if there != data:
            raise EditError(f"{self._files.given[path]} is there, and is another file")
        return False


def _is_plain(path: Path, size: int) -> bool:
    """Return whether there is a plain file of that size."""
    status = path.stat(follow_symlinks=False)
    return stat.S_ISREG(status.st_mode) and status.st_size == size


def write_fixes(result: FixResult) -> None:
    """Write the files, the new ones before those that name them.

    Each is written whole or not at all, through links to where they lead, and keeps its mode.

    Raises:
        ExportError: if one cannot be written, or has changed since it was read.
    """
    for path, data in result.new.items():
        with atomic_write(path) as temporary:
            temporary.write_bytes(data)
    for path, data in result.after.items():
        _rewrite(path, result.before[path], data)


def _rewrite(path: Path, before: bytes, after: bytes) -> None:
    try:
        if read_bytes(path) != before:
            raise ExportError(f"{path} has changed since it was read; nothing was written to it")
        if not os.access(path, os.W_OK):
            raise ExportError(f"cannot write {path}: it is read-only")
        mode = stat.S_IMODE(path.stat().st_mode)
    except OSError as error:
        raise ExportError(f"cannot write {path}: {error.strerror or error}") from error
    with atomic_write(path, overwrite=True) as temporary:
        temporary.write_bytes(after)
        temporary.chmod(mode)


def unified_diff(result: FixResult) -> str:
    """Return the changes as text that `patch -p0` takes; new files have a line each."""
    parts = [f"New file {path} ({len(data)} bytes)\n" for path, data in result.new.items()]
    for path, before in result.before.items():
        parts += _diff(path, before, result.after[path])
    return "".join(parts)


def _diff(path: Path, before: bytes, after: bytes) -> Iterator[str]:
    old, new = _lines(before), _lines(after)
    for line in difflib.unified_diff(old, new, str(path), str(path)):
        yield line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n"


def _lines(data: bytes) -> list[str]:
    """Return the lines with their ends: not those that str would also see, such as U+2028."""
    try:
        text = data.decode()
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return re.findall(r"[^\n]*\n|[^\n]+", text)
