"""Rule on the direction in which the robot faces."""

import re

import numpy as np

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.lint.rule import Violation, Violations, rule

_FRONT = {"front", "fore", "fl", "fr", "lf", "rf"}
_HIND = {"rear", "hind", "back", "rl", "hl", "hr", "bl", "br", "lh", "rh", "lb", "rb"}
_LEFT = {"left", "fl", "rl", "hl", "bl", "lf", "lh", "lb", "lm", "ml"}
_RIGHT = {"right", "fr", "hr", "br", "rf", "rh", "rb", "rm", "mr"}
"""Words of names that give the position of a leg. RR is omitted: it also occurs in other names."""


@rule("LEG005", "forward-axis", "warning", needs=("length-unit", "angle-unit"))
def forward_axis(robot: Facts) -> Violations:
    """The robot does not face +x.

    Commands, rewards and height scans assume that +x is forward and +y is left. A robot with
    another orientation learns to walk sideways or backward, and no metric shows it.

    Fix:
        Rotate the root: add a new root link and a fixed joint with the rotation above the trunk, or
        rotate the origins of all elements of the trunk.

    Source:
        REP 103 (x forward, y left, z up), which all training frameworks follow.
    """
    trunk = robot.bodies[0]
    message = ""
    for axis, letter, ahead, behind, words in (
        (0, "x", "front", "hind", (_FRONT, _HIND)),
        (1, "y", "left", "right", (_LEFT, _RIGHT)),
    ):
        positions = [_leg_positions(robot, group, axis) for group in words]
        if all(positions) and max(positions[0]) < min(positions[1]):
            means = [float(np.mean(group)) for group in positions]
            message = (
                f"position of the {ahead} legs along {letter}: got {means[0]:.3f} m; expected more "
                f"than at the {behind} legs, which are at {means[1]:.3f} m"
            )
            break
    if not message and robot.mirror.normal[0] == 1:
        count = sum(abs(leg.pitch[0]) > abs(leg.pitch[1]) for leg in robot.legs)
        message = (
            f"legs whose pitch axis is x: got {count} of {len(robot.legs)}; expected y for at "
            "least half of the legs, so that they step along x"
        )
    if message:
        yield Violation(element=robot.tree.links[trunk.name], message=message)


def _leg_positions(robot: Facts, labels: set[str], axis: int) -> list[float]:
    """Return where legs with one of the words in their names start along an axis [m]."""
    positions = []
    for leg in robot.legs:
        leg_names = [robot.bodies[leg.limb.chain[-1]].name, leg.foot, leg.joints[-1].name]
        tokens = {t.lower() for name in leg_names for t in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", name)}
        if tokens & labels:
            positions.append(float(leg.limb.points[0][axis]))
    return positions
