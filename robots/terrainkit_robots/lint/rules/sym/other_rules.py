"""What other rules report, which explains an asymmetry."""

from functools import cached_property

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.mirror_pairs import MirrorPair
from terrainkit_robots.lint.rule import findings_of


def check_joint_types(robot: Facts) -> None:
    """Raise CannotCheckError if a joint has an unknown type, so that its body may be merged."""
    if finding := next(findings_of(robot, "JNT001"), None):
        raise CannotCheckError(f"the type of joint {finding.subject} is unknown")


class OtherRules:
    """Links and joints that other rules report, computed on first use."""

    def __init__(self, robot: Facts, *codes: str) -> None:
        self._robot = robot
        self._codes = codes

    @cached_property
    def _names(self) -> set[str]:
        found = findings_of(self._robot, *self._codes)
        return {finding.subject for finding in found if finding.severity != "note"}

    def report(self, pair: MirrorPair) -> bool:
        """Return whether a link or joint of one of two bodies is reported."""
        sides = pair.left, pair.right
        names = {link.name for side in sides for link in side.body.links}
        return not self._names.isdisjoint(names | {side.joint.name for side in sides})
