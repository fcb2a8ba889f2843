"""Rule on joints whose names are exchanged."""

import itertools
from collections import Counter
from collections.abc import Iterator

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.name_words import MAX_NAME_LENGTH, split_name
from terrainkit_robots.description.model import Joint
from terrainkit_robots.lint.rule import Violation, Violations, rule
from terrainkit_robots.text import group

_GENERIC = frozenset({"joint", "link", "body"})
"""Words that tell joints and links apart, but not one joint from another."""

_MIN_NAMED_AFTER_CHILD = 0.75
"""Share of joints named after their child link, at least, where all are meant to be."""


@rule("NAM006", "exchanged-names", "warning", certainty="likely")
def exchanged_names(robot: Facts) -> Violations:
    """The names of two joints are exchanged.

    Each joint is named like the other one in the other legs, or after the child link of the other
    one. Default positions, gains and limits are assigned by name, so each joint gets the values of
    the other one, and no simulator complains.

    Fix:
        Exchange the names of the two joints, and check the limits, which may have moved as well.

    Source:
        legged_gym, Isaac Lab and mjlab match joints by name.
    """
    seen: set[frozenset[str]] = set()
    for one, other, reason in (*_unlike_other_legs(robot), *_unlike_children(robot)):
        pair = frozenset({one.name, other.name})
        if pair not in seen:
            seen.add(pair)
            yield Violation(
                element=one,
                message=f"names of joints {one.name} and {other.name}: got child links "
                f"{one.child} and {other.child}; expected the reverse, {reason}",
            )


def _words(name: str) -> frozenset[str]:
    """Return the words of a name that tell it apart."""
    words = (word.lower() for word in split_name(name[:MAX_NAME_LENGTH]))
    return frozenset(word for word in words if word.isalnum()) - _GENERIC


def _unlike_other_legs(robot: Facts) -> Iterator[tuple[Joint, Joint, str]]:
    """Yield two joints of a leg that are named like each other's counterparts in most legs."""
    for legs in group((len(leg.joints), leg.joints) for leg in robot.legs).values():
        counts = [
            Counter(w for joint in place for w in _words(joint.name))
            for place in zip(*legs, strict=True)
        ]
        typical = [{w for w, n in count.items() if 2 * n > len(legs)} for count in counts]
        for a, b in itertools.combinations(range(len(typical)), 2):
            only_a, only_b = typical[a] - typical[b], typical[b] - typical[a]
            if not (only_a and only_b):
                continue
            for joints in legs:
                words_a, words_b = _words(joints[a].name), _words(joints[b].name)
                exchanged = only_b <= words_a and only_a <= words_b
                if exchanged and not (only_a & words_a or only_b & words_b):
                    yield joints[a], joints[b], "as in the other legs"


def _unlike_children(robot: Facts) -> Iterator[tuple[Joint, Joint, str]]:
    """Yield two joints of which each is named after the child link of the other one."""
    joints = robot.robot_joints
    named = group((_words(joint.name), joint) for joint in joints)
    regular = sum(_words(joint.child) == _words(joint.name) for joint in joints)
    if regular < _MIN_NAMED_AFTER_CHILD * len(joints):
        return
    for joint in joints:
        (other, *more) = named.get(_words(joint.child), [joint])
        if other is not joint and not more and _words(other.child) == _words(joint.name):
            yield joint, other, "since joints are named after their child links"
