"""The audit: whether a map keeps every promise that terrainkit makes, found out from the map alone.

Spawn discs are walked point by point on the surface, the mesh edge by edge and face by face, and
each patch, with what it records, is held against a second build of it from the config.
"""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit import registry
from terrainkit.errors import TerrainkitError, TerrainkitWarning
from terrainkit.layout import assign_patch, terrain_columns
from terrainkit.mesh.tri_mesh import TriMesh
from terrainkit.parameter import parameters_of
from terrainkit.patch import Patch, build_patch
from terrainkit.terrain_map import TerrainMap

_MILLIMETRE = 1e-3


@dataclass(frozen=True, kw_only=True)
class AuditFinding:
    """One broken promise."""

    check: str
    """Which check found it: finite, difficulty, patches, realized, spawn or mesh."""

    message: str
    """What is wrong, where, and by how much."""


def audit(terrain_map: TerrainMap, mesh: TriMesh | None = None) -> list[AuditFinding]:
    """Return what is wrong with a map; an empty list if nothing is.

    Args:
        terrain_map: The map.
        mesh: The trimesh that came with it; without one, that which the map makes is looked at.
    """
    findings = _named("finite", _finite(terrain_map, mesh))
    if findings:
        return findings  # the other checks need finite values
    return [
        *_named("difficulty", _difficulty(terrain_map)),
        *_named("patches", _patches(terrain_map)),
        *_named("realized", _realized(terrain_map)),
        *_named("spawn", _spawn(terrain_map)),
        *_named("mesh", _mesh(terrain_map, mesh or terrain_map.mesh())),
    ]


def _named(check: str, messages: Iterator[str]) -> list[AuditFinding]:
    return [AuditFinding(check=check, message=message) for message in messages]


def _patch_indices(terrain_map: TerrainMap) -> Iterator[tuple[int, int]]:
    rows, cols = terrain_map.difficulty.shape
    return ((row, col) for row in range(rows) for col in range(cols))


def _finite(terrain_map: TerrainMap, mesh: TriMesh | None) -> Iterator[str]:
    arrays = {name: getattr(terrain_map, name) for name in ("heights", "env_origins", "difficulty")}
    if mesh is not None:
        arrays["vertices"] = mesh.vertices
    for name, values in arrays.items():
        broken = np.argwhere(~np.isfinite(values))
        if len(broken):
            first = tuple(int(n) for n in broken[0])
            yield f"{name}: {len(broken)} values are not finite, the first at {first}"


def _difficulty(terrain_map: TerrainMap) -> Iterator[str]:
    config, difficulty = terrain_map.config, terrain_map.difficulty
    if config.mode != "curriculum":
        return
    low, high = config.difficulty_range
    for row, wanted in {len(difficulty) - 1: high, 0: low}.items():  # a single row has the first
        off = difficulty[row][difficulty[row] != np.float32(wanted)]
        if len(off):
            yield f"row {row} has difficulty {off[0]:g}; wanted exactly {wanted:g}"
    if config.difficulty_jitter == 0:
        for row, col in np.argwhere(np.diff(difficulty, axis=0) < 0):
            yield f"difficulty falls from row {row} to row {row + 1} in column {col}"


def _patches(terrain_map: TerrainMap) -> Iterator[str]:
    """Compare each patch, and the border, with what the config makes there on its own."""
    config = terrain_map.config
    border = np.ones(terrain_map.heights.shape, dtype=bool)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TerrainkitWarning)
        columns = terrain_columns(config)
    for row, col in _patch_indices(terrain_map):
        (i, j), (nx, ny) = config.patch_start(row, col), config.patch_shape
        border[i : i + nx, j : j + ny] = False
        kind, difficulty = assign_patch(config, columns, row, col)
        try:
            made = build_patch(config, config.mix[kind], difficulty, row, col)
        except TerrainkitError as error:
            yield f"patch ({row}, {col}) cannot be made from its config: {error}"
            continue
        yield from _differences(terrain_map.tile(row, col), made, f"patch ({row}, {col})")
    if (np.abs(terrain_map.heights[border]) > _MILLIMETRE).any():
        yield "the border is not level at height 0"


def _differences(found: Patch, made: Patch, where: str) -> Iterator[str]:
    if found.terrain != made.terrain:
        yield f"{where} is called {found.terrain}; its config makes {made.terrain} there"
    if abs(found.difficulty - made.difficulty) > 1e-6:
        yield f"{where} has difficulty {found.difficulty:g}; its config says {made.difficulty:g}"
    if found.parameters != made.parameters:
        yield f"{where} records other parameters than its config makes there"
    off = float(np.abs(found.heights - made.heights).max())
    if off > _MILLIMETRE:
        yield (
            f"{where} is up to {off:.3f} m off the {made.terrain} that its config makes there: "
            "edited, out of place, or with its axes swapped"
        )


def _realized(terrain_map: TerrainMap) -> Iterator[str]:
    """Compare what was asked with what was built."""
    cell, mix = terrain_map.config.cell, terrain_map.config.mix
    for row, col in _patch_indices(terrain_map):
        patch = terrain_map.tile(row, col)
        sub_terrain = mix[terrain_map.terrain_types[row, col]]
        kinds = parameters_of(registry.find(sub_terrain.terrain))
        for name, asked in patch.parameters.requested.items():
            built = patch.parameters.realized[name]
            if kinds[name].deviates(asked, built, cell):
                yield (
                    f"patch ({row}, {col}), {patch.terrain}: {name} is {built} where {asked:g} "
                    "was asked"
                )


def _spawn(terrain_map: TerrainMap) -> Iterator[str]:
    config = terrain_map.config
    if 2 * config.spawn_radius > min(config.patch_size):
        x, y = config.patch_size
        yield f"no disc of radius {config.spawn_radius:g} m lies in a patch of {x:g} m x {y:g} m"
        return
    radius = config.spawn_radius * np.linspace(0, 1, max(3, round(config.spawn_radius / 0.05)))
    angle = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    disc = (radius[:, None, None] * circle).reshape(-1, 2)
    for row, col in _patch_indices(terrain_map):
        origin = terrain_map.env_origins[row, col].astype(np.float64)
        where = f"patch ({row}, {col}): the spawn origin"
        plot = config.patch_grid(row, col)
        if (origin[:2] < plot.lower).any() or (origin[:2] > plot.upper).any():
            yield f"{where} is outside the patch"
        ground = terrain_map.height(origin[:2] + disc)
        above = float(origin[2] - terrain_map.height(origin[:2]))
        if abs(above) > _MILLIMETRE:
            yield f"{where} is {abs(above):.3f} m {'above' if above > 0 else 'below'} the ground"
        spread = float(ground.max() - ground.min())
        if spread > config.spawn_tolerance + 1e-6:
            yield (
                f"{where} stands on ground that differs by {spread:.3f} m within "
                f"{config.spawn_radius:g} m; wanted {config.spawn_tolerance:g} m"
            )


def _mesh(terrain_map: TerrainMap, mesh: TriMesh) -> Iterator[str]:
    grid = terrain_map.grid
    a, b, c = (mesh.vertices[mesh.triangles[:, k]].astype(np.float64) for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1) / 2
    if not len(area):
        yield "the mesh has no faces"
        return
    if (area < 1e-12).any():
        yield f"{int((area < 1e-12).sum())} faces have no area"
    # In the last digits of a float, a wall can lean either way.
    upright = np.abs(normal[:, 2]) < 1e-3 * 2 * area
    if (normal[~upright, 2] < 0).any():
        yield f"{int((normal[~upright, 2] < 0).sum())} faces look down"
    covered, wanted = normal[~upright, 2].sum() / 2, grid.size[0] * grid.size[1]
    if abs(covered - wanted) > 1e-4 * wanted:
        yield f"the mesh covers {covered:.1f} m2 of a map of {wanted:.1f} m2"
    yield from _edges(terrain_map, mesh)
    middle = ((a + b + c) / 3)[~upright]
    off = np.abs(middle[:, 2] - terrain_map.height(middle[:, :2]))
    if (off > _MILLIMETRE).any():
        x, y, _ = middle[np.argmax(off)]
        yield f"the mesh is up to {off.max():.3f} m off the heights, most at ({x:.2f}, {y:.2f})"


def _edges(terrain_map: TerrainMap, mesh: TriMesh) -> Iterator[str]:
    edges = mesh.edges()
    directed = np.sort(edges[:, 0] * len(mesh.vertices) + edges[:, 1])
    repeated = int((np.diff(directed) == 0).sum())
    if repeated:
        yield f"{repeated} edges are shared by more than two faces, or by faces turned over"
    ends = mesh.vertices[mesh.boundary()].astype(np.float64)
    inside = ~_on_outline(ends, terrain_map).any(axis=1)
    if inside.any():
        x, y = ends[inside][0, 0, :2]
        yield f"{int(inside.sum())} edges have a face on one side only, as at ({x:.2f}, {y:.2f})"


def _on_outline(ends: NDArray[np.float64], terrain_map: TerrainMap) -> NDArray[np.bool_]:
    """Return whether each edge lies on each of the four sides of the map, shape (n, 4)."""
    sides = [
        np.abs(ends[..., k] - line[k]).max(axis=1) < _MILLIMETRE
        for line in (terrain_map.grid.lower, terrain_map.grid.upper)
        for k in (0, 1)
    ]
    return np.stack(sides, axis=1)
