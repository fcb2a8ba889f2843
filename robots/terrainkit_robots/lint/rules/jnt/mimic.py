"""Rule on mimic joints."""

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint, Mimic
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule

_MAX_EXCESS = 0.05
"""Share of the positions of a follower that may be outside of its limits, for rounding."""


@rule("JNT013", "invalid-mimic", "error", onboarding="blocks")
def invalid_mimic(robot: Facts) -> Violations:
    """A joint mimics a joint that is missing or fixed, or mimics itself.

    MuJoCo ignores the <mimic>, so that the joint stays limp, and rejects a joint that mimics
    itself. The positions of joints that mimic each other in a cycle are not defined. With a
    multiplier of 0, which is a warning, the joint never moves. If it follows beyond its own limits,
    the two contradict each other, and simulators stop one or both. That is a warning if more than
    half of its positions are outside, and a note otherwise.

    Fix:
        Name the joint that is driven, and give the ratio of the two positions as the multiplier.

    Source:
        Tested with MuJoCo 4.0: "<mimic> on joint ignored".
    """
    joints = {joint.name: joint for joint in reversed(robot.model.joints)}
    checked: set[str] = set()
    for joint in robot.model.joints:
        if joint.mimic is None or not joint.moves or joint.name in checked:
            continue
        target = joints.get(joint.mimic.joint)
        cycle = _mimic_cycle(joint, joints)
        checked.update(cycle)
        if target is None:
            got = f"{joint.mimic.joint!r}, which does not exist"
        elif not target.moves:
            got = f"{target.name}, which is {target.kind or 'without a type'}"
        elif cycle == [joint.name]:
            got = "the joint itself"
        elif cycle:
            got = f"{target.name}, in the cycle {' -> '.join(cycle[:10])}"
        elif joint.mimic.multiplier == 0 and not robot.unparsed.has(joint.name, "multiplier"):
            yield Violation(
                element=Part(joint.name, joint.mimic.source),
                severity="warning",
                message=f"multiplier of the mimic of joint {joint.name}: got 0, which holds the "
                "joint still; expected another ratio, or a fixed joint",
            )
            continue
        else:
            yield from _outside_limits(joint, target, joint.mimic)
            continue
        yield Violation(
            element=Part(joint.name, joint.mimic.source),
            message=f"mimic target of joint {joint.name}: got {got}; expected a joint that is "
            "driven",
        )


def _outside_limits(joint: Joint, target: Joint, mimic: Mimic) -> Violations:
    """Yield a violation if a joint follows another one beyond its own limits."""
    own, other = joint.range, target.range
    if own is None or other is None:
        return
    low, high = sorted(mimic.multiplier * end + mimic.offset for end in other)
    excess = max(own[0] - low, high - own[1])
    inside = max(0.0, min(own[1], high) - max(own[0], low))
    if excess > _MAX_EXCESS * (high - low):
        yield Violation(
            element=Part(joint.name, mimic.source),
            severity="warning" if inside < (high - low) / 2 else "note",
            message=f"positions of joint {joint.name}, which follows {target.name}: got {low:.4g} "
            f"to {high:.4g} {joint.unit}; expected positions within its limits of {own[0]:.4g} to "
            f"{own[1]:.4g} {joint.unit}",
            measured={"excess": excess},
        )


def _mimic_cycle(joint: Joint, joints: dict[str, Joint]) -> list[str]:
    """Return the joints that mimic each other in a cycle with `joint`; empty without a cycle."""
    path: dict[str, None] = {}
    current: Joint | None = joint
    while current is not None and current.mimic is not None and current.name not in path:
        path[current.name] = None
        current = joints.get(current.mimic.joint)
    return list(path) if current is not None and current.name == joint.name else []
