"""Rule on the names of mirrored links and joints."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from functools import cached_property

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.name_words import MAX_NAME_LENGTH, split_name
from terrainkit_robots.description.model import Joint, Link
from terrainkit_robots.lint.rule import Violation, Violations, rule

_MIN_PAIRS = 4
"""Minimum number of mirrored pairs from which a naming pattern is derived."""

_MIN_COUNT = 3
"""A difference between mirrored names that occurs this often marks the side. A misspelling occurs
in one joint, and possibly again in its link."""

_MIN_REGULAR = 0.75
"""Minimum share of mirrored pairs that follow the pattern. With fewer, there is no pattern."""

_MIN_SIMILARITY = 0.75
"""Minimum share of common letters for a name to be a misspelling. Below, the names are different on
purpose, such as two tools in the left and the right hand."""


@dataclass(frozen=True, kw_only=True)
class _MirrorPair:
    """Two links or two joints that are mirror images of each other."""

    left: Link | Joint
    right: Link | Joint

    in_legs: bool
    """Whether they are part of legs. Then they correspond even if their names are not similar."""

    @property
    def kind(self) -> str:
        return "joint" if isinstance(self.left, Joint) else "link"

    @cached_property
    def word_pairs(self) -> frozenset[tuple[str, str]]:
        """The words of the left name that differ, each with the word in the right name."""
        left, right = split_name(self.left.name), split_name(self.right.name)
        if len(left) == len(right):
            pairs = [(a, b) for a, b in zip(left, right, strict=True) if a != b]
        else:
            steps = SequenceMatcher(None, left, right, autojunk=False).get_opcodes()
            pairs = [
                ("".join(left[a:b]), "".join(right[c:d]))
                for step, a, b, c, d in steps
                if step != "equal"
            ]
        return frozenset(pairs)


def _strip_common(left: str, right: str) -> tuple[str, str]:
    """Return two words without their common prefix and suffix. Numbers are not changed."""
    if left.isdigit() or right.isdigit():
        return left, right
    while left and right and left[0] == right[0]:
        left, right = left[1:], right[1:]
    while left and right and left[-1] == right[-1]:
        left, right = left[:-1], right[:-1]
    return left, right


@rule("NAM001", "inconsistent-name", "warning")
def inconsistent_name(robot: Facts) -> Violations:
    """A name does not follow the pattern of the other names.

    Configurations address joints and links by patterns such as `.*_thigh_joint`. A joint with
    another spelling is silently left out and gets no stiffness, default position or penalty.

    Fix:
        Rename it and update all references, or check that every pattern in your configuration
        matches it.

    Source:
        legged_gym matches names by substring, Isaac Lab by regular expression.
    """
    pairs = [
        p for p in _mirror_pairs(robot) if len(p.left.name + p.right.name) <= 2 * MAX_NAME_LENGTH
    ]
    sides = _Sides(pairs)
    model_names = _ModelNames(robot, sides)
    for kind in ("joint", "link"):
        of_kind = [pair for pair in pairs if pair.kind == kind]
        irregular = [pair for pair in of_kind if not sides.is_consistent(pair)]
        if len(of_kind) < _MIN_PAIRS or len(irregular) > (1 - _MIN_REGULAR) * len(of_kind):
            continue
        if kind == "link":
            irregular += _unmatched_links(robot, sides)
        for pair in irregular:
            yield from model_names.misspelled(pair)


def _mirror_pairs(robot: Facts) -> Iterator[_MirrorPair]:
    """Yield the joints and top links of mirrored bodies."""
    legs = robot.leg_bodies
    for pair in robot.mirror.pairs:
        left, right = robot.bodies[pair.left], robot.bodies[pair.right]
        in_legs = pair.left in legs and pair.right in legs
        if left.joint is not None and right.joint is not None:
            yield _MirrorPair(left=left.joint, right=right.joint, in_legs=in_legs)
        if not (left.top.virtual or right.top.virtual):
            yield _MirrorPair(left=left.top, right=right.top, in_legs=in_legs)


class _Sides:
    """The words that mark left and right in the names of a robot.

    They are derived from frequent differences between mirrored names, not from a list of words,
    because legs may be numbered or called port and starboard.
    """

    def __init__(self, pairs: Sequence[_MirrorPair]) -> None:
        word_pairs = [words for pair in pairs for words in pair.word_pairs]
        self._words = _common(word_pairs)
        self._letters = _common([_strip_common(*words) for words in word_pairs])
        self._known = {word for words in self._words for word in words}
        counts = Counter(
            words
            for pair in pairs
            if self.is_consistent(pair)
            and len(split_name(pair.left.name)) == len(split_name(pair.right.name))
            for words in pair.word_pairs
        )
        ordered = [words for words, _ in reversed(counts.most_common())]  # the most common wins
        self._to_right = dict(ordered)
        self._to_left = {right: left for left, right in ordered}

    def is_consistent(self, pair: _MirrorPair) -> bool:
        """Return whether two names differ only by the side."""
        return all(
            words in self._words
            or (_strip_common(*words) in self._letters and self._known.isdisjoint(words))
            for words in pair.word_pairs
        )

    def to_right(self, name: str) -> str | None:
        """Return the right counterpart of a left name, or None if the name has no side."""
        return _translate(name, self._to_right)

    def to_left(self, name: str) -> str | None:
        """Return the left counterpart of a right name, or None if the name has no side."""
        return _translate(name, self._to_left)

    def pattern(self, name: str) -> str:
        """Return a name with its sides replaced by `*`."""
        sides = self._to_right.keys() | self._to_left.keys()
        return "".join("*" if word in sides else word for word in split_name(name))


def _common(items: Iterable[tuple[str, str]]) -> set[tuple[str, str]]:
    return {item for item, count in Counter(items).items() if count >= _MIN_COUNT}


class _ModelNames:
    """The names of a robot, with counts of their patterns and words."""

    def __init__(self, robot: Facts, sides: _Sides) -> None:
        self._sides = sides
        self._existing = {
            "link": {link.name for link in robot.model.links},
            "joint": {joint.name for joint in robot.model.joints},
        }
        all_names = set.union(*self._existing.values())
        analyzed = [name for name in all_names if len(name) <= MAX_NAME_LENGTH]
        self._patterns = Counter(sides.pattern(name) for name in analyzed)
        self._words = Counter(word for name in analyzed for word in set(split_name(name)))

    def misspelled(self, pair: _MirrorPair) -> Violations:
        """Yield a violation for the name of a pair that is misspelled, if there is one."""
        right, left = self._sides.to_right(pair.left.name), self._sides.to_left(pair.right.name)
        existing = self._existing[pair.kind]
        if (right is None and left is None) or right in existing or left in existing:
            return  # names without sides, or two pairs with swapped names
        if not (
            pair.in_legs
            or _is_misspelling(right, pair.right.name)
            or _is_misspelling(left, pair.left.name)
        ):
            return
        left_counts, right_counts = self._counts(pair.left.name), self._counts(pair.right.name)
        item = pair.right
        mirror = pair.left
        expected = right
        if left_counts < right_counts:
            item = pair.left
            mirror = pair.right
            expected = left
        is_clear = expected and left_counts != right_counts
        yield Violation(
            element=item,
            message=f"name of the mirror image of {pair.kind} {mirror.name}: got {item.name}; "
            f"expected {expected if is_clear else 'a name that differs only by the side'}",
            certainty="likely",
        )

    def _counts(self, name: str) -> tuple[int, int]:
        """Return how many names have the same pattern, and how many contain its rarest word."""
        words = [self._words[word] for word in split_name(name)]
        return self._patterns[self._sides.pattern(name)], min(words, default=0)


def _unmatched_links(robot: Facts, sides: _Sides) -> Iterator[_MirrorPair]:
    """Yield the merged links of mirrored bodies where one link on each side has no counterpart."""
    for pair in robot.mirror.pairs:
        left, right = robot.bodies[pair.left].links[1:], robot.bodies[pair.right].links[1:]
        expected = {sides.to_right(link.name) or link.name: link for link in left}
        present = {link.name: link for link in right}
        only_left = [link for name, link in expected.items() if name not in present]
        only_right = [link for name, link in present.items() if name not in expected]
        if len(only_left) == len(only_right) == 1:
            yield _MirrorPair(left=only_left[0], right=only_right[0], in_legs=False)


def _translate(name: str, translation: Mapping[str, str]) -> str | None:
    """Return a name with its words replaced, or None if no word is in `translation`."""
    other = "".join(translation.get(word, word) for word in split_name(name))
    return None if other == name else other


def _is_misspelling(expected: str | None, name: str) -> bool:
    """Return whether a name is similar to the expected one. Different numbers do not count."""
    if expected is None or re.sub(r"\d+", "", expected) == re.sub(r"\d+", "", name):
        return False
    return SequenceMatcher(None, expected, name, autojunk=False).ratio() >= _MIN_SIMILARITY
