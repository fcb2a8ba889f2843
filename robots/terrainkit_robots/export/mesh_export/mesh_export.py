"""Export the mesh files of a robot as binary STL, named relative to the robot file.

Simulators stop at missing or flat meshes. Such visual meshes are removed and listed in `changes`.
An unreadable collision mesh is an error, and a flat one is replaced by a thin box.
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

_MIN_THICKNESS = 0.001
"""Thickness of the box that replaces a flat mesh [m]. Simulators with a time step of 5 ms detect
contacts with it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotWithMeshes:
    """A robot with its exported mesh files."""

    model: RobotModel
    """The robot; its mesh paths are keys of `files`. Ellipsoids have a mesh for formats without
    them."""

    files: Mapping[str, bytes]
    """Content of each mesh file, a binary STL, by its name with slashes."""

    changes: tuple[str, ...] = ()
    """What was removed or changed, one sentence each."""


def export_meshes(model: RobotModel, meshes: Meshes, *, folder: str = "meshes") -> RobotWithMeshes:
    """Export the mesh files of a robot.

    Args:
        model: The robot.
        meshes: Its mesh files.
        folder: Folder of the exported files, relative to the robot file.

    Raises:
        RobotFileError: If a collision mesh is missing or cannot be read.
    """
    exporter = _MeshExporter(model, meshes, folder)
    links = tuple(exporter.link(link) for link in model.links)
    return RobotWithMeshes(
        model=replace(model, links=links),
        files=exporter.names.files,
        changes=tuple(exporter.changes),
    )


class _MeshExporter:
    """Export the meshes of one robot, and collect files and notes."""

    def __init__(self, model: RobotModel, meshes: Meshes, folder: str) -> None:
        self._model = model
        self._meshes = meshes
        self._converted: dict[tuple[Path, tuple[float, float, float]], MeshBytes] = {}
        self.names = FileNames(folder)
        self.changes: dict[str, None] = {}

    def link(self, link: Link) -> Link:
        """Return a link with the geometry that can be exported."""
        return replace(
            link,
            collisions=tuple(self._shapes(link, link.collisions, is_collision=True)),
            visuals=tuple(self._shapes(link, link.visuals, is_collision=False)),
        )

    def _shapes(
        self, link: Link, shapes: tuple[Geometry, ...], *, is_collision: bool
    ) -> Iterator[Geometry]:
        for shape in shapes:
            if shape.shape == "mesh" and shape.mesh is not None:
                exported = self._mesh(link, shape, shape.mesh, is_collision=is_collision)
            else:
                exported = self._primitive(link, shape)
            if exported is not None:
                yield exported

    def _add_change(self, change: str) -> None:
        self.changes[change] = None  # unique, in order

    def _primitive(self, link: Link, shape: Geometry) -> Geometry | None:
        if not has_bounds(shape, self._meshes) or min(shape.size[:1]) <= 0:
            what = "geometry of unknown shape" if shape.shape == "unknown" else shape.shape
            self._add_change(f"removed a {what} of {link.name}: it has no valid size")
            return None
        if shape.shape == "capsule" and shape.size[1] == 0:
            return replace(shape, shape="sphere", size=shape.size[:1])
        if min(shape.size) <= 0:
            sizes = " ".join(f"{size:g}" for size in shape.size)
            self._add_change(f"removed a {shape.shape} of {link.name}: its size is {sizes}")
            return None
        if shape.shape != "ellipsoid":
            return replace(shape, mesh=None)
        data = binary_stl(ellipsoid(shape.size))
        name = self.names.add(f"{link.name}_ellipsoid", ".stl", data)
        mesh = MeshFile(source=shape.source, filename=name, path=Path(name))
        return replace(shape, mesh=mesh)

    def _mesh(
        self, link: Link, shape: Geometry, mesh: MeshFile, *, is_collision: bool
    ) -> Geometry | None:
        file = Path(mesh.filename.replace("\\", "/")).name or mesh.filename
        try:
            content = self._content(mesh)
        except MeshError as error:
            is_flat = self._meshes.is_readable(mesh) and has_no_volume(self._meshes, mesh)
            if is_collision and not is_flat:
                raise RobotFileError(
                    f"{self._model.file}: collision mesh {mesh.filename} of {link.name} {error}"
                ) from None
            if is_collision:
                return self._box_of_flat_mesh(link, shape, mesh, file)
            self._add_change(f"removed the visual mesh {file} of {link.name}: it {error}")
            return None
        if content.change:
            self._add_change(f"mesh {file} {content.change}")
        if shape.fit_to_mesh:
            self._add_change(
                f"{link.name} collides with mesh {file} instead of MuJoCo's fitted primitive"
            )
        name = self.names.add(mesh.path.stem, ".stl", content.data)
        new_mesh = replace(
            mesh, filename=name, path=Path(name), found_by="path", scale=content.scale
        )
        return replace(shape, mesh=new_mesh, fit_to_mesh=False)

    def _content(self, mesh: MeshFile) -> MeshBytes:
        key = mesh.path, mesh.scale
        if key not in self._converted:
            self._converted[key] = mesh_bytes(self._meshes, mesh)
        return self._converted[key]

    def _box_of_flat_mesh(
        self, link: Link, shape: Geometry, mesh: MeshFile, file: str
    ) -> Geometry | None:
        """Return a thin box in place of a flat mesh; None for a line or a point."""
        pose, half = oriented_box(self._meshes.vertices(mesh))
        if np.sort(half)[1] < _MIN_THICKNESS / 2:
            self._add_change(f"removed the collision mesh {file} of {link.name}: it has no surface")
            return None
        self._add_change(
            f"replaced the flat collision mesh {file} of {link.name} by a box of "
            f"{1000 * _MIN_THICKNESS:g} mm thickness"
        )
        size = np.maximum(half, _MIN_THICKNESS / 2)
        x, y, z = map(float, size)
        return replace(
            shape,
            shape="box",
            size=(x, y, z),
            mesh=None,
            fit_to_mesh=False,
            origin=shape.origin @ pose,
        )
