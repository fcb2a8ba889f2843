"""Group the meshes of a robot by file, edit the references to a file, and make its replacement."""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from terrainkit_robots.description.fix import Edit, SetAttribute, WriteFile
from terrainkit_robots.description.model import Geometry, Link, MeshFile, RobotModel, Source
from terrainkit_robots.description.package_resolver import (
    filename_on_disk,
    is_absolute,
    is_package_uri,
)
from terrainkit_robots.mesh.mesh_cache import MeshError, Meshes
from terrainkit_robots.mesh.sniff import Header
from terrainkit_robots.mesh.surface import binary_stl, cluster_vertices
from terrainkit_robots.text import group, names

MAX_STL_FACES = 200_000
"""Maximum number of faces that MuJoCo's STL reader accepts."""

# 32 of 536 published files exceed it, all of them with copies of their visual meshes.
MAX_COLLISION_FACES = 20_000
"""A collision mesh with more faces is usually a copy of the visual mesh. Most collision meshes have
fewer than 5,000, and a hull of 1,000 faces deviates by less than 1% of its size."""

MAX_SIMPLIFIED_FACES = 100_000
"""Maximum number of faces of a simplified mesh: half of MuJoCo's limit."""

_INITIAL_CELLS = 512
"""Number of cells along the longest side of a mesh in the first step of simplification."""

_HULL_VERTICES = 500
"""Maximum number of vertices of a convex hull that replaces a mesh. Its deviation is below 1% of
its size."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshUse:
    """A mesh of a link."""

    link: Link
    geometry: Geometry
    mesh: MeshFile

    is_collision: bool
    """Whether the mesh itself, or its convex hull, has contacts."""


@dataclass(frozen=True, kw_only=True, eq=False)
class UsedMesh:
    """A mesh file and its uses."""

    uses: tuple[MeshUse, ...]
    """Its uses, at least one."""

    meshes: Meshes
    """All mesh files."""

    strict: bool
    """Whether every simulator reads the file: a collision mesh, or any mesh of an MJCF file. MuJoCo
    discards the visual meshes of a URDF by default."""

    @property
    def header(self) -> Header:
        """Return the header of the file."""
        return self.meshes.header(self.mesh.path)

    @property
    def mesh(self) -> MeshFile:
        """Return the first reference to the file."""
        return self.uses[0].mesh

    @property
    def name(self) -> str:
        """Return the name of the file in its first reference."""
        return self.mesh.filename

    @property
    def source(self) -> Source:
        """Return where the first reference is written."""
        return self.mesh.source

    @cached_property
    def collisions(self) -> tuple[MeshUse, ...]:
        """The uses as a collision mesh."""
        return tuple(use for use in self.uses if use.is_collision)

    @property
    def label(self) -> str:
        """Return its name and its use, as messages show them."""
        return f"{self.name} ({self.role})"

    @property
    def role(self) -> str:
        """Return a description of its use, such as `collision mesh of FL_calf, FR_calf`."""
        kind, uses = ("collision", self.collisions) if self.collisions else ("visual", self.uses)
        return f"{kind} mesh of {names(dict.fromkeys(use.link.name for use in uses), 2)}"

    def count_faces(self) -> int | None:
        """Return the number of faces, or None if it is unknown. Only collision meshes are read."""
        if self.header.state != "fine":
            return None
        if self.header.faces is not None or not self.collisions:
            return self.header.faces
        try:
            return self.meshes.faces(self.mesh.path)
        except MeshError:
            return None

    def binary_copy(self) -> bytes:
        """Return the mesh as binary STL."""
        return binary_stl(self.meshes.surface(self.mesh.path))

    def hull_stl(self) -> bytes:
        """Return the convex hull as binary STL."""
        return binary_stl(self.meshes.hull(self.mesh.path, _HULL_VERTICES))

    def stl_or_hull(self) -> bytes:
        """Return the mesh as binary STL, or its convex hull if the mesh is too dense to collide."""
        is_dense = self.meshes.faces(self.mesh.path) > MAX_COLLISION_FACES
        return self.hull_stl() if is_dense else self.binary_copy()

    def simplified_stl(self) -> bytes:
        """Return the mesh with fewer faces, as binary STL.

        Raises:
            MeshError: if no faces are left.
        """
        surface = self.meshes.surface(self.mesh.path)
        cells = _INITIAL_CELLS
        while True:
            coarse = cluster_vertices(surface, cells)
            if not len(coarse.faces):
                raise MeshError("has no faces left after its vertices are merged")
            share = MAX_SIMPLIFIED_FACES / len(coarse.faces)
            if share >= 1:
                return binary_stl(coarse)
            # The number of faces grows with the square of the number of cells.
            cells = max(1, int(cells * min(0.9, share**0.5)))

    def has_hull(self, uses: Sequence[MeshUse]) -> bool:
        """Return whether it is readable and has a convex hull at the scale of each of some uses."""
        try:
            return not any(self.meshes.is_flat(use.mesh) for use in uses)
        except MeshError:
            return False

    def replace_edits(
        self, model: RobotModel, uses: Sequence[MeshUse], suffix: str, content: Callable[[], bytes]
    ) -> tuple[Edit, ...] | None:
        """Return the edits that write a new mesh beside this one and refer to it instead.

        Args:
            model: The description.
            uses: The uses that refer to the new mesh, at least one.
            suffix: End of the new name, which replaces the suffix of the file: `_hull.stl`.
            content: Returns the content of the new file.

        Returns:
            The edits, or None if the uses are not editable.
        """
        mesh = uses[0].mesh
        target = _unused_path(self.meshes, mesh.path, suffix)
        if model.kind == "mjcf":  # names are relative to meshdir, which does not change
            folder = mesh.filename.replace("\\", "/").rpartition("/")
            name = f"{folder[0]}{folder[1]}{target.name}"
        else:
            name = relative_name(model, target)
        edits = rename_edits(model, uses, name)
        return None if edits is None else (WriteFile(path=target, content=content), *edits)


def mesh_uses(model: RobotModel) -> Iterator[MeshUse]:
    """Yield every mesh with a file of every link, collision meshes before visual ones."""
    for link in model.links:
        for shapes, may_collide in ((link.collisions, True), (link.visuals, False)):
            for geometry in shapes:
                if geometry.shape == "mesh" and geometry.mesh is not None:
                    yield MeshUse(
                        link=link,
                        geometry=geometry,
                        mesh=geometry.mesh,
                        is_collision=may_collide and geometry.contacts and not geometry.fit_to_mesh,
                    )


def used_meshes(
    model: RobotModel, meshes: Meshes, key: Callable[[MeshFile], object]
) -> list[UsedMesh]:
    """Return the meshes of a robot, one for each value of a key, such as the path."""
    return [
        UsedMesh(
            # in the order of the file, because findings refer to the first one
            uses=tuple(sorted(uses, key=lambda use: use.mesh.source.line)),
            meshes=meshes,
            strict=model.kind == "mjcf" or any(use.is_collision for use in uses),
        )
        for uses in group((key(use.mesh), use) for use in mesh_uses(model)).values()
    ]


def is_missing(used: UsedMesh) -> bool:
    """Return whether no file has the name, apart from its letter case and package."""
    return not used.meshes.exists(used.mesh.path) or is_in_other_folder(used.mesh)


def is_in_other_folder(mesh: MeshFile) -> bool:
    """Return whether the file was found by a search, in another folder than its name says."""
    return (
        mesh.found_by == "search"
        and not is_package_uri(mesh.filename)
        and not is_absolute(mesh.filename)
        and filename_on_disk(mesh.filename, mesh.path) is None
    )


def relative_name(model: RobotModel, path: Path) -> str:
    """Return the name of a file relative to the robot file, with forward slashes."""
    folder = model.file.parent
    name = os.path.relpath(path, folder)
    real = os.path.realpath(path)
    if os.path.realpath(folder / name) != real:  # `..` leaves a symbolic link elsewhere
        name = os.path.relpath(real, os.path.realpath(folder))
    return Path(name).as_posix()


def rename_edits(
    model: RobotModel, uses: Iterable[MeshUse], name: str
) -> tuple[SetAttribute, ...] | None:
    """Return the edits that change the name of a file; None if its uses are not editable.

    A mesh asset whose name follows from the file gets this name, which geoms refer to.
    """
    edits: dict[tuple[Source, str], SetAttribute] = {}
    for use in uses:
        source, implied = use.mesh.source, use.mesh.implied_name
        if source.element is None or model.kind == "xacro":
            return None
        for attribute, value in ((use.mesh.attribute, name), ("name", implied)):
            if value:
                edits[source, attribute] = SetAttribute(source=source, name=attribute, value=value)
    return tuple(edits.values())


def _unused_path(meshes: Meshes, path: Path, name_suffix: str) -> Path:
    """Return a path beside `path` at which no file exists."""
    stem, dot, suffix = name_suffix.rpartition(".")
    for number in range(1, 100):
        numbered = f"{stem}_{number}" if number > 1 else stem
        target = path.with_name(f"{path.stem}{numbered}{dot}{suffix}")
        if not meshes.exists(target):
            return target
    return path.with_name(f"{path.stem}{name_suffix}")
