"""Read and write maps as .npz files, format version 1."""

import dataclasses
import json
import math
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, MapFileError, TerrainkitWarning, is_built_in, listing
from terrainkit.files.archive import MAX_TEXT_BYTES, Archive, open_archive, write_arrays
from terrainkit.geometry.solids import Solids, check_solids
from terrainkit.geometry.walls import ALONG_X, ALONG_Y
from terrainkit.map.import_report import ImportReport
from terrainkit.map.map_config import MapConfig
from terrainkit.map.patch import PatchParameters, Values
from terrainkit.settings.type_hint import MAX_VALUE
from terrainkit.terrain.patch_geometry import MAX_GOALS
from terrainkit.terrain.sub_terrain import SubTerrain, UnavailableSubTerrain

if TYPE_CHECKING:
    from terrainkit.geometry.mesh.tri_mesh import TriMesh
    from terrainkit.map.terrain_map import TerrainMap

SUFFIXES = (".npz",)
BYTES_PER_SAMPLE = 22
FORMAT_VERSION = 1

MAX_FACES_PER_SAMPLE = 20
"""Upper bound of the triangles and vertices of a mesh per sample of its map."""

MAX_SOLID_BYTES = 1 << 30
"""Upper bound of an array of solids [bytes]."""

_SOLIDS = {
    "boxes": "boxes",
    "cylinders": "cylinders",
    "hull_vertices": "hull_vertices",
    "hull_counts": "hull_counts",
    "solid_friction": "friction",
    "solid_collides": "collides",
    "solid_visible": "visible",
    "solid_patch": "patch",
}
"""Field of `Solids` by key of the file."""

MAX_PATCH_RECORD_BYTES = 8192
"""Upper bound of the parameters of a patch as JSON [bytes]."""

_Record = dict[Literal["requested", "realized"], Values]
"""The requested and the realized parameters of a patch."""

_Map = TypeVar("_Map", bound="TerrainMap")


def export(terrain_map: "TerrainMap", path: Path, *, mesh: bool = True) -> None:
    """Write the map as arrays.

    They are heights, ground friction, trimesh, solids, goals, spawn origins and spawns, terrain
    types, difficulty, parameters and config.

    Args:
        terrain_map: The map.
        path: Target.
        mesh: Write the trimesh. `TerrainMap.mesh` builds it from the other arrays.
    """
    config = terrain_map.config
    trimesh = terrain_map.mesh() if mesh else None
    friction = terrain_map.friction
    if (friction == friction[0, 0]).all():
        friction = friction[:1, :1]  # stored once if it is the same in all cells
    records = [[dataclasses.asdict(patch) for patch in row] for row in terrain_map.parameters]
    arrays = {
        "format_version": np.int64(FORMAT_VERSION),
        "heights": terrain_map.heights,
        "ground_friction": friction,
        "cell": np.float64(config.cell),
        "lower": np.array(terrain_map.grid.lower),
        "border": np.float64(config.border),
        "patch_size": np.array(config.patch_size),
        "env_origins": terrain_map.env_origins,
        "terrain_types": terrain_map.terrain_types,
        "terrain_names": np.array(terrain_map.terrain_names),
        "difficulty": terrain_map.difficulty,
        **({"vertices": trimesh.vertices, "triangles": trimesh.triangles} if trimesh else {}),
        **{key: getattr(terrain_map.solids, name) for key, name in _SOLIDS.items()},
        "goals": terrain_map.goals,
        "spawns": terrain_map.spawns,
        "config": np.array(config.to_toml()),
        "parameters": np.array(json.dumps(records, separators=(",", ":"))),
        "friction": np.array([config.static_friction, config.dynamic_friction]),
        "restitution": np.float64(config.restitution),
    }
    if terrain_map.walls is not None:
        arrays["walls"] = terrain_map.walls
    if terrain_map.import_reports:
        text = msgspec.json.encode(terrain_map.import_reports).decode()
        arrays["import_reports"] = np.array(text)
    write_arrays(path, arrays)


def read_map(cls: type[_Map], path: str | Path) -> _Map:
    """Return the map in the .npz file `path` as an instance of `cls`.

    Args:
        cls: Class of the map.
        path: The .npz file.

    Warns:
        TerrainkitWarning: if classes of the user are not available; see `MapConfig.from_map`.

    Raises:
        MapFileError: if the file is missing, truncated, or not a map.
        MemoryLimitError: if its arrays would not fit in memory.
    """
    with open_archive(path) as archive:
        config = _read_config(archive)
        size = (config.rows, config.cols)
        grid = config.grid
        for key, expected in (
            ("cell", config.cell),
            ("border", config.border),
            ("patch_size", config.patch_size),
            ("lower", grid.lower),
            ("friction", (config.static_friction, config.dynamic_friction)),
            ("restitution", config.restitution),
        ):
            archive.check_value(key, expected)
        names = archive.array(
            "terrain_names", "U", (len(config.sub_terrains),), limit=MAX_TEXT_BYTES
        )
        terrain_types = archive.array("terrain_types", "i4", size)
        if terrain_types.min() < 0 or terrain_types.max() >= len(names):
            raise MapFileError(
                f"{path}: terrain_types: got an index out of range; expected 0 to {len(names) - 1}"
            )
        if config.problems:
            warnings.warn(
                f"{path}: loaded as a custom map, not compared with its config or generated again: "
                + "; ".join(config.problems),
                TerrainkitWarning,
                stacklevel=3,
            )
        return cls(
            config=config,
            grid=grid,
            heights=archive.array("heights", "f4", grid.shape),
            friction=_read_friction(archive, config),
            spawns=_read_spawns(archive, config),
            terrain_types=terrain_types,
            terrain_names=tuple(str(name) for name in names),
            difficulty=archive.array("difficulty", "f4", size),
            parameters=_read_parameters(archive, config, terrain_types),
            solids=_read_solids(archive, size),
            goals=_read_poses(archive, "goals", size, MAX_GOALS),
            walls=_read_walls(archive, grid.shape),
            import_reports=_read_import_reports(archive, config.rows * config.cols),
        )


def read_config(path: str | Path) -> MapConfig:
    """Return the config of the map in the .npz file `path`, to generate the map again.

    Raises:
        MapFileError: if the file is not a map, or a class of its config is not available.
    """
    with open_archive(path) as archive:
        return _read_config(archive, MapConfig.from_toml)


def is_map_file(path: Path) -> bool:
    """Return whether `path` is an .npz file with a map."""
    try:
        with open_archive(path) as archive:
            return "format_version" in archive.names()
    except MapFileError:
        return False


def read_mesh(path: str | Path) -> "TriMesh | None":
    """Return the trimesh in the .npz file `path`; None if it was written without one.

    Raises:
        MapFileError: if it has only one of the arrays, or a vertex index is out of range.
        MemoryLimitError: if its arrays would not fit in memory.
    """
    from terrainkit.geometry.mesh.tri_mesh import TriMesh

    with open_archive(path) as archive:
        shape = _read_config(archive).grid.shape
        if archive.names().isdisjoint(("vertices", "triangles")):
            return None
        limit = MAX_FACES_PER_SAMPLE * 12 * math.prod(n + 2 for n in shape)
        vertices = archive.array("vertices", "f4", (None, 3), limit=limit)
        triangles = archive.array("triangles", "i4", (None, 3), limit=limit)
    if triangles.size and not (triangles.min() >= 0 and triangles.max() < len(vertices)):
        raise MapFileError(
            f"{path}: triangles: got an index out of range; expected 0 to {len(vertices) - 1}"
        )
    return TriMesh(vertices=vertices, triangles=triangles)


def _read_config(
    archive: Archive, read: Callable[[str], MapConfig] = MapConfig.from_map
) -> MapConfig:
    """Return the config of the map, after checking the format version."""
    if "format_version" not in archive.names():
        raise MapFileError(f"{archive.path}: not a terrainkit map; format_version is missing")
    version = int(archive.array("format_version", "i", ()))
    if version != FORMAT_VERSION:
        raise MapFileError(
            f"{archive.path}: got format version {version}; expected {FORMAT_VERSION}"
        )
    try:
        return read(archive.text("config"))
    except ConfigError as error:
        raise MapFileError(f"{archive.path}: config: {error}") from error


def _read_friction(archive: Archive, config: MapConfig) -> NDArray[np.float32]:
    """Return the friction of all cells, which is stored once if it is the same."""
    shape = config.grid.shape
    friction = archive.array("ground_friction", "f4", (None, None), limit=4 * math.prod(shape))
    if friction.shape not in (shape, (1, 1)):
        raise MapFileError(
            f"{archive.path}: ground_friction: got shape {friction.shape}; expected {shape}, or "
            "(1, 1)"
        )
    if not ((friction >= 0) & (friction <= MAX_VALUE)).all():
        raise MapFileError(
            f"{archive.path}: ground_friction: got values out of range; expected 0 to {MAX_VALUE}"
        )
    return np.broadcast_to(friction, shape)


def _read_walls(archive: Archive, shape: tuple[int, int]) -> NDArray[np.uint8] | None:
    """Return the walls of an imported map; None if the heights decide."""
    if "walls" not in archive.names():
        return None
    walls = archive.array("walls", "u1", shape)
    beyond = (walls[-1] & ALONG_X).any() or (walls[:, -1] & ALONG_Y).any()
    if beyond or walls.max() > ALONG_X | ALONG_Y:
        raise MapFileError(f"{archive.path}: walls: got an edge out of range; expected 0 to 3")
    return walls


def _read_solids(archive: Archive, size: tuple[int, int]) -> Solids:
    """Return the solids of a map of `size` patches."""

    def read(key: str, kind: str, *shape: int | None) -> NDArray[Any]:
        return archive.array(key, kind, shape, limit=MAX_SOLID_BYTES)

    boxes, cylinders = (read(key, "f4", None, 10) for key in ("boxes", "cylinders"))
    vertices, counts = read("hull_vertices", "f4", None, 3), read("hull_counts", "i4", None)
    number = len(boxes) + len(cylinders) + len(counts)
    solids = Solids(
        boxes=boxes,
        cylinders=cylinders,
        hull_vertices=vertices,
        hull_counts=counts,
        friction=read("solid_friction", "f4", number),
        collides=read("solid_collides", "b1", number),
        visible=read("solid_visible", "b1", number),
        patch=read("solid_patch", "i4", number, 2),
    )
    try:
        check_solids(solids)
        if not ((solids.patch >= 0) & (solids.patch < size)).all():
            raise ConfigError("solid_patch: got invalid values or sizes")
    except ConfigError as error:
        raise MapFileError(f"{archive.path}: {error}") from error
    return solids


def _read_spawns(archive: Archive, config: MapConfig) -> NDArray[np.float32]:
    """Return the spawn positions, of which the first of each patch is its origin.

    A file has the origins twice. `env_origins`, which other programs read, replaces the first
    spawns, so that the two cannot differ.
    """
    size = (config.rows, config.cols)
    origins = archive.array("env_origins", "f4", (*size, 3))
    spawns = _read_poses(archive, "spawns", size, math.prod(config.patch_shape))
    if not spawns.shape[2]:
        raise MapFileError(f"{archive.path}: spawns: got none; expected one or more for each patch")
    spawns[:, :, 0, :3] = origins
    return spawns


def _read_poses(
    archive: Archive, key: str, size: tuple[int, int], max_poses: int
) -> NDArray[np.float32]:
    """Return the poses (x, y, z, heading) of each patch, at most `max_poses`, padded with NaN."""
    limit = math.prod(size) * max_poses * 16
    poses = archive.array(key, "f4", (*size, None, 4), limit=limit)
    is_padding = np.isnan(poses).all(axis=-1)
    if not (is_padding | (np.abs(poses) <= MAX_VALUE).all(axis=-1)).all():
        raise MapFileError(f"{archive.path}: {key}: got values that are not finite")
    if (is_padding[..., :-1] & ~is_padding[..., 1:]).any():
        raise MapFileError(f"{archive.path}: {key}: got a gap; expected NaN at the end only")
    return poses


def _read_import_reports(archive: Archive, number: int) -> tuple[ImportReport, ...]:
    if "import_reports" not in archive.names():
        return ()
    text = archive.text("import_reports", limit=number * MAX_PATCH_RECORD_BYTES)
    try:
        return msgspec.json.decode(text, type=tuple[ImportReport, ...])
    except msgspec.DecodeError as error:
        raise MapFileError(f"{archive.path}: import_reports cannot be read: {error}") from error


def _read_parameters(
    archive: Archive, config: MapConfig, terrain_types: NDArray[np.int32]
) -> NDArray[np.object_]:
    table = np.empty(terrain_types.shape, dtype=object)
    names = [_parameter_names(sub_terrain) for sub_terrain in config.sub_terrains]
    text = archive.text("parameters", limit=(table.size + 16) * MAX_PATCH_RECORD_BYTES)
    try:
        rows = msgspec.json.decode(text, type=list[list[_Record]])
        for row, col in np.ndindex(table.shape):
            record, expected = rows[row][col], names[terrain_types[row, col]]
            keys = record["requested"].keys() if expected is None else expected
            if not record["requested"].keys() == record["realized"].keys() == keys:
                raise ValueError(f"expected {listing(sorted(keys))}, requested and realized")
            table[row, col] = PatchParameters(**record)
    except (msgspec.DecodeError, ValueError, LookupError, TypeError, RecursionError) as error:
        raise MapFileError(f"{archive.path}: parameters cannot be read: {error}") from error
    return table


def _parameter_names(sub_terrain: SubTerrain) -> set[str] | None:
    """Return the names of the parameters in a file; None where a class of the user decides."""
    if isinstance(sub_terrain, UnavailableSubTerrain):
        return None
    classes = sub_terrain.terrain_class, *map(type, sub_terrain.overlays)
    return set(sub_terrain.declarations) if all(map(is_built_in, classes)) else None
