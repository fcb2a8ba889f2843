"""Tables by joint: the key of a table from which each joint takes its value.

A key that is the name of a joint stands for that joint. Any other key is a regular expression that
must match a whole name. Every joint must be matched exactly once, and every key must match a joint:
a forgotten joint or a misspelled key is an error, never a zero.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from terrainkit.errors import ConfigError
from terrainkit.settings.text import closest, truncate
from terrainkit.settings.toml_text import key_text
from terrainkit_robots.spec.pattern import compile_pattern, max_matches
from terrainkit_robots.text import names

T = TypeVar("T")

MAX_MATCHES = 3_000_000
"""Limit on the ways in which the patterns of a table can match its joints: a second of work."""

_MIN_RATIO = 0.75
"""Lowest similarity of a joint and its misspelling, 0 to 1."""

_MAX_SUGGESTIONS = 20
"""Number of unused keys for which a similar joint is searched, which takes time."""


@dataclass(frozen=True, kw_only=True)
class MatchError:
    """A joint that is not matched exactly once, or an invalid key."""

    name: str
    """The joint, or the key."""

    message: str
    """Description of the error."""


@dataclass(frozen=True, kw_only=True)
class JointMatches(Generic[T]):
    """The joints that the keys of a table match."""

    values: Mapping[str, T]
    """Value of each joint that is matched exactly once, in the order of the joints."""

    unmatched: tuple[str, ...]
    """Joints that no key matches."""

    duplicate: Mapping[str, tuple[str, ...]]
    """Keys of each joint that several keys match."""

    unused: Mapping[str, str]
    """Keys that match no joint, each with the most similar joint; empty if there is none."""

    invalid: Mapping[str, str]
    """Keys that are not valid patterns, and why."""

    def errors(self, table: str, *, partial: bool = False) -> Iterator[MatchError]:
        """Yield an error for each joint that is not matched once, and each invalid key.

        Args:
            table: Name of the table.
            partial: Whether joints may be missing.
        """
        for key, reason in self.invalid.items():
            yield MatchError(name=key, message=f"{table}.{truncate(key_text(key))} is {reason}")
        for key, joint in self.unused.items():
            suggestion = f"; did you mean {joint}?" if joint else ""
            message = f"{table}.{truncate(key_text(key))} matches no joint{suggestion}"
            yield MatchError(name=key, message=message)
        for joint, keys in self.duplicate.items():
            listed = names(map(key_text, keys), sep=" and ")
            message = (
                f"joint {truncate(joint)} is matched by {listed} of {table}; expected one of them"
            )
            yield MatchError(name=joint, message=message)
        if self.unmatched and not partial:
            subject = f"joint {truncate(self.unmatched[0])} is"
            if len(self.unmatched) > 1:
                subject = f"joints {names(self.unmatched)} are"
            message = f"{subject} matched by no key of {table}; expected one key for each joint"
            yield MatchError(name=self.unmatched[0], message=message)


def by_joint(table: Mapping[str, T], joints: Sequence[str], name: str = "table") -> dict[str, T]:
    """Return the value of each joint, in the order of `joints`.

    Args:
        table: Values by name or pattern of joints.
        joints: Names of the joints.
        name: Name of the table in error messages.

    Raises:
        ConfigError: if a joint is not matched exactly once, or a key matches no joint.
    """
    matches = match_joints(table, joints)
    for error in matches.errors(name):
        raise ConfigError(error.message)
    return dict(matches.values)


def match_joints(table: Mapping[str, T], joints: Sequence[str]) -> JointMatches[T]:
    """Return which joints the keys of a table match."""
    keys: dict[str, list[str]] = {joint: [] for joint in joints}
    unused: dict[str, str] = {}
    invalid: dict[str, str] = {}
    max_length, total = max(map(len, joints), default=0), 0
    for key in table:
        if key in keys:
            keys[key].append(key)
            continue
        try:
            pattern = compile_pattern(key)
            cost = max_matches(key, max_length) * len(joints)
            if total + cost > MAX_MATCHES:
                raise ConfigError("slow to match against all joints; use names instead")
            total += cost
        except ConfigError as error:
            invalid[key] = str(error)
            continue
        matched = [joint for joint in joints if pattern.fullmatch(joint)]
        for joint in matched:
            keys[joint].append(key)
        if not matched:
            is_searched = len(unused) < _MAX_SUGGESTIONS
            unused[key] = closest(key, joints, _MIN_RATIO) if is_searched else ""
    return JointMatches(
        values={joint: table[matched[0]] for joint, matched in keys.items() if len(matched) == 1},
        unmatched=tuple(joint for joint, matched in keys.items() if not matched),
        duplicate={joint: tuple(matched) for joint, matched in keys.items() if len(matched) > 1},
        unused=unused,
        invalid=invalid,
    )
