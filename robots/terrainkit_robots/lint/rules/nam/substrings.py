"""Rule on the substrings of names that configurations match."""

from collections.abc import Iterator, Sequence

from terrainkit.settings.text import truncate
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.name_words import MAX_NAME_LENGTH, split_name
from terrainkit_robots.lint.rule import Violation, Violations, rule
from terrainkit_robots.text import names

_MAX_NAMES = 2
"""Number of matches in a message."""

_LEG_WORDS = ("thigh", "calf", "shank", "knee", "hip")
"""Words by which configurations select the links whose contacts they penalize."""


@rule("NAM003", "ambiguous-substring", "note", needs=("legs",), certainty="likely")
def ambiguous_substring(robot: Facts) -> Violations:
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
        yield Violation(message="; ".join(parts))


def _foot_matches(robot: Facts) -> Iterator[str]:
    feet = [leg.foot for leg in robot.legs]
    others = [link.name for link in robot.links if link.name not in feet]
    missed = [name for name in feet if "foot" not in name]
    extra = [name for name in others if "foot" in name]
    word = _unique_substring(feet, others)
    suggestion = f" ('{word}' matches exactly the feet)" if word else ""
    if len(missed) == len(feet) and not extra:
        yield f"'foot' matches no link; the feet are {names(feet, _MAX_NAMES)}{suggestion}"
    elif missed:
        yield f"'foot' does not match the feet {names(missed, _MAX_NAMES)}{suggestion}"
    elif extra:
        yield f"'foot' also matches {names(extra, _MAX_NAMES)}, which are not feet{suggestion}"


def _unique_substring(feet: Sequence[str], others: Sequence[str]) -> str | None:
    """Return the shortest run of words that all feet contain and no other link contains."""
    words = split_name(feet[0])[:MAX_NAME_LENGTH]
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
        yield f"'base' also matches {names(extra, _MAX_NAMES)}, not part of the trunk"
    for word in _LEG_WORDS:
        extra = [name for name in links if word in name and name not in in_legs | trunk]
        if extra:
            yield f"'{word}' also matches {names(extra, _MAX_NAMES)}, not part of a leg"
