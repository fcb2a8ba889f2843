"""Defects of collision shapes."""

import numpy as np
from lxml import etree

from defects.patient import NotHereError, Patient, Subjects, child, kind, put
from terrainkit_robots.analysis.bodies.bodies import Body


def _bare(link: etree._Element) -> None:
    for shape in link.findall("collision"):
        link.remove(shape)


def _add(robot: Patient, link: str, shape: str, place: np.ndarray) -> None:
    xyz = " ".join(f"{value:.6g}" for value in place)
    element = etree.fromstring(
        f'<collision><origin xyz="{xyz}"/><geometry>{shape}</geometry></collision>'
    )
    robot.link(link).append(element)


@kind("COL001", "error", "no collision on a shank and its foot")
def bare_leg(robot: Patient) -> Subjects:
    foot = robot.choose(robot.feet())
    shank = child(robot.choose(j for j in robot.knees() if _ends_in(robot, child(j), foot)))
    names = {*robot.body(shank), *robot.body(foot)}
    for link in robot.links("collision"):
        if link.get("name") in names or link.get("name") in _below(robot, shank):
            _bare(link)
    return [*names, *_below(robot, shank)]


def _below(robot: Patient, link: str) -> list[str]:
    found = [link]
    for name in found:
        found += [
            child(joint) for joint in robot.joints() if joint.find("parent").get("link") == name
        ]
    return found


def _ends_in(robot: Patient, link: str, foot: str) -> bool:
    return foot in _below(robot, link)


@kind("COL001", "error", "no collision on any foot")
def bare_feet(robot: Patient) -> Subjects:
    feet = robot.feet()
    for foot in feet:
        _bare(robot.link(foot))
    return [name for foot in feet for name in robot.body(foot)]


@kind("COL002", "warning", "no collision on the trunk")
def bare_trunk(robot: Patient) -> Subjects:
    if any(b.parent == 0 and not _leg(b.name) for b in robot.facts.bodies):
        raise NotHereError  # arms and waist are above the trunk, and collide
    names = robot.body(robot.trunk().get("name"))
    for link in robot.links("collision"):
        if link.get("name") in names:
            _bare(link)
    return names


def _leg(name: str) -> bool:
    return any(word in name for word in ("hip", "thigh", "calf", "knee", "ankle"))


@kind("COL003", "error", "no collision anywhere")
def bare_robot(robot: Patient) -> Subjects:
    for link in robot.links("collision"):
        _bare(link)
    return ()


def _sizes(robot: Patient) -> list[tuple[etree._Element, str]]:
    return [
        (shape, name)
        for shape in robot.root.iterfind("link/collision/geometry/*")
        for name in ("size", "radius", "length")
        if shape.get(name)
    ]


def _resize(robot: Patient, factor: float) -> Subjects:
    shape, name = robot.choose(_sizes(robot))
    values = [float(word) for word in shape.get(name).split()]
    values[robot.rng.randrange(len(values))] *= factor
    put(shape, name, values)
    return [next(e.get("name") for e in shape.iterancestors("link"))]


@kind("COL004", "error", "a size of zero")
def zero_size(robot: Patient) -> Subjects:
    return _resize(robot, 0.0)


@kind("COL004", "error", "a negative size")
def negative_size(robot: Patient) -> Subjects:
    return _resize(robot, -1.0)


def in_thigh(robot: Patient, primitive: bool | None) -> tuple[str, np.ndarray]:
    """Choose the second link of a leg; return it and a place in it, close to its joint.

    Args:
        robot: The robot.
        primitive: Whether its shapes have to be primitives, or meshes.
    """
    bodies = robot.facts.bodies
    thigh = robot.choose(
        b
        for b in bodies
        if b.parent
        and bodies[b.parent].parent == 0
        and b.collisions
        and _leg(b.name)
        and primitive in (None, _is_primitive(b))
    )
    pose = robot.facts.zero_poses[thigh.index]
    middle = (pose @ thigh.collisions[0].pose)[:3, 3]
    return thigh.name, 0.8 * pose[:3, 3] + 0.2 * middle


def _is_primitive(body: Body) -> bool:
    return all(placed.geometry.shape != "mesh" for placed in body.collisions)


def _ball_in_thigh(robot: Patient, primitive: bool) -> Subjects:
    thigh, place = in_thigh(robot, primitive)
    trunk = robot.trunk().get("name")
    inside = np.linalg.inv(robot.place(trunk)) @ [*place, 1]
    _add(robot, trunk, '<sphere radius="0.06"/>', inside[:3])
    return [trunk, *robot.body(thigh)]


@kind("COL005", "error", "the trunk reaches into a thigh")
def overlap(robot: Patient) -> Subjects:
    return _ball_in_thigh(robot, primitive=True)


@kind("COL005", "warning", "the trunk reaches into the mesh of a thigh")
def overlap_of_mesh(robot: Patient) -> Subjects:
    return _ball_in_thigh(robot, primitive=False)


def _ball_in_leg(robot: Patient, primitive: bool) -> Subjects:
    """Put a ball on the first link of a leg, where that of another leg is."""
    firsts = [b for b in robot.facts.bodies if b.parent == 0 and b.joint and _leg(b.name)]
    one = robot.choose(firsts)
    other = robot.choose(
        b for b in firsts if b is not one and b.collisions and _is_primitive(b) is primitive
    )
    poses = robot.facts.zero_poses
    middle = (poses[other.index] @ other.collisions[0].pose)[:, 3]
    place = np.linalg.inv(poses[one.index]) @ middle
    _add(robot, one.top.name, '<sphere radius="0.05"/>', place[:3])
    return [*robot.body(one.name), *robot.body(other.name)]


@kind("COL005", "error", "a shape sits where another leg is")
def overlap_of_legs(robot: Patient) -> Subjects:
    return _ball_in_leg(robot, primitive=True)


@kind("COL005", "warning", "a shape sits where the mesh of another leg is")
def overlap_of_leg_meshes(robot: Patient) -> Subjects:
    return _ball_in_leg(robot, primitive=False)


@kind("COL006", "info", "a cage of the trunk around a thigh")
def cage(robot: Patient) -> Subjects:
    """Put boxes in front of a thigh and above it, where it is in most of its range."""
    if len(robot.feet()) != 4:
        raise NotHereError
    bodies = robot.facts.bodies
    calf = robot.facts.body_of[child(robot.choose(robot.knees()))]
    thigh = bodies[calf.parent]
    hip, knee = (robot.facts.zero_poses[body.index][:3, 3] for body in (thigh, calf))
    length = float(np.linalg.norm(knee - hip))
    trunk = robot.trunk().get("name")
    home = np.linalg.inv(robot.place(trunk))
    for size, place in (
        ((2 * length, 0.2, length), (0, 0, 0.04 + length / 2)),
        ((length, 0.2, length), (0.06 + length / 2, 0, 0)),
    ):
        xyz = " ".join(f"{value:.4f}" for value in size)
        _add(robot, trunk, f'<box size="{xyz}"/>', (home @ [*(hip + place), 1])[:3])
    return [trunk, *robot.body(thigh.name)]
