"""Rule on characters in names."""

import re
from collections.abc import Sequence

from terrainkit.settings.text import truncate
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint, Link
from terrainkit_robots.lint.rule import Severity, Violation, Violations, rule
from terrainkit_robots.text import count, names

_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@rule("NAM002", "invalid-name", "warning")
def invalid_name(robot: Facts) -> Violations:
    """A name contains characters that some simulators do not support.

    USD, which Isaac Sim and Isaac Lab use, supports letters, digits and underscores. It replaces
    all other characters by underscores. Patterns in a configuration that was written for the URDF
    then match nothing, and two names may become the same, which is an error. On fixed joints and in
    MJCF, other characters are only a note.

    Fix:
        Use letters, digits and underscores, and start with a letter.

    Source:
        OpenUSD, TfMakeValidIdentifier.
    """
    links = [link for link in robot.model.links if link.name and not link.virtual]
    joints = [joint for joint in robot.model.joints if joint.name and joint.kind != "fixed"]
    if robot.model.kind != "mjcf":
        joints = [joint for joint in robot.model.joints if joint.name]
    fixed = {id(joint) for joint in joints if joint.kind == "fixed"}
    renamed: dict[Severity, dict[str, Link | Joint]] = {"warning": {}, "note": {}}
    kinds: tuple[tuple[str, Sequence[Link | Joint]], ...] = (("links", links), ("joints", joints))
    for kind, items in kinds:
        conflicts = _conflicts(items)
        for valid, same in conflicts.items():
            yield Violation(
                element=same[1],
                message=f"names of {kind} {names(item.name for item in same)}: USD renames all of "
                f"them to {truncate(valid)}; expected names that stay different",
                severity="error",
                measured={"names": len(same)},
            )
        reported = {item.name for same in conflicts.values() for item in same}
        for item in items:
            if item.name not in reported and not _IDENTIFIER.fullmatch(item.name):
                is_note = robot.model.kind == "mjcf" or id(item) in fixed
                renamed["note" if is_note else "warning"].setdefault(item.name, item)
    for severity, found in renamed.items():
        if not found:
            continue
        first = next(iter(found.values()))
        yield Violation(
            element=first,
            severity=severity,
            message=f"{count(len(found), 'name')} with other characters than letters, digits and "
            f"underscores: {names(found)}; USD renames {truncate(first.name)} to "
            f"{truncate(_valid(first.name))}",
            measured={"names": len(found)},
        )


def _valid(name: str) -> str:
    """Return the name that USD uses instead."""
    return re.sub(r"[^A-Za-z_]", "_", name[:1]) + re.sub(r"[^A-Za-z0-9_]", "_", name[1:])


def _conflicts(items: Sequence[Link | Joint]) -> dict[str, list[Link | Joint]]:
    """Return the items with different names that USD renames to the same name."""
    groups: dict[str, dict[str, Link | Joint]] = {}
    for item in items:
        groups.setdefault(_valid(item.name), {}).setdefault(item.name, item)
    return {valid: list(same.values()) for valid, same in groups.items() if len(same) > 1}
