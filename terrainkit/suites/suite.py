"""A suite: its configuration, and the hash of its content."""

import hashlib
import tomllib
import warnings
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, TerrainkitError, TerrainkitWarning
from terrainkit.map.map_config import MapConfig
from terrainkit.settings.text import expected_names

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from terrainkit.map.generation import Progress
    from terrainkit.map.terrain_map import TerrainMap

RESOLUTION = 1e-4
"""Step to which values are rounded before they are hashed [m, rad, 1]. The last bits of a value
may depend on the version of numpy."""

_FOLDER = Path(__file__).with_name("maps")

_SHA256: dict[str, str] = tomllib.loads((_FOLDER / "sha256.toml").read_text(encoding="utf-8"))
"""Hash of the content of each suite. A released suite never changes: a change is a suite with a new
version."""


@dataclass(frozen=True, kw_only=True)
class Suite:
    """A fixed map: the rows are levels, the columns are tests."""

    name: str
    """Name, which ends with the version, and the scale if there are several."""

    config: MapConfig
    """Configuration of the map. It has a value for every parameter, so that it does not depend on
    the defaults."""

    sha256: str
    """`suite_hash` of the map."""


def suite_names() -> tuple[str, ...]:
    """Return the names of the suites."""
    return tuple(_SHA256)


def get_suite(name: str) -> Suite:
    """Return the suite `name`.

    Raises:
        ConfigError: if there is no such suite.
    """
    if name not in _SHA256:
        raise ConfigError(f"no suite {name!r}; {expected_names(name, _SHA256)}")
    config = MapConfig.load(_FOLDER / f"{name}.toml")
    return Suite(name=name, config=config, sha256=_SHA256[name])


def generate_suite(
    name: str, *, progress: "Progress | None" = None, executor: "Executor | None" = None
) -> "TerrainMap":
    """Generate the map of the suite `name`, and verify its hash.

    Args:
        name: Name of the suite.
        progress: See `terrainkit.generate`.
        executor: See `terrainkit.generate`.

    Returns:
        The map.

    Raises:
        ConfigError: if there is no such suite.
        TerrainkitError: if the map differs from the suite.
    """
    from terrainkit.map.generation import generate

    suite = get_suite(name)
    with warnings.catch_warnings():
        # A suite is fixed: that some levels are equal is no news, and no one can change it.
        warnings.filterwarnings("ignore", "cells of", TerrainkitWarning)
        terrain_map = generate(suite.config, progress=progress, executor=executor)
    if (got := suite_hash(terrain_map)) != suite.sha256:
        raise TerrainkitError(
            f"suite {name}: got a map with SHA-256 {got}; expected {suite.sha256}, from another "
            "version of terrainkit or numpy"
        )
    return terrain_map


def suite_hash(terrain_map: "TerrainMap") -> str:
    """Return the SHA-256 of the content of a map, as 64 hexadecimal digits.

    It covers shape and values of the heights, the friction of the ground, all arrays of the solids,
    the spawns and the goals, in this order. Values are little-endian int32: floating-point numbers
    in units of `RESOLUTION`, NaN as the lowest number.

    Raises:
        ConfigError: if a value does not fit in int32.
    """
    solids = terrain_map.solids
    arrays = {
        "heights": terrain_map.heights,
        "friction": terrain_map.friction,
        **{f"solids.{field.name}": getattr(solids, field.name) for field in fields(solids)},
        "spawns": terrain_map.spawns,
        "goals": terrain_map.goals,
    }
    digest = hashlib.sha256()
    for name, array in arrays.items():
        digest.update(np.array(array.shape, "<i4").tobytes())
        digest.update(_int32_bytes(name, array))
    return digest.hexdigest()


def _int32_bytes(name: str, array: NDArray[Any]) -> bytes:
    lowest, highest = np.iinfo(np.int32).min, np.iinfo(np.int32).max
    values = np.asarray(array, dtype=float)
    units = np.rint(values / RESOLUTION) if array.dtype.kind == "f" else values
    units = np.where(np.isnan(units), lowest, units)
    if not (np.abs(units[units != lowest]) <= highest).all():
        limit = highest * RESOLUTION
        raise ConfigError(
            f"{name}: got values up to {np.nanmax(np.abs(values)):g}; expected at most {limit:g}"
        )
    return units.astype("<i4").tobytes()
