"""A healthy robot to break: its XML, the files beside it, and where things are on it."""

import copy
import random
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
from lxml import etree

from terrainkit_robots.analysis.facts import Facts

Severity = Literal["error", "warning", "info"]
T = TypeVar("T")

LEG = re.compile("hip|thigh|calf|knee|ankle")
KNEE = re.compile("calf|knee")
SIDES = (("FL", "FR"), ("RL", "RR"), ("left", "right"))


class NotHereError(Exception):
    """The robot has no place for this defect."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Healthy:
    """A robot before anything is broken."""

    label: str
    file: Path
    """In a folder of its own, which may be written to."""

    root: etree._Element
    facts: Facts
    """Where things are on it; nothing that a rule says."""


class Patient:
    """A copy of a healthy robot, to be broken."""

    def __init__(self, healthy: Healthy, rng: random.Random, serial: str) -> None:
        self.root = copy.deepcopy(healthy.root)
        self.healthy = healthy
        self.facts = healthy.facts
        self.rng = rng
        self.serial = serial
        """Part of the name of each file written for it, so that no two share one."""

        self.file_name = healthy.file.name
        self.written: list[Path] = []
        self.rewrite: Callable[[bytes], bytes] = lambda text: text
        """What becomes of the text in the end."""

    @property
    def folder(self) -> Path:
        """Return the folder of the robot's file."""
        return self.healthy.file.parent

    def text(self) -> bytes:
        """Return what is to be read."""
        text: bytes = etree.tostring(self.root.getroottree(), encoding="utf-8")
        return self.rewrite(text)

    def write(self, name: str, data: bytes) -> Path:
        """Write a file in the robot's folder; it is removed afterwards."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        self.written.append(path)
        return path

    def choose(self, among: Iterable[T]) -> T:
        """Return one of several things; if there are none, the defect is not for this robot."""
        things = list(among)
        if not things:
            raise NotHereError
        return self.rng.choice(things)

    def links(self, having: str = "") -> list[etree._Element]:
        """Return the links of a URDF, or those with a certain element."""
        return [e for e in self.root.findall("link") if not having or e.find(having) is not None]

    def link(self, name: str) -> etree._Element:
        """Return a link of a URDF."""
        return next(e for e in self.root.findall("link") if e.get("name") == name)

    def joints(self) -> list[etree._Element]:
        """Return the joints of a URDF."""
        return self.root.findall("joint")

    def moving(self) -> list[etree._Element]:
        """Return the joints that move."""
        return [joint for joint in self.joints() if joint.get("type") == "revolute"]

    def leg_joints(self) -> list[etree._Element]:
        """Return the joints of legs."""
        return [joint for joint in self.moving() if LEG.search(joint.get("name", ""))]

    def knees(self) -> list[etree._Element]:
        """Return the knees."""
        return [joint for joint in self.moving() if KNEE.search(joint.get("name", ""))]

    def above(self, link: str) -> etree._Element | None:
        """Return the joint above a link."""
        return next((j for j in self.joints() if child(j) == link), None)

    def trunk(self) -> etree._Element:
        """Return the link of the trunk with the most mass."""
        return self.link(self.facts.bodies[0].name)

    def moved_links(self) -> list[etree._Element]:
        """Return links with an inertial right below a joint that moves."""
        names = {child(joint) for joint in self.moving()}
        return [e for e in self.links("inertial/mass") if e.get("name") in names]

    def leg_links(self) -> list[etree._Element]:
        """Return links of legs with an inertial, each right below a joint that moves."""
        return [e for e in self.moved_links() if LEG.search(e.get("name", ""))]

    def body(self, link: str) -> list[str]:
        """Return all links that move with one, and the joint above them."""
        body = self.facts.body_of.get(link)
        if body is None:
            return [link]
        return [part.name for part in body.links] + ([body.joint.name] if body.joint else [])

    def feet(self) -> list[str]:
        """Return the links that touch the ground, by their place: the ends of the knees' chains."""
        found = []
        for joint in self.knees():
            at = self.facts.body_of[child(joint)]
            while below := [b for b in self.facts.bodies if b.parent == at.index]:
                at = below[0]
            found.append(at.links[-1].name if len(at.links) == 1 else self._lowest(at.index))
        return found

    def _lowest(self, index: int) -> str:
        body, pose = self.facts.bodies[index], self.facts.zero_poses[index]
        shapes = [(float((pose @ s.pose)[2, 3]), s.link) for s in body.collisions]
        return min(shapes)[1] if shapes else body.name

    def insert(self, xml: str) -> etree._Element:
        """Put an element at the end of the root."""
        element = etree.fromstring(xml)
        self.root.append(element)
        return element

    def place(self, link: str) -> np.ndarray:
        """Return the pose of a link in the trunk's frame at zero, shape (4, 4) [m]."""
        body = self.facts.body_of[link]
        names = [part.name for part in body.links]
        pose: np.ndarray = self.facts.zero_poses[body.index] @ body.poses[names.index(link)]
        return pose


def child(joint: etree._Element) -> str:
    element = joint.find("child")
    return "" if element is None else element.get("link", "")


def parent(joint: etree._Element) -> str:
    element = joint.find("parent")
    return "" if element is None else element.get("link", "")


def mirrored(name: str) -> list[str]:
    """Return the name and that of its mirror image, if it has one."""
    for left, right in SIDES:
        for one, other in ((left, right), (right, left)):
            if name.startswith(one):
                return [name, other + name[len(one) :]]
    return [name]


def numbers(element: etree._Element, attribute: str) -> np.ndarray:
    return np.array([float(word) for word in element.get(attribute, "").split()])


def put(element: etree._Element, attribute: str, values: Sequence[float] | np.ndarray) -> None:
    element.set(attribute, " ".join(f"{value:.9g}" for value in values))


def shift(element: etree._Element, attribute: str, by: Sequence[float] | np.ndarray) -> None:
    """Add a vector to the numbers of an attribute."""
    put(element, attribute, numbers(element, attribute) + np.asarray(by))


def origin(element: etree._Element) -> etree._Element:
    """Return the origin of an element; adds it if there is none."""
    found = element.find("origin")
    if found is None:
        found = etree.Element("origin", xyz="0 0 0", rpy="0 0 0")
        element.insert(0, found)
    if not found.get("xyz"):
        found.set("xyz", "0 0 0")
    return found


def scale_inertia(link: etree._Element, factor: float) -> None:
    element = link.find("inertial/inertia")
    if element is None:
        raise NotHereError
    for key, value in element.items():
        element.set(key, f"{float(value) * factor:.9g}")


def scale_mass(link: etree._Element, factor: float) -> None:
    """Scale the mass of a link, and its inertia with it."""
    mass = link.find("inertial/mass")
    if mass is None:
        raise NotHereError
    mass.set("value", f"{float(mass.get('value', '0')) * factor:.9g}")
    scale_inertia(link, factor)


def limit(joint: etree._Element) -> etree._Element:
    found = joint.find("limit")
    if found is None:
        raise NotHereError
    return found


Subjects = Iterable[str]
Inject = Callable[[Patient], Subjects]


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of defect."""

    title: str
    codes: tuple[str, ...]
    """The rule that has to find it; several where more than one is right."""

    severity: Severity
    """How bad it is at least."""

    inject: Inject
    """Breaks a patient and returns the names that a finding may be about; none for any."""

    formats: Literal["urdf", "mjcf"]


KINDS: list[Kind] = []


def kind(
    codes: str, severity: Severity, title: str, formats: Literal["urdf", "mjcf"] = "urdf"
) -> Callable[[Inject], Inject]:
    """Make a function a kind of defect; several codes are separated by a space."""

    def register(inject: Inject) -> Inject:
        KINDS.append(
            Kind(
                title=title,
                codes=tuple(codes.split()),
                severity=severity,
                inject=inject,
                formats=formats,
            )
        )
        return inject

    return register
