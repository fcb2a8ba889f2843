"""Maps in Genesis."""

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.export.requirements import require_one_ground_friction
from terrainkit.geometry.solids import Solids
from terrainkit.integrations import load_map, missing
from terrainkit.map.terrain_map import TerrainMap

try:
    import genesis as gs
    import torch
    import trimesh
except ModuleNotFoundError as error:
    raise missing("Genesis", "pip install genesis-world") from error

_SDF_RESOLUTION = 16
"""Nodes of a signed distance field along each axis; the fewest that Genesis accepts."""


def add_map(scene: Any, source: TerrainMap | str | Path, *, visualization: bool = True) -> Any:
    """Add the map to a scene: the ground as a heightfield, the solids as fixed bodies.

    Walls of the ground are slopes over one cell. `terrain.get_terrain_height` returns the heights
    of the ground. Cameras and rays see a mesh with vertical walls, and the solids.

    Args:
        scene: Scene that is not built.
        source: Map, or path of a .npz file.
        visualization: Whether to add the mesh of the ground, which only cameras and rays need.

    Returns:
        The entity of the ground.

    Raises:
        ExportError: if the ground has several friction coefficients; a heightfield has one.
    """
    terrain_map = load_map(source)
    require_one_ground_friction(terrain_map, "a heightfield of Genesis")
    friction = float(terrain_map.config.static_friction)
    heights = terrain_map.heights.astype(gs.np_float)
    bounds, scale = _bounds(heights, terrain_map.config.cell)
    terrain = scene.add_entity(
        gs.morphs.Terrain(
            height_field=bounds,
            horizontal_scale=scale,
            vertical_scale=1.0,
            pos=(*terrain_map.first_sample, 0.0),
            visualization=False,
        ),
        material=_material(friction),
    )
    # Genesis computes the signed distance field of a terrain's mesh, which takes minutes for all of
    # its triangles, though rigid bodies collide with the heights: the mesh has only their bounds.
    terrain._desc.terrain_hf = heights
    terrain._desc.terrain_scale = np.array([terrain_map.config.cell, 1.0], dtype=gs.np_float)
    terrain._morph.horizontal_scale = terrain_map.config.cell
    terrain._terrain_height_field = torch.as_tensor(heights, dtype=gs.tc_float, device=gs.device)
    if visualization:
        _add_mesh(scene, replace(terrain_map, solids=Solids.empty()))
    _add_solids(scene, terrain_map.solids, friction)
    return terrain


def _bounds(heights: NDArray[np.floating], cell: float) -> tuple[NDArray[np.floating], float]:
    """Return a coarse heightfield with the bounds of `heights`, and the size of its cells [m].

    It is nowhere above the ground, except in a corner outside of the map, so that rays hit the mesh
    of the ground first.
    """
    span = (np.array(heights.shape) - 1) * cell
    scale = float(span.max()) / _SDF_RESOLUTION
    shape = np.ceil(span / scale).astype(int) + 3
    bounds = np.full(shape, heights.min() - 1e-3)
    bounds[-1, -1] = heights.max()
    return bounds, scale


def _material(friction: float) -> Any:
    return gs.materials.Rigid(
        friction=friction,
        use_visual_raycasting=True,
        sdf_min_res=_SDF_RESOLUTION,
        sdf_max_res=_SDF_RESOLUTION,
    )


def _add_mesh(scene: Any, terrain_map: TerrainMap) -> None:
    """Add the mesh of the ground for cameras and rays."""
    with tempfile.TemporaryDirectory() as folder:
        path = terrain_map.save(Path(folder) / "map.obj")
        morph = gs.morphs.Mesh(file=str(path), fixed=True, collision=False)
        scene.add_entity(morph, material=gs.materials.Rigid(use_visual_raycasting=True))


def _add_solids(scene: Any, solids: Solids, friction: float) -> None:
    """Add a fixed body for each solid."""
    with tempfile.TemporaryDirectory() as folder:
        morphs: list[tuple[Any, dict[str, Any]]] = [
            (gs.morphs.Box, {"pos": row[:3], "size": 2 * row[3:6], "quat": row[6:]})
            for row in solids.boxes
        ]
        morphs += [
            (
                gs.morphs.Cylinder,
                {"pos": row[:3], "radius": row[3], "height": 2 * row[5], "quat": row[6:]},
            )
            for row in solids.cylinders
        ]
        for k, vertices in enumerate(solids.hulls()):
            path = Path(folder) / f"{k}.obj"
            trimesh.convex.convex_hull(vertices).export(path)
            morphs.append((gs.morphs.Mesh, {"file": str(path)}))
        for (morph, shape), own, collides, visible in zip(
            morphs, solids.friction, solids.collides, solids.visible, strict=True
        ):
            if collides or visible:
                scene.add_entity(
                    morph(
                        **shape, fixed=True, collision=bool(collides), visualization=bool(visible)
                    ),
                    material=_material(friction if np.isnan(own) else float(own)),
                )
