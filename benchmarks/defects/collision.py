"""Defects of collision shapes (COL)."""

import numpy as np
from lxml import etree

from defects.mutant import Mutant, NotApplicableError, Subjects, child, mutation, set_numbers
from terrainkit_robots.analysis.bodies.bodies import Body


def _remove_shapes(link: etree._Element) -> None:
    for shape in link.findall("collision"):
        link.remove(shape)


def _add_shape(robot: Mutant, link: str, shape: str, position: np.ndarray) -> None:
    xyz = " ".join(f"{value:.6g}" for value in position)
    element = etree.fromstring(
        f'<collision><origin xyz="{xyz}"/><geometry>{shape}</geometry></collision>'
    )
    robot.link(link).append(element)


@mutation("COL001", "error", "shank and foot without collision shapes")
def no_shank_collision(robot: Mutant) -> Subjects:
    foot = robot.pick(robot.feet())
    shank = child(
        robot.pick(j for j in robot.knee_joints() if foot in _links_below(robot, child(j)))
    )
    names = {*robot.body_names(shank), *robot.body_names(foot)}
    for link in robot.links("collision"):
        if link.get("name") in names or link.get("name") in _links_below(robot, shank):
            _remove_shapes(link)
    return [*names, *_links_below(robot, shank)]


def _links_below(robot: Mutant, link: str) -> list[str]:
    found = [link]
    for name in found:
        found += [
            child(joint) for joint in robot.joints() if joint.find("parent").get("link") == name
        ]
    return found


@mutation("COL001", "error", "all feet without collision shapes")
def no_foot_collision(robot: Mutant) -> Subjects:
    feet = robot.feet()
    for foot in feet:
        _remove_shapes(robot.link(foot))
    return [name for foot in feet for name in robot.body_names(foot)]


@mutation("COL002", "warning", "trunk without collision shapes")
def no_base_collision(robot: Mutant) -> Subjects:
    if any(b.parent == 0 and not _is_leg(b.name) for b in robot.facts.bodies):
        raise NotApplicableError  # the arms and the waist have collision shapes
    names = robot.body_names(robot.base_link().get("name"))
    for link in robot.links("collision"):
        if link.get("name") in names:
            _remove_shapes(link)
    return names


def _is_leg(name: str) -> bool:
    return any(word in name for word in ("hip", "thigh", "calf", "knee", "ankle"))


@mutation("COL003", "error", "robot without collision shapes")
def no_collision(robot: Mutant) -> Subjects:
    for link in robot.links("collision"):
        _remove_shapes(link)
    return ()


def _sizes(robot: Mutant) -> list[tuple[etree._Element, str]]:
    return [
        (shape, name)
        for shape in robot.root.iterfind("link/collision/geometry/*")
        for name in ("size", "radius", "length")
        if shape.get(name)
    ]


def _resize(robot: Mutant, factor: float) -> Subjects:
    shape, name = robot.pick(_sizes(robot))
    values = [float(word) for word in shape.get(name).split()]
    values[robot.rng.randrange(len(values))] *= factor
    set_numbers(shape, name, values)
    return [next(e.get("name") for e in shape.iterancestors("link"))]


@mutation("COL004", "error", "shape with size zero")
def zero_size(robot: Mutant) -> Subjects:
    return _resize(robot, 0.0)


@mutation("COL004", "error", "shape with negative size")
def negative_size(robot: Mutant) -> Subjects:
    return _resize(robot, -1.0)


def pick_thigh(robot: Mutant, primitive: bool | None) -> tuple[str, np.ndarray]:
    """Return a random second link of a leg, and a point inside it close to its joint.

    Args:
        robot: The robot.
        primitive: Whether its shapes must be primitives or meshes; None for any.
    """
    bodies = robot.facts.bodies
    thigh = robot.pick(
        b
        for b in bodies
        if b.parent
        and bodies[b.parent].parent == 0
        and b.collisions
        and _is_leg(b.name)
        and primitive in (None, _is_primitive(b))
    )
    pose = thigh.zero_pose
    middle = (pose @ thigh.collisions[0].pose)[:3, 3]
    return thigh.name, 0.8 * pose[:3, 3] + 0.2 * middle


def _is_primitive(body: Body) -> bool:
    return all(placed.geometry.shape != "mesh" for placed in body.collisions)


def _add_sphere_to_base(robot: Mutant, primitive: bool) -> Subjects:
    thigh, position = pick_thigh(robot, primitive)
    trunk = robot.base_link().get("name")
    inside = np.linalg.inv(robot.link_pose(trunk)) @ [*position, 1]
    _add_shape(robot, trunk, '<sphere radius="0.06"/>', inside[:3])
    return [trunk, *robot.body_names(thigh)]


@mutation("COL005", "error", "overlap of trunk and thigh")
def overlap(robot: Mutant) -> Subjects:
    return _add_sphere_to_base(robot, primitive=True)


@mutation("COL005", "warning", "overlap of trunk and thigh mesh")
def mesh_overlap(robot: Mutant) -> Subjects:
    return _add_sphere_to_base(robot, primitive=False)


def _add_sphere_to_leg(robot: Mutant, primitive: bool) -> Subjects:
    """Add a sphere to the first link of a leg at the position of the first link of another."""
    firsts = [b for b in robot.facts.bodies if b.parent == 0 and b.joint and _is_leg(b.name)]
    one = robot.pick(firsts)
    other = robot.pick(
        b for b in firsts if b is not one and b.collisions and _is_primitive(b) is primitive
    )
    middle = (other.zero_pose @ other.collisions[0].pose)[:, 3]
    position = np.linalg.inv(one.zero_pose) @ middle
    _add_shape(robot, one.top.name, '<sphere radius="0.05"/>', position[:3])
    return [*robot.body_names(one.name), *robot.body_names(other.name)]


@mutation("COL005", "error", "overlap of two legs")
def leg_overlap(robot: Mutant) -> Subjects:
    return _add_sphere_to_leg(robot, primitive=True)


@mutation("COL005", "warning", "overlap of a leg and the mesh of another leg")
def leg_mesh_overlap(robot: Mutant) -> Subjects:
    return _add_sphere_to_leg(robot, primitive=False)


@mutation("COL006", "info", "overlap of trunk and thigh in most of the joint range")
def overlap_in_range(robot: Mutant) -> Subjects:
    """Add boxes in front of and above a thigh, where it is in most of its range."""
    if len(robot.feet()) != 4:
        raise NotApplicableError
    bodies = robot.facts.bodies
    calf = robot.facts.body_of[child(robot.pick(robot.knee_joints()))]
    thigh = bodies[calf.parent]
    hip, knee = (body.zero_pose[:3, 3] for body in (thigh, calf))
    length = float(np.linalg.norm(knee - hip))
    trunk = robot.base_link().get("name")
    home = np.linalg.inv(robot.link_pose(trunk))
    for size, position in (
        ((2 * length, 0.2, length), (0, 0, 0.04 + length / 2)),
        ((length, 0.2, length), (0.06 + length / 2, 0, 0)),
    ):
        xyz = " ".join(f"{value:.4f}" for value in size)
        _add_shape(robot, trunk, f'<box size="{xyz}"/>', (home @ [*(hip + position), 1])[:3])
    return [trunk, *robot.body_names(thigh.name)]
