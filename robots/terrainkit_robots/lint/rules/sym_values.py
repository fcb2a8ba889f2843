"""Rules on the symmetry of losses, gears, products of inertia, mimics and shapes (SYM)."""

import math
from collections.abc import Iterator

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body, BodyShape
from terrainkit_robots.analysis.bodies.link_source import inertia_source
from terrainkit_robots.analysis.bodies.shapes import bounds, has_bounds
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.mirror import side_words
from terrainkit_robots.analysis.symmetry.mirror_pairs import MirrorPair, MirrorSide
from terrainkit_robots.description.model import Geometry, Joint
from terrainkit_robots.lint.rule import Violation, rule
from terrainkit_robots.transforms import Matrix

_MAX_RATIO = 5.0
"""Allowed ratio of two losses. Those that were identified joint by joint differ by up to 3."""

_TYPICAL = {"damping": 10.0, "friction": 1.0, "armature": 100.0}
"""Typical speed [rad/s], sign and acceleration [rad/s2] of a leg joint, by which a loss takes
effort."""

_MIN_EFFORT_SHARE = 0.1
"""Difference of that effort, as a share of the effort limit, below which a loss does not matter."""

_MAX_PRODUCT_ERROR = 0.1
"""Allowed difference of inertias in the same axes, as a share of the largest moment."""

_MAX_MOMENT_ERROR = 0.05
"""Difference of principal moments above which SYM003 reports the pair, as the same share."""

_MAX_SIZE_RATIO = 1.5
"""Allowed ratio of the sizes of two mirrored primitives."""

_MAX_SHAPE_ERROR, _SHAPE_MARGIN = 0.3, 0.01
"""Allowed distance between two mirrored bounding boxes: a share of the diagonal plus a constant
[m]."""


@rule("SYM009", "loss-asymmetry", "warning")
def loss_asymmetry(robot: Facts) -> Iterator[Violation]:
    """The damping, friction or armature of a joint is far from that of its mirror image.

    Both sides have the same motor and gear. A number was mistyped or changed on one side only, and
    the robot veers to that side.

    Fix:
        Give both joints the same values.

    Source:
        The losses of published robots agree exactly, or are identified joint by joint and differ by
        less than a factor of 3.
    """
    for pair in robot.mirror_pairs:
        for name in ("damping", "friction", "armature"):
            a, b = (float(getattr(side.joint, name)) for side in (pair.left, pair.right))
            least, most = sorted((a, b))
            if least < 0 or most <= _MAX_RATIO * least or least == 0:
                continue
            efforts = [robot.effort_limit(side.joint) for side in (pair.left, pair.right)]
            known = [effort for effort in efforts if effort is not None]
            if known and (most - least) * _TYPICAL[name] < _MIN_EFFORT_SHARE * max(known):
                continue

            def value(body: Body, name: str = name) -> Matrix | None:
                return None if body.joint is None else np.array([getattr(body.joint, name)])

            odd, other = robot.outlier_first(pair.left, pair.right, value)
            own, mirrored = getattr(odd.joint, name), getattr(other.joint, name)
            dynamics = odd.joint.dynamics
            yield Violation(
                subject=odd.joint.name,
                source=dynamics.source if dynamics else odd.joint.source,
                certainty="likely",
                message=f"{name} of joint {odd.joint.name}: got {own:g}, and {mirrored:g} for its "
                f"mirror image {other.joint.name}; expected at most a factor of {_MAX_RATIO:g}",
                measured={name: own, "other": mirrored, "mirror_image": other.joint.name},
            )


@rule("SYM010", "gear-asymmetry", "warning")
def gear_asymmetry(robot: Facts) -> Iterator[Violation]:
    """The gear of an actuator has another sign than that of its mirror image.

    A positive command then moves the two joints in opposite directions, although their axes and
    limits say otherwise. If all legs with such a joint agree, the sign is a convention.

    Fix:
        Remove the sign of the gear, or mirror the axis and the limits of the joint as well.

    Source:
        MuJoCo's XML reference, actuator: gear scales the force on the joint.
    """
    gears = {actuator.joint: actuator for actuator in robot.model.actuators if actuator.joint}
    opposite: list[MirrorPair] = []
    same: list[MirrorPair] = []
    for pair in robot.mirror_pairs:
        names = pair.left.joint.name, pair.right.joint.name
        if pair.sign != 0 and all(name in gears for name in names):
            product = gears[names[0]].gear * gears[names[1]].gear
            if product < 0:
                opposite.append(pair)
            elif product > 0:
                same.append(pair)
    for pair in opposite:
        alike = [p for p in same if p.sign == pair.sign]
        if pair.sign < 0 and not any(_is_parallel(p.left, pair.left) for p in alike):
            continue

        def is_negative(body: Body) -> Matrix | None:
            actuator = gears.get(body.joint.name) if body.joint else None
            return None if actuator is None else np.array([float(actuator.gear < 0)])

        odd, other = robot.outlier_first(pair.left, pair.right, is_negative)
        if gears[odd.joint.name].gear > 0:
            odd, other = other, odd
        yield Violation(
            subject=odd.joint.name,
            source=gears[odd.joint.name].source,
            certainty="likely",
            message=f"gear of the actuator of joint {odd.joint.name}: got "
            f"{gears[odd.joint.name].gear:g}, and {gears[other.joint.name].gear:g} for its mirror "
            f"image {other.joint.name}; expected the same sign",
            measured={"mirror_image": other.joint.name},
        )


def _is_parallel(a: MirrorSide, b: MirrorSide) -> bool:
    return abs(float(a.axis @ b.axis)) > 0.9


@rule("SYM011", "product-asymmetry", "warning")
def product_asymmetry(robot: Facts) -> Iterator[Violation]:
    """The inertia of a body is not turned like that of its mirror image.

    The principal moments agree, but their axes do not: a product of inertia has the wrong sign, or
    two moments are exchanged. Exporters differ in the sign of the products, and copies of the other
    side keep it. The trunk mirrors itself, so that its products with the mirrored axis are small.

    Fix:
        Negate the two products that contain the mirrored axis: ixy and iyz for left and right.

    Source:
        Pull request 160 of mujoco_menagerie and pull request 511 of jsk_aerial_robot. Bodies that
        both sides share without mirroring them are not checked. The trunks of 141 of 143 published
        legged robots have products of 2 % at most.
    """
    # The frames of bodies behind a misaligned joint are turned; SYM006 reports the joint.
    _, displaced = robot.misalignments
    for pair in robot.uncopied_pairs:
        left, right = pair.left, pair.right
        if displaced & pair.indices:
            continue
        a, b = _inertia(left.body), _inertia(right.body)
        if a is None or b is None:
            continue
        if np.abs(left.body.inertia - right.body.inertia).max() < 1e-3 * np.abs(a).max():
            if not _has_products(left.body.inertia):
                continue
            if _is_copy(left.body, right.body):
                continue
        largest = max(float(left.body.principal[2]), float(right.body.principal[2]))
        moments = np.abs(left.body.principal - right.body.principal).max() / largest
        normal = robot.mirror.normal
        reflection = np.eye(3) - 2 * np.outer(normal, normal)
        error = float(np.abs(reflection @ a @ reflection - b).max()) / largest
        if error <= _MAX_PRODUCT_ERROR or moments > _MAX_MOMENT_ERROR:
            continue
        odd, other = robot.outlier_first(left, right, lambda body: body.inertia.ravel())
        yield Violation(
            subject=odd.body.name,
            source=inertia_source(odd.body.main_link),
            certainty="likely",
            message=f"inertia of body {odd.body.name} in the axes of the trunk: got {error:.0%} "
            f"of its largest moment between it and the mirrored one of {other.body.name}; "
            f"expected at most {_MAX_PRODUCT_ERROR:.0%}",
            measured={"difference": error, "mirror_image": other.body.name},
        )
    if len(robot.legs) > 1 and robot.uncopied_pairs:
        yield from _turned_trunk(robot)


def _turned_trunk(robot: Facts) -> Iterator[Violation]:
    """Yield a violation if the trunk has large products of inertia with the mirrored axis."""
    trunk, normal = robot.bodies[0], robot.mirror.normal
    inertia, inertial = _inertia(trunk), trunk.main_link.inertial
    if inertia is None or inertial is None or inertial.inertia is None:
        return
    if not inertial.inertia.any():
        return  # reported by INR003
    row = inertia @ normal
    share = float(np.linalg.norm(row - (row @ normal) * normal) / trunk.principal[2])
    if share > _MAX_PRODUCT_ERROR:
        yield Violation(
            subject=trunk.name,
            source=inertia_source(trunk.main_link),
            certainty="likely",
            message=f"products of inertia of trunk {trunk.name} with the mirrored axis: got "
            f"{share:.0%} of its largest moment; expected at most {_MAX_PRODUCT_ERROR:.0%}",
            measured={"share": share},
        )


def _inertia(body: Body) -> Matrix | None:
    """Return the inertia of a body in the axes of the trunk; None if it is not physical."""
    if body.mass <= 0 or not np.isfinite(body.inertia).all() or body.principal[0] <= 0:
        return None
    rotation = body.zero_pose[:3, :3]
    return np.asarray(rotation @ body.inertia @ rotation.T)


def _has_products(inertia: Matrix) -> bool:
    products = inertia - np.diag(np.diag(inertia))
    return float(np.abs(products).max()) > _MAX_PRODUCT_ERROR / 2 * float(np.abs(inertia).max())


def _is_copy(a: Body, b: Body) -> bool:
    """Return whether two bodies have the same center of mass, so that they are the same part."""
    return float(np.abs(a.center - b.center).max()) < 0.002


@rule("SYM012", "mimic-asymmetry", "warning")
def mimic_asymmetry(robot: Facts) -> Iterator[Violation]:
    """A joint and its mirror image do not follow mirrored joints in the same way.

    Only one of them is coupled, or it follows a joint of the other side or of another leg, or its
    multiplier has a wrong sign: names and signs were not changed after copying one side.

    Fix:
        Give both joints a <mimic> of their own side. The multipliers are equal, or opposite if the
        axis of exactly one of the two joints is mirrored.

    Source:
        http://wiki.ros.org/urdf/XML/joint: mimic.
    """
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
        odd, problem = right, ""
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
                subject=odd.name,
                source=mimic.source,
                certainty="likely",
                message=f"mimic of joint {odd.name}: {problem}",
            )


def _crosses(robot: Facts, joint: Joint) -> bool:
    """Return whether a joint of a leg follows a joint of another leg."""
    target = "" if joint.mimic is None else joint.mimic.joint
    chains = [
        {body.joint.name for i in leg.limb.chain if (body := robot.bodies[i]).joint is not None}
        for leg in robot.legs
    ]
    own = [chain for chain in chains if joint.name in chain]
    return any(target in chain for chain in chains) and not any(target in each for each in own)


def _is_gripper(left: Joint, right: Joint) -> bool:
    """Return whether two joints are fingers of one gripper, or of two equal ones.

    One follows the other, or a name has two sides, such as l_gripper_r_finger_joint.
    """
    targets = {joint.mimic.joint for joint in (left, right) if joint.mimic is not None}
    return not targets.isdisjoint({left.name, right.name}) or any(
        len(side_words(joint.name)) > 1 for joint in (left, right)
    )


@rule("SYM013", "collision-asymmetry", "warning")
def collision_asymmetry(robot: Facts) -> Iterator[Violation]:
    """The collision shapes of a body are not where those of its mirror image are, or as large.

    A shape is turned, shifted or scaled on one side only, or has the mesh of another part. The legs
    collide at different positions, and one foot may reach deeper than the other. The sizes of
    primitives are compared on all pairs, arms included.

    Fix:
        Mirror the <origin> and the size of the collision shapes.

    Source:
        Bounding boxes at position 0. Those of published robots agree to 30 % of their diagonal.
    """
    # Bodies behind a misaligned joint are elsewhere; SYM006 reports the joint.
    _, displaced = robot.misalignments
    for pair in robot.uncopied_pairs:
        left, right = pair.left, pair.right
        resized = _resized(robot, pair)
        if resized is not None:
            yield resized
            continue
        if displaced & pair.indices or not pair.indices <= robot.leg_bodies:
            continue
        a, b = _box(robot, left), _box(robot, right)
        if a is None or b is None:
            continue
        corners = robot.mirror.image(a)
        image = np.array([corners.min(axis=0), corners.max(axis=0)])
        error = float(np.abs(image - b).max())
        size = min(float(np.linalg.norm(box[1] - box[0])) for box in (a, b))
        limit = _MAX_SHAPE_ERROR * size + _SHAPE_MARGIN
        if error <= limit:
            continue

        def extent(body: Body) -> Matrix | None:
            if body.joint is None:
                return None
            box = bounds(body.collisions, robot.meshes)
            return None if box is None else box.ravel()

        odd, other = robot.outlier_first(left, right, extent)
        yield Violation(
            subject=odd.body.name,
            source=odd.body.collisions[0].geometry.source,
            certainty="likely",
            message=f"bounding box of the collision shapes of {odd.body.name}: got a face "
            f"{1000 * error:.3g} mm from that of its mirror image {other.body.name}; expected at "
            f"most {1000 * limit:.3g} mm",
            measured={"difference": error, "mirror_image": other.body.name},
        )


def _resized(robot: Facts, pair: MirrorPair) -> Violation | None:
    """Return the violation of a pair whose primitives have different sizes, or None."""
    shapes = _primitives(pair.left.body), _primitives(pair.right.body)
    if [each.shape for each in shapes[0]] != [each.shape for each in shapes[1]]:
        return None
    for left, right in zip(*shapes, strict=True):
        sizes = np.array(left.size), np.array(right.size)
        ratio = float(max((sizes[0] / sizes[1]).max(), (sizes[1] / sizes[0]).max()))
        if ratio <= _MAX_SIZE_RATIO:
            continue

        def size(body: Body, index: int = shapes[0].index(left)) -> Matrix | None:
            siblings = _primitives(body)
            return np.array(siblings[index].size) if len(siblings) == len(shapes[0]) else None

        odd, other = robot.outlier_first(pair.left, pair.right, size)
        own, mirrored = (left, right) if odd is pair.left else (right, left)
        return Violation(
            subject=odd.body.name,
            source=own.size_source or own.source,
            certainty="likely",
            message=f"size of the collision {own.shape} of {odd.body.name}: got "
            f"{_format_size(own)} m, and {_format_size(mirrored)} m for its mirror image "
            f"{other.body.name} (radii and half lengths); expected at most a factor of "
            f"{_MAX_SIZE_RATIO:g}",
            measured={"ratio": ratio, "mirror_image": other.body.name},
        )
    return None


def _primitives(body: Body) -> list[Geometry]:
    """Return the collision primitives of a body, by shape and size."""
    found = [s.geometry for s in body.collisions if s.geometry.size and min(s.geometry.size) > 0]
    return sorted(found, key=lambda each: (each.shape, each.size))


def _format_size(geometry: Geometry) -> str:
    return " ".join(f"{value:g}" for value in geometry.size)


def _box(robot: Facts, side: MirrorSide) -> Matrix | None:
    """Return the bounding box of collision shapes from the joint, in the axes of the trunk [m]."""
    shapes = [
        BodyShape(geometry=s.geometry, link=s.link, pose=side.body.zero_pose @ s.pose)
        for s in side.body.collisions
    ]
    if not shapes or not all(has_bounds(s.geometry, robot.meshes) for s in shapes):
        return None
    box = bounds(shapes, robot.meshes)
    return None if box is None else box - side.point
