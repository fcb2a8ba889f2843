"""Defects of masses and inertias (INR)."""

import numpy as np
from lxml import etree

from defects.mutant import (
    Mutant,
    Subjects,
    add_offset,
    mutation,
    numbers,
    origin,
    scale_inertia,
    scale_mass,
    set_numbers,
)

_SIX = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}


def _set_inertia(link: etree._Element, inertia: np.ndarray) -> None:
    element = link.find("inertial/inertia")
    for name, place in _SIX.items():
        element.set(name, f"{inertia[place]:.9g}")


def _inertia(link: etree._Element) -> np.ndarray:
    element = link.find("inertial/inertia")
    xx, xy, xz, yy, yz, zz = (float(element.get(name)) for name in _SIX)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _single_links(robot: Mutant) -> list[etree._Element]:
    """Return the links that have the whole mass of a moving body."""
    found = []
    for link in robot.actuated_links():
        parts = robot.facts.body_of[link.get("name")].links
        if sum(bool(part.inertial and part.inertial.mass) for part in parts) == 1:
            found.append(link)
    return found


@mutation("INR001", "error", "moving body without inertial")
def no_inertial(robot: Mutant) -> Subjects:
    link = robot.pick(robot.actuated_links())
    for name in robot.body_names(link.get("name")):
        for part in robot.links("inertial"):
            if part.get("name") == name:
                part.remove(part.find("inertial"))
    return robot.body_names(link.get("name"))


@mutation("INR001", "error", "moving body with mass zero")
def zero_mass(robot: Mutant) -> Subjects:
    link = robot.pick(robot.actuated_links())
    for part in robot.links("inertial/mass"):
        if part.get("name") in robot.body_names(link.get("name")):
            part.find("inertial/mass").set("value", "0")
    return robot.body_names(link.get("name"))


@mutation("INR002", "error", "negative mass")
def negative_mass(robot: Mutant) -> Subjects:
    link = robot.pick(
        e for e in robot.links("inertial/mass") if float(e.find("inertial/mass").get("value")) > 0
    )
    mass = link.find("inertial/mass")
    mass.set("value", f"-{mass.get('value')}")
    return [link.get("name")]


@mutation("INR003", "error", "negative moment of inertia")
def negative_inertia(robot: Mutant) -> Subjects:
    link = robot.pick(robot.actuated_links())
    element = link.find("inertial/inertia")
    name = robot.pick(["ixx", "iyy", "izz"])
    element.set(name, f"-{element.get(name)}")
    return robot.body_names(link.get("name"))


@mutation("INR003", "error", "product of inertia that is too large")
def large_product(robot: Mutant) -> Subjects:
    link = robot.pick(robot.actuated_links())
    inertia = _inertia(link)
    inertia[0, 1] = inertia[1, 0] = 2 * max(inertia[0, 0], inertia[1, 1])
    _set_inertia(link, inertia)
    return robot.body_names(link.get("name"))


@mutation("INR003 INR001", "error", "inertia of zeros")
def zero_inertia(robot: Mutant) -> Subjects:
    link = robot.pick(robot.actuated_links())
    _set_inertia(link, np.zeros((3, 3)))
    return robot.body_names(link.get("name"))


@mutation("INR004", "error", "violation of the triangle inequality")
def triangle(robot: Mutant) -> Subjects:
    link = robot.pick(robot.actuated_links())
    moments, axes = np.linalg.eigh(_inertia(link))
    moments[2] = (moments[0] + moments[1]) * robot.rng.uniform(1.1, 3)
    _set_inertia(link, axes @ np.diag(moments) @ axes.T)
    return robot.body_names(link.get("name"))


@mutation("INR004", "warning", "violation of the triangle inequality by less than 1 %")
def near_triangle(robot: Mutant) -> Subjects:
    link = robot.pick(robot.actuated_links())
    moments, axes = np.linalg.eigh(_inertia(link))
    moments[2] = (moments[0] + moments[1]) * 1.005
    _set_inertia(link, axes @ np.diag(moments) @ axes.T)
    return robot.body_names(link.get("name"))


@mutation("INR005", "warning", "identity matrix as inertia")
def identity(robot: Mutant) -> Subjects:
    link = robot.pick(robot.actuated_links())
    _set_inertia(link, np.eye(3))
    return robot.body_names(link.get("name"))


@mutation("INR005", "warning", "same inertia for all links")
def same_inertia(robot: Mutant) -> Subjects:
    size = robot.pick([0.001, 0.01, 0.1])
    for link in robot.links("inertial/inertia"):
        _set_inertia(link, np.eye(3) * size)
    return ()


@mutation("INR006", "warning", "inertia 50 to 1000 times too large")
def large_inertia(robot: Mutant) -> Subjects:
    link = robot.pick(_single_links(robot))
    scale_inertia(link, robot.pick([50.0, 100.0, 1000.0]))
    return robot.body_names(link.get("name"))


@mutation("INR006", "error", "inertia in g m2")
def inertia_units(robot: Mutant) -> Subjects:
    link = robot.pick(_single_links(robot))
    scale_inertia(link, 1e4)
    return robot.body_names(link.get("name"))


@mutation("INR007", "warning", "inertia at least 10,000 times too small")
def low_inertia(robot: Mutant) -> Subjects:
    link = robot.pick(_single_links(robot))
    scale_inertia(link, robot.pick([1e-4, 1e-6]))
    return robot.body_names(link.get("name"))


@mutation("INR008", "warning", "center of mass outside of the body")
def com_offset(robot: Mutant) -> Subjects:
    link = robot.pick(_single_links(robot))
    where = origin(link.find("inertial"))
    axis = np.eye(3)[robot.rng.randrange(3)] * robot.pick([-1, 1])
    add_offset(where, "xyz", 0.6 * axis)
    return robot.body_names(link.get("name"))


@mutation("INR008", "error", "center of mass in millimeters")
def com_units(robot: Mutant) -> Subjects:
    link = robot.pick(
        e
        for e in _single_links(robot)
        if e.find("inertial/origin") is not None
        and np.linalg.norm(numbers(e.find("inertial/origin"), "xyz")) > 0.02
    )
    where = origin(link.find("inertial"))
    set_numbers(where, "xyz", numbers(where, "xyz") * 1000)
    return robot.body_names(link.get("name"))


@mutation("INR009", "warning", "additional link of a few grams")
def light_link(robot: Mutant) -> Subjects:
    host = robot.pick(
        b for b in robot.facts.bodies if b.mass > 1 and (not b.parent or len(b.links) == 1)
    )
    mass = host.mass / robot.rng.uniform(2000, 8000)
    size = (mass / 1000) ** (1 / 3)
    inertia = mass * size**2 / 6
    robot.insert(
        f'<link name="shutter"><inertial><mass value="{mass:.6g}"/><inertia ixx="{inertia:.6g}" '
        f'ixy="0" ixz="0" iyy="{inertia:.6g}" iyz="0" izz="{inertia:.6g}"/></inertial>'
        f'<visual><geometry><box size="{size:.6g} {size:.6g} {size:.6g}"/></geometry></visual>'
        "</link>"
    )
    robot.insert(
        '<joint name="shutter_joint" type="revolute"><origin xyz="0.02 0 0.02"/>'
        f'<parent link="{host.name}"/><child link="shutter"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" effort="0.5" velocity="10"/></joint>'
    )
    return ["shutter", "shutter_joint", *robot.body_names(host.name)]


@mutation("INR009 INR010", "warning", "link of a gram next to one of kilograms")
def mass_ratio(robot: Mutant) -> Subjects:
    link = robot.pick(_single_links(robot))
    body = robot.facts.body_of[link.get("name")]
    above = robot.facts.bodies[body.parent]
    scale_mass(link, above.mass / body.mass / robot.rng.uniform(3000, 20000))
    return [*robot.body_names(link.get("name")), *(part.name for part in above.links)]


@mutation("INR010", "warning", "mass in grams")
def mass_units(robot: Mutant) -> Subjects:
    link = robot.pick(_single_links(robot))
    scale_mass(link, 1000)
    return robot.body_names(link.get("name"))


@mutation("INR010", "warning", "mass 1000 times too small")
def low_mass(robot: Mutant) -> Subjects:
    link = robot.pick(_single_links(robot))
    for part in robot.links("inertial/mass"):
        if part.get("name") in robot.body_names(link.get("name")):
            scale_mass(part, 0.001)
    return robot.body_names(link.get("name"))


@mutation("INR010", "warning", "mass of the trunk in grams")
def base_mass_units(robot: Mutant) -> Subjects:
    names = robot.body_names(robot.base_link().get("name"))
    for link in robot.links("inertial/mass"):
        if link.get("name") in names:
            scale_mass(link, 1000)
    return names


def _add_box(robot: Mutant, size: float, name: str) -> str:
    host = robot.base_link().get("name")
    robot.insert(
        f'<link name="{name}"><visual><geometry><box size="{size} {size} {size}"/></geometry>'
        f'</visual><collision><geometry><box size="{size} {size} {size}"/></geometry>'
        "</collision></link>"
    )
    robot.insert(
        f'<joint name="{name}_joint" type="fixed"><origin xyz="0 0 0.05"/>'
        f'<parent link="{host}"/><child link="{name}"/></joint>'
    )
    return name


@mutation("INR011", "error", "shape without inertial, with large inferred mass")
def large_inferred_mass(robot: Mutant) -> Subjects:
    size = (0.12 * robot.facts.total_mass / 1000) ** (1 / 3)
    _add_box(robot, round(size, 4), "cover")
    return ()


@mutation("INR011", "warning", "shape without inertial, with small inferred mass")
def low_inferred_mass(robot: Mutant) -> Subjects:
    size = (0.025 * robot.facts.total_mass / 1000) ** (1 / 3)
    _add_box(robot, round(size, 4), "lid")
    return ()
