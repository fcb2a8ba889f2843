"""Replace collision meshes by hulls, convex parts or primitives.

Simulators collide with convex shapes, and convert meshes in different ways. A gripper or a shell
that is replaced by its hull loses its opening. The shapes are therefore created here, the same for
all simulators, and the change of volume is reported.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from terrainkit_robots.description.model import Geometry, Link, MeshFile, RobotModel
from terrainkit_robots.export.collision_simplification.convex_parts import convex_parts
from terrainkit_robots.export.mesh_export.decimate import decimate
from terrainkit_robots.export.mesh_export.file_names import FileNames
from terrainkit_robots.export.mesh_export.mesh_bytes import has_no_volume, scaled
from terrainkit_robots.mesh.hull import convex_hull
from terrainkit_robots.mesh.mesh_cache import MeshError, Meshes
from terrainkit_robots.mesh.surface import Surface, binary_stl, signed_volume, welded
from terrainkit_robots.text import count

CollisionMethod = Literal["keep", "hull", "coacd", "primitives"]

Progress = Callable[[Iterable[Any], int], Iterable[Any]]
"""Show a progress bar for an iterable with so many items."""

_MAX_HULL_VERTICES = 500
"""Maximum number of vertices of a hull, which is visually exact and fast to collide with."""

_MAX_HULL_RATIO = 2.0
"""Meshes with a larger ratio of hull volume to volume are decomposed, as in rule MSH014."""

MAX_WELDED_FACES = 500_000
"""Larger meshes are decimated before their vertices are merged."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SimplifiedRobot:
    """A robot with simplified collision geometry."""

    model: RobotModel
    """The robot; the files of new meshes exist only in `contents`."""

    contents: Mapping[Path, bytes] = field(default_factory=dict)
    """Content of the new meshes by path."""

    meshes: Meshes
    """Mesh files of the robot, including the new ones."""

    changes: tuple[str, ...] = ()
    """What replaced each collision mesh, one sentence each."""


def simplify_collisions(
    model: RobotModel,
    meshes: Meshes,
    method: CollisionMethod = "keep",
    *,
    cache: Path | None = None,
    progress: Progress = lambda items, _: items,
) -> SimplifiedRobot:
    """Simplify the collision meshes of a robot.

    Meshes that are flat or cannot be read are unchanged; `export_meshes` reports them.

    Args:
        model: The robot.
        meshes: Its mesh files.
        method: keep: no change; hull: convex hulls; coacd: convex parts for meshes whose hull has
            more than twice their volume, hulls for the others; primitives: the best fitting
            primitive.
        cache: Folder of the decomposition cache; None disables it.
        progress: Shows a progress bar for the meshes.
    """
    if method == "keep":
        return SimplifiedRobot(model=model, meshes=meshes)
    simplifier = _Simplifier(meshes, method, cache)
    uses = {
        (shape.mesh.path, shape.mesh.scale): shape.mesh
        for link in model.links
        for shape in link.collisions
        if shape.shape == "mesh" and shape.mesh is not None
    }
    for mesh in progress(uses.values(), len(uses)):
        simplifier.simplify(mesh)
    links = tuple(simplifier.link(link) for link in model.links)
    contents = {Path(name): data for name, data in simplifier.names.files.items()}
    return SimplifiedRobot(
        model=replace(model, links=links),
        contents=contents,
        meshes=meshes.with_contents(contents),
        changes=tuple(simplifier.changes),
    )


class _Simplifier:
    """Simplify the collision meshes of one robot."""

    def __init__(self, meshes: Meshes, method: CollisionMethod, cache: Path | None) -> None:
        self._meshes = meshes
        self._method = method
        self._cache = cache
        self._shapes: dict[tuple[Path, tuple[float, float, float]], tuple[Geometry, ...]] = {}
        # a folder that does not exist, because the contents are in memory
        self.names = FileNames(f".terrainkit-{method}")
        self.changes: list[str] = []

    def simplify(self, mesh: MeshFile) -> None:
        """Create the replacement of a mesh."""
        try:
            if has_no_volume(self._meshes, mesh):
                return
            shapes, replacement, volume = self._replacement(mesh)
            original = self._meshes.solid_volume(mesh)
        except MeshError:
            return  # unchanged; export_meshes reports the error
        self._shapes[mesh.path, mesh.scale] = shapes
        change = f"{100 * (volume / original - 1):+.1f} %" if original else "unknown"
        self.changes.append(
            f"replaced collision mesh {mesh.filename} by {replacement} (volume {change})"
        )

    def link(self, link: Link) -> Link:
        """Return a link with its collision meshes replaced."""
        found: list[Geometry] = []
        for shape in link.collisions:
            mesh = shape.mesh if shape.shape == "mesh" else None
            replacements = self._shapes.get((mesh.path, mesh.scale)) if mesh is not None else None
            found += (
                [shape]
                if replacements is None
                else [_replace_shape(shape, replacement) for replacement in replacements]
            )
        return replace(link, collisions=tuple(found))

    def _replacement(self, mesh: MeshFile) -> tuple[tuple[Geometry, ...], str, float]:
        """Return the replacement in the frame of a mesh, its description, and its volume [m3]."""
        if self._method == "primitives":
            return self._primitive(mesh)
        if self._method == "coacd" and self._is_nonconvex(mesh):
            try:
                return self._parts(mesh)
            except MeshError as error:
                self.changes.append(
                    f"collision mesh {mesh.filename} {error}; its convex hull is used"
                )
        hull = self._hull(mesh, _MAX_HULL_VERTICES)
        shapes = (self._mesh_in_memory(mesh, hull, f"{mesh.path.stem}_hull"),)
        return shapes, "its convex hull", abs(signed_volume(hull))

    def _primitive(self, mesh: MeshFile) -> tuple[tuple[Geometry, ...], str, float]:
        from terrainkit_robots.export.collision_simplification.fit_primitive import fit_primitive

        hull = self._hull(mesh, None)
        fitted = fit_primitive(hull.points.astype(np.float64))
        shape = Geometry(
            source=mesh.source, shape=fitted.shape, size=fitted.size, origin=fitted.pose
        )
        return (shape,), f"a {fitted.shape}", fitted.volume

    def _parts(self, mesh: MeshFile) -> tuple[tuple[Geometry, ...], str, float]:
        # decomposed without mirroring, so that left and right parts are mirror images
        x, y, z = map(abs, mesh.scale)
        parts = convex_parts(scaled(self._welded(mesh.path), (x, y, z)), self._cache)
        mirror = tuple(np.sign(mesh.scale).tolist())
        parts = tuple(scaled(part, mirror) for part in parts)
        shapes = tuple(
            self._mesh_in_memory(mesh, part, f"{mesh.path.stem}_part_{k}")
            for k, part in enumerate(parts, 1)
        )
        what = count(len(parts), "convex part")
        return shapes, what, sum(abs(signed_volume(part)) for part in parts)

    def _mesh_in_memory(self, mesh: MeshFile, surface: Surface, name: str) -> Geometry:
        """Return a mesh geometry whose file is in memory."""
        name = self.names.add(name, ".stl", binary_stl(surface))
        file = MeshFile(source=mesh.source, filename=name, path=Path(name))
        return Geometry(source=mesh.source, shape="mesh", mesh=file)

    def _hull(self, mesh: MeshFile, max_vertices: int | None) -> Surface:
        surface = self._welded(mesh.path)
        return scaled(convex_hull(surface.points, max_vertices), mesh.scale)

    def _welded(self, path: Path) -> Surface:
        surface = self._meshes.surface(path)
        if len(surface.faces) > MAX_WELDED_FACES:
            return welded(decimate(surface, MAX_WELDED_FACES))
        return self._meshes.welded(path)

    def _is_nonconvex(self, mesh: MeshFile) -> bool:
        """Return whether the volume of the hull is much larger than the volume of the mesh.

        The volume of an open mesh is computed as if it were closed, which small gaps change little.
        """
        x, y, z = mesh.scale
        enclosed = abs(signed_volume(self._welded(mesh.path)) * x * y * z)
        return abs(signed_volume(self._hull(mesh, None))) > _MAX_HULL_RATIO * enclosed


def _replace_shape(shape: Geometry, other: Geometry) -> Geometry:
    """Return a geometry with another shape at the same place, with the same contact bits."""
    return replace(
        shape,
        shape=other.shape,
        size=other.size,
        mesh=other.mesh,
        origin=shape.origin @ other.origin,
        fit_to_mesh=False,
    )
