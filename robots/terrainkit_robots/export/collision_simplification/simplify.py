"""Collision meshes made fit to collide with: hulls, convex parts or primitives in their place.

Simulators collide with convex shapes. What they make of a mesh on their own differs, and a gripper
or a shell that becomes its hull fills what it should leave open; so the shapes are made here once,
the same for all of them, and how much volume that adds is told.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from terrainkit_robots.description.model import Geometry, Link, MeshFile, RobotModel
from terrainkit_robots.export.collision_simplification.convex_parts import convex_parts
from terrainkit_robots.export.collision_simplification.fit_primitive import fit_primitive
from terrainkit_robots.export.mesh_export.decimate import decimate
from terrainkit_robots.export.mesh_export.file_names import FileNames
from terrainkit_robots.export.mesh_export.mesh_bytes import has_no_volume, scaled
from terrainkit_robots.mesh.hull import convex_hull
from terrainkit_robots.mesh.mesh_cache import MeshError, Meshes
from terrainkit_robots.mesh.surface import (
    Surface,
    binary_stl,
    signed_volume,
    welded,
)

How = Literal["keep", "hull", "coacd", "primitives"]

Progress = Callable[[Iterable[Any], int], Iterable[Any]]
"""Draws a bar while it passes on so many things."""

_HULL_CORNERS = 500
"""Corners that a hull may have: as close to a limb as can be seen, and quick to collide with."""

_FAR_FROM_CONVEX = 2.0
"""A mesh whose hull has more than so many times its volume is decomposed; as MSH014 tells it."""

_MOST_WELDED = 500_000
"""Of more faces the corners are not compared; the mesh is made coarser first."""


@dataclass(frozen=True, kw_only=True)
class VolumeError:
    """How much the volume of a collision mesh has changed."""

    mesh: str
    """Name of the file, as written."""

    became: str
    """What is in its place, in words: its hull, 5 convex parts, a capsule."""

    solid: float | None
    """Volume that the mesh encloses [m3]; None if it is not closed."""

    treated: float
    """Volume of what is in its place [m3]; of parts, the sum."""

    @property
    def percent(self) -> float | None:
        """Return by how much the volume has grown [%]; None if the mesh encloses none."""
        return 100 * (self.treated / self.solid - 1) if self.solid else None


@dataclass(frozen=True, kw_only=True, eq=False)
class SimplifiedRobot:
    """A robot with other collision shapes."""

    model: RobotModel
    """The robot; the new meshes have paths that are on no disk."""

    contents: Mapping[Path, bytes] = field(default_factory=dict)
    """Content of the new meshes by path."""

    meshes: Meshes
    """The robot's mesh files, the new ones included."""

    errors: tuple[VolumeError, ...] = ()
    """One for each mesh that something else is in place of."""

    notes: tuple[str, ...] = ()
    """What became of each collision mesh, a sentence each."""


def simplify_collisions(
    model: RobotModel,
    meshes: Meshes,
    how: How = "keep",
    *,
    cache: Path | None = None,
    progress: Progress = lambda items, _: items,
) -> SimplifiedRobot:
    """Return a robot with its collision meshes made fit to collide with.

    A mesh that cannot be read or is flat stays as it is: it is told when it is packed.

    Args:
        model: The robot.
        meshes: Its mesh files.
        how: Keep them; their hulls; convex parts by CoACD where the hull has more than twice the
            volume, else hulls; or for each the primitive that fits best.
        cache: Folder that keeps convex parts from one run to the next; None keeps nothing.
        progress: Draws a bar while it passes on the meshes.
    """
    if how == "keep":
        return SimplifiedRobot(model=model, meshes=meshes)
    work = _Work(meshes, how, cache)
    uses = {
        (shape.mesh.path, shape.mesh.scale): shape.mesh
        for link in model.links
        for shape in link.collisions
        if shape.shape == "mesh" and shape.mesh is not None
    }
    for mesh in progress(uses.values(), len(uses)):
        work.simplify(mesh)
    links = tuple(work.link(link) for link in model.links)
    contents = {Path(name): data for name, data in work.names.files.items()}
    return SimplifiedRobot(
        model=replace(model, links=links),
        contents=contents,
        meshes=meshes.with_contents(contents),
        errors=tuple(work.errors),
        notes=tuple(work.notes),
    )


class _Work:
    """One walk over the collision meshes of a robot."""

    def __init__(self, meshes: Meshes, how: How, cache: Path | None) -> None:
        self._meshes = meshes
        self._how = how
        self._cache = cache
        self._shapes: dict[tuple[Path, tuple[float, float, float]], tuple[Geometry, ...]] = {}
        # on no disk: what is held is read before what is there
        self.names = FileNames(f".terrainkit-{how}")
        self.errors: list[VolumeError] = []
        self.notes: list[str] = []

    def simplify(self, mesh: MeshFile) -> None:
        """Find what is to be in the place of a mesh."""
        try:
            if has_no_volume(self._meshes, mesh):
                return
            shapes, became, volume = self._replacement(mesh)
            solid = self._meshes.solid_volume(mesh)
        except MeshError:
            return  # stays as it is, and packing tells why
        self._shapes[mesh.path, mesh.scale] = shapes
        error = VolumeError(mesh=mesh.filename, became=became, solid=solid, treated=volume)
        self.errors.append(error)
        change = (
            "which is not closed, so that its volume is not known"
            if error.percent is None
            else f"{error.percent:+.1f} % of its volume"
        )
        self.notes.append(f"{became} in place of the collision mesh {mesh.filename}: {change}")

    def link(self, link: Link) -> Link:
        """Return a link with what is in the place of its collision meshes."""
        found: list[Geometry] = []
        for shape in link.collisions:
            mesh = shape.mesh if shape.shape == "mesh" else None
            instead = self._shapes.get((mesh.path, mesh.scale)) if mesh is not None else None
            found += [shape] if instead is None else [_instead(shape, each) for each in instead]
        return replace(link, collisions=tuple(_named_once(found)))

    def _replacement(self, mesh: MeshFile) -> tuple[tuple[Geometry, ...], str, float]:
        """Return shapes in the frame of a mesh, what they are in words, and their volume [m3]."""
        if self._how == "primitives":
            return self._primitive(mesh)
        if self._how == "coacd" and self._is_far_from_convex(mesh):
            try:
                return self._parts(mesh)
            except MeshError as error:
                self.notes.append(f"the collision mesh {mesh.filename} {error}; its hull will do")
        hull = self._hull(mesh, _HULL_CORNERS)
        shapes = (self._held(mesh, hull, f"{mesh.path.stem}_hull"),)
        return shapes, "the hull is", abs(signed_volume(hull))

    def _primitive(self, mesh: MeshFile) -> tuple[tuple[Geometry, ...], str, float]:
        hull = self._hull(mesh, None)
        fitted = fit_primitive(hull.points.astype(np.float64))
        shape = Geometry(
            source=mesh.source, shape=fitted.shape, size=fitted.size, origin=fitted.pose
        )
        return (shape,), f"a {fitted.shape} is", fitted.volume

    def _parts(self, mesh: MeshFile) -> tuple[tuple[Geometry, ...], str, float]:
        # found as the file has them, and mirrored after, so that left and right parts are alike
        x, y, z = map(abs, mesh.scale)
        parts = convex_parts(scaled(self._welded(mesh.path), (x, y, z)), self._cache)
        mirror = tuple(np.sign(mesh.scale).tolist())
        parts = tuple(scaled(part, mirror) for part in parts)
        shapes = tuple(
            self._held(mesh, part, f"{mesh.path.stem}_part_{k}") for k, part in enumerate(parts, 1)
        )
        what = "one convex part is" if len(parts) == 1 else f"{len(parts)} convex parts are"
        return shapes, what, sum(abs(signed_volume(part)) for part in parts)

    def _held(self, mesh: MeshFile, surface: Surface, stem: str) -> Geometry:
        """Return a shape whose mesh is kept in memory."""
        name = self.names.add(stem, ".stl", binary_stl(surface))
        file = MeshFile(source=mesh.source, filename=name, path=Path(name))
        return Geometry(source=mesh.source, shape="mesh", mesh=file)

    def _hull(self, mesh: MeshFile, most_corners: int | None) -> Surface:
        surface = self._welded(mesh.path)
        return scaled(convex_hull(surface.points, most_corners), mesh.scale)

    def _welded(self, path: Path) -> Surface:
        surface = self._meshes.surface(path)
        if len(surface.faces) > _MOST_WELDED:
            return welded(decimate(surface, _MOST_WELDED))
        return self._meshes.welded(path)

    def _is_far_from_convex(self, mesh: MeshFile) -> bool:
        """Return whether the hull is much larger than what a mesh encloses.

        One that is not closed counts by what its triangles enclose with its middle, which small
        gaps change little.
        """
        x, y, z = mesh.scale
        enclosed = abs(signed_volume(self._welded(mesh.path)) * x * y * z)
        return abs(signed_volume(self._hull(mesh, None))) > _FAR_FROM_CONVEX * enclosed


def _instead(shape: Geometry, other: Geometry) -> Geometry:
    """Return a shape that is where another is, and collides with what that does."""
    return replace(
        shape,
        shape=other.shape,
        size=other.size,
        mesh=other.mesh,
        origin=shape.origin @ other.origin,
        fit_to_mesh=False,
    )


def _named_once(shapes: Iterable[Geometry]) -> Iterable[Geometry]:
    """Yield shapes of which no two have one name."""
    counts: dict[str, int] = {}
    for shape in shapes:
        count = counts[shape.name] = counts.get(shape.name, 0) + 1
        yield (
            shape if count == 1 or not shape.name else replace(shape, name=f"{shape.name}_{count}")
        )
