"""Packing: a robot with copies of its mesh files, named relative to where it will be written.

What a reader would refuse is left out and told: simulators stop at the first mesh that is missing
or flat. A collision mesh is never left out in silence's stead: one that cannot be read is an error,
and one that is flat becomes the thin box that it looks like.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from terrainkit_robots.analysis.bodies.shapes import has_bounds
from terrainkit_robots.description.model import Geometry, Link, MeshFile, RobotModel
from terrainkit_robots.description.xml.document import RobotFileError
from terrainkit_robots.export.collision_simplification.oriented_box import oriented_box
from terrainkit_robots.export.mesh_export.ellipsoid import ellipsoid
from terrainkit_robots.export.mesh_export.file_names import FileNames
from terrainkit_robots.export.mesh_export.mesh_bytes import MeshBytes, has_no_volume, mesh_bytes
from terrainkit_robots.mesh.mesh_cache import MeshError, Meshes
from terrainkit_robots.mesh.surface import binary_stl
from terrainkit_robots.transforms import Matrix

_THIN = 0.001
"""Thickness of the box that stands for a flat mesh [m]: about that of the sheets that are drawn so,
and enough for simulators that step by 5 ms to keep a foot on it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotWithMeshes:
    """A robot with its mesh files."""

    model: RobotModel
    """The robot; names and paths of its meshes are keys of `files`. An ellipsoid has a mesh as
    well, for formats that have no such shape."""

    files: Mapping[str, bytes]
    """Content of each mesh file, a binary STL, by its name with slashes."""

    notes: tuple[str, ...] = ()
    """What was left out or changed, a sentence each."""


def export_meshes(model: RobotModel, meshes: Meshes, *, folder: str = "meshes") -> RobotWithMeshes:
    """Return a robot with copies of its mesh files.

    Args:
        model: The robot.
        meshes: Its mesh files.
        folder: What to put before the name of each file, with a slash.

    Raises:
        RobotFileError: if a collision mesh is missing or cannot be read.
    """
    packing = _Packing(model, meshes, folder)
    links = tuple(packing.link(link) for link in model.links)
    return RobotWithMeshes(
        model=replace(model, links=links),
        files=packing.names.files,
        notes=tuple(packing.notes),
    )


class _Packing:
    """One walk over the shapes of a robot; files and notes are gathered on the way."""

    def __init__(self, model: RobotModel, meshes: Meshes, folder: str) -> None:
        self._model = model
        self._meshes = meshes
        self._done: dict[tuple[Path, tuple[float, float, float]], MeshBytes | MeshError] = {}
        self.names = FileNames(folder)
        self.notes: dict[str, None] = {}

    def link(self, link: Link) -> Link:
        """Return a link with the shapes that can be written."""
        return replace(
            link,
            collisions=tuple(self._shapes(link, link.collisions, collides=True)),
            visuals=tuple(self._shapes(link, link.visuals, collides=False)),
        )

    def _shapes(
        self, link: Link, shapes: tuple[Geometry, ...], *, collides: bool
    ) -> Iterator[Geometry]:
        for shape in shapes:
            if shape.shape == "mesh" and shape.mesh is not None:
                packed = self._mesh(link, shape, shape.mesh, collides=collides)
            else:
                packed = self._primitive(link, shape)
            if packed is not None:
                yield packed

    def _tell(self, note: str) -> None:
        self.notes[note] = None  # each once, in order

    def _primitive(self, link: Link, shape: Geometry) -> Geometry | None:
        if not has_bounds(shape, self._meshes) or min(shape.size[:1]) <= 0:
            what = "shape without a size" if shape.shape == "unknown" else shape.shape
            self._tell(f"left out a {what} of {link.name}: it has no extent that can be written")
            return None
        if shape.shape == "capsule" and shape.size[1] == 0:
            return replace(shape, shape="sphere", size=shape.size[:1])
        if min(shape.size) <= 0:
            sizes = " ".join(f"{size:g}" for size in shape.size)
            self._tell(f"left out a {shape.shape} of {link.name}: its size is {sizes}")
            return None
        if shape.shape != "ellipsoid":
            return replace(shape, mesh=None)
        data = binary_stl(ellipsoid(shape.size))
        name = self.names.add(f"{link.name}_ellipsoid", ".stl", data)
        mesh = MeshFile(source=shape.source, filename=name, path=Path(name))
        return replace(shape, mesh=mesh)

    def _mesh(
        self, link: Link, shape: Geometry, mesh: MeshFile, *, collides: bool
    ) -> Geometry | None:
        file = Path(mesh.filename.replace("\\", "/")).name or mesh.filename
        try:
            content = self._content(mesh)
        except MeshError as error:
            if collides and not self._is_flat(mesh):
                raise RobotFileError(
                    f"{self._model.file}: collision mesh {mesh.filename} of {link.name} {error}; "
                    "wanted a mesh that can be read"
                ) from None
            if collides:
                return self._sheet(link, shape, mesh, file)
            self._tell(f"left out the visual mesh {file} of {link.name}: it {error}")
            return None
        if content.note:
            self._tell(f"the mesh {file} {content.note}")
        if shape.fit_to_mesh:
            self._tell(
                f"{link.name} collides with the mesh {file}, to which MuJoCo fitted a primitive"
            )
        name = self.names.add(mesh.path.stem, ".stl", content.data)
        own = replace(mesh, filename=name, path=Path(name), found_by="path", scale=content.scale)
        return replace(shape, mesh=own, fit_to_mesh=False)

    def _content(self, mesh: MeshFile) -> MeshBytes:
        key = mesh.path, mesh.scale
        if key not in self._done:
            try:
                self._done[key] = mesh_bytes(self._meshes, mesh)
            except MeshError as error:
                self._done[key] = error
        done = self._done[key]
        if isinstance(done, MeshError):
            raise MeshError(*done.args)
        return done

    def _is_flat(self, mesh: MeshFile) -> bool:
        return self._meshes.is_readable(mesh) and has_no_volume(self._meshes, mesh)

    def _sheet(self, link: Link, shape: Geometry, mesh: MeshFile, file: str) -> Geometry | None:
        """Return a thin box in the place of a flat mesh; none in that of a line or a point."""
        pose, half = oriented_box(self._meshes.vertices(mesh))
        if np.sort(half)[1] < _THIN / 2:
            self._tell(f"left out the collision mesh {file} of {link.name}: it has no surface")
            return None
        self._tell(
            f"the collision mesh {file} of {link.name} is flat; a box {1000 * _THIN:g} mm thick is "
            "in its place"
        )
        size = np.maximum(half, _THIN / 2)
        return _box(shape, pose, size)


def _box(shape: Geometry, pose: Matrix, size: Matrix) -> Geometry:
    x, y, z = map(float, size)
    return replace(
        shape, shape="box", size=(x, y, z), mesh=None, fit_to_mesh=False, origin=shape.origin @ pose
    )
