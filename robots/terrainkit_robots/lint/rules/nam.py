"""NAM: rules on the names of links and joints."""

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from functools import cached_property

import numpy as np

from terrainkit.settings.text import truncate
from terrainkit_robots.analysis.bodies.kinematics import joint_axis
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.mirror import swap_sides
from terrainkit_robots.description.model import Joint, Link
from terrainkit_robots.lint.rule import Severity, Violation, rule
from terrainkit_robots.text import count, names

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

_MAX_LENGTH = 100
"""Maximum length of a name that is analyzed."""

_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+|[^A-Za-z\d]+")


# NAM001: names of mirrored links and joints.


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
def inconsistent_name(robot: Facts) -> Iterator[Violation]:
    """A name does not follow the pattern of the other names.

    Configurations address joints and links by patterns such as `.*_thigh_joint`. A joint with
    another spelling is silently left out and gets no stiffness, default position or penalty.

    Fix:
        Rename it and update all references, or check that every pattern in your configuration
        matches it.

    Source:
        legged_gym matches names by substring, Isaac Lab by regular expression.
    """
    pairs = [p for p in _mirror_pairs(robot) if len(p.left.name + p.right.name) <= 2 * _MAX_LENGTH]
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
            and len(_words(pair.left.name)) == len(_words(pair.right.name))
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
        return "".join("*" if word in sides else word for word in _words(name))


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
        analyzed = [name for name in all_names if len(name) <= _MAX_LENGTH]
        self._patterns = Counter(sides.pattern(name) for name in analyzed)
        self._words = Counter(word for name in analyzed for word in set(_words(name)))

    def misspelled(self, pair: _MirrorPair) -> Iterator[Violation]:
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
        item, mirror, expected = pair.right, pair.left, right
        if left_counts < right_counts:
            item, mirror, expected = pair.left, pair.right, left
        is_clear = expected and left_counts != right_counts
        yield Violation(
            subject=item.name,
            source=item.source,
            message=f"name of the mirror image of {pair.kind} {mirror.name}: got {item.name}; "
            f"expected {expected if is_clear else 'a name that differs only by the side'}",
            certainty="likely",
        )

    def _counts(self, name: str) -> tuple[int, int]:
        """Return how many names have the same pattern, and how many contain its rarest word."""
        words = [self._words[word] for word in _words(name)]
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
    other = "".join(translation.get(word, word) for word in _words(name))
    return None if other == name else other


def _is_misspelling(expected: str | None, name: str) -> bool:
    """Return whether a name is similar to the expected one. Different numbers do not count."""
    if expected is None or re.sub(r"\d+", "", expected) == re.sub(r"\d+", "", name):
        return False
    return SequenceMatcher(None, expected, name, autojunk=False).ratio() >= _MIN_SIMILARITY


# NAM002: valid identifiers.

_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@rule("NAM002", "invalid-name", "warning")
def invalid_name(robot: Facts) -> Iterator[Violation]:
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
    renamed: dict[Severity, dict[str, Link | Joint]] = {"warning": {}, "info": {}}
    kinds: tuple[tuple[str, Sequence[Link | Joint]], ...] = (("links", links), ("joints", joints))
    for kind, items in kinds:
        conflicts = _conflicts(items)
        for valid, same in conflicts.items():
            yield _conflict_violation(kind, valid, same)
        reported = {item.name for same in conflicts.values() for item in same}
        for item in items:
            if item.name not in reported and not _IDENTIFIER.fullmatch(item.name):
                is_note = robot.model.kind == "mjcf" or id(item) in fixed
                renamed["info" if is_note else "warning"].setdefault(item.name, item)
    for severity, found in renamed.items():
        if not found:
            continue
        first = next(iter(found.values()))
        yield Violation(
            subject=first.name,
            source=first.source,
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


def _conflict_violation(kind: str, valid: str, same: Sequence[Link | Joint]) -> Violation:
    return Violation(
        subject=same[1].name,
        source=same[1].source,
        message=f"names of {kind} {names(item.name for item in same)}: USD renames all of them to "
        f"{truncate(valid)}; expected names that stay different",
        severity="error",
        measured={"names": len(same)},
    )


# NAM003: substrings that configurations match.

_LEG_WORDS = ("thigh", "calf", "shank", "knee", "hip")
"""Words by which configurations select the links whose contacts they penalize."""


@rule("NAM003", "ambiguous-substring", "info", needs=("legs",))
def ambiguous_substring(robot: Facts) -> Iterator[Violation]:
    """A substring that configurations use matches unexpected links.

    legged_gym treats every link whose name contains `foot` as a foot, ends the episode when a link
    with `base` touches the ground, and penalizes contacts of links with `thigh` or `calf`. If no
    link matches, the reward is always zero. If too many links match, the robot is penalized for
    contacts of its sensors.

    Fix:
        Check what each substring in your configuration matches, and use the suggested one.

    Source:
        legged_gym: asset.foot_name, penalize_contacts_on and terminate_after_contacts_on are
        case-sensitive substrings of body names.
    """
    parts = [*_foot_matches(robot), *_other_matches(robot)]
    if parts:
        yield Violation(
            subject=robot.model.title,
            source=robot.model.source,
            message="; ".join(parts),
            certainty="likely",
        )


def _foot_matches(robot: Facts) -> Iterator[str]:
    feet = [leg.foot for leg in robot.legs]
    others = [link.name for link in robot.links if link.name not in feet]
    missed = [name for name in feet if "foot" not in name]
    extra = [name for name in others if "foot" in name]
    word = _unique_substring(feet, others)
    suggestion = f" ('{word}' matches exactly the feet)" if word else ""
    if len(missed) == len(feet) and not extra:
        yield f"'foot' matches no link; the feet are {names(feet)}{suggestion}"
    elif missed:
        yield f"'foot' does not match the feet {names(missed)}{suggestion}"
    elif extra:
        yield f"'foot' also matches {names(extra)}, which are not feet{suggestion}"


def _unique_substring(feet: Sequence[str], others: Sequence[str]) -> str | None:
    """Return the shortest run of words that all feet contain and no other link contains."""
    words = _words(feet[0])[:_MAX_LENGTH]
    runs = {"".join(words[a:b]) for a in range(len(words)) for b in range(a + 1, len(words) + 1)}
    whole = [run for run in runs if run[0].isalpha() and run[-1].isalnum()]
    for run in sorted(whole, key=lambda run: (len(run), run)):
        if all(run in name for name in feet) and not any(run in name for name in others):
            return run
    return None


def _other_matches(robot: Facts) -> Iterator[str]:
    trunk = {link.name for link in robot.bodies[0].links}
    in_legs = {link.name for index in robot.leg_bodies for link in robot.bodies[index].links}
    links = [link.name for link in robot.links]
    matches = [name for name in links if "base" in name]
    extra = [name for name in matches if name not in trunk]
    if not matches:
        yield f"'base' matches no link; the trunk is {truncate(robot.bodies[0].top.name)}"
    elif extra:
        yield f"'base' also matches {names(extra)}, not part of the trunk"
    for word in _LEG_WORDS:
        extra = [name for name in links if word in name and name not in in_legs | trunk]
        if extra:
            yield f"'{word}' also matches {names(extra)}, not part of a leg"


# NAM004: names of axes.

_MIN_COSINE = 0.5
"""Cosine from which a leg bends about the lateral axis."""

_MAX_COSINE = 0.3
"""Cosine below which a joint does not turn about the axis in its name: more than 72 degrees."""


@rule("NAM004", "wrong-axis-name", "warning", needs=("legs",))
def wrong_axis_name(robot: Facts) -> Iterator[Violation]:
    """A joint of a leg does not turn about the axis in its name.

    The name says pitch, roll or yaw, but the joint turns about another axis. Default positions,
    gains and symmetries are assigned by name, so the wrong joint gets them.

    Fix:
        Compare the <axis> and the rotation of the <origin> with the joints of the other legs, or
        rename the joint.

    Source:
        The axis at joint positions 0, compared with the axis about which the leg bends (pitch), the
        vertical axis (yaw) and the axis perpendicular to both (roll).
    """
    up = np.array([0.0, 0.0, 1.0])
    lateral = robot.mirror.normal
    bend_laterally = [abs(float(leg.pitch @ lateral)) > _MIN_COSINE for leg in robot.legs]
    reported: set[str] = set()
    for leg, bends_laterally in zip(robot.legs, bend_laterally, strict=True):
        # A wrong axis may outvote the others of its leg, but not those of the other legs.
        pitch = leg.pitch if bends_laterally or not any(bend_laterally) else lateral
        roll = np.cross(pitch, up)
        expected = {"pitch": pitch, "yaw": up, "roll": roll / np.linalg.norm(roll)}
        for joint in leg.joints:
            stated = {word.lower() for word in _words(joint.name)} & expected.keys()
            if len(stated) != 1 or joint.kind == "prismatic" or joint.name in reported:
                continue
            (word,) = stated
            body = robot.body_of_joint[joint.name]
            _, axis = joint_axis(body, body.zero_pose)
            cosines = {name: abs(float(axis @ other)) for name, other in expected.items()}
            if cosines[word] < _MAX_COSINE:
                reported.add(joint.name)
                best = max(cosines, key=cosines.__getitem__)
                yield Violation(
                    subject=joint.name,
                    source=joint.axis_source or joint.source,
                    certainty="likely",
                    message=f"axis of joint {joint.name}: got {best} "
                    f"({math.degrees(math.acos(cosines[word])):.0f} deg from {word}); "
                    f"expected {word}, as its name says",
                    measured={"cosine": cosines[word]},
                )


# NAM005: names of actuators.

_SHORT_SIDES = {"left": "l", "right": "r"}

_FILLERS = frozenset(
    {"joint", "motor", "actuator", "act", "servo", "position", "pos", "torque", "ctrl", "drive"}
)
"""Words in the names of joints and actuators that do not identify the joint."""


@rule("NAM005", "actuator-of-another-joint", "warning")
def actuator_of_another_joint(robot: Facts) -> Iterator[Violation]:
    """An actuator has the name of another joint than the one that it drives.

    Its joint was not changed after copying, or two joints were exchanged. Commands are assigned by
    the name or the order of the actuators, so that two legs get each other's torques.

    Fix:
        Exchange the joints of the actuators, or rename the actuators.

    Source:
        MuJoCo does not compare names. Words such as joint and motor, and the words left and l, are
        not distinguished.
    """
    joints: dict[tuple[str, ...], str] = {}
    for joint in robot.joints:
        joints.setdefault(_identity(joint.name), joint.name)
    names_of = {name: key for key, name in joints.items()}
    for actuator in robot.model.actuators:
        own, driven = _identity(actuator.name), names_of.get(actuator.joint)
        if driven is None or own == driven or len(actuator.name) > _MAX_LENGTH:
            continue
        named = joints.get(own)
        if named is None and _identity(swap_sides(actuator.name)) == driven:
            named = swap_sides(actuator.joint)
        if named is not None:
            yield Violation(
                subject=actuator.joint,
                source=actuator.source,
                certainty="likely",
                message=f"joint of actuator {truncate(actuator.name)}: got {actuator.joint}; "
                f"expected {named}, as its name says",
                measured={"expected": named},
            )


def _identity(name: str) -> tuple[str, ...]:
    """Return the words of a name that identify a joint."""
    words = (word.lower() for word in _words(name) if word[0].isalnum())
    return tuple(_SHORT_SIDES.get(word, word) for word in words if word not in _FILLERS)
