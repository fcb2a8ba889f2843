"""An interactive 3D view of a map in the browser, drawn by viser."""

import html
from itertools import groupby, product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.geometry.mesh.solid_mesh import concatenate_meshes, solid_meshes
from terrainkit.views.preview import (
    LEVELS,
    LIGHT,
    Levels,
    hatch_friction,
    height_colors,
    map_levels,
    map_title,
    own_frictions,
    shaded_colors,
    shaded_relief,
)

if TYPE_CHECKING:
    import viser

    from terrainkit.map.terrain_map import TerrainMap

_HIDDEN_COLOR = (200, 120, 200)
_SPAWN_COLOR = (196, 40, 40)
_GOAL_COLOR = (40, 90, 160)

FIELD_OF_VIEW = np.radians(45.0)
"""Vertical field of view of the first picture [rad]."""

_ELEVATION = np.radians(50.0)
"""Angle of the first picture's camera above the horizon [rad]."""

_FILL = 0.85
"""Side of the square that the patches fill, relative to the height of the picture."""

_CONTRAST = 0.15
"""Contrast of the shading of solids, relative to the ground's: walls that face away from the light
are not dark, so that rooms can be seen."""

_SHADOW = 0.4
"""Opacity of shadows on the ground."""

_MAX_TEXTURE = 4096
"""Largest side of the texture of the ground [pixels]."""

_ARROW_LENGTH = 0.6
"""Length of the arrows that show headings [m]."""

_ABOVE_GROUND = 0.1
"""Height of markers above the ground [m]."""


def show_map(server: "viser.ViserServer", terrain_map: "TerrainMap") -> "viser.FrameHandle":
    """Add a map to the scene of a viser server, and a checkbox for each of its parts.

    The parts are the ground and the solids, colored, shaded and hatched for friction as in the
    preview, and in another color the solids that are not visible to sensors or do not collide;
    spawn positions and goals with their headings; the order of the goals; and the names of the
    terrains with the levels. A slider cuts the solids off at a height, such as floors and roofs.
    New pages show all patches, with x to the right and y away, as in the preview.

    Returns:
        The frame of all parts, which moves the map.
    """
    server.scene.set_up_direction("+z")
    frame = server.scene.add_frame("/map", show_axes=False)
    _add_ground(server, terrain_map)
    parts = {
        "solids": _add_solids(server, terrain_map),
        "spawns": _add_arrows(server, "spawns", terrain_map.spawns, _SPAWN_COLOR),
        "goals": [
            *_add_arrows(server, "goals", terrain_map.goals, _GOAL_COLOR),
            *_add_goal_order(server, terrain_map),
        ],
        "labels": _add_labels(server, terrain_map),
    }
    names = html.escape(", ".join(terrain_map.terrain_names))
    title = f"<b>{map_title(terrain_map.config)}</b><br>{names}"
    if len(frictions := own_frictions(terrain_map)):
        low, high = frictions[[0, -1]].tolist()
        title += f"<br>hatched: friction {low:.2f} (dense) to {high:.2f}"
    server.gui.add_html(f'<div style="margin: 0.5em">{title}</div>')
    for name, handles in parts.items():
        if handles:
            add_checkbox(server, name, handles)
    if solids := parts["solids"]:
        _add_cut(server, terrain_map, solids)
    lower, upper = _patch_bounds(terrain_map)
    server.initial_camera.fov = FIELD_OF_VIEW
    server.initial_camera.look_at = (lower + upper) / 2
    server.initial_camera.position = camera_position(lower, upper)
    return frame


def add_checkbox(
    server: "viser.ViserServer", name: str, handles: list[Any], *, initial_value: bool = True
) -> "viser.GuiCheckboxHandle":
    """Add a checkbox that shows and hides a part of the scene, and return it."""
    checkbox = server.gui.add_checkbox(name, initial_value=initial_value)

    def update(_: object) -> None:
        for handle in handles:
            handle.visible = checkbox.value

    checkbox.on_update(update)
    return checkbox


def camera_position(lower: NDArray[np.float64], upper: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the nearest position of a camera at which its picture shows a box.

    The camera looks at the center of the box along y, and down.

    Args:
        lower: Lower corner of the box [m], shape (3,).
        upper: Upper corner of the box [m], shape (3,).

    Returns:
        The position [m], shape (3,).
    """
    corners = np.array(list(product(*zip(lower, upper, strict=True)))) - (lower + upper) / 2
    backward = np.array([0.0, -np.cos(_ELEVATION), np.sin(_ELEVATION)])
    upward = np.array([0.0, np.sin(_ELEVATION), np.cos(_ELEVATION)])
    sides = np.maximum(np.abs(corners[:, 0]), np.abs(corners @ upward))
    distances = sides / (_FILL * np.tan(FIELD_OF_VIEW / 2)) + corners @ backward
    return np.asarray((lower + upper) / 2 + distances.max() * backward)


def _patch_bounds(terrain_map: "TerrainMap") -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lower and the upper corner of the patches, from the lowest spawn to the highest.

    The corners are in meters, of shape (3,). The border and deep gaps are left out.
    """
    config = terrain_map.config
    heights = terrain_map.env_origins[..., 2]
    first, last = (0, 0), (config.rows - 1, config.cols - 1)
    lower = [*config.patch_grid(*first).lower, heights.min()]
    upper = [*config.patch_grid(*last).upper, heights.max()]
    return np.array(lower), np.array(upper)


def _add_ground(server: "viser.ViserServer", terrain_map: "TerrainMap") -> None:
    """Add the ground, with the relief of the preview as its texture."""
    from PIL import Image
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    mesh = terrain_map.ground_mesh()
    grid = terrain_map.grid
    levels = map_levels(terrain_map.heights)
    picture = shaded_relief(terrain_map.heights, grid.cell, levels)
    hatch_friction(picture, terrain_map.friction, terrain_map.config.static_friction)
    relief = Image.fromarray(picture)
    relief.thumbnail((_MAX_TEXTURE, _MAX_TEXTURE))
    x, y = ((mesh.vertices[:, :2] - grid.lower) / grid.size).T
    uv = np.stack([y, 1 - x], axis=1)  # image rows are along x
    visual = TextureVisuals(uv=uv, material=PBRMaterial(baseColorTexture=relief))
    data = _shaded_glb(mesh.vertices, mesh.triangles, visual=visual)
    server.scene.add_glb("/map/ground", data, cast_shadow=False, receive_shadow=_SHADOW)


def _add_cut(server: "viser.ViserServer", terrain_map: "TerrainMap", handles: list[Any]) -> None:
    """Add a slider for the height at which the solids, whose handles it renews, are cut off."""
    low, high = (bound[:, 2] for bound in terrain_map.solids.bounds())
    top = float(high.max()) + 0.1
    slider = server.gui.add_slider("height cut [m]", float(low.min()), top, 0.1, top)

    def update(_: object) -> None:
        is_visible = {handle.name: handle.visible for handle in handles}
        for handle in handles:
            handle.remove()
        handles[:] = _add_solids(server, terrain_map, slider.value)
        for handle in handles:
            handle.visible = is_visible.get(handle.name, True)

    slider.on_update(update)


def _add_solids(
    server: "viser.ViserServer", terrain_map: "TerrainMap", cut: float = np.inf
) -> list[Any]:
    """Add the solids, cut off at a height [m]."""
    solids = terrain_map.solids.select(terrain_map.solids.bounds()[0][:, 2] < cut)
    is_usual = solids.visible & solids.collides
    handles = []
    levels = map_levels(terrain_map.heights)
    for name, chosen in (("solids", is_usual), ("special_solids", ~is_usual)):
        if chosen.any():
            mesh = concatenate_meshes(solid_meshes(solids.select(chosen)))
            mesh.vertices[:, 2] = np.minimum(mesh.vertices[:, 2], cut)
            corners = mesh.vertices[mesh.triangles].astype(np.float64)
            colors = triangle_colors(corners, None if name == "solids" else _HIDDEN_COLOR, levels)
            linear = 255 * (colors / 255) ** 2.2  # as glTF defines the colors of vertices
            data = _shaded_glb(
                corners.reshape(-1, 3),
                np.arange(corners.size // 3).reshape(-1, 3),
                vertex_colors=linear.astype(np.uint8).repeat(3, axis=0),
            )
            handles.append(server.scene.add_glb(f"/map/{name}", data, receive_shadow=False))
    return handles


def triangle_colors(
    corners: NDArray[np.float64],
    color: tuple[int, int, int] | None = None,
    levels: Levels = LEVELS,
) -> NDArray[np.float64]:
    """Return the colors of triangles, shaded by slope as in the preview, with less contrast.

    The color of a wall is that of its lower end, which is lighter than that of its top.

    Args:
        corners: Corners [m], counter-clockwise, shape (n, 3, 3).
        color: Color of level triangles; None to color by height as in the preview.
        levels: Heights of the colors [m].

    Returns:
        Red, green and blue, 0 to 255, shape (n, 3).
    """
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    level = np.array(color or height_colors(corners[:, :, 2].min(axis=1), levels))
    return shaded_colors(level, 1 + _CONTRAST * (normals @ LIGHT / LIGHT[2] - 1))


def _shaded_glb(
    vertices: NDArray[np.floating], triangles: NDArray[np.integer], **colors: Any
) -> bytes:
    """Return a mesh in glTF whose colors include the shading, so that no light changes them."""
    import trimesh

    def disable_lights(tree: dict[str, Any]) -> None:
        tree["extensionsUsed"] = ["KHR_materials_unlit"]
        tree.setdefault("materials", [{}])[0]["extensions"] = {"KHR_materials_unlit": {}}
        tree["meshes"][0]["primitives"][0]["material"] = 0

    mesh = trimesh.Trimesh(vertices, triangles, process=False, **colors)
    return bytes(mesh.export(file_type="glb", tree_postprocessor=disable_lights))


def _add_arrows(
    server: "viser.ViserServer",
    name: str,
    positions: NDArray[np.float32],
    color: tuple[int, int, int],
) -> list[Any]:
    """Add an arrow for each position, which has x, y, z [m] and a heading [rad]."""
    flat = positions.reshape(-1, 4)
    flat = flat[~np.isnan(flat).any(axis=1)]
    if not len(flat):
        return []
    heading = flat[:, 3]
    start = flat[:, :3] + [0.0, 0.0, _ABOVE_GROUND]
    direction = np.stack([np.cos(heading), np.sin(heading), np.zeros_like(heading)], axis=1)
    arrows = np.stack([start, start + _ARROW_LENGTH * direction], axis=1)
    return [
        server.scene.add_arrows(
            f"/map/{name}", arrows, color, shaft_radius=0.03, head_radius=0.08, head_length=0.2
        )
    ]


def _add_goal_order(server: "viser.ViserServer", terrain_map: "TerrainMap") -> list[Any]:
    """Add a line from the spawn origin of each patch through its goals."""
    path = np.concatenate([terrain_map.env_origins[:, :, None], terrain_map.goals[..., :3]], axis=2)
    lines = np.stack([path[:, :, :-1], path[:, :, 1:]], axis=3).reshape(-1, 2, 3)
    lines = lines[~np.isnan(lines).any(axis=(1, 2))] + [0.0, 0.0, _ABOVE_GROUND]
    if not len(lines):
        return []
    return [server.scene.add_line_segments("/map/goal_order", lines, _GOAL_COLOR, thickness=0.03)]


def _add_labels(server: "viser.ViserServer", terrain_map: "TerrainMap") -> list[Any]:
    """Label the columns with the names of their terrains, and the rows with their levels."""
    config, ((x, y, low), (_, _, high)) = terrain_map.config, _patch_bounds(terrain_map)
    (length, width), z = config.patch_size, min(max(0.0, low), high)
    first_row = terrain_map.patch_names[0].tolist() if config.mode != "randomized" else []
    row = "row" if config.mode == "custom" else "level"
    labels = [
        (f"level_{i}", f"{row} {i}", x + (i + 0.5) * length, y - 0.5, "top-center")
        for i in range(config.rows)
    ]
    for name, group in groupby(range(len(first_row)), first_row.__getitem__):
        columns = list(group)
        middle = y + width * (columns[0] + columns[-1] + 1) / 2
        labels.append((f"terrain_{columns[0]}", name, x - 0.5, middle, "center-right"))
    return [
        server.scene.add_label(f"/map/labels/{key}", text, position=(x, y, z), anchor=anchor)
        for key, text, x, y, anchor in labels
    ]
