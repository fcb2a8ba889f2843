"""Match the keys of a per-joint table to joints.

A key is the name of a joint, or a regular expression that matches whole names. Every joint must be
matched exactly once, and every key must match a joint, so that a missing joint or a misspelled key
is an error.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from terrainkit.errors import ConfigError
from terrainkit.toml_text import key_text
from terrainkit_robots.spec.pattern import compile_pattern, count_match_paths, max_length
from terrainkit_robots.text import closest, names, short

T = TypeVar("T")

_MAX_MATCH_PATHS = 3_000_000
"""Maximum number of paths in which all patterns of a table can match: about a second."""

_MIN_SIMILARITY = 0.75
"""Minimum similarity of a key to the joint that is suggested for it."""


@dataclass(frozen=True, kw_only=True)
class MatchProblem:
    """A joint that is not matched exactly once, or an invalid key."""

    subject: str
    """Name of the joint, or the key."""

    message: str
    """What is wrong."""


@dataclass(frozen=True, kw_only=True)
class Matching(Generic[T]):
    """Joints matched by the keys of a table."""

    values: Mapping[str, T]
    """Value of each joint that is matched exactly once, in the order of the joints."""

    unmatched: tuple[str, ...]
    """Joints that no key matches."""

    ambiguous: Mapping[str, tuple[str, ...]]
    """Keys of each joint that several keys match."""

    unused: Mapping[str, str]
    """Keys that match no joint, with a suggested joint, which may be empty."""

    invalid: Mapping[str, str]
    """Keys that are not valid patterns, with the reason."""

    def problems(self, what: str, *, allow_missing: bool = False) -> Iterator[MatchProblem]:
        """Yield what is wrong.

        Args:
            what: Name of the table.
            allow_missing: Whether joints without a key are allowed.
        """
        for key, reason in self.invalid.items():
            yield _problem(key, f"{_key(what, key)}: {reason}")
        for key, meant in self.unused.items():
            instead = f"; did you mean {meant}?" if meant else ""
            yield _problem(key, f"{_key(what, key)} matches no joint{instead}")
        for joint, keys in self.ambiguous.items():
            listed = names(map(key_text, keys), separator=" and ")
            message = f"joint {short(joint)} is matched by {listed} of {what}; expected one key"
            yield _problem(joint, message)
        if self.unmatched and not allow_missing:
            subject = f"joint {short(self.unmatched[0])} is"
            if len(self.unmatched) > 1:
                subject = f"joints {names(self.unmatched)} are"
            message = f"{subject} matched by no key of {what}; expected one key per joint"
            yield _problem(self.unmatched[0], message)


def _problem(subject: str, message: str) -> MatchProblem:
    return MatchProblem(subject=subject, message=message)


def _key(what: str, key: str) -> str:
    return f"{what}.{short(key_text(key))}"


def by_joint(table: Mapping[str, T], joints: Sequence[str], what: str = "table") -> dict[str, T]:
    """Return the value of each joint, in the order of `joints`.

    Args:
        table: Values by joint names or patterns.
        joints: Names of the joints.
        what: Name of the table in error messages.

    Raises:
        ConfigError: If a joint is not matched exactly once, or a key matches no joint.
    """
    matching = match_joints(table, joints)
    for problem in matching.problems(what):
        raise ConfigError(problem.message)
    return dict(matching.values)


def match_joints(table: Mapping[str, T], joints: Sequence[str]) -> Matching[T]:
    """Match the keys of a table to joints."""
    keys: dict[str, list[str]] = {joint: [] for joint in joints}
    unused: dict[str, str] = {}
    invalid: dict[str, str] = {}
    name_length, spent = max_length(joints), 0
    for key in table:
        if key in keys:
            keys[key].append(key)
            continue
        try:
            pattern = compile_pattern(key)
            cost = count_match_paths(key, name_length) * len(joints)
            if spent + cost > _MAX_MATCH_PATHS:
                raise ConfigError("slow to match against all joints; use names instead")
            spent += cost
        except ConfigError as error:
            invalid[key] = str(error)
            continue
        found = [joint for joint in joints if pattern.fullmatch(joint)]
        for joint in found:
            keys[joint].append(key)
        if not found:
            unused[key] = (
                closest(key, joints, _MIN_SIMILARITY) if len(unused) < _MAX_SUGGESTIONS else ""
            )
    return Matching(
        values={joint: table[found[0]] for joint, found in keys.items() if len(found) == 1},
        unmatched=tuple(joint for joint, found in keys.items() if not found),
        ambiguous={joint: tuple(found) for joint, found in keys.items() if len(found) > 1},
        unused=unused,
        invalid=invalid,
    )


_MAX_SUGGESTIONS = 20
"""Maximum number of unused keys for which a joint is suggested."""
