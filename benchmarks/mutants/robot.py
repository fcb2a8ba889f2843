"""Functions for the XPath expressions of defects that need the robot's bodies, poses or files."""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.facts import Facts

from .mutant import Element
from .xpath_functions import FUNCTIONS, format_numbers, mirror_names, texts


@dataclass(frozen=True, kw_only=True, eq=False)
class SourceRobot:
    """A robot without defects.

    Attributes:
        label: Name of the folder with the robot and its meshes.
        file: The robot file, in a writable folder of its own.
        root: Root of its XML.
        facts: Its bodies, poses and masses; no findings.
    """

    label: str
    file: Path
    root: Element
    facts: Facts

    def functions(self) -> Mapping[str, Callable[..., Any]]:
        """Return the functions by name. Their first argument is the context of lxml."""
        facts = self.facts

        def body(link: Any) -> Body:
            return facts.body_of[texts(link)[0]]

        def joint_limit(name: Any) -> Any:
            return next(joint.limit for joint in facts.joints if joint.name == texts(name)[0])

        def file(path: Any) -> Path:
            return self.file.parent / texts(path)[0]

        return FUNCTIONS | {
            # Names
            "root_link": lambda _: facts.tree.order[0],
            "trunk": lambda _: facts.bodies[0].name,
            "feet": lambda _: list(self._feet()),
            "bodies_heavier_than": lambda _, mass: [
                body.name
                for body in facts.bodies
                if body.mass > mass and (self._depth(body) <= 1 or len(body.links) == 1)
            ],
            "thighs": lambda _: [
                body.name
                for body in facts.bodies
                if self._depth(body) == 2
                and body.collisions
                and re.search("hip|thigh|calf|knee|ankle", body.name)
            ],
            "main_links": lambda _: [body.name for body in facts.bodies],
            "body": lambda _, links: [n for name in texts(links) for n in self._body_names(name)],
            "top_link": lambda _, link: body(link).top.name,
            "above": lambda _, link: [part.name for part in self._parent(body(link)).links],
            "below": lambda _, link: self._below(texts(link)[0]),
            "limb": lambda _, link: self._limb(body(link)),
            # Values
            "mass": lambda _, link: float(body(link).mass),
            "num_masses": lambda _, link: float(
                sum(bool(part.inertial and part.inertial.mass) for part in body(link).links)
            ),
            "total_mass": lambda _: float(facts.total_mass),
            "depth": lambda _, link: float(self._depth(body(link))),
            "shapes": lambda _, link: [shape.geometry.shape for shape in body(link).collisions],
            "lower": lambda _, joint: float(joint_limit(joint).lower),
            "upper": lambda _, joint: float(joint_limit(joint).upper),
            # Positions
            "distance": lambda _, one, other: float(
                np.linalg.norm(body(one).zero_pose[:3, 3] - body(other).zero_pose[:3, 3])
            ),
            "displaced": lambda _, link, *offset: self._in_trunk(
                body(link).zero_pose[:3, 3] + offset, 6
            ),
            "near_joint": lambda _, link, digits: self._in_trunk(
                0.8 * body(link).zero_pose[:3, 3] + 0.2 * _first_shape(body(link))[:3, 3],
                int(digits),
            ),
            "first_shape": lambda _, link, frame: format_numbers(
                (np.linalg.inv(body(frame).zero_pose) @ _first_shape(body(link)))[:3, 3], 6
            ),
            # Files
            "other_mesh": lambda _, link: self._other_mesh(texts(link)[0]),
            "calf_mesh": lambda _: self._calf_mesh(),
            "file_stem": lambda _: self.file.stem,
            "exists": lambda _, path: file(path).exists(),
            "absolute_path": lambda _, path: str(file(path).resolve()),
            "package_path": lambda _, path: self._package_path(file(path).resolve()),
        }

    def _parent(self, body: Body) -> Body:
        assert body.parent is not None, "the trunk has no parent"
        return self.facts.bodies[body.parent]

    def _depth(self, body: Body) -> int:
        """Return the number of bodies above a body."""
        return 0 if body.parent is None else 1 + self._depth(self._parent(body))

    def _body_names(self, link: str) -> list[str]:
        """Return the names of all links of the body of a link, and of the joint above them."""
        body = self.facts.body_of.get(link)
        if body is None:
            return [link]
        return [part.name for part in body.links] + ([body.joint.name] if body.joint else [])

    def _feet(self) -> Iterator[str]:
        """Yield the links at the ends of the knees' chains that touch the ground."""
        for knee in self._knees():
            body = self.facts.body_of[knee.find("child").get("link")]
            while below := [b for b in self.facts.bodies if b.parent == body.index]:
                body = below[0]
            pose = body.zero_pose
            shapes = [(float((pose @ s.pose)[2, 3]), s.link) for s in body.collisions]
            if len(body.links) == 1:
                yield body.links[-1].name
            else:
                yield min(shapes)[1] if shapes else body.name

    def _below(self, link: str) -> list[str]:
        """Return a link and all links below it."""
        found = [link]
        for name in found:
            found += [joint.child for joint in self.facts.tree.child_joints.get(name, ())]
        return found

    def _limb(self, body: Body) -> list[str]:
        """Return the names of all links and joints of the limb of a body."""
        while body.parent:
            body = self._parent(body)
        links = self._below(body.top.name)
        return links + [self.facts.tree.parent_joint[link].name for link in links]

    def _visual_mesh(self, link: str) -> str | None:
        mesh = self.root.find(f"link[@name='{link}']/visual/geometry/mesh")
        return None if mesh is None else mesh.get("filename")

    def _calf_mesh(self) -> str:
        """Return the visual mesh of the first calf that has one."""
        calves = [joint.find("child").get("link") for joint in self._knees()]
        return next(mesh for calf in calves if (mesh := self._visual_mesh(calf)))

    def _other_mesh(self, link: str) -> str:
        """Return the visual mesh of the mirror image of a link, if the link has another mesh."""
        own, names = self._visual_mesh(link), mirror_names(link)
        other = self._visual_mesh(names[1]) if own and len(names) == 2 else None
        return other if other and other != own else ""

    def _knees(self) -> list[Element]:
        joints = self.root.findall("joint[@type='revolute']")
        return [joint for joint in joints if re.search("calf|knee", joint.get("name"))]

    def _in_trunk(self, position: np.ndarray, digits: int) -> str:
        """Return a position in the frame of the main link of the trunk."""
        trunk = self.facts.bodies[0]
        pose = trunk.poses[trunk.links.index(trunk.main_link)]
        return format_numbers((np.linalg.inv(pose) @ [*position, 1])[:3], digits)

    def _package_path(self, path: Path) -> str:
        top = next(parent for parent in path.parents if parent.name == self.label)
        return f"package://{top.name}/{path.relative_to(top)}"


def _first_shape(body: Body) -> np.ndarray:
    """Return the pose of the first collision shape of a body, in the frame of the trunk."""
    pose: np.ndarray = body.zero_pose @ body.collisions[0].pose
    return pose
