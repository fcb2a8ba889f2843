"""Merge findings that repeat over joints or links into one entry with a list."""

import re
from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass

from terrainkit_robots.description.model import RobotModel
from terrainkit_robots.lint.rule import Finding

_MAX_LISTED = 12
"""Maximum number of elements that the list of a group shows."""

_TOKEN = re.compile(r"\d{1,3}(?:,\d{3})+(?![\w,])|[\w./+%-]*[\w%]")
_LIST = re.compile(rf"(?:{_TOKEN.pattern})(?:, (?:{_TOKEN.pattern}))*(?:, \.\.\.)?")
_NUMBER = re.compile(r"[-+]?\d+(?:[.,]\d+)*(?:e[-+]?\d+)?%?")

_SUBJECT, _VALUE = "\0", "\1"
"""Placeholders in a message for the name of the subject and for a value that may differ."""


@dataclass(frozen=True, kw_only=True)
class FindingGroup:
    """Findings of one rule whose messages differ only in names and numbers."""

    first: Finding
    text: str
    """Message of the first finding."""

    others: tuple[str, ...] = ()
    """Subject of each other finding, with the values that differ in parentheses."""

    noun: str = "more"
    """What the subjects are, such as `joints`."""

    @property
    def also(self) -> str:
        """List of the other findings, such as `also 2 joints: FL_hip (1.2), FR_hip (1.3)`."""
        if not self.others:
            return ""
        noun = self.noun.removesuffix("s") if len(self.others) == 1 else self.noun
        hidden = len(self.others) - _MAX_LISTED
        listed = ", ".join(self.others[:_MAX_LISTED])
        return f"also {len(self.others)} {noun}: {listed}" + (
            f", and {hidden} more" if hidden > 0 else ""
        )


def group_findings(
    model: RobotModel,
    findings: Sequence[Finding],
    text: Callable[[Finding], str] = lambda finding: finding.message,
) -> list[FindingGroup]:
    """Return the findings as groups, in the order of the first finding of each group.

    Args:
        model: The robot.
        findings: Its findings.
        text: Returns the text of a finding. By default, this is its message.
    """
    joints = {joint.name for joint in model.joints}
    links = {link.name for link in model.links}
    groups: dict[tuple[object, ...], list[tuple[Finding, list[str]]]] = {}
    for finding in findings:
        template, values = _template(text(finding), finding.subject, joints | links)
        safety = finding.fix.safety if finding.fix is not None else ""
        key = (finding.code, finding.severity, finding.certainty, finding.hint, finding.file)
        groups.setdefault((*key, safety, template), []).append((finding, values))
    return [
        FindingGroup(
            first=members[0][0],
            text=text(members[0][0]),
            others=_list_others(members),
            noun=_noun({finding.subject for finding, _ in members}, joints, links),
        )
        for members in groups.values()
    ]


def _template(text: str, subject: str, names: Set[str]) -> tuple[str, list[str]]:
    """Return `text` with placeholders for the subject, names and numbers, and their values."""
    values: list[str] = []
    basename = subject.rpartition("/")[2]
    if subject:
        text = re.sub(rf"(?<!\w){re.escape(subject)}(?!\w)", _SUBJECT, text)

    def replace_list(match: re.Match[str]) -> str:
        items = match[0].removesuffix(", ...").split(", ")
        if len(items) > 1 and names >= set(items):
            values.append(match[0])
            return _VALUE
        return _TOKEN.sub(replace, match[0])

    def replace(match: re.Match[str]) -> str:
        token = match[0]
        if basename and token.rpartition("/")[2] == basename:
            return _SUBJECT  # a path of the file that is the subject
        if token in names or _NUMBER.fullmatch(token):
            values.append(token)
            return _VALUE
        return token

    return _LIST.sub(replace_list, text), values


def _list_others(members: Sequence[tuple[Finding, list[str]]]) -> tuple[str, ...]:
    columns = zip(*(values for _, values in members), strict=True)
    differs = [len(set(column)) > 1 for column in columns]
    others = []
    for finding, values in members[1:]:
        name = finding.subject or f"line {finding.line}"
        shown = [
            # Without separators of thousands, which would read as several numbers.
            value.replace(",", "") if _NUMBER.fullmatch(value) else value
            for value, differ in zip(values, differs, strict=True)
            if differ
        ]
        others.append(f"{name} ({', '.join(shown)})" if shown else name)
    return tuple(others)


def _noun(subjects: Set[str], joints: Set[str], links: Set[str]) -> str:
    if subjects <= joints:
        return "joints"
    return "links" if subjects <= links else "more"
