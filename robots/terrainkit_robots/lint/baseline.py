"""Accept the findings that a baseline file records, so that only new ones are reported.

{
  "version": 1,
  "robots": {
    "robots/arm.urdf": {"INR004": ["upper_link", "lower_link"]}
  }
}

An entry is a robot file relative to the folder of the baseline, the code of a rule, and the
subject of the finding. Lines and messages are not part of it, since edits elsewhere change them. A
subject is listed once for each finding.
"""

import json
import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, Self

import msgspec

from terrainkit.errors import ConfigError
from terrainkit.files.atomic_write import atomic_write
from terrainkit_robots.description.package_resolver import exists
from terrainkit_robots.description.xml.document import read_bytes
from terrainkit_robots.lint.check import Suppressed
from terrainkit_robots.lint.rule import Finding
from terrainkit_robots.lint.runner import Report, Skipped
from terrainkit_robots.text import count, display_path, group, names

Entries = Mapping[str, Sequence[str]]
"""Subjects of the accepted findings of a robot, by code of the rule."""


@dataclass(frozen=True, kw_only=True)
class _Content:
    """The content of a baseline file."""

    version: Literal[1]
    robots: Mapping[str, Entries]


@dataclass(frozen=True, kw_only=True)
class Baseline:
    """Findings that are accepted."""

    path: Path
    """The baseline file."""

    robots: Mapping[str, Entries] = field(default_factory=dict)
    """Accepted findings by robot file, relative to the folder of the baseline file."""

    @classmethod
    def read(cls, path: Path) -> Self:
        """Return the findings that a file records.

        Raises:
            RobotFileError: if the file cannot be read.
            ConfigError: if the file has another format.
        """
        try:
            # msgspec.json rejects file names that are not valid text.
            content = msgspec.convert(json.loads(read_bytes(path)), type=_Content)
        except (msgspec.MsgspecError, ValueError, RecursionError) as error:
            expected = "expected a file written by --write-baseline"
            raise ConfigError(f"baseline {path}: {error}; {expected}") from error
        return cls(path=path, robots=content.robots)

    def write(self) -> None:
        """Write the file."""
        content = {"version": 1, "robots": self.robots}
        with atomic_write(self.path, overwrite=True) as temporary:
            temporary.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")

    def updated(self, reports: Iterable[Report]) -> Self:
        """Return a baseline that accepts the errors and warnings of `reports`.

        Entries stay for robots without a report, and for rules that did not run. Entries for
        files that do not exist are removed.
        """
        folder = self.path.parent
        robots = {key: value for key, value in self.robots.items() if exists(folder / key)}
        for report in reports:
            key = self._key(report)
            entries = {c: v for c, v in robots.get(key, {}).items() if c not in report.completed}
            entries |= group(sorted(_counts(report).elements()))
            robots[key] = dict(sorted(entries.items()))
        return replace(self, robots={key: robots[key] for key in sorted(robots) if robots[key]})

    def accept(self, report: Report) -> Report:
        """Return a report without the findings that the baseline records.

        If a rule has more findings for a subject than recorded, all of them are reported, since
        they cannot be told apart. A recorded finding that no longer exists is reported as unused.
        """
        entries = self.robots.get(self._key(report), {})
        recorded = Counter((code, subject) for code in entries for subject in entries[code])
        found = _counts(report)
        file = display_path(self.path)
        known = {key for key in found if found[key] <= recorded[key]}
        reason = f"{count(sum(found[key] for key in known), 'finding')} accepted in {file}"
        kept, skipped = list[Finding](), list(report.skipped)
        for finding in report.findings:
            if finding.severity != "note" and (finding.code, finding.subject) in known:
                skipped.append(
                    Suppressed(code=finding.code, kind="suppressed", reason=reason, finding=finding)
                )
            else:
                kept.append(finding)
        unused = group(sorted(key for key in recorded - found if key[0] in report.completed))
        for code, subjects in unused.items():
            reason = f"no longer needed in {file}: {names(subjects)}"
            skipped.append(Skipped(code=code, kind="unused", reason=reason))
        return replace(report, findings=tuple(kept), skipped=tuple(skipped))

    def _key(self, report: Report) -> str:
        """Return the robot file relative to the folder of the baseline, with forward slashes."""
        file, folder = report.facts.model.file.absolute(), self.path.absolute().parent
        try:
            relative = os.path.relpath(file, folder)
        except ValueError:  # on another drive of Windows
            relative = str(file)
        return Path(relative).as_posix()


def _counts(report: Report) -> Counter[tuple[str, str]]:
    """Return the number of errors and warnings by code and subject. Notes need no acceptance."""
    return Counter((f.code, f.subject) for f in report.findings if f.severity != "note")
