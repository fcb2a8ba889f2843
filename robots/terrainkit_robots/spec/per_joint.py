"""Tables by joint: which key of a table each joint takes its value from.

A key that is the name of a joint is that joint. Any other is a regular expression, which has to
match the whole of a name. Every joint has to be matched exactly once, and every key has to match:
a joint that was forgotten, or a key with a slip in it, is an error and not a zero.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from terrainkit.errors import ConfigError
from terrainkit.toml_text import key_text
from terrainkit_robots.spec.pattern import compiled, longest_of, ways
from terrainkit_robots.text import closest, names, truncate

T = TypeVar("T")

_MOST_WAYS = 3_000_000
"""The patterns of a table may match its joints in so many ways in all: a second of work."""

_CLOSE = 0.75
"""Share of common letters from which a joint is what a key was meant for."""


@dataclass(frozen=True, kw_only=True)
class Clash:
    """A joint that is not matched exactly once, or a key that does not work."""

    subject: str
    """The joint, or the key."""

    message: str
    """What is wrong with it."""


@dataclass(frozen=True, kw_only=True)
class Matching(Generic[T]):
    """What the keys of a table match."""

    values: Mapping[str, T]
    """Value of each joint that is matched exactly once, in the order of the joints."""

    unmatched: tuple[str, ...]
    """Joints that no key matches."""

    doubled: Mapping[str, tuple[str, ...]]
    """Keys of each joint that is matched by several."""

    idle: Mapping[str, str]
    """Keys that match no joint, with the joint that each may be meant for; empty for none."""

    refused: Mapping[str, str]
    """Keys that are no pattern, and why."""

    def clashes(self, what: str, *, partial: bool = False) -> Iterator[Clash]:
        """Yield what is wrong.

        Args:
            what: Name of the table.
            partial: Whether joints may be left out.
        """
        for key, reason in self.refused.items():
            yield _clash(key, f"{_key(what, key)} is {reason}")
        for key, meant in self.idle.items():
            instead = f"; did you mean {meant}?" if meant else ""
            yield _clash(key, f"{_key(what, key)} matches no joint{instead}")
        for joint, keys in self.doubled.items():
            listed = names(map(key_text, keys), separator=" and ")
            yield _clash(
                joint,
                f"joint {truncate(joint)} is matched by {listed} of {what}; wanted one of them",
            )
        if self.unmatched and not partial:
            subject = f"joint {truncate(self.unmatched[0])} is"
            if len(self.unmatched) > 1:
                subject = f"joints {names(self.unmatched)} are"
            message = f"{subject} matched by no key of {what}; wanted one for each joint"
            yield _clash(self.unmatched[0], message)


def _clash(subject: str, message: str) -> Clash:
    return Clash(subject=subject, message=message)


def _key(what: str, key: str) -> str:
    return f"{what}.{truncate(key_text(key))}"


def by_joint(table: Mapping[str, T], joints: Sequence[str], what: str = "table") -> dict[str, T]:
    """Return the value of each joint, in the order of `joints`.

    Args:
        table: Values by names of joints, or patterns of those.
        joints: The joints.
        what: What to call the table in the error.

    Raises:
        ConfigError: if a joint is not matched exactly once, or a key matches none.
    """
    matching = match_joints(table, joints)
    for clash in matching.clashes(what):
        raise ConfigError(clash.message)
    return dict(matching.values)


def match_joints(table: Mapping[str, T], joints: Sequence[str]) -> Matching[T]:
    """Return what the keys of a table match among `joints`."""
    keys: dict[str, list[str]] = {joint: [] for joint in joints}
    idle: dict[str, str] = {}
    refused: dict[str, str] = {}
    longest, spent = longest_of(joints), 0
    for key in table:
        if key in keys:
            keys[key].append(key)
            continue
        try:
            pattern = compiled(key)
            cost = ways(key, longest) * len(joints)
            if spent + cost > _MOST_WAYS:
                raise ConfigError("slow to match against all joints; use names instead")
            spent += cost
        except ConfigError as error:
            refused[key] = str(error)
            continue
        found = [joint for joint in joints if pattern.fullmatch(joint)]
        for joint in found:
            keys[joint].append(key)
        if not found:
            idle[key] = closest(key, joints, _CLOSE) if len(idle) < _MOST_MEANT else ""
    return Matching(
        values={joint: table[found[0]] for joint, found in keys.items() if len(found) == 1},
        unmatched=tuple(joint for joint, found in keys.items() if not found),
        doubled={joint: tuple(found) for joint, found in keys.items() if len(found) > 1},
        idle=idle,
        refused=refused,
    )


_MOST_MEANT = 20
"""So many slips get a suggestion: to look for one takes a while."""
