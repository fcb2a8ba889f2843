"""Edits of rotations and inertias."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from .edits import attributes, edit
from .mutant import Element, Mutant
from .xpath_functions import format_numbers, numbers

_INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


@edit("turn")
def turn(mutant: Mutant, path: str, *, about: str, by: Any, with_position: bool = True) -> None:
    """Rotate the origins of elements about an axis, by an angle in degrees."""
    rotation = Rotation.from_rotvec(numbers(about) * float(mutant.fill(by)), degrees=True)
    for element in mutant.xpath(path):
        origin = element.find("origin")
        if origin is None:
            origin = element.makeelement("origin", {"xyz": "0 0 0", "rpy": "0 0 0"})
            element.insert(0, origin)
        turned = rotation * Rotation.from_euler("xyz", numbers(origin.get("rpy") or "0 0 0"))
        origin.set("rpy", format_numbers(turned.as_euler("xyz")))
        if with_position:
            origin.set("xyz", format_numbers(rotation.apply(numbers(origin.get("xyz")))))


@edit("scale_one_size")
def scale_one_size(mutant: Mutant, factor: float) -> None:
    """Multiply a random dimension of a random collision shape; `$link` is its link."""
    shape, name = mutant.pick(
        [
            (shape, name)
            for shape in mutant.root.iterfind("link/collision/geometry/*")
            for name in ("size", "radius", "length")
            if shape.get(name)
        ]
    )
    values = numbers(shape.get(name))
    values[mutant.rng.randrange(len(values))] *= factor
    shape.set(name, format_numbers(values))
    mutant.variables["link"] = next(shape.iterancestors("link")).get("name")


@edit("tilt")
def tilt(mutant: Mutant, path: str, *, by: Any) -> None:
    """Tilt an axis toward a random axis that is perpendicular to it, by an angle [rad]."""
    ((element, name),) = attributes(mutant, path)
    axis = numbers(element.get(name))
    other = mutant.pick([unit for unit in np.eye(3) if abs(unit @ axis) < 0.5])
    rotation = Rotation.from_rotvec(float(mutant.fill(by)) * np.cross(axis, other))
    element.set(name, format_numbers(rotation.apply(axis)))


@edit("set_largest_moment")
def set_largest_moment(mutant: Mutant, path: str, *, to_sum_times: Any) -> None:
    """Set the largest principal moment of inertia to the sum of the others, times a factor."""
    (element,) = mutant.select(path)
    moments, axes = np.linalg.eigh(_inertia(element))
    moments[2] = (moments[0] + moments[1]) * float(mutant.fill(to_sum_times))
    _set_inertia(element, axes @ np.diag(moments) @ axes.T)


@edit("move_inertia")
def move_inertia_to_link(mutant: Mutant, path: str) -> None:
    """Give the inertia of an `<inertial>` about the origin of its link."""
    (inertial,) = mutant.select(path)
    x, y, z = numbers(inertial.find("origin").get("xyz"))
    mass = float(inertial.find("mass").get("value"))
    offset = -np.outer((x, y, z), (x, y, z))
    np.fill_diagonal(offset, (y * y + z * z, x * x + z * z, x * x + y * y))
    element = inertial.find("inertia")
    _set_inertia(element, _inertia(element) + mass * offset)


def _inertia(element: Element) -> np.ndarray:
    xx, xy, xz, yy, yz, zz = (float(element.get(name)) for name in _INERTIA)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _set_inertia(element: Element, inertia: np.ndarray) -> None:
    for name, value in zip(_INERTIA, inertia[np.triu_indices(3)], strict=True):
        element.set(name, f"{value:.9g}")
