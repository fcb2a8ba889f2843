"""A mutant: a copy of a robot without defects, to which one defect is added."""

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
Format = Literal["urdf", "mjcf"]
T = TypeVar("T")

LEG = re.compile("hip|thigh|calf|knee|ankle")
KNEE = re.compile("calf|knee")
SIDES = (("FL", "FR"), ("RL", "RR"), ("left", "right"))


class NotApplicableError(Exception):
    """The robot has no element to which the mutation applies."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SourceRobot:
    """A robot without defects."""

    label: str
    file: Path
    """The robot file, in a writable folder of its own."""

    root: etree._Element
    facts: Facts
    """Its bodies, poses and masses; no findings."""


class Mutant:
    """A copy of a robot whose XML, text and files can be changed."""

    def __init__(self, source: SourceRobot, rng: random.Random, prefix: str) -> None:
        self.root = copy.deepcopy(source.root)
        self.source = source
        self.facts = source.facts
        self.rng = rng
        self.prefix = prefix
        """Start of the names of all files written for this mutant."""

        self.file_name = source.file.name
        self.files: list[Path] = []
        """The files written for this mutant."""

        self.rewrite: Callable[[bytes], bytes] = lambda text: text
        """A function that is applied to the final text."""

    @property
    def folder(self) -> Path:
        """Return the folder of the robot file."""
        return self.source.file.parent

    def text(self) -> bytes:
        """Return the text of the robot file."""
        text: bytes = etree.tostring(self.root.getroottree(), encoding="utf-8")
        return self.rewrite(text)

    def write(self, name: str, data: bytes) -> Path:
        """Write a file to the folder of the robot."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        self.files.append(path)
        return path

    def pick(self, candidates: Iterable[T]) -> T:
        """Return a random candidate.

        Raises:
            NotApplicableError: If there are no candidates.
        """
        listed = list(candidates)
        if not listed:
            raise NotApplicableError
        return self.rng.choice(listed)

    def links(self, path: str = "") -> list[etree._Element]:
        """Return the links of a URDF that have an element at `path`."""
        return [e for e in self.root.findall("link") if not path or e.find(path) is not None]

    def link(self, name: str) -> etree._Element:
        """Return a link of a URDF by name."""
        return next(e for e in self.root.findall("link") if e.get("name") == name)

    def joints(self) -> list[etree._Element]:
        """Return the joints of a URDF."""
        return self.root.findall("joint")

    def actuated_joints(self) -> list[etree._Element]:
        """Return the revolute joints."""
        return [joint for joint in self.joints() if joint.get("type") == "revolute"]

    def leg_joints(self) -> list[etree._Element]:
        """Return the revolute joints of the legs."""
        return [joint for joint in self.actuated_joints() if LEG.search(joint.get("name", ""))]

    def knee_joints(self) -> list[etree._Element]:
        """Return the revolute joints of the knees."""
        return [joint for joint in self.actuated_joints() if KNEE.search(joint.get("name", ""))]

    def parent_joint(self, link: str) -> etree._Element | None:
        """Return the joint above a link."""
        return next((j for j in self.joints() if child(j) == link), None)

    def base_link(self) -> etree._Element:
        """Return the link of the trunk with the most mass."""
        return self.link(self.facts.bodies[0].name)

    def actuated_links(self) -> list[etree._Element]:
        """Return the links with an inertial that are children of revolute joints."""
        names = {child(joint) for joint in self.actuated_joints()}
        return [e for e in self.links("inertial/mass") if e.get("name") in names]

    def leg_links(self) -> list[etree._Element]:
        """Return the links with an inertial that are children of leg joints."""
        return [e for e in self.actuated_links() if LEG.search(e.get("name", ""))]

    def body_names(self, link: str) -> list[str]:
        """Return the names of all links of the body of a link, and of the joint above them."""
        body = self.facts.body_of.get(link)
        if body is None:
            return [link]
        return [part.name for part in body.links] + ([body.joint.name] if body.joint else [])

    def feet(self) -> list[str]:
        """Return the links at the ends of the knees' chains that touch the ground."""
        feet = []
        for joint in self.knee_joints():
            body = self.facts.body_of[child(joint)]
            while below := [b for b in self.facts.bodies if b.parent == body.index]:
                body = below[0]
            pose = body.zero_pose
            shapes = [(float((pose @ s.pose)[2, 3]), s.link) for s in body.collisions]
            if len(body.links) == 1:
                feet.append(body.links[-1].name)
            else:
                feet.append(min(shapes)[1] if shapes else body.name)
        return feet

    def insert(self, xml: str) -> etree._Element:
        """Append an element to the root."""
        element = etree.fromstring(xml)
        self.root.append(element)
        return element

    def link_pose(self, link: str) -> np.ndarray:
        """Return the pose of a link in the trunk frame, all joints at 0, shape (4, 4) [m]."""
        body = self.facts.body_of[link]
        names = [part.name for part in body.links]
        pose: np.ndarray = body.zero_pose @ body.poses[names.index(link)]
        return pose


def child(joint: etree._Element) -> str:
    element = joint.find("child")
    return "" if element is None else element.get("link", "")


def parent(joint: etree._Element) -> str:
    element = joint.find("parent")
    return "" if element is None else element.get("link", "")


def mirror_names(name: str) -> list[str]:
    """Return a name, and that of its mirror image if there is one."""
    for left, right in SIDES:
        for one, other in ((left, right), (right, left)):
            if name.startswith(one):
                return [name, other + name[len(one) :]]
    return [name]


def numbers(element: etree._Element, attribute: str) -> np.ndarray:
    return np.array([float(word) for word in element.get(attribute, "").split()])


def set_numbers(
    element: etree._Element, attribute: str, values: Sequence[float] | np.ndarray
) -> None:
    element.set(attribute, " ".join(f"{value:.9g}" for value in values))


def add_offset(
    element: etree._Element, attribute: str, offset: Sequence[float] | np.ndarray
) -> None:
    set_numbers(element, attribute, numbers(element, attribute) + np.asarray(offset))


def origin(element: etree._Element) -> etree._Element:
    """Return the origin of an element; add one if there is none."""
    existing = element.find("origin")
    if existing is None:
        existing = etree.Element("origin", xyz="0 0 0", rpy="0 0 0")
        element.insert(0, existing)
    if not existing.get("xyz"):
        existing.set("xyz", "0 0 0")
    return existing


def scale_inertia(link: etree._Element, factor: float) -> None:
    element = link.find("inertial/inertia")
    if element is None:
        raise NotApplicableError
    for key, value in element.items():
        element.set(key, f"{float(value) * factor:.9g}")


def scale_mass(link: etree._Element, factor: float) -> None:
    """Scale the mass and the inertia of a link."""
    mass = link.find("inertial/mass")
    if mass is None:
        raise NotApplicableError
    mass.set("value", f"{float(mass.get('value', '0')) * factor:.9g}")
    scale_inertia(link, factor)


def limit(joint: etree._Element) -> etree._Element:
    element = joint.find("limit")
    if element is None:
        raise NotApplicableError
    return element


Subjects = Iterable[str]
Apply = Callable[[Mutant], Subjects]


@dataclass(frozen=True, kw_only=True)
class Mutation:
    """A kind of defect."""

    title: str
    codes: tuple[str, ...]
    """The rules of which one must report the defect."""

    severity: Severity
    """Lowest severity that counts."""

    apply: Apply
    """Adds the defect to a mutant, and returns the names a finding may be about; none for any."""

    format: Format


MUTATIONS: list[Mutation] = []


def mutation(
    codes: str, severity: Severity, title: str, format_: Format = "urdf"
) -> Callable[[Apply], Apply]:
    """Return a decorator that registers a mutation; several codes are separated by spaces."""

    def register(apply: Apply) -> Apply:
        MUTATIONS.append(
            Mutation(
                title=title,
                codes=tuple(codes.split()),
                severity=severity,
                apply=apply,
                format=format_,
            )
        )
        return apply

    return register
