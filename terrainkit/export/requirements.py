"""What a format requires of a map: errors and warnings for what it cannot represent."""

import warnings

import numpy as np

from terrainkit.errors import ExportError, TerrainkitWarning
from terrainkit.map.terrain_map import TerrainMap
from terrainkit.settings.type_hint import MAX_VALUE


def has_one_friction(terrain_map: TerrainMap) -> bool:
    """Return whether all of the ground and all solids have the friction of the map."""
    static = np.float32(terrain_map.config.static_friction)
    solids = terrain_map.solids.friction
    is_map_friction = np.isnan(solids) | (solids == static)
    return bool((terrain_map.friction == static).all() and is_map_friction.all())


def require_finite(terrain_map: TerrainMap) -> None:
    """Raise ExportError if a height or an origin is not finite or out of range."""
    for name in ("heights", "env_origins"):
        values = getattr(terrain_map, name)
        # One pass each: NaN makes both comparisons false.
        if not (values.min() >= -MAX_VALUE and values.max() <= MAX_VALUE):
            raise ExportError(
                f"{name} has values that are not finite or beyond {MAX_VALUE:g} m; "
                "run terrainkit check-map for details"
            )


def require_no_solids(terrain_map: TerrainMap, what: str) -> None:
    """Raise ExportError if the map has solids, which `what` cannot represent."""
    if len(terrain_map.solids):
        raise ExportError(
            f"got a map with {len(terrain_map.solids)} solids, which {what} cannot represent; "
            "expected a mesh (.stl, .ply, .obj, .glb) or MuJoCo model (.xml)"
        )


def require_one_ground_friction(terrain_map: TerrainMap, what: str) -> None:
    """Raise ExportError if the ground has several friction coefficients; `what` has one."""
    if not (terrain_map.friction == np.float32(terrain_map.config.static_friction)).all():
        raise ExportError(
            f"got ground with several friction coefficients, which {what} cannot represent; "
            "expected no friction of sub-terrains or friction patches"
        )


def require_one_friction(terrain_map: TerrainMap, what: str) -> None:
    """Raise ExportError if the map has several friction coefficients; `what` has one."""
    if not has_one_friction(terrain_map):
        raise ExportError(
            f"got a map with several friction coefficients, which {what} cannot represent; "
            "expected no friction of sub-terrains, friction patches or solids"
        )


def require_whole_solids(terrain_map: TerrainMap, what: str) -> None:
    """Raise ExportError if a solid only collides or is only visible; `what` does both."""
    if count := _num_partial_solids(terrain_map):
        raise ExportError(
            f"got {count} solids that only collide or are only visible, "
            f"which {what} cannot represent; expected solids that are both"
        )


def warn_about_loss(terrain_map: TerrainMap, what: str) -> None:
    """Warn if the map has several frictions or partial solids, which `what` cannot represent."""
    if count := _num_partial_solids(terrain_map):
        warnings.warn(
            f"{what} has the solids that collide, visible or not: "
            f"{count} solids are only one of both; use .npz or .xml",
            TerrainkitWarning,
            stacklevel=5,
        )
    if not has_one_friction(terrain_map):
        warnings.warn(
            f"{what} has one friction, {terrain_map.config.static_friction:g}: the friction of "
            "sub-terrains, friction patches and solids is not in the file; use .npz or .xml",
            TerrainkitWarning,
            stacklevel=5,
        )


def _num_partial_solids(terrain_map: TerrainMap) -> int:
    return int(np.count_nonzero(terrain_map.solids.collides != terrain_map.solids.visible))
