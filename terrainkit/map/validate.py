"""Validate a map: spawn disks, mesh, recorded parameters and difficulty.

Everything is recomputed from the map alone. Spawn disks are sampled on the surface, the mesh is
checked edge by edge and face by face, and each patch is compared with a second build of it.
Imported and edited maps (mode custom) are not compared with their config.
"""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import PluginError, TerrainkitError, TerrainkitWarning, listing
from terrainkit.geometry.mesh.solid_mesh import concatenate_meshes, solid_meshes
from terrainkit.geometry.mesh.tri_mesh import TriMesh
from terrainkit.map.layout import column_types, terrain_and_difficulty
from terrainkit.map.patch import Patch, build_patch
from terrainkit.map.terrain_map import TerrainMap
from terrainkit.terrain.parameter import format_value

TOLERANCE = 1e-3
"""Largest difference in position that is not an issue [m]."""

_FACES_PER_BLOCK = 1 << 16


@dataclass(frozen=True, kw_only=True)
class Issue:
    """One violated guarantee of a map."""

    check: str
    """Check that found it: finite, difficulty, patches, realized, solids, goals, spawn or mesh."""

    message: str
    """What is wrong, where, and by how much."""


def validate(terrain_map: TerrainMap, mesh: TriMesh | None = None) -> list[Issue]:
    """Return the issues of a map; an empty list if it is valid.

    Args:
        terrain_map: The map.
        mesh: The trimesh stored with the map. By default the mesh of the map is built and checked.
    """
    issues = _issues(finite=_check_finite(terrain_map, mesh))
    if issues:
        return issues  # the other checks need finite values
    if terrain_map.config.mode == "custom":
        issues = _issues(solids=_check_solids(terrain_map), goals=_check_goals(terrain_map))
    else:
        issues = _issues(
            difficulty=_check_difficulty(terrain_map),
            patches=_check_patches(terrain_map),
            realized=_check_realized(terrain_map),
        )
    built = mesh or terrain_map.mesh()
    return issues + _issues(spawn=_check_spawn(terrain_map), mesh=_check_mesh(terrain_map, built))


def _issues(**messages: Iterator[str]) -> list[Issue]:
    """Return the messages of checks as issues."""
    return [Issue(check=check, message=text) for check, texts in messages.items() for text in texts]


def _check_finite(terrain_map: TerrainMap, mesh: TriMesh | None) -> Iterator[str]:
    arrays = {name: getattr(terrain_map, name) for name in ("heights", "env_origins", "difficulty")}
    if mesh is not None:
        arrays["vertices"] = mesh.vertices
    for name, values in arrays.items():
        invalid = np.argwhere(~np.isfinite(values))
        if len(invalid):
            first = tuple(int(n) for n in invalid[0])
            yield f"{name}: {len(invalid)} values are not finite, the first at {first}"


def _check_difficulty(terrain_map: TerrainMap) -> Iterator[str]:
    config, difficulty = terrain_map.config, terrain_map.difficulty
    if config.mode != "curriculum":
        return
    low, high = config.difficulty_range
    # A single row has the lowest difficulty, so row 0 comes last.
    for row, expected in {len(difficulty) - 1: high, 0: low}.items():
        values = difficulty[row][difficulty[row] != np.float32(expected)]
        if len(values):
            yield f"row {row}: got difficulty {values[0]:g}; expected exactly {expected:g}"
    if config.difficulty_jitter == 0:
        for row, col in np.argwhere(np.diff(difficulty, axis=0) < 0):
            yield f"difficulty decreases from row {row} to row {row + 1} in column {col}"


def _check_patches(terrain_map: TerrainMap) -> Iterator[str]:
    """Compare each patch, and the border, with what its config generates."""
    config = terrain_map.config
    border = np.ones(terrain_map.heights.shape, dtype=bool)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TerrainkitWarning)
        columns = column_types(config)
    for row, col in np.ndindex(terrain_map.difficulty.shape):
        border[config.patch_cells(row, col)] = False
        terrain_type, difficulty = terrain_and_difficulty(config, columns, row, col)
        try:
            expected = build_patch(config, config.sub_terrains[terrain_type], difficulty, row, col)
        except PluginError:
            raise
        except TerrainkitError as error:
            yield f"cannot be generated from the config: {error}"
            continue
        yield from _compare(terrain_map.patch(row, col), expected, f"patch ({row}, {col})")
    if (np.abs(terrain_map.heights - config.border_heights())[border] > TOLERANCE).any():
        yield "the border does not have the height in its config"


def _compare(patch: Patch, expected: Patch, location: str) -> Iterator[str]:
    if patch.terrain != expected.terrain:
        yield f"{location}: got terrain {patch.terrain}; expected {expected.terrain} by its config"
    if abs(patch.difficulty - expected.difficulty) > 1e-6:
        yield (
            f"{location}: got difficulty {patch.difficulty:g}; expected {expected.difficulty:g} "
            "by its config"
        )
    if patch.parameters != expected.parameters:
        yield (
            f"{location}: the recorded parameters differ from its config: "
            f"{listing(patch.parameters.diff(expected.parameters))}"
        )
    is_same = {
        "friction coefficients": np.allclose(patch.friction, expected.friction, atol=1e-6),
        "solids": not patch.solids.diff(expected.solids, TOLERANCE),
        "goals": _same_poses(patch.goals, expected.goals),
        "spawn positions": _same_poses(patch.spawns[1:], expected.spawns[1:]),
    }
    for what, same in is_same.items():
        if not same:
            yield f"{location}: the {what} differ from its config"
    moved = float(np.abs(patch.origin[:2] - expected.origin[:2]).max())
    if moved > TOLERANCE:
        yield f"{location}: the spawn origin is {moved:.3f} m from its place in the config"
    if expected.spawn_offset > expected.grid.cell:
        yield (
            f"{location}: no flat disk at the spawn position of {expected.terrain}: the origin is "
            f"{expected.spawn_offset:.3f} m away, where a robot may be beyond the obstacle"
        )
    error = float(np.abs(patch.heights - expected.heights).max())
    if error > TOLERANCE:
        yield (
            f"{location}: heights differ by up to {error:.3f} m from the {expected.terrain} of its "
            "config: edited, moved, or with axes swapped; TerrainMap.edited() makes a custom map"
        )


def _same_poses(poses: NDArray[np.float32], expected: NDArray[np.float32]) -> bool:
    return poses.shape == expected.shape and np.allclose(poses, expected, atol=TOLERANCE)


def _check_realized(terrain_map: TerrainMap) -> Iterator[str]:
    """Compare the requested parameters with the realized ones."""
    config, types = terrain_map.config, terrain_map.terrain_types
    for (row, col), parameters in np.ndenumerate(terrain_map.parameters):
        declared = config.sub_terrains[types[row, col]].declarations
        for name in parameters.deviating(declared, config.cell):
            yield (
                f"patch ({row}, {col}), {terrain_map.patch_names[row, col]}: {name} is "
                f"{parameters.realized[name]}; requested {format_value(parameters.requested[name])}"
            )


def _check_solids(terrain_map: TerrainMap) -> Iterator[str]:
    grid = terrain_map.grid
    lower, upper = (corner[:, :2] for corner in terrain_map.solids.bounds())
    beyond = np.maximum(grid.lower - lower, upper - grid.upper).max(axis=1, initial=0.0)
    for index in np.flatnonzero(beyond > TOLERANCE).tolist():
        yield f"solid {index} extends {beyond[index]:.3f} m beyond the map"


def _check_goals(terrain_map: TerrainMap) -> Iterator[str]:
    for row, col in np.ndindex(terrain_map.difficulty.shape):
        grid = terrain_map.config.patch_grid(row, col)
        goals = terrain_map.goals[row, col]
        last = np.flatnonzero(~np.isnan(goals).all(axis=1)).max(initial=-1)
        for k, goal in enumerate(goals[: last + 1].astype(np.float64)):
            subject = f"patch ({row}, {col}): goal {k}"
            if not np.isfinite(goal).all():
                yield f"{subject} is not finite"
                continue
            xy, z = goal[:2], float(goal[2])
            if (xy < np.array(grid.lower)).any() or (xy > np.array(grid.upper)).any():
                yield f"{subject} is outside the patch"
                continue
            below = float(terrain_map.height(xy)) - z
            floor, ceiling = terrain_map.intervals(xy).T
            if below > TOLERANCE:
                yield f"{subject} is {below:.3f} m below the ground"
            elif not ((floor - TOLERANCE <= z) & (z <= ceiling + TOLERANCE)).any():
                yield f"{subject} is inside a solid"


def _check_spawn(terrain_map: TerrainMap) -> Iterator[str]:
    config = terrain_map.config
    if 2 * config.spawn_radius > min(config.patch_size):
        x, y = config.patch_size
        yield f"no disk of radius {config.spawn_radius:g} m fits in a patch of {x:g} m x {y:g} m"
        return
    radius = config.spawn_radius * np.linspace(0, 1, max(3, round(config.spawn_radius / 0.05)))
    angle = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    disk = (radius[:, None, None] * circle).reshape(-1, 2)
    for row, col in np.ndindex(terrain_map.difficulty.shape):
        spawns = terrain_map.patch(row, col).spawns.astype(np.float64)
        for number, (*xy, z, _) in enumerate(spawns):
            name = f"spawn {number}" if number else "the spawn origin"
            subject = f"patch ({row}, {col}): {name}"
            grid = config.patch_grid(row, col)
            if (xy < np.array(grid.lower)).any() or (xy > np.array(grid.upper)).any():
                yield f"{subject} is outside the patch"
            ground, free = _floor_and_headroom(terrain_map, xy + disk, z)
            if free < config.spawn_headroom - TOLERANCE:
                headroom = config.spawn_headroom
                yield f"{subject} has {free:.3f} m of headroom; expected {headroom:g} m"
            spread = float(ground.max() - ground.min())
            slack = _rounding(terrain_map) * spread / config.spawn_radius
            above = float(z - ground[0])
            if abs(above) > TOLERANCE + slack:
                side = "above" if above > 0 else "below"
                yield f"{subject} is {abs(above):.3f} m {side} the ground"
            if spread > config.spawn_tolerance + 1e-6 + slack:
                yield (
                    f"{subject} is not on flat ground: heights within {config.spawn_radius:g} m "
                    f"differ by {spread:.3f} m; expected at most {config.spawn_tolerance:g} m"
                )
            others = np.hypot(*(spawns[:number, :2] - xy).T)
            if others.min(initial=np.inf) < 2 * config.spawn_radius - TOLERANCE:
                yield (
                    f"{subject} is {others.min():.3f} m from spawn {others.argmin()}; expected at "
                    f"least {2 * config.spawn_radius:g} m, two spawn radii"
                )


def _floor_and_headroom(
    terrain_map: TerrainMap, xy: NDArray[np.float64], z: float
) -> tuple[NDArray[np.float64], float]:
    """Return the heights of the ground or of a floor, and the least free height above it [m].

    Args:
        terrain_map: The map.
        xy: Points of a disk, the center first [m], shape (n, 2).
        z: Height of its center [m].
    """
    ground = terrain_map.height(xy)
    if z > ground[0] + TOLERANCE:
        near = np.column_stack([xy, np.full(len(xy), z + terrain_map.config.spawn_tolerance)])
        floor, ceiling = terrain_map.scan(near, "down"), terrain_map.scan(near, "up")
        if abs(floor[0] - z) <= TOLERANCE:
            return floor, float(np.nanmin(np.append(ceiling, np.inf))) - z
    return ground, float(terrain_map.clearance(xy, step_height=0.0).min())


def _check_mesh(terrain_map: TerrainMap, mesh: TriMesh) -> Iterator[str]:
    grid = terrain_map.grid
    solids = terrain_map.solids.select(terrain_map.solids.collides)
    if len(solids):
        last = concatenate_meshes(solid_meshes(solids))
        nv, nf = len(mesh.vertices) - len(last.vertices), len(mesh.triangles) - len(last.triangles)
        if (
            min(nv, nf) < 0
            or not np.array_equal(mesh.triangles[nf:] - np.int32(nv), last.triangles)
            or not np.allclose(mesh.vertices[nv:], last.vertices, atol=TOLERANCE)
        ):
            yield "the last faces of the mesh differ from the solids of the map"
            return
        mesh = TriMesh(vertices=mesh.vertices[:nv], triangles=mesh.triangles[:nf])
    if not len(mesh.triangles):
        yield "the mesh has no faces"
        return
    empty, downward, covered, largest, place = 0, 0, 0.0, 0.0, np.zeros(3)
    rounding = _rounding(terrain_map)
    for start in range(0, len(mesh.triangles), _FACES_PER_BLOCK):
        corners = mesh.vertices[mesh.triangles[start : start + _FACES_PER_BLOCK]].astype(np.float64)
        a, b, c = corners.swapaxes(0, 1)
        normal = np.cross(b - a, c - a)
        area = np.linalg.norm(normal, axis=1) / 2
        # Rounding can tilt a wall to either side.
        vertical = np.abs(normal[:, 2]) < 1e-3 * 2 * area
        empty += int(np.count_nonzero(area < 1e-12))
        downward += int(np.count_nonzero(normal[~vertical, 2] < 0))
        covered += normal[~vertical, 2].sum() / 2
        centroid = ((a + b + c) / 3)[~vertical]
        # Rounding of a vertex moves its face sideways.
        sloped = np.abs(normal[~vertical])
        moved = rounding * np.hypot(*sloped[:, :2].T) / np.maximum(sloped[:, 2], 1e-300)
        error = np.abs(centroid[:, 2] - terrain_map.height(centroid[:, :2])) - moved
        if error.max(initial=0.0) > largest:
            largest, place = error.max(), centroid[np.argmax(error)]
    if empty:
        yield f"{empty} faces have no area"
    if downward:
        yield f"{downward} faces point downward"
    expected = grid.size[0] * grid.size[1]
    if abs(covered - expected) > 1e-4 * expected:
        yield f"the mesh covers {covered:.1f} m2; expected the {expected:.1f} m2 of the map"
    yield from _check_edges(terrain_map, mesh)
    if largest > TOLERANCE:
        yield (
            f"the mesh differs from the heights by up to {largest:.3f} m, "
            f"most at ({place[0]:.2f}, {place[1]:.2f})"
        )


def _rounding(terrain_map: TerrainMap) -> float:
    """Return the distance between two single-precision numbers at the edge of the map [m]."""
    farthest = np.abs([terrain_map.grid.lower, terrain_map.grid.upper]).max()
    return float(np.spacing(np.float32(farthest)))


def _check_edges(terrain_map: TerrainMap, mesh: TriMesh) -> Iterator[str]:
    numbers = mesh.edge_numbers()
    repeated = np.count_nonzero(numbers[1:] == numbers[:-1])
    if repeated:
        yield f"{repeated} edges are shared by more than two faces or by faces of opposite winding"
    boundary = mesh.vertices[mesh.boundary(numbers)].astype(np.float64)
    corners = np.array([terrain_map.grid.lower, terrain_map.grid.upper])
    # Distance of each edge from the four sides of the map.
    distance = np.abs(boundary[:, :, None, :2] - corners).max(axis=1)
    inside = (distance >= max(TOLERANCE, _rounding(terrain_map))).all(axis=(1, 2))
    if inside.any():
        x, y = boundary[inside][0, 0, :2]
        yield f"{int(inside.sum())} edges have only one face, for example at ({x:.2f}, {y:.2f})"
