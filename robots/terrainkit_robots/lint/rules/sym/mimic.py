"""Rule on the symmetry of mimic joints."""

import math
import re

import numpy as np

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.mirror import side_words
from terrainkit_robots.analysis.symmetry.mirror_pairs import MirrorPair
from terrainkit_robots.description.model import Joint
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule

_FINGER_NAME = re.compile(r"finger|grip|jaw|claw|knuckle|thumb")

_MIN_SHARE_ACROSS = 0.7
"""Share of the motion of a finger that closes the gripper, at least."""


@rule("SYM012", "mimic-asymmetry", "warning")
def mimic_asymmetry(robot: Facts) -> Violations:
    """A joint and its mirror image do not follow mirrored joints in the same way.

    Only one of them is coupled, or it follows a joint of the other side or of another leg, or its
    multiplier has a wrong sign: names and signs were not changed after copying one side. Two
    fingers of which one follows the other have to move in opposite directions.

    Fix:
        Give both joints a <mimic> of their own side. The multipliers are equal, or opposite if the
        axis of exactly one of the two joints is mirrored. Negate the axis or the multiplier of a
        finger.

    Source:
        http://wiki.ros.org/urdf/XML/joint: mimic.
    """
    yield from _same_way(robot)
    images: dict[str, str] = {}
    signs: dict[str, int] = {}
    for pair in robot.mirror_pairs:
        names = pair.left.joint.name, pair.right.joint.name
        images |= dict(zip(names, names[::-1], strict=True))
        signs |= dict.fromkeys(names, pair.sign)
    for pair in robot.mirror_pairs:
        left, right = pair.left.joint, pair.right.joint
        a, b = left.mimic, right.mimic
        in_legs = pair.indices <= robot.leg_bodies
        if (a is None and b is None) or (_is_gripper(left, right) and not in_legs):
            continue
        odd = right
        problem = ""
        crossed = next(
            (joint for joint in (left, right) if in_legs and _crosses(robot, joint)), None
        )
        if crossed is not None and crossed.mimic is not None:
            odd, problem = crossed, f"got {crossed.mimic.joint}; expected a joint of the same leg"
        elif a is None or b is None:
            odd, other = (left, right) if b is None else (right, left)
            assert odd.mimic is not None
            problem = f"got {odd.mimic.joint}, and no mimic for its mirror image {other.name}"
        elif a.joint in images and b.joint not in (images[a.joint], a.joint):
            problem = f"got {b.joint}; expected {images[a.joint]}, as {left.name} follows {a.joint}"
        elif a.joint in images and b.joint == images[a.joint]:
            sign = pair.sign * signs[a.joint]
            expected = a.multiplier * sign
            if sign and not math.isclose(b.multiplier, expected, rel_tol=0.02, abs_tol=1e-6):
                problem = (
                    f"got the multiplier {b.multiplier:g}; expected {expected:g} from its mirror "
                    f"image {left.name}"
                )
        if problem:
            mimic = odd.mimic
            assert mimic is not None
            yield Violation(
                element=Part(odd.name, mimic.source),
                message=f"mimic of joint {odd.name}: {problem}",
            )


def _same_way(robot: Facts) -> Violations:
    """Yield fingers that follow another one in the same direction."""
    for pair in robot.mirror_pairs:
        follower = same_way_follower(robot, pair)
        if follower is not None and (mimic := follower.mimic) is not None:
            links = f"{pair.left.body.top.name} and {pair.right.body.top.name}"
            yield Violation(
                element=Part(follower.name, mimic.source),
                certainty="likely",
                message=f"mimic of joint {follower.name}: got the multiplier {mimic.multiplier:g}, "
                f"which moves {links} the same way; expected opposite ways: the axis or the "
                "multiplier has the wrong sign",
            )


def same_way_follower(robot: Facts, pair: MirrorPair) -> Joint | None:
    """Return the joint of two mirrored fingers that follows the other one the same way.

    Both may follow a third joint. Fingers slide along the line between them, or are named so: the
    wheels of an axle turn the same way, as eyes do.
    """
    for side, other in ((pair.left, pair.right), (pair.right, pair.left)):
        joint, bodies = side.joint, (side.body, other.body)
        mimic, same = joint.mimic, other.joint.mimic
        if mimic is None:
            continue
        ratio = mimic.multiplier if mimic.joint == other.joint.name else 0.0
        if same is not None and mimic.joint == same.joint:
            ratio = mimic.multiplier * same.multiplier
        if ratio * pair.sign >= 0:
            continue
        if joint.kind != "prismatic":
            names = (joint.name, *(body.top.name for body in bodies))
            return joint if any(_FINGER_NAME.search(name.lower()) for name in names) else None
        normal = np.abs(robot.mirror.reflection.diagonal() - 1) / 2
        way = side.body.zero_pose[:3, :3] @ joint.direction
        return joint if float(np.abs(way) @ normal) > _MIN_SHARE_ACROSS else None
    return None


def _crosses(robot: Facts, joint: Joint) -> bool:
    """Return whether a joint of a leg follows a joint of another leg."""
    target = "" if joint.mimic is None else joint.mimic.joint
    chains = [
        {body.joint.name for i in leg.limb.chain if (body := robot.bodies[i]).joint is not None}
        for leg in robot.legs
    ]
    own = [chain for chain in chains if joint.name in chain]
    return any(target in chain for chain in chains) and not any(target in chain for chain in own)


def _is_gripper(left: Joint, right: Joint) -> bool:
    """Return whether two joints are fingers of one gripper, or of two equal ones.

    One follows the other, or a name has two sides, such as l_gripper_r_finger_joint.
    """
    targets = {joint.mimic.joint for joint in (left, right) if joint.mimic is not None}
    return not targets.isdisjoint({left.name, right.name}) or any(
        len(side_words(joint.name)) > 1 for joint in (left, right)
    )
