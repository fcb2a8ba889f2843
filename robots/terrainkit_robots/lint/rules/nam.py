"""Names: whether configurations, simulators and people will take them for what they are."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from functools import cached_property

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint, Link
from terrainkit_robots.lint.rule import Violation, rule
from terrainkit_robots.text import names, short

_FEWEST_TWINS = 4
"""Of fewer mirrored names nobody could tell a pattern."""

_SEEN = 3
"""A difference between mirrored names seen so often is the side; a slip is in a joint's name, and
perhaps again in its link's."""

_REGULAR = 0.75
"""Where this share of mirrored names differ by the side only, the others break a pattern."""

_ALIKE = 0.75
"""Share of common letters from which on two names are the same with a slip, rather than two names.
Left and right hands may well hold two tools."""

_MOST_LETTERS = 100
"""Longer names are not looked into."""

_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+|[^A-Za-z\d]+")


# Siblings.


@dataclass(frozen=True, kw_only=True)
class _Twins:
    """The names of two links or two joints that are mirror images of each other."""

    left: Link | Joint
    right: Link | Joint

    sure: bool
    """Whether they belong together even if their names are nothing alike: joints of legs."""

    @property
    def what(self) -> str:
        return "joint" if isinstance(self.left, Joint) else "link"

    @cached_property
    def differences(self) -> frozenset[tuple[str, str]]:
        """Words of the left one, and what the right one has in their place."""
        left, right = _words(self.left.name), _words(self.right.name)
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


def _words(name: str) -> list[str]:
    return _WORD.findall(name)


def _trimmed(left: str, right: str) -> tuple[str, str]:
    """Return two words without what they begin and end with in common; numbers as they are."""
    if left.isdigit() or right.isdigit():
        return left, right
    while left and right and left[0] == right[0]:
        left, right = left[1:], right[1:]
    while left and right and left[-1] == right[-1]:
        left, right = left[:-1], right[:-1]
    return left, right


@rule("NAM001", "inconsistent-name", "warning")
def inconsistent_name(robot: Facts) -> Iterator[Violation]:
    """A name breaks the pattern that its siblings follow.

    Configurations address joints and links by patterns such as .*_thigh_joint. The one that is
    spelt otherwise is left out without a word: its stiffness, its default position or its penalty
    are those of no joint.

    Fix:
        Rename it, wherever it is used, or check that every pattern in your configuration matches
        it, too.

    Source:
        legged_gym looks for names as substrings, Isaac Lab by regular expressions.
    """
    twins = [t for t in _twins(robot) if len(t.left.name + t.right.name) <= 2 * _MOST_LETTERS]
    sides = _Sides(twins)
    known = _Names(robot, sides)
    for what in ("joint", "link"):
        kind = [each for each in twins if each.what == what]
        odd = [each for each in kind if not sides.explain(each)]
        if len(kind) < _FEWEST_TWINS or len(odd) > (1 - _REGULAR) * len(kind):
            continue
        if what == "link":
            odd += _carried(robot, sides)
        for each in odd:
            yield from known.odd(each)


def _twins(robot: Facts) -> Iterator[_Twins]:
    """Yield the joints and links whose bodies are mirrored."""
    legs = robot.leg_bodies
    for pair in robot.mirror.pairs:
        left, right = robot.bodies[pair.left], robot.bodies[pair.right]
        sure = pair.left in legs and pair.right in legs
        if left.joint is not None and right.joint is not None:
            yield _Twins(left=left.joint, right=right.joint, sure=sure)
        if not (left.top.virtual or right.top.virtual):
            yield _Twins(left=left.top, right=right.top, sure=sure)


class _Sides:
    """What left and right are called in the names of a robot: what they differ by again and again.

    No list of words says so: legs may be numbered, or be called port and starboard.
    """

    def __init__(self, twins: Sequence[_Twins]) -> None:
        differences = [pair for each in twins for pair in each.differences]
        self._words = _often(differences)
        self._letters = _often([_trimmed(*pair) for pair in differences])
        self._known = {word for pair in self._words for word in pair}
        seen = Counter(
            pair
            for each in twins
            if self.explain(each) and len(_words(each.left.name)) == len(_words(each.right.name))
            for pair in each.differences
        )
        often = [pair for pair, _ in reversed(seen.most_common())]  # the most common one wins
        self._right = dict(often)
        self._left = {right: left for left, right in often}

    def explain(self, twins: _Twins) -> bool:
        """Return whether two names differ by the side only."""
        return all(
            pair in self._words
            or (_trimmed(*pair) in self._letters and self._known.isdisjoint(pair))
            for pair in twins.differences
        )

    def right(self, name: str) -> str | None:
        """Return what the mirror image of a left one is called; None for a name without a side."""
        return _translated(name, self._right)

    def left(self, name: str) -> str | None:
        """Return what the mirror image of a right one is called; None for one without a side."""
        return _translated(name, self._left)

    def form(self, name: str) -> str:
        """Return a name without its sides."""
        sides = self._right.keys() | self._left.keys()
        return "".join("*" if word in sides else word for word in _words(name))


def _often(items: Iterable[tuple[str, str]]) -> set[tuple[str, str]]:
    return {item for item, count in Counter(items).items() if count >= _SEEN}


class _Names:
    """The names of a robot, and how usual each one is."""

    def __init__(self, robot: Facts, sides: _Sides) -> None:
        self._sides = sides
        self._taken = {
            "link": {link.name for link in robot.model.links},
            "joint": {joint.name for joint in robot.model.joints},
        }
        every = set.union(*self._taken.values())
        brief = [name for name in every if len(name) <= _MOST_LETTERS]
        self._forms = Counter(sides.form(name) for name in brief)
        self._words = Counter(word for name in brief for word in set(_words(name)))

    def odd(self, twins: _Twins) -> Iterator[Violation]:
        """Yield the one of two twins whose name has a slip, if one has."""
        right, left = self._sides.right(twins.left.name), self._sides.left(twins.right.name)
        taken = self._taken[twins.what]
        if (right is None and left is None) or right in taken or left in taken:
            return  # names without sides, or two pairs that are named crosswise
        if not (twins.sure or _is_slip(right, twins.right.name) or _is_slip(left, twins.left.name)):
            return
        counts = self._uses(twins.left.name), self._uses(twins.right.name)
        odd, twin, wanted = twins.right, twins.left, right
        if counts[0] < counts[1]:
            odd, twin, wanted = twins.left, twins.right, left
        yield Violation(
            subject=odd.name,
            source=odd.source,
            message=f"{twins.what} {odd.name} is the mirror image of {twin.name}, but the names "
            "differ by more than the side, unlike those of the others"
            + (f"; wanted {wanted}" if wanted and counts[0] != counts[1] else ""),
            certainty="likely",
        )

    def _uses(self, name: str) -> tuple[int, int]:
        """Return how many names have the form of this one, and how many its rarest word."""
        words = [self._words[word] for word in _words(name)]
        return self._forms[self._sides.form(name)], min(words, default=0)


def _carried(robot: Facts, sides: _Sides) -> Iterator[_Twins]:
    """Yield links that mirrored bodies carry, if one on either side has no counterpart."""
    for pair in robot.mirror.pairs:
        left, right = robot.bodies[pair.left].links[1:], robot.bodies[pair.right].links[1:]
        expected = {sides.right(link.name) or link.name: link for link in left}
        present = {link.name: link for link in right}
        alone = [link for name, link in expected.items() if name not in present]
        others = [link for name, link in present.items() if name not in expected]
        if len(alone) == len(others) == 1:
            yield _Twins(left=alone[0], right=others[0], sure=False)


def _translated(name: str, translation: Mapping[str, str]) -> str | None:
    """Return a name with other sides; None if it has none."""
    other = "".join(translation.get(word, word) for word in _words(name))
    return None if other == name else other


def _is_slip(expected: str | None, name: str) -> bool:
    """Return whether a name is the expected one but for a slip; numbers are no slip."""
    if expected is None or re.sub(r"\d+", "", expected) == re.sub(r"\d+", "", name):
        return False
    return SequenceMatcher(None, expected, name, autojunk=False).ratio() >= _ALIKE


# Identifiers.

_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@rule("NAM002", "invalid-name", "warning")
def invalid_name(robot: Facts) -> Iterator[Violation]:
    """Names have characters that not every simulator takes.

    USD, and with it Isaac Sim and Isaac Lab, knows letters, digits and underscores. It puts an
    underscore in the place of everything else, after which the patterns of a configuration that was
    written for the URDF match nothing, and two names may have become one.

    Fix:
        Use letters, digits and underscores, and begin with a letter.

    Source:
        OpenUSD, TfMakeValidIdentifier.
    """
    links = [link for link in robot.model.links if link.name and not link.virtual]
    joints = [joint for joint in robot.model.joints if joint.name and joint.kind != "fixed"]
    if robot.model.kind != "mjcf":
        joints = [joint for joint in robot.model.joints if joint.name]
    renamed: dict[str, Link | Joint] = {}
    every: tuple[tuple[str, Sequence[Link | Joint]], ...] = (("links", links), ("joints", joints))
    for what, items in every:
        clashing = _clashing(items)
        for valid, same in clashing.items():
            yield _clash(what, valid, same)
        told = {item.name for same in clashing.values() for item in same}
        for item in items:
            if item.name not in told and not _IDENTIFIER.fullmatch(item.name):
                renamed.setdefault(item.name, item)
    if renamed:
        first = next(iter(renamed.values()))
        count = f"{len(renamed)} names have" if len(renamed) > 1 else "a name has"
        yield Violation(
            subject=first.name,
            source=first.source,
            message=f"{count} other characters than letters, digits and underscores: "
            f"{names(renamed)}; USD would call the first {short(_valid(first.name))}",
            measured={"names": len(renamed)},
        )


def _valid(name: str) -> str:
    """Return what USD calls it."""
    return re.sub(r"[^A-Za-z_]", "_", name[:1]) + re.sub(r"[^A-Za-z0-9_]", "_", name[1:])


def _clashing(items: Sequence[Link | Joint]) -> dict[str, list[Link | Joint]]:
    """Return those whose names are different, and become the same."""
    groups: dict[str, dict[str, Link | Joint]] = {}
    for item in items:
        groups.setdefault(_valid(item.name), {}).setdefault(item.name, item)
    return {valid: list(same.values()) for valid, same in groups.items() if len(same) > 1}


def _clash(what: str, valid: str, same: Sequence[Link | Joint]) -> Violation:
    return Violation(
        subject=same[1].name,
        source=same[1].source,
        message=f"{what} {names(item.name for item in same)} would all be {short(valid)} in USD, "
        "which takes letters, digits and underscores; wanted names that stay different",
        severity="error",
        measured={"names": len(same)},
    )


# Substrings.

_LEG_WORDS = ("thigh", "calf", "shank", "knee", "hip")
"""What configurations penalize contacts of."""


@rule("NAM003", "ambiguous-substring", "info", needs=("legs",))
def ambiguous_substring(robot: Facts) -> Iterator[Violation]:
    """Words that configurations look for match other links than one would think.

    legged_gym takes every link whose name contains `foot` for a foot, ends the episode when one
    with `base` touches the ground, and penalizes those with `thigh` or `calf`. With none that
    matches, a reward is never given; with too many, the robot is punished for its sensors.

    Fix:
        Look at what each word of your configuration matches, and use the one that is given here.

    Source:
        legged_gym, `find` of asset.foot_name, penalize_contacts_on and terminate_after_contacts_on
        in the names of all bodies; case counts.
    """
    said = [*_said_of_feet(robot), *_said_of_others(robot)]
    if said:
        yield Violation(
            subject=robot.model.title,
            source=robot.model.source,
            message="; ".join(said),
            certainty="likely",
        )


def _said_of_feet(robot: Facts) -> Iterator[str]:
    feet = [leg.foot for leg in robot.legs]
    others = [link.name for link in robot.links if link.name not in feet]
    missed = [name for name in feet if "foot" not in name]
    extra = [name for name in others if "foot" in name]
    word = _exact_word(feet, others)
    instead = f" ({word} matches the feet and nothing else)" if word else ""
    if len(missed) == len(feet) and not extra:
        yield f"foot matches no link, the feet are {names(feet)}{instead}"
    elif missed:
        yield f"foot does not match {names(missed)}, on which the robot stands{instead}"
    elif extra:
        yield f"foot matches {names(extra)}, too, besides the feet{instead}"


def _exact_word(feet: Sequence[str], others: Sequence[str]) -> str | None:
    """Return the shortest run of words that all feet have, and no other link."""
    words = _words(feet[0])[:_MOST_LETTERS]
    runs = {"".join(words[a:b]) for a in range(len(words)) for b in range(a + 1, len(words) + 1)}
    whole = [run for run in runs if run[0].isalpha() and run[-1].isalnum()]
    for run in sorted(whole, key=lambda run: (len(run), run)):
        if all(run in name for name in feet) and not any(run in name for name in others):
            return run
    return None


def _said_of_others(robot: Facts) -> Iterator[str]:
    trunk = {link.name for link in robot.bodies[0].links}
    legs = robot.leg_bodies
    in_legs = {link.name for index in legs for link in robot.bodies[index].links}
    every = [link.name for link in robot.links]
    matches = [name for name in every if "base" in name]
    astray = [name for name in matches if name not in trunk]
    if not matches:
        yield f"base matches no link, the trunk is {short(robot.bodies[0].top.name)}"
    elif astray:
        yield f"base matches {names(astray)}, too, which is not of the trunk"
    for word in _LEG_WORDS:
        astray = [name for name in every if word in name and name not in in_legs | trunk]
        if astray:
            yield f"{word} matches {names(astray)}, too, which is not of a leg"
