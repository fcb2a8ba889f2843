"""Where a robot uses its mesh files: each file once, with everything that refers to it."""

import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.fix import Edit, SetAttribute, WriteFile
from terrainkit_robots.description.model import Geometry, Link, MeshFile, Source
from terrainkit_robots.description.package_resolver import (
    filename_on_disk,
    is_absolute,
    is_package_uri,
)
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.mesh.sniff import Header
from terrainkit_robots.text import names


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshUse:
    """A shape of a link that is a mesh."""

    link: Link
    geometry: Geometry
    mesh: MeshFile

    collides: bool
    """Whether things touch it, by its hull or as it is."""


@dataclass(frozen=True, kw_only=True, eq=False)
class UsedMesh:
    """A mesh file and its uses, of which there is at least one."""

    uses: tuple[MeshUse, ...]

    meshes: Meshes
    """The files of the run."""

    strict: bool
    """Whether every simulator reads it: one that collides, or any of a MJCF file. MuJoCo drops the
    visual meshes of a URDF unless it is told to keep them."""

    @property
    def header(self) -> Header:
        """What the file is."""
        return self.meshes.header(self.mesh.path)

    @property
    def mesh(self) -> MeshFile:
        """The first use."""
        return self.uses[0].mesh

    @property
    def name(self) -> str:
        """The name of the file, as it is first written."""
        return self.mesh.filename

    @property
    def source(self) -> Source:
        """Where that is."""
        return self.mesh.source

    @cached_property
    def collisions(self) -> tuple[MeshUse, ...]:
        """The uses that collide."""
        return tuple(use for use in self.uses if use.collides)

    @property
    def role(self) -> str:
        """What the file is, in words: a collision mesh of which links, or a visual one."""
        kind, uses = ("collision", self.collisions) if self.collisions else ("visual", self.uses)
        return f"{kind} mesh of {names(dict.fromkeys(use.link.name for use in uses), 2)}"


def mesh_uses(robot: Facts) -> Iterator[MeshUse]:
    """Yield every mesh of every link, collision before visual, as far as it has a file."""
    for link in robot.model.links:
        for shapes, may_collide in ((link.collisions, True), (link.visuals, False)):
            for geometry in shapes:
                if geometry.shape == "mesh" and geometry.mesh is not None:
                    collides = may_collide and geometry.contacts and not geometry.fit_to_mesh
                    yield MeshUse(
                        link=link, geometry=geometry, mesh=geometry.mesh, collides=collides
                    )


def meshes_by_name(robot: Facts) -> list[UsedMesh]:
    """Return the meshes of a robot, one for each name that is written."""
    return _grouped(robot, lambda mesh: mesh.filename)


def meshes_by_file(robot: Facts) -> list[UsedMesh]:
    """Return the meshes of a robot, one for each file, without those that MSH001 reports."""
    files = _grouped(robot, lambda mesh: mesh.path)
    return [file for file in files if not is_lost(file)]


def _grouped(robot: Facts, key: Callable[[MeshFile], object]) -> list[UsedMesh]:
    groups: dict[object, list[MeshUse]] = {}
    for use in mesh_uses(robot):
        groups.setdefault(key(use.mesh), []).append(use)
    return [
        UsedMesh(
            # in the order of the file, so that the first is the one that is reported
            uses=tuple(sorted(uses, key=lambda use: use.mesh.source.line)),
            meshes=robot.meshes,
            strict=robot.model.kind == "mjcf" or any(use.collides for use in uses),
        )
        for uses in groups.values()
    ]


def is_lost(used: UsedMesh) -> bool:
    """Return whether there is no file where the name says, letters and packages aside."""
    return not used.meshes.exists(used.mesh.path) or is_elsewhere(used.mesh)


def is_elsewhere(mesh: MeshFile) -> bool:
    """Return whether a search found it in another folder than the one that is written."""
    return (
        mesh.found_by == "search"
        and not is_package_uri(mesh.filename)
        and not is_absolute(mesh.filename)
        and filename_on_disk(mesh.filename, mesh.path) is None
    )


def relative_name(robot: Facts, path: Path) -> str:
    """Return what a URDF has to call a file, with slashes on every system."""
    folder = robot.model.file.parent
    name = os.path.relpath(path, folder)
    real = os.path.realpath(path)
    if os.path.realpath(folder / name) != real:  # a link on the way: `..` leads elsewhere
        name = os.path.relpath(real, os.path.realpath(folder))
    return Path(name).as_posix()


def renamed(robot: Facts, uses: Iterable[MeshUse], name: str) -> tuple[SetAttribute, ...] | None:
    """Return edits that let uses refer to a file by this name; None if they cannot be edited."""
    edits: dict[Source, SetAttribute] = {}
    for use in uses:
        source = use.mesh.source
        if source.element is None or robot.model.kind == "xacro":
            return None
        edits[source] = SetAttribute(source=source, name=use.mesh.attribute, value=name)
    return tuple(edits.values())


def replaced(
    robot: Facts, uses: Iterable[MeshUse], ending: str, content: Callable[[], bytes]
) -> tuple[Edit, ...] | None:
    """Return edits that write a new mesh beside the one in use, and let the uses refer to it.

    Args:
        robot: The robot.
        uses: Uses of one file.
        ending: Of the new name, after that of the file without its own: `_hull.stl`.
        content: Makes the new file.
    """
    uses = list(uses)
    mesh = uses[0].mesh
    target = _free(robot, mesh.path, ending)
    if robot.model.kind == "mjcf":  # its names start at meshdir, which stays as it is
        folder = mesh.filename.replace("\\", "/").rpartition("/")
        name = f"{folder[0]}{folder[1]}{target.name}"
    else:
        name = relative_name(robot, target)
    edits = renamed(robot, uses, name)
    return None if edits is None else (WriteFile(path=target, content=content), *edits)


def _free(robot: Facts, path: Path, ending: str) -> Path:
    """Return a name beside `path` that no file has."""
    stem, dot, suffix = ending.rpartition(".")
    for number in range(1, 100):
        counted = f"{stem}_{number}" if number > 1 else stem
        target = path.with_name(f"{path.stem}{counted}{dot}{suffix}")
        if not robot.meshes.exists(target):
            return target
    return path.with_name(f"{path.stem}{ending}")
