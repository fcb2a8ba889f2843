"""The .npz map: what terrainkit reads and writes, and numpy alone can read.

Format version 1. Reading trusts nothing: every array's dtype, shape and size is checked against the
others from its header, before any of it is decompressed, and nothing is ever unpickled.
"""

import dataclasses
import json
import math
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from terrainkit.capacity import require_memory
from terrainkit.config import MapConfig
from terrainkit.config_text import from_toml, to_toml
from terrainkit.errors import ConfigError, MapFileError
from terrainkit.mesh.tri_mesh import TriMesh
from terrainkit.parameter import Realized, Value
from terrainkit.patch import Parameters

if TYPE_CHECKING:
    from terrainkit.terrain_map import TerrainMap

SUFFIXES = (".npz",)
FORMAT_VERSION = 1

_Map = TypeVar("_Map", bound="TerrainMap")


def export(terrain_map: "TerrainMap", path: Path) -> None:
    """Write the map with everything in it: heights, trimesh, origins, and its config.

    Args:
        terrain_map: The map.
        path: Where to.
    """
    config, mesh = terrain_map.config, terrain_map.mesh()
    np.savez(
        path,
        allow_pickle=False,
        format_version=np.int64(FORMAT_VERSION),
        heights=terrain_map.heights,
        cell=np.float64(config.cell),
        lower=np.array(terrain_map.grid.lower),
        border=np.float64(config.border),
        patch_size=np.array(config.patch_size),
        env_origins=terrain_map.env_origins,
        terrain_types=terrain_map.terrain_types,
        terrain_names=np.array(terrain_map.terrain_names),
        difficulty=terrain_map.difficulty,
        vertices=mesh.vertices,
        triangles=mesh.triangles,
        boxes=np.empty((0, 10), dtype=np.float32),
        config=np.array(to_toml(config)),
        parameters=np.array(_parameters_text(terrain_map)),
        friction=np.array([config.static_friction, config.dynamic_friction]),
        restitution=np.float64(config.restitution),
    )


def read_map(cls: type[_Map], path: str | Path) -> _Map:
    """Return the map in the .npz file `path`, as a `cls`.

    Raises:
        MapFileError: if the file is missing, foreign, truncated, or not a whole map.
        CapacityError: if what it says it holds would not fit in memory.
    """
    with _opened(path) as archive:
        config = archive.config()
        rows, cols, grid = config.rows, config.cols, config.grid
        names = archive.array("terrain_names", "U", (len(config.mix),), limit=_LONGEST_TEXT)
        archive.expect("cell", config.cell)
        archive.expect("border", config.border)
        archive.expect("patch_size", config.patch_size)
        archive.expect("lower", grid.lower)
        kinds = archive.array("terrain_types", "i", (rows, cols))
        if kinds.min() < 0 or kinds.max() >= len(names):
            raise MapFileError(f"{path}: terrain_types points beyond the {len(names)} names")
        archive.refuse_boxes()
        return cls(
            config=config,
            grid=grid,
            heights=archive.array("heights", "f", grid.shape),
            env_origins=archive.array("env_origins", "f", (rows, cols, 3)),
            terrain_types=kinds,
            terrain_names=tuple(str(name) for name in names),
            difficulty=archive.array("difficulty", "f", (rows, cols)),
            parameters=archive.parameters((rows, cols)),
        )


def read_mesh(path: str | Path) -> TriMesh:
    """Return the trimesh in the .npz file `path`.

    Raises:
        MapFileError: if there is none, or a triangle points beyond the vertices.
        CapacityError: if what it says it holds would not fit in memory.
    """
    with _opened(path) as archive:
        limit = _MOST_FACES * 12 * math.prod(n + 2 for n in archive.config().grid.shape)
        vertices = archive.array("vertices", "f", (None, 3), limit=limit)
        triangles = archive.array("triangles", "i", (None, 3), limit=limit)
    if triangles.size and not (triangles.min() >= 0 and triangles.max() < len(vertices)):
        raise MapFileError(f"{path}: triangles points beyond the {len(vertices)} vertices")
    return TriMesh(vertices=vertices, triangles=triangles)


# ---- the archive -------------------------------------------------------------------------------

_LONGEST_TEXT = 64 << 20
"""Most that a text in a map may take [bytes]: the config, and the parameters of its patches."""

_MOST_FACES = 20
"""Most triangles and vertices that a mesh of a map can have for each sample."""


@contextmanager
def _opened(name: str | Path) -> Iterator["_Archive"]:
    path = Path(name)
    try:
        # A FIFO would block, a device never end.
        if path.exists() and not path.is_file():
            raise MapFileError(f"{path} is not a file; wanted a map in .npz")
        with zipfile.ZipFile(path) as file:
            archive = _Archive(path, file)
            archive.check_version()
            yield archive
    except FileNotFoundError:
        raise MapFileError(f"no file {path}") from None
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise MapFileError(f"{path} is not an .npz file, or not a whole one: {error}") from error
    except OSError as error:
        raise MapFileError(f"cannot read {path}: {error.strerror or error}") from error


class _Archive:
    """An open .npz, whose arrays are checked before they are read."""

    def __init__(self, path: Path, file: zipfile.ZipFile) -> None:
        self._path = path
        self._file = file

    def check_version(self) -> None:
        """Raise MapFileError unless this is a map of the version that we read."""
        if "format_version.npy" not in self._file.namelist():
            raise MapFileError(f"{self._path} is not a map of terrainkit: it has no format_version")
        version = int(self.array("format_version", "iu", ()))
        if version != FORMAT_VERSION:
            raise MapFileError(
                f"{self._path} has format version {version}; this terrainkit reads {FORMAT_VERSION}"
            )

    def array(
        self, key: str, kinds: str, shape: tuple[int | None, ...], *, limit: int | None = None
    ) -> NDArray[Any]:
        """Return the array `key`.

        Args:
            key: Its name.
            kinds: Kinds of dtype that it may have, as numpy's letters.
            shape: Shape that it must have; None for any length.
            limit: Most bytes that it may take.
        """
        try:
            with self._file.open(f"{key}.npy") as member:
                self._check_header(member, key, kinds, shape, limit)
            with self._file.open(f"{key}.npy") as member:
                return np.lib.format.read_array(member, allow_pickle=False)
        except KeyError:
            raise MapFileError(f"{self._path} has no {key}") from None
        except ValueError as error:
            raise MapFileError(f"{self._path}: {key} cannot be read: {error}") from error

    def _check_header(
        self,
        member: IO[bytes],
        key: str,
        kinds: str,
        shape: tuple[int | None, ...],
        limit: int | None,
    ) -> None:
        version = np.lib.format.read_magic(member)
        read = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }
        if version not in read:
            raise MapFileError(f"{self._path}: {key} has an unknown .npy version {version}")
        found, _, dtype = read[version](member)
        if dtype.hasobject or dtype.kind not in kinds:
            raise MapFileError(f"{self._path}: {key} has dtype {dtype}; wanted kind {kinds!r}")
        fits = len(found) == len(shape) and all(
            wanted in (n, None) for n, wanted in zip(found, shape, strict=True)
        )
        if not fits:
            raise MapFileError(f"{self._path}: {key} has shape {found}; wanted {_text(shape)}")
        needed = math.prod(found) * dtype.itemsize
        if limit is not None and needed > limit:
            raise MapFileError(f"{self._path}: {key} takes {needed} bytes; {limit} at most")
        require_memory(needed, f"{key} in {self._path}")

    def expect(self, key: str, wanted: float | tuple[float, ...]) -> None:
        """Raise MapFileError unless the numbers under `key` are those that the config says."""
        found = self.array(key, "fiu", np.shape(wanted))
        if not np.allclose(found, wanted, rtol=1e-9, atol=1e-9):
            raise MapFileError(
                f"{self._path}: {key} is {found.tolist()}, but its config says {wanted}"
            )

    def text(self, key: str) -> str:
        """Return the text under `key`."""
        return str(self.array(key, "U", (), limit=_LONGEST_TEXT))

    def config(self) -> MapConfig:
        """Return the config of the map."""
        try:
            return from_toml(self.text("config"))
        except ConfigError as error:
            raise MapFileError(f"{self._path}: config: {error}") from error

    def parameters(self, shape: tuple[int, int]) -> NDArray[np.object_]:
        """Return the parameters of each patch, shape `shape`."""
        try:
            rows = json.loads(self.text("parameters"))
            table = np.empty(shape, dtype=object)
            for index in np.ndindex(shape):
                table[index] = _parameters(rows[index[0]][index[1]])
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
            raise MapFileError(f"{self._path}: parameters cannot be read: {error}") from error
        return table

    def refuse_boxes(self) -> None:
        """Raise MapFileError if the map has solids, which no terrain of this version makes."""
        count = len(self.array("boxes", "f", (None, 10), limit=_LONGEST_TEXT))
        if count:
            raise MapFileError(
                f"{self._path} has {count} solids beside its heights; this terrainkit reads none"
            )


def _parameters_text(terrain_map: "TerrainMap") -> str:
    rows = [[dataclasses.asdict(patch) for patch in row] for row in terrain_map.parameters]
    return json.dumps(rows, separators=(",", ":"))


def _parameters(record: Mapping[str, Mapping[str, Any]]) -> Parameters:
    realized = {name: _realized(value) for name, value in record["realized"].items()}
    requested = {name: _number(value) for name, value in record["requested"].items()}
    return Parameters(requested=requested, realized=realized)


def _realized(value: Any) -> Realized:
    if isinstance(value, list):
        x, y = value
        return _number(x), _number(y)
    return _number(value)


def _number(value: Any) -> Value:
    if not isinstance(value, int | float):
        raise TypeError(f"{value!r} is no number")
    return value


def _text(shape: tuple[int | None, ...]) -> str:
    return f"({', '.join('any' if n is None else str(n) for n in shape)})"
