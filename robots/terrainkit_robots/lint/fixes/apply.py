"""Apply the fixes of findings to the files of a robot.

Fixes are applied in memory, in rounds: all fixes that do not overlap are applied, the robot is
checked again, and new findings are fixed in the next round. Only `write_fixes` writes, and only to
the robot's own files and to new files near them, regardless of the paths in the robot's file.
"""

import difflib
import hashlib
import os
import re
import stat
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from terrainkit.errors import ExportError, TerrainkitError
from terrainkit.files.atomic_write import atomic_write
from terrainkit_robots.description.fix import Edit, Fix, InsertChild, ReplaceBytes, WriteFile
from terrainkit_robots.description.model import RobotModel
from terrainkit_robots.description.xml.document import read_bytes
from terrainkit_robots.lint.fixes.edits import EditedBytes, EditError
from terrainkit_robots.lint.rule import Finding
from terrainkit_robots.lint.runner import Report
from terrainkit_robots.mesh.mesh_cache import MeshError
from terrainkit_robots.text import display_path

CheckContents = Callable[[Mapping[Path, bytes]], Report]
"""Loads and checks a robot. The argument replaces the content of files, by path."""

_MAX_ROUNDS = 50
"""Maximum number of rounds. Fixes that depend on each other need a few."""

_ROBOT_FOLDERS = {"urdf", "xacro", "mjcf", "xml", "robots"}
"""Conventional names of the folder of the robot's file in a package."""

_NEW_SUFFIXES = frozenset({".stl", ".obj"})
"""Suffixes of files that a fix may create."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FixResult:
    """The result of fixing a robot. Nothing is written yet."""

    before: Mapping[Path, bytes]
    """Original contents of the changed files, by the path under which they were read."""

    after: Mapping[Path, bytes]
    """Fixed contents of the changed files."""

    new: Mapping[Path, bytes]
    """Contents of the files to create."""

    report: Report
    """The report on the fixed robot, with the findings that were fixed and those that were not."""


def fix_robot(
    file: Path, check: CheckContents, *, report: Report | None = None, unsafe: bool = False
) -> FixResult:
    """Apply the fixes of a robot in memory. Nothing is written.

    Args:
        file: The robot's file.
        check: Function that loads and checks the robot.
        report: The report on the unchanged files, if there is one already.
        unsafe: Whether to apply fixes that change a number, a shape or another file.
    """
    report = report or check({})
    files = _Files(file)
    applied: list[Finding] = []
    reasons: dict[_Key, str] = {}
    seen = {_state(files.current)}
    while len(seen) <= _MAX_ROUNDS:
        current, done, reasons = _apply_round(files, report, unsafe=unsafe, applied=applied)
        if _state(current) in seen:
            reasons |= dict.fromkeys(map(_key, done), "the fix has no effect or reverts another")
            break
        seen.add(_state(current))
        files.current = current
        applied += done
        report = check(files.contents(report.facts.model))
    left = {_key(finding) for finding in report.findings}
    changed = [p for p, data in files.original.items() if files.current.get(p, data) != data]
    created = [path for path in files.current if path not in files.original]
    return FixResult(
        before={files.path[p]: files.original[p] for p in changed},
        after={files.path[p]: files.current[p] for p in changed},
        new={files.path[p]: files.current[p] for p in created},
        report=replace(
            report,
            fixed=tuple({_key(f): f for f in applied if _key(f) not in left}.values()),
            unfixed=tuple(
                (f, reasons.get(_key(f), f"not done after {_MAX_ROUNDS} rounds"))
                for f in report.findings
                if f.fix is not None and (unsafe or f.fix.safety == "safe")
            ),
        ),
    )


_Key = tuple[str, str, str]


def _key(finding: Finding) -> _Key:
    return finding.code, finding.subject, finding.message


def _state(contents: Mapping[Path, bytes]) -> frozenset[tuple[Path, bytes]]:
    return frozenset((path, hashlib.sha256(data).digest()) for path, data in contents.items())


def _package(folder: Path) -> Path:
    """Return the folder of the robot's package, or the folder itself if there is no package."""
    parent = folder.parent
    return parent if folder.name in _ROBOT_FOLDERS or (parent / "package.xml").is_file() else folder


def _resolve(path: Path) -> Path:
    """Return the target of a path. Unlike `Path.resolve`, this accepts loops of links."""
    return Path(os.path.realpath(path))


class _Files:
    """The files of a robot, by resolved path."""

    def __init__(self, file: Path) -> None:
        self.folder = _resolve(file.parent)
        self.path: dict[Path, Path] = {_resolve(file): file}
        """The path under which each file was read."""

        self.original: dict[Path, bytes] = {}
        """Original contents of the files that a fix edits."""

        self.current: dict[Path, bytes] = {}
        """Current contents of changed and new files."""

    def contents(self, model: RobotModel) -> dict[Path, bytes]:
        """Return the current contents by every path that leads to a file."""
        contents = self.current | {self.path[p]: data for p, data in self.current.items()}
        for source in model.sources:
            if _resolve(source) in self.current:
                contents[source] = self.current[_resolve(source)]
        return contents

    def read(self, path: Path) -> bytes:
        """Return the current content of a file."""
        if path not in self.original:
            self.original[path] = read_bytes(path)
        return self.current.get(path, self.original[path])


def _apply_round(
    files: _Files, report: Report, *, unsafe: bool, applied: Sequence[Finding]
) -> tuple[dict[Path, bytes], list[Finding], dict[_Key, str]]:
    """Apply all fixes that do not overlap.

    Returns:
        The new contents, the findings whose fixes were applied, and the reasons for the others.
    """
    inserted = {edit for finding in applied for edit in _insertions(finding)}
    batch = _Batch(files, report.facts.model)
    done: list[Finding] = []
    reasons: dict[_Key, str] = {}
    for finding in report.findings:
        if finding.fix is None or not (unsafe or finding.fix.safety == "safe"):
            continue
        try:
            # A fix that is found again after it was applied would be applied in every round.
            if not inserted.isdisjoint(_insertions(finding)):
                raise EditError("the fix was applied without effect")
            batch.add(finding.fix)
        except (TerrainkitError, MeshError, OSError, ValueError, MemoryError) as error:
            reasons[_key(finding)] = str(error) or type(error).__name__
        else:
            done.append(finding)
    return batch.result(), done, reasons


def _insertions(finding: Finding) -> Iterator[tuple[_Key, Edit]]:
    """Yield the edits that would make a file longer in each round if they had no effect."""
    for edit in finding.fix.edits if finding.fix else ():
        if isinstance(edit, InsertChild | ReplaceBytes):
            source = replace(edit.source, line=0)
            yield _key(finding), replace(edit, source=source)


class _Batch:
    """The files with the fixes of one round."""

    def __init__(self, files: _Files, model: RobotModel) -> None:
        self._files = files
        self._model = model
        self._sources = {_resolve(source) for source in model.sources}
        self._edited: dict[Path, EditedBytes] = {}
        self._new: dict[Path, bytes] = {}

    def add(self, fix: Fix) -> None:
        """Apply all edits of a fix, or none.

        Raises:
            TerrainkitError: if an edit is not possible or not allowed.
        """
        if self._model.kind == "xacro":
            raise EditError("xacro files cannot be fixed")
        edits: dict[Path, list[Edit]] = {}
        new: dict[Path, bytes] = {}
        for edit in fix.edits:
            if isinstance(edit, WriteFile):
                new[self._new_path(edit)] = edit.content()
            else:
                edits.setdefault(self._source_path(edit.source.file), []).append(edit)
        created = {path: data for path, data in new.items() if self._is_new(path, data)}
        edited = {path: self._edited_bytes(path) for path in edits}
        replacements = {path: edited[path].prepare(edits[path]) for path in edits}
        for path, prepared in replacements.items():
            edited[path].apply(prepared)
        self._new |= created

    def result(self) -> dict[Path, bytes]:
        """Return the current contents of the files."""
        edited = {path: file.result() for path, file in self._edited.items()}
        return self._files.current | edited | self._new

    def _edited_bytes(self, path: Path) -> EditedBytes:
        if path not in self._edited:
            self._edited[path] = EditedBytes(self._files.read(path))
        return self._edited[path]

    def _source_path(self, file: Path) -> Path:
        """Return the resolved path of a file, if it belongs to the robot."""
        path = _resolve(file)
        if path not in self._sources:
            raise EditError(f"{display_path(file)} is not a file of this robot")
        if path not in self._files.path and not path.is_relative_to(self._files.folder):
            folder = display_path(self._files.folder)
            raise EditError(f"{display_path(file)} is outside of {folder} and is not changed")
        self._files.path.setdefault(path, file)
        return path

    def _new_path(self, edit: WriteFile) -> Path:
        """Return the resolved path of a new file, if it may be created.

        It must be in the folder of the robot or of its package, such as meshes/ beside urdf/. The
        robot's file defines the names of meshes, but must not select other folders for writing.
        """
        path = _resolve(edit.path.parent) / edit.path.name
        package = _package(self._files.folder)
        is_hidden = path.is_relative_to(package) and any(
            part.startswith(".") for part in path.relative_to(package).parts
        )
        name = display_path(edit.path)
        if is_hidden or not path.is_relative_to(package):
            raise EditError(f"{name} is outside of {display_path(package)} and is not written")
        if path.suffix.lower() not in _NEW_SUFFIXES:
            expected = " or ".join(sorted(_NEW_SUFFIXES))
            raise EditError(f"suffix of the new file {name}: expected {expected}")
        if not path.parent.is_dir():
            raise EditError(f"the folder {display_path(edit.path.parent)} does not exist")
        normal = Path(os.path.normpath(edit.path))  # without the .. of urdf/../meshes
        self._files.path.setdefault(path, normal if _resolve(normal) == path else edit.path)
        return path

    def _is_new(self, path: Path, data: bytes) -> bool:
        """Return whether a file has to be created, or False if it exists with the same content."""
        existing = self._new.get(path, self._files.current.get(path))
        if existing is None:
            if not os.path.lexists(path):
                return True
            status = path.stat(follow_symlinks=False)
            is_same_size = stat.S_ISREG(status.st_mode) and status.st_size == len(data)
            existing = path.read_bytes() if is_same_size else None
        if existing != data:
            name = display_path(self._files.path[path])
            raise EditError(f"{name} exists with different content")
        return False


def write_fixes(result: FixResult) -> None:
    """Write the fixed files. New files are written before the files that refer to them.

    Each file is replaced atomically and keeps its mode. Symbolic links are followed.

    Raises:
        ExportError: if a file cannot be written, or has changed since it was read.
    """
    for path, data in result.new.items():
        with atomic_write(path) as temporary:
            temporary.write_bytes(data)
    for path, data in result.after.items():
        _rewrite(path, result.before[path], data)


def _rewrite(path: Path, before: bytes, after: bytes) -> None:
    try:
        if read_bytes(path) != before:
            raise ExportError(f"{path} has changed since it was read and is not written")
        if not os.access(path, os.W_OK):
            raise ExportError(f"cannot write {path}: the file is read-only")
        mode = stat.S_IMODE(path.stat().st_mode)
    except OSError as error:
        raise ExportError(f"cannot write {path}: {error.strerror or error}") from error
    with atomic_write(path, overwrite=True) as temporary:
        temporary.write_bytes(after)
        temporary.chmod(mode)


def unified_diff(result: FixResult) -> str:
    """Return the changes as a diff for `patch -p0`, with one line per new file."""
    parts = [
        f"New file {display_path(path)} ({len(data)} bytes)\n" for path, data in result.new.items()
    ]
    for path, before in result.before.items():
        parts += _diff(path, before, result.after[path])
    return "".join(parts)


def _diff(path: Path, before: bytes, after: bytes) -> Iterator[str]:
    old, new, name = _lines(before), _lines(after), display_path(path)
    for line in difflib.unified_diff(old, new, name, name):
        yield line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n"


def _lines(data: bytes) -> list[str]:
    """Return the lines with their line ends. Other separators (U+2028) do not split lines."""
    try:
        text = data.decode()
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return re.findall(r"[^\n]*\n|[^\n]+", text)
