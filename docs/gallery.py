"""Pictures of patches for the documentation, rendered by MuJoCo in the colors of the preview."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.mesh import closed_mesh, full_mesh
from terrainkit.geometry.mesh.solid_mesh import concatenate_meshes, solid_meshes
from terrainkit.geometry.mesh.tri_mesh import TriMesh
from terrainkit.map.patch import Patch
from terrainkit.map.terrain_map import TerrainMap
from terrainkit.views.preview import height_colors
from terrainkit_robots.rendering import appearance
from terrainkit_robots.rendering.child_process import stream_frames

MIN_HEIGHT = -1.0
"""Deeper holes are cut off at this height [m]."""

COLOR_RANGE = (-1.5, 3.0)
"""Heights of the first and the last color of the texture [m]."""

GAP = 0.5
"""Distance between the corners of two patches [m]."""

MARGIN = 12
"""Margin above and below the patches [pixels]."""

TILE = 0.5
"""Side of the tiles of a checkered ground [m]."""

TILE_SHADE = 0.9
"""Brightness of the darker tiles."""


def render_patches(
    patches: list[Patch], width: int, cuts: Sequence[float] = ()
) -> NDArray[np.uint8]:
    """Return an RGB picture of `patches` side by side, shape (height, width, 3).

    The patches are seen from low x and low y; each is a block with its solids.

    Args:
        patches: Patches of the same size.
        width: Width of the picture [pixels].
        cuts: Height of each patch at which solids are cut off [m]; empty for no cut.
    """
    heights = cuts or [np.inf] * len(patches)
    meshes = [block(*part, k) for k, part in enumerate(zip(patches, heights, strict=True))]
    return render_meshes(meshes, width, 45.0, 0.53)


def render_map(terrain_map: TerrainMap, width: int) -> NDArray[np.uint8]:
    """Return an RGB picture of a map, shape (height, width, 3); y is away from the camera."""
    mesh = terrain_map.mesh()
    heights = np.maximum(mesh.vertices[:, 2:], 2 * MIN_HEIGHT)  # below the stairs
    vertices = np.hstack([mesh.vertices[:, :2], heights]).astype(np.float32)
    return render_meshes([TriMesh(vertices=vertices, triangles=mesh.triangles)], width, 82.0, 0.49)


def render_meshes(
    meshes: list[TriMesh], width: int, azimuth: float, scale: float
) -> NDArray[np.uint8]:
    """Return an RGB picture of meshes without the sky above and below.

    Args:
        meshes: The meshes.
        width: Width of the picture [pixels].
        azimuth: Azimuth of the camera [deg].
        scale: Width that the camera sees at the center, as a part of twice the meshes' diagonal.
    """
    (frame,) = stream_frames(partial(_frames, meshes, (width, width), azimuth, scale))
    used = np.flatnonzero((frame != frame[0, 0]).any(axis=(1, 2)))
    return frame[max(0, used[0] - MARGIN) : used[-1] + MARGIN]


def block(patch: Patch, cut: float = np.inf, index: int = 0) -> TriMesh:
    """Return the ground of a patch as a block, with the solids, at place `index` of the row.

    Upright boxes are cut off at a height; higher ones are not shown.
    """
    threshold = 0.75 * patch.grid.cell
    ground = full_mesh(np.maximum(patch.heights, MIN_HEIGHT), patch.grid, threshold)
    solids = patch.solids.select(patch.solids.bounds()[0][:, 2] < cut)
    mesh = concatenate_meshes([_with_thickness(closed_mesh(ground)), *solid_meshes(solids)])
    mesh.vertices[:, 2] = np.minimum(mesh.vertices[:, 2], cut)
    # The row runs to the right of a camera that looks along x and y.
    step = sum(patch.grid.size) / 2 + GAP
    offset = np.array([index * step, -index * step, 0.0]) - [*patch.grid.lower, 0.0]
    return TriMesh(vertices=(mesh.vertices + offset).astype(np.float32), triangles=mesh.triangles)


def _with_thickness(mesh: TriMesh) -> TriMesh:
    """Return a closed mesh whose bottom is 0.3 m below the deepest hole that is shown."""
    vertices = mesh.vertices.copy()
    bottom = vertices[:, 2] == vertices[:, 2].min()
    vertices[bottom, 2] = min(0.0, float(vertices[~bottom, 2].min())) - 0.3
    return TriMesh(vertices=vertices, triangles=mesh.triangles)


def _frames(
    meshes: list[TriMesh], size: tuple[int, int], azimuth: float, scale: float
) -> Iterator[NDArray[np.uint8]]:
    spec = mujoco.MjSpec()
    appearance.set_appearance(spec)
    add_meshes(spec, meshes)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    extent = float(np.linalg.norm(upper - lower))
    renderer = appearance.make_renderer(model, size, extent)
    renderer.scene.flags[mujoco.mjtRndFlag.mjRND_FOG] = 0
    target = (lower + upper) / 2
    half_angle = np.radians(appearance.FIELD_OF_VIEW / 2)
    distance = scale * float(np.linalg.norm((upper - lower)[:2])) / np.tan(half_angle)
    appearance.update_scene(renderer, data, target, distance, azimuth, -32.0)
    yield renderer.render()


def add_meshes(spec: Any, meshes: list[TriMesh], *, checkered: bool = False) -> None:
    """Add meshes to a `mujoco.MjSpec`, colored by height, and with tiles if they are checkered."""
    low, high = COLOR_RANGE
    colors = height_colors(np.linspace(low, high, 512))
    texture = spec.add_texture(
        name="heights", type=mujoco.mjtTexture.mjTEXTURE_2D, width=512, height=4, nchannel=3
    )
    rows = [colors, colors, TILE_SHADE * colors, TILE_SHADE * colors]
    texture.data = np.array(rows).astype(np.uint8).tobytes()
    material = spec.add_material(name="heights", specular=0.1)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "heights"
    for k, mesh in enumerate(meshes):
        triangles = mesh.vertices[mesh.triangles]  # corners are not shared, so that faces are flat
        corners = triangles.reshape(-1, 3)
        level = np.clip((corners[:, 2] - low) / (high - low), 0.001, 0.999)
        tile = np.floor(triangles.min(axis=1) / TILE).astype(int)  # of both triangles of a cell
        row = 0.125 + 0.75 * checkered * ((tile[:, 0] + tile[:, 1]) % 2)
        spec.add_mesh(
            name=f"patch{k}",
            uservert=corners.ravel(),
            userface=np.arange(len(corners)),
            usertexcoord=np.column_stack([level, row.repeat(3)]).ravel(),
            userfacetexcoord=np.arange(len(corners)),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=f"patch{k}",
            material="heights",
            contype=0,
            conaffinity=0,
        )
