"""A suite: its configuration, and the hash of its content."""

import hashlib
import warnings
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, TerrainkitError, TerrainkitWarning
from terrainkit.map.config import MapConfig
from terrainkit.settings.text import expected_names

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from terrainkit.map.generation import Progress
    from terrainkit.map.terrain_map import TerrainMap

RESOLUTION = 1e-4
"""Step to which values are rounded before they are hashed [m, rad, 1]. The last bits of a value
may depend on the version of numpy."""

_SHA256 = {
    "basics-1": "f00eae7013071e577ab8dfeb8efb6ea464dd30820d7b6eee018763b3b3dc4828",
    "response-1-small": "afb64ea74ff350166d01d4a3a9dbdfd1f28c0ebdc2d6d3f25c13f94ae8def120",
    "response-1-medium": "966425ba941ffaa038ac353fd7712d9c38a84a1ee33fffd751d1b4f1ade051f5",
    "response-1-large": "92eab26ec60a165462843ee6d5b2e1acbc7b56c128d68a9458d6da7a8226e2d5",
    "parkour-1": "e1214a35cada47f5545abd67a8eccd3b46b94eb4ef0b612cef28c61b49982d28",
    "sparse-1": "9a53958938b2c3051901a6c295b2178bc4ebe7f1d0b22a2a71ab3cc32f08e987",
    "confined-1": "c94dc43000531de302a2f7598e645993f3e036cca17c6c12d5d58a5533d7af62",
    "natural-1": "7e89511ecb0cd594d221c8ec404df2b2904a8808233316448becd661b1ca820f",
    "indoor-1": "8d04da472acc7bc6074828513368bb65b04900eeb09a8fec6151dfff8b20e1c8",
    "street-1": "328326e8b5a3dd6b1c15eccd43871e357292a9cee2ea5ad4aa3b6614176f63ee",
}
"""Hash of the content of each suite. A released suite never changes: a change is a suite with a new
version."""

_FOLDER = Path(__file__).with_name("maps")


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
