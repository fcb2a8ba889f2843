"""Defects of masses and inertias."""

import numpy as np
from lxml import etree

from defects.patient import (
    Patient,
    Subjects,
    kind,
    numbers,
    origin,
    put,
    scale_inertia,
    scale_mass,
    shift,
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


def _alone(robot: Patient) -> list[etree._Element]:
    """Return links that are the only ones with mass of a body that moves."""
    found = []
    for link in robot.moved_links():
        parts = robot.facts.body_of[link.get("name")].links
        if sum(bool(part.inertial and part.inertial.mass) for part in parts) == 1:
            found.append(link)
    return found


@kind("INR001", "error", "a moving body without an inertial")
def no_inertial(robot: Patient) -> Subjects:
    link = robot.choose(robot.moved_links())
    for name in robot.body(link.get("name")):
        for part in robot.links("inertial"):
            if part.get("name") == name:
                part.remove(part.find("inertial"))
    return robot.body(link.get("name"))


@kind("INR001", "error", "a moving body with a mass of zero")
def no_mass(robot: Patient) -> Subjects:
    link = robot.choose(robot.moved_links())
    for part in robot.links("inertial/mass"):
        if part.get("name") in robot.body(link.get("name")):
            part.find("inertial/mass").set("value", "0")
    return robot.body(link.get("name"))


@kind("INR002", "error", "a negative mass")
def negative_mass(robot: Patient) -> Subjects:
    link = robot.choose(
        e for e in robot.links("inertial/mass") if float(e.find("inertial/mass").get("value")) > 0
    )
    mass = link.find("inertial/mass")
    mass.set("value", f"-{mass.get('value')}")
    return [link.get("name")]


@kind("INR003", "error", "a negative moment of inertia")
def negative_inertia(robot: Patient) -> Subjects:
    link = robot.choose(robot.moved_links())
    element = link.find("inertial/inertia")
    name = robot.choose(["ixx", "iyy", "izz"])
    element.set(name, f"-{element.get(name)}")
    return robot.body(link.get("name"))


@kind("INR003", "error", "a product of inertia too large")
def large_product(robot: Patient) -> Subjects:
    link = robot.choose(robot.moved_links())
    inertia = _inertia(link)
    inertia[0, 1] = inertia[1, 0] = 2 * max(inertia[0, 0], inertia[1, 1])
    _set_inertia(link, inertia)
    return robot.body(link.get("name"))


@kind("INR003 INR001", "error", "an inertia of zeros")
def zero_inertia(robot: Patient) -> Subjects:
    link = robot.choose(robot.moved_links())
    _set_inertia(link, np.zeros((3, 3)))
    return robot.body(link.get("name"))


@kind("INR004", "error", "moments that no body has")
def triangle(robot: Patient) -> Subjects:
    link = robot.choose(robot.moved_links())
    moments, axes = np.linalg.eigh(_inertia(link))
    moments[2] = (moments[0] + moments[1]) * robot.rng.uniform(1.1, 3)
    _set_inertia(link, axes @ np.diag(moments) @ axes.T)
    return robot.body(link.get("name"))


@kind("INR004", "warning", "moments that no body has, by less than 1 %")
def slight_triangle(robot: Patient) -> Subjects:
    link = robot.choose(robot.moved_links())
    moments, axes = np.linalg.eigh(_inertia(link))
    moments[2] = (moments[0] + moments[1]) * 1.005
    _set_inertia(link, axes @ np.diag(moments) @ axes.T)
    return robot.body(link.get("name"))


@kind("INR005", "warning", "the identity for an inertia")
def identity(robot: Patient) -> Subjects:
    link = robot.choose(robot.moved_links())
    _set_inertia(link, np.eye(3))
    return robot.body(link.get("name"))


@kind("INR005", "warning", "one inertia for all links")
def same_everywhere(robot: Patient) -> Subjects:
    size = robot.choose([0.001, 0.01, 0.1])
    for link in robot.links("inertial/inertia"):
        _set_inertia(link, np.eye(3) * size)
    return ()


@kind("INR006", "warning", "an inertia a hundred times too large")
def large_inertia(robot: Patient) -> Subjects:
    link = robot.choose(_alone(robot))
    scale_inertia(link, robot.choose([50.0, 100.0, 1000.0]))
    return robot.body(link.get("name"))


@kind("INR006", "error", "an inertia in g m2")
def inertia_in_grams(robot: Patient) -> Subjects:
    link = robot.choose(_alone(robot))
    scale_inertia(link, 1e4)
    return robot.body(link.get("name"))


@kind("INR007", "warning", "an inertia ten thousand times too small")
def small_inertia(robot: Patient) -> Subjects:
    link = robot.choose(_alone(robot))
    scale_inertia(link, robot.choose([1e-4, 1e-6]))
    return robot.body(link.get("name"))


@kind("INR008", "warning", "a centre of mass beside the body")
def center_outside(robot: Patient) -> Subjects:
    link = robot.choose(_alone(robot))
    where = origin(link.find("inertial"))
    axis = np.eye(3)[robot.rng.randrange(3)] * robot.choose([-1, 1])
    shift(where, "xyz", 0.6 * axis)
    return robot.body(link.get("name"))


@kind("INR008", "error", "a centre of mass in millimetres")
def center_in_millimetres(robot: Patient) -> Subjects:
    link = robot.choose(
        e
        for e in _alone(robot)
        if e.find("inertial/origin") is not None
        and np.linalg.norm(numbers(e.find("inertial/origin"), "xyz")) > 0.02
    )
    where = origin(link.find("inertial"))
    put(where, "xyz", numbers(where, "xyz") * 1000)
    return robot.body(link.get("name"))


@kind("INR009", "warning", "a part of a few grams on its own joint")
def light_part(robot: Patient) -> Subjects:
    host = robot.choose(
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
    return ["shutter", "shutter_joint", *robot.body(host.name)]


@kind("INR009 INR010", "warning", "a link of a gram beside one of kilograms")
def mass_ratio(robot: Patient) -> Subjects:
    link = robot.choose(_alone(robot))
    body = robot.facts.body_of[link.get("name")]
    above = robot.facts.bodies[body.parent]
    scale_mass(link, above.mass / body.mass / robot.rng.uniform(3000, 20000))
    return [*robot.body(link.get("name")), *(part.name for part in above.links)]


@kind("INR010", "warning", "a mass in grams")
def mass_in_grams(robot: Patient) -> Subjects:
    link = robot.choose(_alone(robot))
    scale_mass(link, 1000)
    return robot.body(link.get("name"))


@kind("INR010", "warning", "a mass a thousand times too small")
def mass_in_tonnes(robot: Patient) -> Subjects:
    link = robot.choose(_alone(robot))
    for part in robot.links("inertial/mass"):
        if part.get("name") in robot.body(link.get("name")):
            scale_mass(part, 0.001)
    return robot.body(link.get("name"))


@kind("INR010", "warning", "a trunk in grams")
def heavy_trunk(robot: Patient) -> Subjects:
    names = robot.body(robot.trunk().get("name"))
    for link in robot.links("inertial/mass"):
        if link.get("name") in names:
            scale_mass(link, 1000)
    return names


def _box(robot: Patient, size: float, name: str) -> str:
    host = robot.trunk().get("name")
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


@kind("INR011", "error", "a shape without an inertial that MuJoCo gives a large mass")
def unweighed(robot: Patient) -> Subjects:
    size = (0.12 * robot.facts.total_mass / 1000) ** (1 / 3)
    _box(robot, round(size, 4), "cover")
    return ()


@kind("INR011", "warning", "a shape without an inertial that MuJoCo gives a small mass")
def slightly_unweighed(robot: Patient) -> Subjects:
    size = (0.025 * robot.facts.total_mass / 1000) ** (1 / 3)
    _box(robot, round(size, 4), "lid")
    return ()
